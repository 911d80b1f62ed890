//! A loss of the picture of a thrown and bouncing body, differentiated by how it was thrown.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend::autodiff::check::finite_difference_gradient;
use prehend::autodiff::lie::lift;
use prehend::autodiff::{Scalar, Var, gradient};
use prehend::geometry::{TriMesh, shapes};
use prehend::render::{Camera, Light, RenderModel, Renderer, Scene, SceneVars};
use prehend::sim::fields::HalfSpace;
use prehend::sim::{
    Body, BodyState, ContactBodies, Coulomb, GapSmoothing, KelvinVoigt, Law, Model, RigidBody,
    SemiImplicitEuler, State, Surface, TimeSteps,
};

const TIME_STEPS: TimeSteps = TimeSteps { dt: 1e-4, steps: 1000 };

/// A block, painted in smooth colors.
fn block() -> TriMesh {
    let mut mesh = shapes::superellipsoid([0.04, 0.03, 0.05], [0.8, 0.8], 32);
    let color = |p: &Point3<f64>| [p.x, p.y, p.z].map(|v| (0.5 + 0.4 * (50.0 * v).sin()) as f32);
    mesh.colors = Some(mesh.vertices.iter().map(color).collect());
    mesh
}

fn model(mesh: &TriMesh) -> Model {
    let rigid = RigidBody::new(0.2, Matrix3::identity() * 2e-4, Point3::origin()).unwrap();
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let field = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let surface = Surface::uniform(&mesh.vertices, mesh.area()).unwrap();
    let samples = model.add(Body::dynamic("block", rigid).with_surface(surface));
    let spring = KelvinVoigt { stiffness: 2e6, damping: 1e3 };
    let law = Law::new(spring, Coulomb { friction: 0.4, slip_scale: 5e-2 }).unwrap();
    let smoothing = GapSmoothing::Softplus { width: 5e-4 };
    model.add_contact(ContactBodies { samples, field }, Arc::new(law), smoothing).unwrap();
    model
}

/// Poses of the block at the end, in the model, for a throw of the given tangent.
fn end<S: Scalar>(model: &Model, tangent: &[S]) -> Isometry3<S> {
    let mut start = BodyState::at_rest(Isometry3::translation(0.0, 0.0, 0.08));
    start.linear = Vector3::new(0.3, 0.0, -0.4);
    start.angular = Vector3::new(1.0, 3.0, -2.0);
    let still = BodyState::at_rest(Isometry3::identity()).cast();
    let thrown = start.retract(&std::array::from_fn(|i| tangent[i]));
    let states =
        model.cast().simulate_with(&SemiImplicitEuler, &State::new([still, thrown]), TIME_STEPS);
    states.unwrap().states[1].pose
}

#[test]
fn an_image_loss_flows_back_through_a_rollout() {
    let mesh = block();
    let (model, mesh_model) = (model(&mesh), Arc::new(RenderModel::new(&mesh).unwrap()));
    let camera = Camera { fx: 110.0, fy: 110.0, cx: 31.3, cy: 23.6, width: 64, height: 48 };
    // Looks along the model's y axis, with z up.
    let turn = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::FRAC_PI_2);
    let t_cam_world = Isometry3::from_parts(Translation3::new(-0.02, 0.04, 0.3), turn);
    let renderer = Renderer::new(Light::headlight(0.5, 0.5));
    let scene_at = |pose: Isometry3<f64>| Scene::new(camera).with(mesh_model.clone(), pose);
    let still = end(&model, &[0.0; 12]);
    let target =
        renderer.render(&scene_at(t_cam_world * Translation3::new(0.004, 0.003, -0.002) * still));
    let target = &target.buffers;
    let plain = |x: &[f64]| -> f64 {
        let image = renderer.render(&scene_at(t_cam_world * end(&model, x))).buffers;
        let color = image.color.as_flattened().iter().zip(target.color.as_flattened());
        let alpha = image.alpha.iter().zip(&target.alpha);
        color.chain(alpha).map(|(a, b)| (a - b).powi(2)).sum()
    };
    let (value, by) = gradient(
        |x| {
            let pose = lift::<Var>(&t_cam_world) * end(&model, x);
            let vars = SceneVars { poses: vec![(0, pose)], ..SceneVars::default() };
            let image = renderer.record(&scene_at(Isometry3::identity()), &vars).unwrap();
            let color = image.color.as_flattened().iter().zip(target.color.as_flattened());
            let alpha = image.alpha.iter().zip(&target.alpha);
            color.chain(alpha).fold(Var::default(), |sum, (a, b)| {
                let residual = a.plus(-b);
                sum + residual * residual
            })
        },
        &[0.0; 12],
    );
    assert!((value - plain(&[0.0; 12])).abs() < 1e-9 * value && value > 1.0, "{value}");
    let differences = finite_difference_gradient(plain, &[0.0; 12], 1e-6);
    let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let error: Vec<f64> = by.iter().zip(&differences).map(|(a, b)| a - b).collect();
    // The differences also see changes of visibility, which are left out of the derivative; over such a step they are rare.
    assert!(norm(&error) < 1e-4 * norm(&differences), "{by:?} {differences:?}");
}
