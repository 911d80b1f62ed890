//! Times a distance grid of 128³ samples on one core: `cargo bench -p prehend-geometry --bench sdf`.

mod body;

fn main() {}
