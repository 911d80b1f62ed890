//! Times the gradients of four functions with this repository's autodiff and with other crates, in one run:
//! `cargo run --release --manifest-path benches/peers/Cargo.toml --bin autodiff`.
//!
//! The functions are those of `crates/autodiff/benches/workloads`, the same text for everybody. Each crate
//! is used as its documentation recommends for a gradient, in its own file here.

// The workloads are mounted twice, over two versions of nalgebra.
#![allow(clippy::duplicate_mod)]

// The workloads take nalgebra from their parent.
extern crate nalgebra;

mod ad_trait;
mod echidna;
mod num_dual;
mod older;
#[path = "../../../../crates/autodiff/benches/workloads/ours.rs"]
mod ours;
#[path = "../../../../crates/autodiff/benches/workloads/rigid_blocks.rs"]
mod rigid_blocks;
#[path = "../../../../crates/autodiff/benches/workloads/table.rs"]
mod table;
#[path = "../../../../crates/autodiff/benches/workloads/mod.rs"]
mod workloads;

fn main() {
    let scenes = ours::Scenes::new();
    let mut comparisons = ours::Comparisons::new(&scenes);
    num_dual::add(&mut comparisons, &scenes);
    echidna::add(&mut comparisons, &scenes);
    ad_trait::add(&mut comparisons);
    comparisons.print();
}
