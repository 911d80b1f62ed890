//! A parcel that a plunger tips up: it slides on an edge and rattles back down.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_sim::fields::{Cuboid, HalfSpace};
use prehend_sim::{
    Body, BodyState, ContactBodies, ContactCalibration, Coulomb, GapSmoothing, HuntCrossley,
    KelvinVoigt, Law, Model, RigidBody, State, Surface,
};

use super::scenes::{HARD, down};

/// Half of the edges of the parcel \[m\], and how deep it sinks into the table.
const HALF: [f64; 3] = [0.04, 0.06, 0.03];
const DEPTH: f64 = 1e-4;
/// Radius of the plunger's tip \[m\].
const TIP: f64 = 0.015;

/// The plunger's path: 6 cm along x and back, off the middle.
fn plunger(time: f64) -> BodyState {
    let (stroke, duration) = (0.06, 0.2);
    let phase = PI * time.min(duration) / duration;
    let x = stroke * phase.sin().powi(2) - HALF[0] - TIP - 1e-3;
    let mut state = BodyState::at_rest(Isometry3::translation(x, 2e-3, HALF[2]));
    state.linear.x = stroke * PI / duration * (2.0 * phase).sin();
    state
}

/// Table, parcel and plunger; the parcel is number 1, its friction parameter 2 of contact 0.
pub(crate) fn tipped() -> (Model, State) {
    let mass = 0.65;
    let [a, b, c] = HALF.map(|half| mass * half * half / 3.0);
    let inertia = Vector3::new(b + c, a + c, mass * 0.0259 * 0.0259);
    // Far back and high up.
    let com = Point3::new(-0.016, -0.002, 0.012);
    let rigid = RigidBody::new(mass, Matrix3::from_diagonal(&inertia), com).unwrap();
    // One sample in the middle of each square of 2 cm.
    let middle = |i: i32| 0.01 * f64::from(2 * i + 1);
    let row = |i| (-3..3).map(move |j| Point3::new(middle(i), middle(j), -HALF[2]));
    let bottom: Vec<_> = (-2..2).flat_map(row).collect();
    let area = 4.0 * HALF[0] * HALF[1];
    let sides = Cuboid { half_extents: HALF.into(), rounding: 1e-3 };
    let tip_area = 1e-4;
    let tip = Surface::uniform(&[Point3::origin()], tip_area).unwrap().rounded(TIP).unwrap();

    let mut model = Model::new(down());
    let table = model.add(Body::fixed("table").with_field(Arc::new(HalfSpace::floor())));
    let parcel = Body::dynamic("parcel", rigid).with_field(Arc::new(sides));
    let parcel = model.add(parcel.with_surface(Surface::uniform(&bottom, area).unwrap()));
    let plunger = model.add(Body::kinematic("plunger", plunger).with_surface(tip));
    let target =
        ContactCalibration { mass: 0.4, gravity: 9.81, penetration: DEPTH, contact_area: area };
    let floor = KelvinVoigt::from_target(&target, 0.3).unwrap();
    let law = Law::new(floor, Coulomb { friction: 0.432, slip_scale: 5e-3 }).unwrap();
    let smoothing = GapSmoothing::Softplus { width: 0.1 * DEPTH };
    let bodies = ContactBodies { samples: parcel, field: table };
    model.add_contact(bodies, Arc::new(law), smoothing).unwrap();
    // The tip is a roller: no friction.
    let spring = HuntCrossley { stiffness: 1500.0 / tip_area, damping: 0.1, exponent: 1.0 };
    let law = Law::new(spring, Coulomb { friction: 0.0, slip_scale: 5e-3 }).unwrap();
    let bodies = ContactBodies { samples: plunger, field: parcel };
    model.add_contact(bodies, Arc::new(law), HARD).unwrap();

    let still = BodyState::at_rest(Isometry3::identity());
    let start = rigid.at_rest(&Isometry3::translation(0.0, 0.0, HALF[2] - DEPTH));
    (model, State::new([still, start, still]))
}
