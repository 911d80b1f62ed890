//! Writes a small made-up dataset to try the `prehend` command on.
//!
//! `cargo run --release -p prehend-refine --example sample_dataset DIR [FRAMES]`

use std::path::PathBuf;

use anyhow::Context;
use prehend_refine::scene::default_scene;
use prehend_refine::synth::write_dataset;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let dir = PathBuf::from(arguments.next().context("usage: sample_dataset DIR [FRAMES]")?);
    let frames = arguments.next().map_or(Ok(4), |n| n.parse()).context("FRAMES")?;
    let scenes = (0..frames).map(default_scene).collect::<Result<Vec<_>, _>>()?;
    write_dataset(&dir, &scenes)?;
    println!(
        "{} frames; now: prehend check --dataset {1} --poses {1}/init.csv",
        frames,
        dir.display()
    );
    Ok(())
}
