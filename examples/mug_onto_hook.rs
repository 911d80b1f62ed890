//! Throws a mug onto a hook by gradient: mesh on mesh, handle over rod.
//!
//! Gauss–Newton steps on derivatives through the catch find velocity and spin of the throw, first so that the handle is around the
//! hook, then so that the mug hangs.
//!
//! `cargo run --release --example mug_onto_hook [folder]` writes the first and the found throw as an animation, `mug_onto_hook.png`, to the
//! folder (`target/mug_onto_hook` unless given).

use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use parry3d_f64::math::Vector;
use prehend::autodiff::optimize::{Criteria, LevenbergMarquardt, NormalEquations};
use prehend::autodiff::{Fwd, Scalar};
use prehend::geometry::TriMesh;
use prehend::geometry::shapes::{Mug, tube};
use prehend::render::{Camera, Light, RenderModel, Renderer, RgbImage, Scene, look_at};
use prehend::sim::contact::Bounce;
use prehend::sim::prelude::*;

/// Radius of the hook's rod, and where along it the mug is to hang \[m\].
const ROD: f64 = 4e-3;
const PLACE: f64 = 0.03;
/// Horizons after the throw, one after the other \[s\].
const HORIZONS: [f64; 2] = [0.12, 0.6];
/// Units of velocity \[m/s\] and spin \[rad/s\] in which the throw is looked for.
const UNITS: [f64; 6] = [0.1, 0.1, 0.1, 1.0, 1.0, 1.0];
/// The first throw.
const GUESS: [f64; 6] = [-0.7, 0.0, 0.1, 0.0, 0.0, 0.0];
const FRAMES: usize = 40;

/// A rod from a wall at x = 0 along x, that turns up at its end; z up.
fn hook() -> TriMesh {
    let (length, bend) = (0.05, 0.012);
    let straight = (0..20).map(|i| Point3::new(length * f64::from(i) / 20.0, 0.0, 0.0));
    let turn = (0..=8).map(|i| {
        let (sin, cos) = (FRAC_PI_2 * f64::from(i) / 8.0).sin_cos();
        Point3::new(length + bend * sin, 0.0, bend * (1.0 - cos))
    });
    let end = (1..3).map(|i| Point3::new(length + bend, 0.0, bend + 2e-3 * f64::from(i)));
    tube(&straight.chain(turn).chain(end).collect::<Vec<_>>(), ROD, 16, 4)
}

/// The shape of a mesh with samples `spacing` and a grid of cells `cell` \[m\].
fn shape(mesh: &TriMesh, spacing: f64, cell: f64) -> anyhow::Result<Shape> {
    let vertices = mesh.vertices.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let mesh = parry3d_f64::shape::TriMesh::new(vertices, mesh.faces.clone())?;
    let options = ShapeOptions { spacing: Some(spacing), cell: Some(cell), rounding: None };
    Ok(Shape::from_parry_with(&mesh, &options)?)
}

/// A mug before a hook.
struct Throw {
    model: Model,
    mug: RigidBody,
    /// Pose of the mug's model when it is let go.
    hand: Isometry3<f64>,
    /// Inside of the handle, and middle of the mug, in its model frame \[m\].
    marks: [Point3<f64>; 2],
}

impl Throw {
    fn new(mug: &Mug) -> anyhow::Result<Self> {
        let mut model = Model::new(Vector3::z() * -9.81);
        let hook = model.add(Body::fixed_from_shape("hook", &shape(&hook(), 3e-3, 1.5e-3)?));
        // Of stoneware.
        let body = Body::from_shape("mug", &shape(&mug.mesh(), 4e-3, 2.5e-3)?, 2400.0)?;
        let rigid = *body.rigid().context("a mug has a mass")?;
        let thrown = model.add(body);
        let (mass, contact_area) = (rigid.mass(), 2e-5);
        let target = ContactCalibration { mass, gravity: 9.81, penetration: 3e-4, contact_area };
        let bounce = Bounce { restitution: 0.2, impact_speed: 0.5 };
        let normal = HuntCrossley::from_target(&target, 1.0, bounce)?;
        let law = Law::new(normal, Coulomb { friction: 0.4, slip_scale: 2e-2 })?;
        let smoothing = GapSmoothing::Softplus { width: 2e-5 };
        model.add_symmetric_contact(thrown, hook, Arc::new(law), smoothing)?;
        // The handle up, its opening along the rod.
        let turn =
            UnitQuaternion::from_basis_unchecked(&[Vector3::z(), Vector3::x(), Vector3::y()]);
        let middle = 0.5 * mug.height;
        let marks = [
            Point3::new(mug.radius + mug.reach - mug.handle, 0.0, middle),
            Point3::new(0.0, 0.0, middle),
        ];
        let hand = Translation3::new(0.11, 0.0, 0.03) * turn * Translation3::from(-marks[0].coords);
        Ok(Self { model, mug: rigid, hand, marks })
    }

    /// Poses of the mug's model at equal times within `time` \[s\], thrown with velocity and spin `x`.
    fn poses<S: Scalar>(
        &self,
        x: &[S],
        time: f64,
        steps: usize,
    ) -> Result<Vec<Isometry3<S>>, SimulationError> {
        let model = self.model.cast::<S>();
        let unit = |i: usize| x[i].times(UNITS[i]);
        let mut start = model.neutral_state();
        start[1] = self.mug.at_rest(&self.hand).cast();
        start[1].linear = Vector3::new(unit(0), unit(1), unit(2));
        start[1].angular = Vector3::new(unit(3), unit(4), unit(5));
        let run = model.rollout(&start, TimeSteps { dt: time / steps as f64, steps })?;
        let mug = self.mug.cast::<S>();
        Ok(run.iter().map(|states| mug.body_pose(&states[1].pose)).collect())
    }

