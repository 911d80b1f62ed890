//! Rollouts of a body in contact, with sensitivities to its initial pose.

use nalgebra::{SMatrix, Vector3};
use prehend_geometry::DistanceField;

use crate::body::{RigidBody, SurfacePoint};
use crate::contact::law::LocalLaw;
use crate::contact::onset::Onset;
use crate::contact::wrench::{contact_wrench, contact_wrench_jacobian, within_reach};
use crate::integrator::{step, step_transition};
use crate::state::State;

/// Derivative of a state (see [`Vector12`](crate::Vector12)) by the initial pose twist.
pub type Matrix12x6 = SMatrix<f64, 12, 6>;

/// How far points may move before the list of those near contact is made anew \[m\].
const LIST_MARGIN: f64 = 2e-3;

/// A body, its surroundings' contact law and the time step.
#[derive(Clone, Copy, Debug)]
pub struct Simulation<'a, L: LocalLaw + ?Sized> {
    /// The body.
    pub body: &'a RigidBody,
    /// Its surface samples.
    pub points: &'a [SurfacePoint],
    /// Gravity, world frame \[m/s²\].
    pub gravity: Vector3<f64>,
    /// The contact law.
    pub law: &'a L,
    /// How contact begins.
    pub onset: Onset,
    /// Time step \[s\].
    pub dt: f64,
}

impl<L: LocalLaw + ?Sized> Simulation<'_, L> {
    /// The states at 0, dt, …, `steps`·dt, from `initial`, against the fixed `field` (world frame).
    pub fn rollout(&self, initial: &State, field: &dyn DistanceField, steps: usize) -> Vec<State> {
        let mut states = Vec::with_capacity(steps + 1);
        states.push(*initial);
        let mut state = *initial;
        let mut near = NearPoints::new(self, &state, field);
        for index in 0..steps {
            near.follow(self, &state, field);
            let onset = self.onset.at_step(index);
            let wrench = contact_wrench(self.law, onset, near.points.iter(), &state, field);
            state = step(self.body, &state, &wrench, &self.gravity, self.dt);
            states.push(state);
        }
        states
    }

    /// [`Self::rollout`] with the 12×6 derivative of each state by the initial pose: left twist about the
    /// centre of mass, initial velocities kept.
    pub fn rollout_with_sensitivities(
        &self,
        initial: &State,
        field: &dyn DistanceField,
        steps: usize,
    ) -> Vec<(State, Matrix12x6)> {
        let mut states = Vec::with_capacity(steps + 1);
        let (mut state, mut sensitivity) = (*initial, Matrix12x6::identity());
        states.push((state, sensitivity));
        let mut near = NearPoints::new(self, &state, field);
        for index in 0..steps {
            near.follow(self, &state, field);
            let onset = self.onset.at_step(index);
            let contact =
                contact_wrench_jacobian(self.law, onset, near.points.iter(), &state, field);
            let (next, transition) =
                step_transition(self.body, &state, &contact, &self.gravity, self.dt);
            (state, sensitivity) = (next, transition * sensitivity);
            states.push((state, sensitivity));
        }
        states
    }
}

/// The points that can touch before the body has moved [`LIST_MARGIN`]: the others need no query.
///
/// Points left out exert no force, so results do not depend on the list.
struct NearPoints {
    points: Vec<SurfacePoint>,
    /// State for which the list was made.
    made_at: State,
    /// Largest distance of a point from the centre of mass \[m\].
    radius: f64,
}

impl NearPoints {
    fn new<L: LocalLaw + ?Sized>(
        simulation: &Simulation<'_, L>,
        state: &State,
        field: &dyn DistanceField,
    ) -> Self {
        let radius = simulation.points.iter().map(|p| p.position.norm()).fold(0.0, f64::max);
        Self { points: Self::list(simulation, state, field), made_at: *state, radius }
    }

    fn list<L: LocalLaw + ?Sized>(
        simulation: &Simulation<'_, L>,
        state: &State,
        field: &dyn DistanceField,
    ) -> Vec<SurfacePoint> {
        // Interpolated fields are a little steeper than one in places: leave a quarter in hand.
        let distance = simulation.law.cutoff() + simulation.onset.band() + 1.25 * LIST_MARGIN;
        within_reach(simulation.points, &state.pose, field, distance)
    }

