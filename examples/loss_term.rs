//! Adds a term of one's own to the four: a gripper camera's hint of where the bottle's cap is.

use nalgebra::{Matrix6, Point3, Vector6};
use prehend::refine::Config;
use prehend::refine::factor::Term;
use prehend::refine::problem::{Block, Normal, State};
use prehend::refine::scene::default_scene;
use prehend::refine::standard_terms;
use prehend::refine::strategy::{Heuristic, HeuristicSettings};

/// A point of the object is believed to be at a place, with standard deviation `sigma` \[m\].
struct Landmark {
    on_object: Point3<f64>,
    in_camera: Point3<f64>,
    sigma: f64,
}

impl Term for Landmark {
    fn name(&self) -> &'static str {
        "landmark"
    }

    fn value(&self, state: &State) -> f64 {
        let offset = state.t_cam_object * self.on_object - self.in_camera;
        0.5 * offset.norm_squared() / self.sigma.powi(2)
    }

    fn linearize(&self, state: &State, normal: &mut Normal) -> f64 {
        let point = state.t_cam_object * self.on_object;
        let arm = prehend::autodiff::lie::cross_matrix(&(point.coords - state.center()));
        let mut rows = nalgebra::Matrix3x6::zeros();
        rows.fixed_columns_mut::<3>(0).fill_with_identity();
        rows.fixed_columns_mut::<3>(3).copy_from(&-arm);
        let precision = self.sigma.powi(-2);
        let gradient: Vector6<f64> = rows.tr_mul(&(point - self.in_camera)) * precision;
        let hessian: Matrix6<f64> = rows.tr_mul(&rows) * precision;
        normal.add(&[Block::ObjectPose], &gradient, &hessian);
        self.value(state)
    }
}

fn main() -> anyhow::Result<()> {
    let scene = default_scene(1)?;
    let start = State::new(&scene.observation, &scene.object, &scene.initial)?;
    let robot = Some(&scene.robot);
    let mut terms =
        standard_terms(&scene.observation, &scene.object, robot, &start, &Config::combined())?;
    let cap = Point3::new(0.0, 0.0, 0.09);
    terms.push(Box::new(Landmark { on_object: cap, in_camera: scene.truth * cap, sigma: 3e-3 }));

    let mut pose = start.t_cam_object;
    let heuristic = Heuristic { settings: HeuristicSettings::default() };
    let trace = heuristic.run(&terms, start, scene.object.radius, |state, _| {
        pose = state.t_cam_object;
        true
    });
    let error = |p: &nalgebra::Isometry3<f64>| (p * cap - scene.truth * cap).norm() * 1e3;
    println!("terms: {}", trace.terms.join(", "));
    println!(
        "the cap was {:.1} mm off and is now {:.2} mm off",
        error(&scene.initial),
        error(&pose)
    );
    anyhow::ensure!(error(&pose) < 3.0);
    Ok(())
}
