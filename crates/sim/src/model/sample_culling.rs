//! Culling of samples that cannot touch for a while (a Verlet list).

use std::sync::Arc;

use prehend_autodiff::Scalar;

use super::Model;
use super::contact_pair::ContactPair;
use crate::body_state::{BodyState, Rows};

/// Distance that samples may move relative to a field before those near it are looked for anew \[m\]: the least and the most
/// that pays.
const MARGIN: [f64; 2] = [1e-3, 4e-3];

/// Steps for which a search for near samples should serve.
const STEPS: f64 = 2.0;

/// Up to so many samples cost no more to ask than to look for near ones.
const FEW: usize = 8;

/// A model in which contacts of more than [`FEW`] samples know only those near to the field. The others exert no force, so results are the same to the last bit.
pub(crate) struct SampleCulling<S: Scalar> {
    model: Option<Model<S>>,
    /// The contacts whose near samples are looked for, and how far the samples of each are from their body's center of mass \[m\].
    followed: Vec<(usize, f64)>,
    /// For each of those, the body with the samples as the field saw it when near ones were looked for.
    made_at: Vec<BodyState>,
    /// Distance that samples may move until the next search \[m\].
    margin: f64,
}

impl<S: Scalar> SampleCulling<S> {
    pub(crate) fn new(full: &Model<S>) -> Self {
        let followed = |(index, pair): (usize, &ContactPair<S>)| {
            let body = &full.bodies[pair.bodies.samples];
            let surface = body.surface.as_ref().filter(|surface| surface.points().len() > FEW)?;
            Some((index, surface.radius_about(&body.com().map(S::value))))
        };
        let followed = full.contacts.iter().enumerate().filter_map(followed).collect();
        Self { model: None, followed, made_at: Vec::new(), margin: 0.0 }
    }

    /// A model whose forces at `states` are those of `full`, for a step of `dt` \[s\].
    pub(crate) fn model<'a>(
        &'a mut self,
        full: &'a Model<S>,
        states: &Rows<S>,
        dt: f64,
    ) -> &'a Model<S> {
        if self.followed.is_empty() {
            return full;
        }
        let (mut moved, mut ahead): (f64, f64) = (0.0, 0.0);
        for (place, (index, radius)) in self.followed.iter().enumerate() {
            let now = full.relative_value(&full.contacts[*index], states);
            ahead = ahead.max(now.speed_within(*radius));
            if let Some(then) = self.made_at.get(place) {
                let shift = now.pose.translation.vector - then.pose.translation.vector;
                let turn = now.pose.rotation.angle_to(&then.pose.rotation);
                moved = moved.max(shift.norm() + turn * radius);
            }
        }
        if self.model.is_none() || moved.is_nan() || moved > self.margin {
            self.margin = MARGIN[0].max(STEPS * ahead * dt);
            if self.margin > MARGIN[1] {
                self.model = None;
                return full;
            }
            self.look(full, states);
        }
        self.model.as_ref().unwrap_or(full)
    }

    fn look(&mut self, full: &Model<S>, states: &Rows<S>) {
        let mut near = full.clone();
        self.made_at.clear();
        for (index, _) in &self.followed {
            let (pair, near) = (&full.contacts[*index], &mut near.contacts[*index]);
            let state = full.relative_value(pair, states);
            self.made_at.push(state);
            if let Some(query) = full.contact_query(pair, state) {
                near.near = Some(Arc::new(query.near(pair.law().cutoff(), self.margin)));
            }
        }
        self.model = Some(near);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Vector3};

    use crate::scenes::{bowl, egg_on, floor};
    use crate::{
        Body, ContactBodies, GapSmoothing, Integrator, Model, RigidBody, RungeKutta4,
        SemiImplicitEuler, State, Surface, TimeSteps, integrator::BackwardEuler,
    };

    fn assert_same(integrator: &impl Integrator, gap: f64, dt: f64, steps: usize) {
        for field in [bowl(), floor()] {
            let (model, mut states) = egg_on(field, GapSmoothing::Softplus { width: 1e-5 });
            states[1].pose.translation.z += gap;
            states[1].linear = Vector3::zeros();
            assert_steps_alike(&model, &states, integrator, dt, steps);
        }
    }

    /// A rollout goes where single steps, which look at all samples, go.
    fn assert_steps_alike(
        model: &Model,
        states: &State,
        integrator: &impl Integrator,
        dt: f64,
        steps: usize,
    ) {
        let time_steps = TimeSteps { dt, steps };
        let run = model.rollout_with(integrator, states, time_steps).unwrap().states;
        let mut expected = states.clone();
        for (step, state) in time_steps.after(0.0).zip(&run[1..]) {
            expected = model.step(integrator, &expected, step).unwrap();
            assert_eq!(&expected, state, "{step:?}");
        }
    }

    #[test]
    fn contacts_of_few_samples_come_and_go_beside_others() {
        let ball = RigidBody::ball(0.5, 0.05).unwrap();
        let surface = Arc::new(Surface::ball(0.05).unwrap());
        for egg_too in [false, true] {
            let (mut model, states) = egg_on(floor(), GapSmoothing::Softplus { width: 1e-5 });
            let law = Arc::clone(model.contacts[0].law());
            let id = model.add(Body::dynamic("ball", ball).with_surface(Arc::clone(&surface)));
            let mut contacts = std::mem::take(&mut model.contacts);
            let field = contacts[0].bodies.field;
            let bodies = ContactBodies { samples: id, field };
            model.add_contact(bodies, law, GapSmoothing::Hard).unwrap();
            if egg_too {
                model.contacts.append(&mut contacts);
            }
            let mut rolling = ball.at_rest(&Isometry3::translation(0.5, 0.0, 0.0495));
            rolling.linear.x = 0.3;
            let states = State::new([states.bodies(), &[rolling]].concat());
            assert_steps_alike(&model, &states, &SemiImplicitEuler, 1e-3, 200);
        }
    }

    #[test]
    fn leaving_out_far_samples_changes_no_bit() {
        for (gap, dt, steps) in [(0.0, 1e-3, 200), (3e-3, 2e-3, 30), (2e-3, 1e-2, 3)] {
            assert_same(&SemiImplicitEuler, gap, dt, steps);
            assert_same(&RungeKutta4, gap, dt, steps.min(30));
        }
        // Forces at the end of a long step are of samples that were out of reach at its start.
        assert_same(&BackwardEuler, 2e-3, 4e-2, 1);
    }
}
