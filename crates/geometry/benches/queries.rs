//! Times the queries of this crate on one thread, each checked before it is timed:
//! `cargo bench -p prehend-geometry --bench queries`. A word after `--` picks the workloads with it in their name.
//!
//! `benches/peers/geometry` at the root of the repository prints the same table with other crates in it.

mod workloads;

fn main() {
    workloads::use_one_thread();
    let scenes = workloads::Scenes::new();
    workloads::Comparisons::new(&scenes).print();
}
