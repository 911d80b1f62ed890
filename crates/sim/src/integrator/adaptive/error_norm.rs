//! Norm of errors.

use std::cell::LazyCell;

use nalgebra::{Vector3, Vector6};

use super::Adaptive;
use super::sensitivity::Tangent;
use crate::articulated::Joint;
use crate::body_state::{BodyState, Rows};
use crate::contact::bristles::Bristles;
use crate::handle::BodyId;
use crate::integrator::runge_kutta::dormand_prince::{Estimate, Trial};
use crate::model::Model;
use crate::model::contact_pair::ContactPair;

/// Part of the fastest body's speed that counts for all: what is at rest may be hit by it.
const SLOW: f64 = 0.1;
/// Speed of a model in which nothing moves \[m/s\].
const SLOWEST: f64 = 1e-9;

/// Part of the largest sensitivity that those of velocities are compared with at least.
const SMALL: f64 = 0.1;
/// Error of the sensitivity in a substep that cannot be shorter, because of a kink: next to nothing beside what follows, where the kink
/// is the onset of a contact that stiff.
const SHARPEST_KINK: f64 = 1e-3;

/// Errors of a substep: of its states, and of its sensitivity relative to that.
pub(super) struct Errors {
    state: f64,
    sensitivity: f64,
}

/// Norm of errors.
pub(super) struct ErrorNorm {
    tolerance: f64,
    sensitivity_tolerance: f64,
    /// Number of bodies, whose states come first.
    bodies: usize,
    /// For each free body, then of each joint, with the place of its state.
    scales: Vec<(usize, Scale)>,
    /// For each contact with bristles, the radius of gyration of its smaller body \[m\].
    deflections: Vec<f64>,
}

/// Units of the coordinates of a body or joint.
#[derive(Clone, Copy)]
struct Scale {
    /// By which angular momenta are those of angular velocities times the squared length; so 1/length² where they are such velocities.
    mass: f64,
    /// Radius of gyration \[m\]; 1 rad of a coordinate that is an angle.
    length: f64,
    /// Speed of a fall through that radius, or in the acceleration by contacts if nothing falls \[m/s\]; or that of the angle.
    speed: f64,
    /// Speed of a coordinate by that of the bodies: 1, or 1/radius \[1/m\] of an angle.
    per_meter: f64,
    /// Presence of its coordinates: places, rotations.
    has: [bool; 2],
}

impl Scale {
    /// The larger of a change of position \[m\] and orientation \[rad\], and that of velocity \[m/s\] and angular momentum
    /// \[kg m²/s\], given in the order of integration; velocities in multiples of `speed` \[m/s\].
    fn largest(&self, change: [f64; 4], speed: f64) -> [f64; 2] {
        let [position, velocity, turn, momentum] = change;
        let spin = momentum / (self.mass * self.length * speed);
        [max_or_nan(position / self.length, turn), max_or_nan(velocity / speed, spin)]
    }

    /// The largest components of the sensitivity of `state`.
    fn sensitivity(&self, state: &BodyState<Tangent>, speed: f64) -> [f64; 2] {
        let tangent = state.tangent().map(|x| x.derivative[0]);
        let [position, turn, velocity, spin] =
            std::array::from_fn(|k| Vector3::from_column_slice(&tangent[3 * k..][..3]).norm());
        let momentum = spin * self.mass * self.length * self.length;
        self.largest([position, velocity, turn, momentum], speed)
    }
}