    /// How far handle and mug are from where they hang, `time` \[s\] after a throw \[m\].
    fn off<S: Scalar>(&self, x: &[S], time: f64) -> Result<Vec<S>, SimulationError> {
        let pose = self.poses(x, time, 1)?[1];
        let [handle, middle] = self.marks.map(|mark| pose * mark.cast::<S>());
        let below = ROD - (self.marks[0] - self.marks[1]).norm();
        let places = [Vector3::new(PLACE, 0.0, ROD), Vector3::new(PLACE, 0.0, below)];
        let off = [handle, middle].into_iter().zip(places);
        Ok(off.flat_map(|(mark, place)| (0..3).map(move |i| mark[i].plus(-place[i]))).collect())
    }
}

pub(crate) fn main() -> anyhow::Result<()> {
    let folder = PathBuf::from(
        std::env::args().nth(1).filter(|_| !cfg!(test)).unwrap_or("target/mug_onto_hook".into()),
    );
    let mug = Mug::default();
    let throw = Throw::new(&mug)?;
    let guess: Vec<f64> = GUESS.iter().zip(UNITS).map(|(x, unit)| x / unit).collect();
    let last = HORIZONS[HORIZONS.len() - 1];
    let size = |off: &[f64]| off.iter().map(|x| x * x).sum::<f64>().sqrt();
    println!("thrown as guessed it ends {:.1} cm off", 100.0 * size(&throw.off(&guess, last)?));
    let mut found = guess.clone();
    for time in HORIZONS {
        let began = std::time::Instant::now();
        let residuals = |x: &[Fwd<6>]| {
            // The solver steps back from what cannot be simulated.
            throw.off(x, time).unwrap_or_else(|_| vec![Fwd::constant(f64::NAN); 6])
        };
        let criteria = Criteria { iterations: 12, ..LevenbergMarquardt::default().criteria };
        let solver = LevenbergMarquardt { criteria, ..LevenbergMarquardt::default() };
        let outcome = solver.minimize(&found, |x| NormalEquations::forward(residuals, x))?;
        found = outcome.parameters;
        println!(
            "looking {time} s ahead: {:.2} cm off after {} steps in {:.1} s",
            100.0 * size(&throw.off(&found, time)?),
            outcome.iterations,
            began.elapsed().as_secs_f64()
        );
    }
    let [vx, vy, vz, wx, wy, wz] = std::array::from_fn(|i| found[i] * UNITS[i]);
    println!("found: ({vx:.3}, {vy:.3}, {vz:.3}) m/s, ({wx:.2}, {wy:.2}, {wz:.2}) rad/s");

    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let path = folder.join("mug_onto_hook.png");
    let ways = [throw.poses(&guess, 1.5 * last, FRAMES)?, throw.poses(&found, 1.5 * last, FRAMES)?];
    animate(&mug, &ways, &path)?;
    println!("wrote {}", path.display());
    let hangs = throw.off(&found, 1.5 * last)?;
    let along = PLACE + hangs[0];
    let on_rod = (0.0..0.06).contains(&along) && hangs[1].hypot(hangs[2]) < 0.01;
    anyhow::ensure!(on_rod, "the handle should be on the rod: {hangs:?}");
    Ok(())
}

/// Both throws side by side, as an animated PNG.
fn animate(mug: &Mug, ways: &[Vec<Isometry3<f64>>; 2], path: &Path) -> anyhow::Result<()> {
    let camera = Camera { fx: 350.0, fy: 350.0, cx: 99.5, cy: 82.5, width: 200, height: 200 };
    // From the side and a little above, with z up.
    let (eye, middle) = (Point3::new(0.2, 0.4, 0.12), Point3::new(0.05, 0.0, -0.03));
    let t_cam_world = look_at(&eye, &middle, &Vector3::z(), 0.0);
    let renderer = Renderer::new(Light::headlight(0.4, 0.6));
    let hook = Arc::new(RenderModel::new(&hook())?.with_uniform_color([0.55, 0.55, 0.6]));
    let mug = Arc::new(RenderModel::new(&mug.mesh())?.with_uniform_color([0.85, 0.45, 0.25]));
    let picture = |pose: &Isometry3<f64>| -> anyhow::Result<RgbImage> {
        let scene = Scene { background: [0.96; 3], ..Scene::new(camera) }
            .with(Arc::clone(&hook), t_cam_world)
            .with(Arc::clone(&mug), t_cam_world * pose);
        Ok(renderer.render(&scene).buffers.to_rgb()?)
    };
    let file = std::io::BufWriter::new(std::fs::File::create(path)?);
    let (width, height) = (camera.width, camera.height);
    let mut encoder = png::Encoder::new(file, 2 * width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::Adaptive);
    encoder.set_animated(ways[0].len() as u32, 0)?;
    encoder.set_frame_delay(1, 14)?;
    let mut writer = encoder.write_header()?;
    for (first, found) in ways[0].iter().zip(&ways[1]) {
        let pictures = [picture(first)?, picture(found)?];
        let mut bytes = Vec::with_capacity(6 * width * height);
        for y in 0..height {
            for picture in &pictures {
                let row = picture.pixels()[y * width..][..width].as_flattened();
                bytes.extend(row.iter().map(|x| (255.0 * x).round() as u8));
            }
        }
        writer.write_image_data(&bytes)?;
    }
    writer.finish()?;
    Ok(())
}
