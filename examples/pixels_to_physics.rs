//! Finds how a block was pushed, and its friction, from ten pictures of its slide: renderer and simulator on one tape.
//!
//! `cargo run --release --example pixels_to_physics [folder]` writes five of the pictures, over the first guess and over what
//! was found, to `guess_found_seen.png` in the folder (`target/pixels_to_physics` unless given).

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend::autodiff::lie::lift;
use prehend::autodiff::optimize::{Adam, Criteria};
use prehend::autodiff::{Scalar, Var, gradient};
use prehend::geometry::{TriMesh, shapes};
use prehend::render::{Camera, Light, RenderModel, Renderer, RgbImage, Scene, SceneVars};
use prehend::sim::prelude::*;

const PICTURES: TimeSteps = TimeSteps { dt: 0.05, steps: 10 };
const HALF: [f64; 3] = [0.04, 0.03, 0.03];
/// Unknowns: velocity [m/s], spin [rad/s] and friction coefficient, in these units.
const UNITS: [f64; 4] = [0.1, 0.1, 1.0, 0.1];
const TRUTH: [f64; 4] = [0.7, 0.25, 4.0, 0.22];
const GUESS: [f64; 4] = [0.5, 0.0, 0.0, 0.3];

/// A block, painted in smooth colors.
fn block() -> TriMesh {
    let mut mesh = shapes::superellipsoid(HALF, [0.5, 0.5], 32);
    let color = |p: &Point3<f64>| [p.x, p.y, p.z].map(|v| (0.5 + 0.4 * (50.0 * v).sin()) as f32);
    mesh.colors = Some(mesh.vertices.iter().map(color).collect());
    mesh
}

/// The block on a table.
fn model() -> anyhow::Result<Model> {
    let inertia = Matrix3::from_diagonal(&Vector3::new(2.4e-4, 3.3e-4, 3.3e-4));
    let rigid = RigidBody::new(0.4, inertia, Point3::origin())?;
    let feet = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
        .map(|(x, y)| Point3::new(0.03 * x, 0.02 * y, -HALF[2]));
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let field = model.add(Body::fixed("table").with_field(Arc::new(HalfSpace::floor())));
    let surface = Surface::uniform(&feet, 4e-4)?;
    let samples = model.add(Body::dynamic("block", rigid).with_surface(surface));
    let spring = KelvinVoigt { stiffness: 4e7, damping: 4e5 };
    let law = Law::new(spring, Coulomb { friction: 0.3, slip_scale: 1e-2 })?;
    let smoothing = GapSmoothing::Softplus { width: 5e-5 };
    model.add_contact(ContactBodies { samples, field }, Arc::new(law), smoothing)?;
    Ok(model)
}

/// Where the block is in each picture.
fn slide<S: Scalar>(model: &Model, x: &[S]) -> Result<Vec<Isometry3<S>>, SimulationError> {
    let [vx, vy, spin, friction] = std::array::from_fn(|i| x[i].times(UNITS[i]));
    let mut model = model.cast::<S>();
    *model.contacts[0].param_mut("friction")? = friction;
    let mut start = model.neutral_state();
    let block = &mut start[1];
    *block = BodyState::at_rest(Isometry3::translation(-0.1, -0.04, HALF[2])).cast();
    (block.linear.x, block.linear.y, block.angular.z) = (vx, vy, spin);
    let run = model.rollout(&start, PICTURES)?;
    Ok(run[1..].iter().map(|states| states[1].pose).collect())
}

/// A camera that looks down on the table.
fn scene() -> (Scene, Isometry3<f64>) {
    let camera = Camera { fx: 120.0, fy: 120.0, cx: 31.5, cy: 23.5, width: 64, height: 48 };
    let turn = UnitQuaternion::from_scaled_axis(Vector3::x() * 2.4);
    (Scene::new(camera), Isometry3::from_parts(Translation3::new(0.0, 0.03, 0.45), turn))
}