/// The larger of two numbers; NaN if one of them is.
fn max_or_nan(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

impl ErrorNorm {
    /// Error norm of a step from `states`.
    pub(super) fn new(settings: &Adaptive, model: &Model, states: &Rows) -> Self {
        let wrenches = LazyCell::new(|| model.wrenches_of(states, 0));
        let scale = |body: BodyId| {
            let rigid = model.bodies[body].rigid()?;
            let length = rigid.gyration_radius();
            let force = |wrench: &Vector6<f64>| wrench.fixed_rows::<3>(0).norm() / rigid.mass();
            let constant = model.gravity.norm() + force(&model.bodies[body].external_wrench);
            // Without gravity, what is pushed by contacts alone.
            let acceleration = if constant > 0.0 { constant } else { force(&wrenches[body]) };
            let speed = (acceleration * length).sqrt().max(SLOWEST);
            let (mass, per_meter, has) = (rigid.mass(), 1.0, [true; 2]);
            Some((body.index(), Scale { mass, length, speed, per_meter, has }))
        };
        let mut scales: Vec<(usize, Scale)> =
            model.free_bodies().into_iter().filter_map(scale).collect();
        scales.extend(model.joint_places().zip(joint_scales(model, states, &wrenches)));
        let Adaptive { tolerance, sensitivity_tolerance, .. } = *settings;
        let length = |(pair, _): (&ContactPair, Bristles)| {
            let bodies = [pair.bodies.samples, pair.bodies.field];
            let lengths = bodies.map(|body| model.gyration_radius(body)).into_iter();
            lengths.filter(|length| *length > 0.0).fold(f64::INFINITY, f64::min)
        };
        let deflections = model.bristle_contacts().map(length).collect();
        let bodies = model.bodies.len();
        Self { tolerance, sensitivity_tolerance, bodies, scales, deflections }
    }

    /// The places of the states of free bodies and joints, and units of the twelve coordinates of their tangents.
    pub(super) fn units(&self) -> impl Iterator<Item = (usize, [f64; 12])> {
        self.scales.iter().map(|(place, Scale { length, speed, has: [moves, turns], .. })| {
            let units = [*length, 1.0, *speed, speed / length];
            let has = [moves, turns, moves, turns];
            (*place, std::array::from_fn(|i| if *has[i / 3] { units[i / 3] } else { 0.0 }))
        })
    }

    /// A length to begin with: a tenth of the time in which accelerations change a velocity by as much as it counts.
    pub(super) fn first_step(&self, model: &Model, wrenches: &[Vector6<Tangent>]) -> f64 {
        let time = |(place, scale): &(usize, Scale)| {
            let (Scale { mass, length, speed, .. }, wrench) =
                (*scale, wrenches[*place].map(|w| w.value));
            let (force, torque) = (wrench.fixed_rows::<3>(0), wrench.fixed_rows::<3>(3));
            if *place >= model.bodies.len() {
                return 0.1 * speed / force.norm().max(torque.norm() * length);
            }
            let linear = (model.gravity + force / mass).norm();
            0.1 * speed / linear.max(torque.norm() / (mass * length))
        };
        self.scales.iter().map(time).fold(f64::INFINITY, f64::min)
    }

    /// The errors of `trial`, a step from `states` that is off by `estimate`: no numbers if the step is none.
    pub(super) fn errors(
        &self,
        states: &Rows<Tangent>,
        trial: &Trial<Tangent>,
        estimate: &Estimate<Tangent>,
    ) -> Errors {
        let (value, derivative) = (|x: Tangent| x.value, |x: Tangent| x.derivative[0]);
        let (mut error, mut slope_error, mut slope) = (0.0, [0.0; 2], [0.0; 2]);
        let bodies = |states| <[BodyState<Tangent>]>::iter(states).take(self.bodies);
        let speeds = bodies(states).chain(bodies(trial.end()));
        let speeds = speeds.map(|s| s.linear.map(value).norm());
        let fastest = speeds.fold(0.0, f64::max);
        for (i, (place, scale)) in self.scales.iter().enumerate() {
            let (start, end) = (&states[*place], &trial.end()[*place]);
            let own = [start, end].map(|state| state.value().speed_within(scale.length));
            let own = max_or_nan(own[0], own[1]);
            let speed = scale.speed + own + SLOW * fastest * scale.per_meter;
            let largest = |substep| scale.largest(estimate.across_kinks(i, substep), speed);
            error = largest(value).into_iter().fold(error, max_or_nan);
            slope_error = larger(slope_error, largest(derivative));
            for state in [start, end] {
                slope = larger(slope, scale.sensitivity(state, speed));
            }
        }
        for (i, length) in (self.scales.len()..).zip(&self.deflections) {
            let largest = |[linear, angular, ..]: [f64; 4]| max_or_nan(linear / length, angular);
            error = max_or_nan(error, largest(estimate.across_kinks(i, value)));
            slope_error[0] =
                max_or_nan(slope_error[0], largest(estimate.across_kinks(i, derivative)));
        }
        // Velocities decide what comes of an impact, even where a long flight has made positions the more sensitive.
        let whole = max_or_nan(slope[0], slope[1]);
        let of = [whole, max_or_nan(slope[1], SMALL * whole)];
        // Where everything is constant there is no error to compare.
        let relative = |k: usize| if slope_error[k] == 0.0 { 0.0 } else { slope_error[k] / of[k] };
        Errors { state: error, sensitivity: max_or_nan(relative(0), relative(1)) }
    }

    /// `errors` in multiples of what is tolerated.
    pub(super) fn error_ratio(&self, errors: &Errors) -> f64 {
        let Errors { state, sensitivity } = errors;
        max_or_nan(state / self.tolerance, sensitivity / self.sensitivity_tolerance)
    }

    /// True if `errors` of a substep that could not be shorter are those of a kink alone: a substep that short has no other of its
    /// sensitivity.
    pub(super) fn only_kinks(&self, errors: &Errors) -> bool {
        errors.state <= self.tolerance && errors.sensitivity <= SHARPEST_KINK
    }
}

/// For each joint: the radius of what it moves, its fall through that, and angles in radians. Where nothing falls, accelerations are those of
/// the joint itself.
fn joint_scales<'a>(
    model: &'a Model,
    states: &'a Rows,
    wrenches: &'a LazyCell<Vec<Vector6<f64>>, impl FnOnce() -> Vec<Vector6<f64>>>,
) -> impl Iterator<Item = Scale> + 'a {
    let all = model.articulated(states).flat_map(|(own, joints)| {
        let [q, v] = own.coordinates(joints);
        let radii = own.tree.kinematics(&q, &v).radii();
        own.tree.links().iter().map(|link| &link.joint).zip(radii).collect::<Vec<_>>()
    });
    all.zip(model.joint_places()).map(move |((joint, radius), place)| {
        let radius = if radius > 0.0 { radius } else { 1.0 };
        let angle = !matches!(joint, Joint::Prismatic(_) | Joint::Floating);
        let (length, per_meter) = if angle { (1.0, 1.0 / radius) } else { (radius, 1.0) };
        let acceleration = match model.gravity.norm() {
            0.0 => wrenches[place].norm() / per_meter,
            gravity => gravity,
        };
        let speed = (acceleration * radius).sqrt().max(SLOWEST) * per_meter;
        let has = [joint.nv() > 0 && !matches!(joint, Joint::Spherical), joint.turns()];
        Scale { mass: 1.0 / (length * length), length, speed, per_meter, has }
    })
}

/// The larger of each.
fn larger(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [max_or_nan(a[0], b[0]), max_or_nan(a[1], b[1])]
}
