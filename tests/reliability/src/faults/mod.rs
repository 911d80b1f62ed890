//! Faults of a run: it is killed, the disk is full, its inputs vanish. Resumed, it must end with the same bytes, and nothing half-written may
//! ever be seen.

mod place;
mod run;
mod trials;

pub use place::{COMMANDS, LongCommand, Place};
pub use trials::{FAULTS, Fault, befall};
