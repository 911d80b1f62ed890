//! Times the queries of this repository's geometry and of other crates on one thread, in one run:
//! `cargo run --release --manifest-path benches/peers/Cargo.toml --bin geometry`. Words after `--` pick the jobs
//! with one of them in their names.
//!
//! The jobs are those of `crates/geometry/benches/workloads`. Each crate is used as its documentation recommends,
//! in its own file here, and every answer is checked before it is timed.

// parry's part is mounted twice, over its crates of single and of double precision.
#![allow(clippy::duplicate_mod)]

mod boolmesh;
mod kiddo;
mod parry;
#[path = "../../../../crates/geometry/benches/workloads/mod.rs"]
mod workloads;

fn main() {
    workloads::use_one_thread();
    let scenes = workloads::Scenes::new();
    let mut comparisons = workloads::Comparisons::new(&scenes);
    parry::add(&mut comparisons, &scenes);
    boolmesh::add(&mut comparisons, &scenes);
    kiddo::add(&mut comparisons, &scenes);
    comparisons.print();
}