pub(crate) fn main() -> anyhow::Result<()> {
    let folder = std::env::args()
        .nth(1)
        .filter(|_| !cfg!(test))
        .unwrap_or("target/pixels_to_physics".to_owned());
    let (model, mesh_model) = (model()?, Arc::new(RenderModel::new(&block())?));
    let renderer = Renderer::new(Light::headlight(0.5, 0.5));
    let (empty, t_cam_world) = scene();
    let truth: Vec<f64> = TRUTH.iter().zip(UNITS).map(|(x, unit)| x / unit).collect();
    let guess: Vec<f64> = GUESS.iter().zip(UNITS).map(|(x, unit)| x / unit).collect();
    let seen: Vec<_> = (slide(&model, &truth)?.into_iter())
        .map(|pose| {
            renderer.render(&empty.clone().with(mesh_model.clone(), t_cam_world * pose)).buffers
        })
        .collect();

    // Sum of squared differences of all colors in all pictures.
    let shown = empty.clone().with(mesh_model.clone(), Isometry3::identity());
    let loss = |x: &[Var]| -> anyhow::Result<Var> {
        let mut sum = Var::default();
        for (pose, seen) in slide(&model, x)?.into_iter().zip(&seen) {
            let pose = lift::<Var>(&t_cam_world) * pose;
            let vars = SceneVars { poses: vec![(0, pose)], ..SceneVars::default() };
            let image = renderer.record(&shown, &vars)?;
            let colors = image.color.as_flattened().iter().zip(seen.color.as_flattened());
            for (color, seen) in colors {
                let off = color.plus(-seen);
                sum += off * off;
            }
        }
        Ok(sum)
    };
    // The solver steps back from what cannot be simulated.
    let objective = |x: &[f64]| gradient(|x| loss(x).unwrap_or_else(|_| Var::from(f64::NAN)), x);
    let criteria = Criteria { iterations: 150, ..Adam::default().criteria };
    let outcome = Adam { rate: 0.1, criteria, ..Adam::default() }.minimize(&guess, objective)?;

    let found: Vec<f64> = outcome.parameters.iter().zip(UNITS).map(|(x, unit)| x * unit).collect();
    println!("            vx m/s  vy m/s  spin rad/s  friction");
    for (name, x) in [("guess", &GUESS[..]), ("found", &found), ("truth", &TRUTH[..])] {
        println!("{name:<10}  {:6.3}  {:6.3}  {:10.3}  {:8.3}", x[0], x[1], x[2], x[3]);
    }
    let picture = |x: &[f64]| -> anyhow::Result<Vec<RgbImage>> {
        let mut large = empty.clone();
        large.camera = large.camera.scaled(3.0);
        let poses = slide(&model, x)?;
        let every_second = poses.iter().step_by(2).map(|pose| {
            let scene = large.clone().with(mesh_model.clone(), t_cam_world * pose);
            Ok(renderer.render(&scene).buffers.to_rgb()?)
        });
        every_second.collect()
    };
    let rows = [picture(&guess)?, picture(&outcome.parameters)?, picture(&truth)?];
    std::fs::create_dir_all(&folder).with_context(|| folder.clone())?;
    let path = PathBuf::from(folder).join("guess_found_seen.png");
    sheet(&rows)?.save(&path)?;
    println!("wrote {}", path.display());
    for ((name, off), unit) in ["vx", "vy", "spin", "friction"]
        .into_iter()
        .zip(found.iter().zip(TRUTH).map(|(a, b)| a - b))
        .zip(UNITS)
    {
        anyhow::ensure!(off.abs() < 0.05 * unit, "{name} is off by {off}");
    }
    Ok(())
}

/// Pictures in rows.
fn sheet(rows: &[Vec<RgbImage>]) -> anyhow::Result<RgbImage> {
    let (width, height) = (rows[0][0].width(), rows[0][0].height());
    let mut pixels = Vec::new();
    for row in rows {
        for y in 0..height {
            pixels.extend(row.iter().flat_map(|p| &p.pixels()[y * width..][..width]).copied());
        }
    }
    Ok(RgbImage::new(width * rows[0].len(), height * rows.len(), pixels)?)
}