    fn follow<L: LocalLaw + ?Sized>(
        &mut self,
        simulation: &Simulation<'_, L>,
        state: &State,
        field: &dyn DistanceField,
    ) {
        let shift = state.pose.translation.vector - self.made_at.pose.translation.vector;
        let turn = state.pose.rotation.angle_to(&self.made_at.pose.rotation);
        if shift.norm() + turn * self.radius > LIST_MARGIN {
            self.points = Self::list(simulation, state, field);
            self.made_at = *state;
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3, Vector6};
    use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};
    use prehend_autodiff::lie::{perturb_about, so3_log};

    use super::*;
    use crate::Penalty;
    use crate::fields::{HalfSpace, SphereCavity};

    fn scene() -> (RigidBody, Vec<SurfacePoint>, State) {
        let inertia = Matrix3::from_diagonal(&Vector3::new(6e-5, 9e-5, 5e-5));
        let body = RigidBody::new(0.2, inertia, Point3::origin()).unwrap();
        let points = (0..60)
            .map(|i| {
                let (t, z) = (2.4 * f64::from(i), 1.0 - (f64::from(i) + 0.5) / 30.0);
                let r = (1.0 - z * z).sqrt();
                let position = Vector3::new(0.03 * r * t.cos(), 0.025 * r * t.sin(), 0.02 * z);
                SurfacePoint { position, area: 1e-4 }
            })
            .collect();
        let pose = nalgebra::Isometry3::new(
            Vector3::new(0.002, 0.001, 0.0195),
            Vector3::new(0.1, 0.2, 0.3),
        );
        let (linear, angular) = (Vector3::new(0.05, 0.02, -0.1), Vector3::new(1.0, -0.5, 0.7));
        (body, points, State { pose, linear, angular })
    }

    fn assert_sensitivities(field: &dyn DistanceField, onset: Onset) {
        let (body, points, initial) = scene();
        let law = Penalty::new(5e6, 2e4, 0.6, 2e-2).unwrap();
        let gravity = Vector3::new(0.3, -0.2, -9.81);
        let sim = Simulation { body: &body, points: &points, gravity, law: &law, onset, dt: 1e-3 };
        let (state, exact) = *sim.rollout_with_sensitivities(&initial, field, 30).last().unwrap();
        assert!((state.linear - (initial.linear + gravity * 0.03)).norm() > 0.05, "no contact");
        let com = initial.pose.translation.vector;
        let differences = finite_difference_jacobian(
            |x| {
                let pose = perturb_about(&initial.pose, &com, &Vector6::from_column_slice(x));
                let end = *sim.rollout(&State { pose, ..initial }, field, 30).last().unwrap();
                let turn = so3_log(&(end.pose.rotation * state.pose.rotation.inverse()));
                let parts = [end.pose.translation.vector, turn, end.linear, end.angular];
                parts.iter().flat_map(|v| v.iter().copied()).collect()
            },
            &[0.0; 6],
            2e-6,
        );
        for (row, reference) in differences.iter().enumerate() {
            let exact: Vec<f64> = exact.row(row).iter().copied().collect();
            let error = compare_gradients(&exact, reference);
            assert!(error.relative < 1e-6, "row {row}: {error:?}");
        }
    }

    #[test]
    fn sensitivities_match_differences_on_smooth_fields() {
        let onset = Onset::Softplus { width: 3e-4 };
        assert_sensitivities(&HalfSpace::floor(), onset);
        let bowl = SphereCavity { center: Point3::new(0.0, 0.0, 0.05), radius: 0.05 };
        assert_sensitivities(&bowl, onset);
    }

    #[test]
    fn the_list_of_near_points_changes_nothing() {
        let (body, points, initial) = scene();
        let law = Penalty::new(5e6, 2e4, 0.6, 2e-2).unwrap();
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        let sim = Simulation {
            body: &body,
            points: &points,
            gravity,
            law: &law,
            onset: Onset::Hard,
            dt: 1e-3,
        };
        let field = HalfSpace::floor();
        let mut state = initial;
        for listed in sim.rollout(&initial, &field, 200).iter().skip(1) {
            let wrench = contact_wrench(&law, Onset::Hard, points.iter(), &state, &field);
            state = step(&body, &state, &wrench, &gravity, 1e-3);
            assert_eq!(&state, listed);
        }
        assert!((state.pose.translation.vector - initial.pose.translation.vector).norm() > 3e-3);
    }
}
