//! Times the gradients of four functions in every mode of this crate, beside plain numbers and derivatives
//! by hand: `cargo bench -p prehend-autodiff`.
//!
//! `benches/peers/autodiff` at the root of the repository prints the same table with other crates in it.

// The workloads take nalgebra from their parent.
extern crate nalgebra;

#[path = "workloads/ours.rs"]
mod ours;
#[path = "workloads/rigid_blocks.rs"]
mod rigid_blocks;
#[path = "workloads/table.rs"]
mod table;
mod workloads;

fn main() {
    let scenes = ours::Scenes::new();
    ours::Comparisons::new(&scenes).print();
}
