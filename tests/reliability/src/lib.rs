//! Attacks on Prehend: what is broken, too large or cut off must end in an error that names it, and never in a panic, a
//! hang, or a result that is not finite. `docs/RELIABILITY.md` has what came of them.

pub mod attack;
pub mod corpus;
pub mod faults;
pub mod fuzz;
pub mod loads;
pub mod mutants;
pub mod mutate;
pub mod parsers;
pub mod scene;
pub mod seeds;
pub mod small_dataset;
pub mod table;
pub mod tools;
