//! Painlevé's rod: a rod whose tip slides ahead of its center of mass on a rough floor.
//!
//! With half length l, angle θ to the floor and I = m l²/3 a normal impulse P changes the tip's velocity by
//! p P/m across the floor's plane and by q P/m along it. In slip p = 1 + 3 cos²θ − 3μ sinθ cosθ and q = 3 sinθ cosθ −
//! μ(1 + 3 sin²θ); in stick p_s = 4/(1 + 3 sin²θ). For p < 0 there is no rigid solution (P. Painlevé, 1895).
//! A stiff compliant one jams ("impact without collision"): depth grows exponentially until slip ends, and the
//! contact's energy then throws the tip off the floor (A. Champneys and P. Várkonyi, "The Painlevé paradox in contact
//! mechanics", IMA J. Applied Mathematics 81, 2016, §4). Slip v₀ ends with the normal velocity p v₀/|q|, and since
//! p and p_s relate speed squared to the same elastic energy, the tip leaves at v₀ (|p|/|q|) √(1 + p_s/|p|),
//! whatever the elastic law.

use nalgebra::{Point3, Vector3};
use prehend_sim::{BodyState, GapSmoothing, Model, State, TimeSteps};

use super::integrators::Scheme;
use super::laws::{G, Law, Spec};
use super::rows::Row;
use super::scene::{BODY, above_floor, carrying_height, down, on_floor};

const HALF_LENGTH: f64 = 0.5;
const MASS: f64 = 1.0;
const SPEED: f64 = 1.0;

/// The tip from the center of mass, at 60°.
fn tip() -> Vector3<f64> {
    let (sine, cosine) = 60f64.to_radians().sin_cos();
    Vector3::new(HALF_LENGTH * cosine, 0.0, -HALF_LENGTH * sine)
}

/// (p, q, p_s) for a friction coefficient.
fn responses(friction: f64) -> [f64; 3] {
    let (s, c) = 60f64.to_radians().sin_cos();
    let p = 1.0 + 3.0 * c * c - 3.0 * friction * s * c;
    let q = 3.0 * s * c - friction * (1.0 + 3.0 * s * s);
    [p, q, 4.0 / (1.0 + 3.0 * s * s)]
}

/// A rod whose tip would carry its weight at 10 nm: stiff enough that gravity does little during an impact.
fn rod(law: &Law, friction: f64) -> Model {
    let spec = Spec {
        mass: MASS,
        depth: 1e-8,
        samples: 1,
        area: 1e-4,
        damping: 0.0,
        friction,
        slip_scale: 5e-3,
    };
    let inertia = MASS * HALF_LENGTH * HALF_LENGTH / 3.0;
    on_floor(law, &spec, GapSmoothing::Hard, down(), &[Point3::from(tip())], inertia)
}

/// States with the tip at `height`, sliding.
fn sliding(height: f64) -> State {
    above_floor(height - tip().z, Vector3::new(SPEED, 0.0, 0.0))
}

/// Position and velocity of the tip.
fn tip_motion(state: &BodyState) -> (Vector3<f64>, Vector3<f64>) {
    let arm = state.pose.rotation * tip();
    (state.pose.translation.vector + arm, state.linear + state.angular.cross(&arm))
}

/// In the paradox the rod jams and leaps.
pub(crate) fn jam(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let friction = 2.0;
    let [p, q, stick] = responses(friction);
    let (model, start) = (rod(law, friction), sliding(0.0));
    let time_steps = TimeSteps { dt: 2e-8, steps: 50_000 };
    let course = scheme.course(&model, &start, time_steps, BODY);
    let motion: Vec<_> = course.iter().map(tip_motion).collect();
    let touched = motion.iter().position(|(x, _)| x.z < 0.0).unwrap_or(motion.len());
    let leaves = motion[touched..].iter().find(|(x, _)| x.z > 0.0);
    let speed = leaves.map_or(f64::NAN, |(_, v)| v.z);
    let slip = leaves.map_or(f64::NAN, |(_, v)| v.x.abs());
    let expected = SPEED * p.abs() / q.abs() * (1.0 + stick / p.abs()).sqrt();
    vec![
        Row::relative("leaps at [m/s]", speed, expected, 0.02),
        Row::new("slip as it leaps [m/s]", slip, 0.0, 0.02),
    ]
}

/// With p > 0 it slides on, pressed by m g/p.
pub(crate) fn slide(scheme: &Scheme, law: &Law) -> Vec<Row> {
    let friction = 1.0;
    let [p, ..] = responses(friction);
    let model = rod(law, friction);
    let touching = -tip().z;
    let height = carrying_height(&model, MASS * G / p, touching - 1e-6, touching);
    let start = sliding(height - touching);
    let time_steps = TimeSteps { dt: 1e-7, steps: 2000 };
    let end = scheme.end(&model, &start, time_steps);
    let force = model.wrenches(&end, time_steps.steps)[BODY].z;
    vec![Row::relative("normal force m g/p [N]", force, MASS * G / p, 0.01)]
}
