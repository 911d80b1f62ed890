//! How much forces change from one step to the next.

use nalgebra::{Vector3, Vector6};
use prehend_autodiff::Scalar;

use crate::contact::wrench::stack;
use crate::state::State;
use crate::time::Step;
use crate::world::World;
use crate::world::body_id::BodyId;

/// Follows the velocities of free bodies.
pub(super) struct Roughness {
    bodies: Vec<Followed>,
    /// Sums of the squared changes of velocity by contacts, and of the squared changes of these.
    kicks: f64,
    changes: f64,
    /// The largest of the latter, whose it is, and when \[s\].
    largest: (f64, Option<(BodyId, f64)>),
}

/// A free body and what is known of its last step.
struct Followed {
    body: BodyId,
    /// Radius of gyration \[m\].
    length: f64,
    /// Acceleration without contacts \[m/s²\].
    pull: Vector3<f64>,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
    kick: Vector6<f64>,
}

impl Roughness {
    pub(super) fn new<S: Scalar>(world: &World<S>, initial: &[State<S>]) -> Self {
        let follow = |body: BodyId| {
            let (rigid, state) = (world.bodies[body].rigid()?, initial[body].value());
            let mass = rigid.mass().value();
            let force = world.bodies[body].external_wrench.fixed_rows::<3>(0).map(|x| x.value());
            Some(Followed {
                body,
                length: rigid.gyration_radius(),
                pull: world.gravity.map(|x| x.value()) + force / mass,
                linear: state.linear,
                angular: state.angular,
                kick: Vector6::zeros(),
            })
        };
        let bodies = world.free_bodies().into_iter().filter_map(follow).collect();
        Self { bodies, kicks: 0.0, changes: 0.0, largest: (0.0, None) }
    }

    /// After `step` has led to `states`.
    #[inline]
    pub(super) fn step<S: Scalar>(&mut self, step: Step, states: &[State<S>]) {
        for followed in &mut self.bodies {
            let state = &states[followed.body];
            let (linear, angular) = (state.linear.map(S::value), state.angular.map(S::value));
            let by_contacts = linear - followed.linear - followed.pull * step.dt;
            let kick = stack(&by_contacts, &((angular - followed.angular) * followed.length));
            let change = (kick - followed.kick).norm_squared();
            self.kicks += kick.norm_squared();
            self.changes += change;
            if change > self.largest.0 {
                self.largest = (change, Some((followed.body, step.start)));
            }
            (followed.linear, followed.angular, followed.kick) = (linear, angular, kick);
        }
    }

    /// The ratio of both root mean squares.
    pub(super) fn mean(&self) -> f64 {
        if self.kicks > 0.0 { (self.changes / self.kicks).sqrt() } else { 0.0 }
    }

    /// The body with the largest change, and when \[s\].
    pub(super) fn roughest(&self) -> Option<(BodyId, f64)> {
        self.largest.1
    }
}
