//! Grasps every built-in object with the built-in hand, prints what came of it, and draws some grasps. Times are the
//! processor's.
//!
//! `cargo run --release -p prehend-refine --example grasp_study [TRIES [FOLDER]]`

use std::path::PathBuf;

use anyhow::Context;
use cpu_time::ProcessTime;
use nalgebra::{Point3, Vector3};
use prehend_geometry::hand::{ALLEGRO_XELA_URDF, taxels};
use prehend_geometry::objects::YcbObject;
use prehend_geometry::robot::KinematicTree as Tree;
use prehend_refine::scene::{Hand, Object};
use prehend_refine::synth::{Grasp, GraspSettings, Grasper};
use prehend_render::{Camera, Light, RenderModel, look_at, render_scene};

const FRAMES: usize = 100;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let tries: u64 = arguments.next().map_or(Ok(20), |n| n.parse()).context("TRIES")?;
    let folder = arguments.next().map(PathBuf::from);
    let only = arguments.next();
    let robot = Hand::new(Tree::from_urdf_str(ALLEGRO_XELA_URDF, None)?, taxels())?;
    println!(
        "{:22} {:>9} {:>6} {:>6} {:>6} {:>6} {:>6} {:>8} {:>8}  faults",
        "object", "grasps", "IV", "CA", "links", "mm", "°", "s/grasp", "frames/s"
    );
    for ycb in YcbObject::ALL {
        if only.as_ref().is_some_and(|o| !ycb.name().contains(o.as_str())) {
            continue;
        }
        let object = Object::with_mass(ycb.name(), ycb.mesh(), Some(ycb.mass()), 0)?;
        let grasper = Grasper::new(&robot, &object, &GraspSettings::default())?;
        let start = ProcessTime::now();
        let mut grasps = Vec::new();
        let mut faults: Vec<String> = Vec::new();
        for seed in 0..tries {
            match grasper.grasp(seed) {
                Ok(grasp) => grasps.push((seed, grasp)),
                Err(fault) => faults.push(format!("{seed}: {fault}")),
            }
        }
        let seconds = start.elapsed().as_secs_f64() / grasps.len().max(1) as f64;
        let start = ProcessTime::now();
        let mut frames = 0;
        for (seed, grasp) in grasps.iter().take(3) {
            match grasper.trajectory(grasp, *seed, FRAMES) {
                Ok(moments) => frames += moments.len(),
                Err(fault) => faults.push(format!("trajectory {seed}: {fault}")),
            }
        }
        let rate = frames as f64 / start.elapsed().as_secs_f64();
        let mean = |f: &dyn Fn(&Grasp) -> f64| {
            grasps.iter().map(|(_, g)| f(g)).sum::<f64>() / grasps.len() as f64
        };
        println!(
            "{:22} {:>4}/{:<4} {:>6.3} {:>6.1} {:>6.1} {:>6.2} {:>6.2} {:>8.2} {:>8.1}  {}",
            ycb.name(),
            grasps.len(),
            tries,
            mean(&|g| g.intersection_volume),
            mean(&|g| g.contact_area),
            mean(&|g| g.links.len() as f64),
            mean(&|g| g.drift * 1e3),
            mean(&|g| g.turn.to_degrees()),
            seconds,
            rate,
            faults.join("; ")
        );
        if let Some(folder) = &folder {
            std::fs::create_dir_all(folder)?;
            let model = RenderModel::new(&object.mesh)?;
            for (seed, grasp) in grasps.iter().take(3) {
                draw(&robot, &model, grasp)
                    .save(&folder.join(format!("{}_{seed}.png", ycb.name())))?;
            }
        }
    }
    Ok(())
}

/// Three views side by side.
fn draw(robot: &Hand, object: &RenderModel, grasp: &Grasp) -> prehend_render::RgbImage {
    let (width, height) = (420, 420);
    let camera = Camera { fx: 620.0, fy: 620.0, cx: 209.5, cy: 209.5, width, height };
    let mut picture = prehend_render::RgbImage::filled(3 * width, height, [0.0; 3]);
    let target = Point3::new(0.04, 0.0, 0.02);
    let eyes = [[0.45, 0.1, 0.15], [0.12, 0.42, 0.1], [0.15, -0.35, -0.25]];
    for (view, eye) in eyes.into_iter().enumerate() {
        let t_cam_hand = look_at(&Point3::from(eye), &target, &Vector3::z(), 0.0);
        let t_cam_model = t_cam_hand * grasp.t_hand_object;
        let mut bodies = vec![(object, t_cam_model)];
        bodies.extend(robot.render_bodies(&t_cam_hand, &grasp.joints));
        let toward = Vector3::new(-0.4, -0.7, -0.6).normalize();
        let light = Light { ambient: [0.45; 3], directional: [toward * 0.55; 3], offset: [0.0; 3] };
        let behind = |_, _| [0.12, 0.13, 0.15];
        let image = render_scene(&camera, &bodies, 3, |_, point| light.color(point), behind);
        for y in 0..height {
            for x in 0..width {
                picture.pixels_mut()[y * 3 * width + view * width + x] =
                    image.color.pixels()[y * width + x];
            }
        }
    }
    picture
}
