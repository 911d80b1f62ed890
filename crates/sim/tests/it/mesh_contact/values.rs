//! Values with derivatives beside those without.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_autodiff::Fwd;
use prehend_geometry::shapes::cuboid;
use prehend_sim::contact::LeakSteps;
use prehend_sim::{
    Adaptive, Body, BodyState, ContactBodies, Coulomb, GapSmoothing, HuntCrossley, Integrator, Law,
    Model, SemiImplicitEuler, State, TimeSteps,
};

use super::scenes::{Lengths, shape};

/// A box that lies on one of its size, all edges above edges.
fn stacked(smoothing: GapSmoothing) -> (Model, State) {
    let mesh = cuboid(Vector3::repeat(0.1));
    let lengths = Lengths { spacing: 0.02, cell: 0.005 };
    let shape = shape(&mesh, lengths).unwrap();
    let mut model = Model::new(Vector3::z() * -9.81);
    let fixed = model.add(Body::fixed_from_shape("fixed", &shape));
    let body = Body::from_shape("moving", &shape, 1000.0).unwrap();
    let start = body.rigid().unwrap().at_rest(&Isometry3::translation(0.0, 0.0, 0.0999));
    let moving = model.add(body);
    let normal = HuntCrossley { stiffness: 1e9, damping: 1.0, exponent: 1.5 };
    let law = Law::new(normal, Coulomb { friction: 0.5, slip_scale: 1e-2 }).unwrap();
    model
        .add_contact(ContactBodies { samples: moving, field: fixed }, Arc::new(law), smoothing)
        .unwrap();
    (model, State::new([BodyState::at_rest(Isometry3::identity()), start]))
}

/// Largest difference of positions \[m\].
fn difference(integrator: &impl Integrator, smoothing: GapSmoothing) -> f64 {
    let (model, start) = stacked(smoothing);
    let time = TimeSteps { dt: 1e-3, steps: 12 };
    let plain = model.rollout_with(integrator, &start, time).unwrap().states;
    let lifted = model.cast::<Fwd<1>>();
    let mut moved: State<Fwd<1>> = start.cast();
    moved[1].pose.translation.vector.z += Fwd::variable(0.0, 0);
    let with = lifted.rollout_with(integrator, &moved, time).unwrap().states;
    let off = plain.iter().zip(&with).map(|(a, b)| {
        let (a, b) = (a[1].pose.translation.vector, b[1].value().pose.translation.vector);
        (a - b).norm()
    });
    off.fold(0.0, f64::max)
}

#[test]
fn derivatives_change_no_value() {
    let leaky = GapSmoothing::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::All };
    for smoothing in [GapSmoothing::Hard, GapSmoothing::Softplus { width: 1e-5 }, leaky] {
        assert_eq!(difference(&Adaptive::default(), smoothing), 0.0, "{smoothing:?}");
        assert_eq!(difference(&SemiImplicitEuler, smoothing), 0.0, "{smoothing:?}");
    }
}
