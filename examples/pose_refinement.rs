//! Refines the pose of a bottle held in a robot hand, on a made-up frame whose truth is known.
//!
//! `cargo run --release --example pose_refinement [SEED]`

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, ensure};
use nalgebra::Isometry3;
use prehend::geometry::{ClosestPoints, SolidUnion};
use prehend::refine::evaluate::metrics::{ContactModel, Table, oe_deg, pe_cm};
use prehend::refine::evaluate::report::before_and_after;
use prehend::refine::scene::HandMeasurement;
use prehend::refine::scene::default_scene;
use prehend::refine::{Method, PreparedFrame, refine};

pub(crate) fn main() -> anyhow::Result<()> {
    let seed = std::env::args()
        .nth(1)
        .filter(|_| !cfg!(test))
        .map_or(Ok(1), |text| text.parse())
        .context("SEED must be a number")?;
    println!("Making a frame: a mustard bottle in an Allegro hand, seen by a noisy RGB-D camera.");
    let scene = default_scene(seed)?;

    let start = Instant::now();
    let observation = &scene.frame;
    let frame = PreparedFrame::new(observation, &scene.object)?;
    let refined = refine(&frame, &scene.initial, &Method::default())?;
    let seconds = start.elapsed().as_secs_f64();

    let hand = observation.hand.as_ref().context("the frame has a hand")?;
    let HandMeasurement { t_cam_hand, joints, .. } = hand;
    let body = SolidUnion::new(&scene.hand.posed(t_cam_hand, joints)?.mesh_parts())?;
    let surface = ClosestPoints::new(&body.mesh())?;
    let contact = ContactModel::new(&scene.object.mesh);
    let header = ["", "PE cm", "OE °", "CA cm²", "IV cm³"].map(str::to_owned).to_vec();
    let mut table = Table::new(header);
    let mut row = |name: &str, pose: &Isometry3<f64>| -> anyhow::Result<()> {
        let figures = [
            pe_cm(pose, &scene.truth),
            oe_deg(pose, &scene.truth),
            contact.contact_area_cm2(pose, &surface),
            contact.intersection_volume_cm3(pose, &body)?,
        ];
        let figures = figures.iter().map(|f| format!("{f:.2}"));
        table.push([name.to_owned()].into_iter().chain(figures).collect());
        Ok(())
    };
    row("initial pose", &scene.initial)?;
    row("refined pose", refined.t_cam_object())?;
    row("true pose", &scene.truth)?;
    println!("\n{table}");
    let probability =
        refined.posterior.as_ref().map_or(f64::NAN, |posterior| posterior.probability());
    println!("{seconds:.2} s. Within 5 mm and 5° with a probability of {probability:.3}.");

    let picture = Path::new("out/pose_refinement.png");
    std::fs::create_dir_all("out")?;
    before_and_after(observation, &scene.object, &scene.initial, refined.t_cam_object())
        .save(picture)?;
    println!("Before and after: {}", picture.display());

    ensure!(
        pe_cm(refined.t_cam_object(), &scene.truth) < 0.5 * pe_cm(&scene.initial, &scene.truth),
        "the refinement should have halved the position error"
    );
    Ok(())
}
