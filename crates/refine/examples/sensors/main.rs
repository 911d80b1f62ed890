//! Contribution of each sensor: frames of the built-in world with errors that calibrations have, refined with one sensor more at a time.
//!
//! ```sh
//! cargo run --release -p prehend-refine --example sensors -- [FRAMES] [FOLDER]
//! ```
//!
//! With a folder, the first frame of each is left there: examples of [frame files](../../../../docs/FRAME.md).

mod sensing;
mod world;

use std::path::PathBuf;

use prehend_refine::data::load_frame_file;
use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::strategy::Fused;
use prehend_refine::{PreparedFrame, refine};

use crate::sensing::{Extra, write_frame};
use crate::world::World;

/// Rows compared with the first of them: a world, and the sensors.
type Group =
    (&'static str, fn(u64) -> anyhow::Result<World>, &'static [(&'static str, &'static [Extra])]);

const GROUPS: [Group; 4] = [
    (
        "held in a hand",
        |seed| World::held(seed, 1),
        &[
            ("color and depth", &[]),
            ("depth alone", &[Extra::DepthAlone]),
            ("depth of its own camera", &[Extra::DepthCamera]),
            ("two cameras", &[Extra::SecondCamera]),
            ("color, depth, contact patches", &[Extra::Patch]),
        ],
    ),
    (
        "held in a hand, without depth",
        |seed| World::held(seed, 1),
        &[
            ("color alone", &[Extra::ColorAlone]),
            ("color, forces", &[Extra::ColorAlone, Extra::Force]),
            ("color, binary contact", &[Extra::ColorAlone, Extra::Binary]),
            ("color, proximity", &[Extra::ColorAlone, Extra::Proximity]),
            ("color, contact patches", &[Extra::ColorAlone, Extra::Patch]),
        ],
    ),
    (
        "on a table, half hidden by another object",
        World::on_table,
        &[
            ("color and depth", &[]),
            ("and the table", &[Extra::Table]),
            ("and the table and the other object", &[Extra::Table, Extra::Other]),
        ],
    ),
    (
        "in two hands",
        |seed| World::held(seed, 2),
        &[("one hand known", &[]), ("both hands known", &[Extra::SecondHand])],
    ),
];

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let frames: u64 = arguments.next().map_or(Ok(12), |frames| frames.parse())?;
    let keep = arguments.next().map(PathBuf::from);
    for (group, world, rows) in GROUPS {
        println!("\n{group}, {frames} frames; means (medians)\n");
        println!(
            "| sensors | PE, cm | OE, ° | PE from the hand, or height above the table, cm | distance, σ |"
        );
        println!("|---|---|---|---|---|");
        for (name, extras) in rows {
            let [mut pe, mut oe, mut beside, mut sigmas] = [const { Vec::<f64>::new() }; 4];
            for seed in 0..frames {
                let folder = tempfile::tempdir()?;
                let world = world(seed)?;
                let table = write_frame(folder.path(), &world, extras, seed)?;
                let file = folder.path().join("frame.json");
                let (input, start) = load_frame_file(&file, 0, None, None)?;
                let found = refine(
                    &PreparedFrame::new(&input.frame, &input.object)?,
                    &start,
                    &Fused::default(),
                )?;
                let (pose, truth) = (found.t_cam_object(), world.t_cam_object());
                pe.push(pe_cm(pose, &truth));
                oe.push(oe_deg(pose, &truth));
                let base = found.state.t_cam_hand.inverse();
                beside.push(match world.hands.first() {
                    Some(hand) => pe_cm(&(base * pose), &(hand.inverse() * world.t_world_object)),
                    None => {
                        let known = extras.contains(&Extra::Table);
                        let above = if known { base * pose } else { table.inverse() * pose };
                        100.0 * (above.translation.z - world.t_world_object.translation.z).abs()
                    }
                });
                sigmas.extend(found.posterior.map(|posterior| posterior.mahalanobis(&truth)));
                if let Some(keep) = keep.as_ref().filter(|_| seed == 0) {
                    let kept = keep.join(format!("{group}, {name}").replace([' ', ','], "_"));
                    std::fs::create_dir_all(&kept)?;
                    for entry in std::fs::read_dir(folder.path())? {
                        let path = entry?.path();
                        std::fs::copy(&path, kept.join(path.file_name().unwrap_or_default()))?;
                    }
                }
            }
            let cell = |values: &mut Vec<f64>, digits: usize| {
                values.sort_by(f64::total_cmp);
                let Some(median) = values.get(values.len() / 2) else { return String::new() };
                let mean = values.iter().sum::<f64>() / values.len() as f64;
                format!("{mean:.digits$} ({median:.digits$})")
            };
            let [pe, oe] = [cell(&mut pe, 3), cell(&mut oe, 2)];
            let [beside, sigmas] = [cell(&mut beside, 3), cell(&mut sigmas, 1)];
            println!("| {name} | {pe} | {oe} | {beside} | {sigmas} |");
        }
    }
    Ok(())
}
