//! Points at which bodies touch.

use nalgebra::{Point3, Vector3, Vector6};

use super::Model;
use super::contact_pair::ContactBodies;
use crate::body_state::BodyState;
use crate::contact::bristle_function::across;
use crate::error::Result;
use crate::state::State;

/// Point at which two bodies touch, and the force there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointContact {
    /// The two bodies.
    pub bodies: ContactBodies,
    /// Position on the surface of the samples \[m\], world frame.
    pub position: Point3<f64>,
    /// Unit normal, out of the body with the field, world frame.
    pub normal: Vector3<f64>,
    /// Gap that the law sees \[m\], negative in penetration.
    pub gap: f64,
    /// Force on the body with the samples \[N\], world frame; that on the other body is its negative.
    pub force: Vector3<f64>,
}

impl Model {
    /// Points at which bodies touch, pair after pair, MuJoCo's `contact` with `mj_contactForce`. Two bodies that both have samples and a field touch
    /// at those of both, with half the force each. Where a field has no distance, the force at its points is not a number.
    ///
    /// # Errors
    /// If it is no state of this model.
    pub fn point_contacts(&self, state: &State) -> Result<Vec<PointContact>> {
        let state = self.sensed(state)?;
        let states = state.rows();
        let model = self.with_touching(states, 0.0);
        let mut all = Vec::new();
        let mut with_bristles = self.joint_places().end..;
        for pair in &model.contacts {
            let (law, p) = (pair.law().as_ref(), pair.param_values());
            let bristles = law.bristles().map(|bristles| {
                let deflection = with_bristles.next().and_then(|place| states.get(place));
                (bristles, deflection.map_or_else(Vector6::zeros, BodyState::deflection))
            });
            // Leaks of the first step are no forces.
            let Some(query) = model.contact_query_at(pair, states, 1) else { continue };
            let com = self.bodies[pair.bodies.field].com();
            let t_world_field = states[pair.bodies.field].shifted(&-com.coords).pose;
            let cutoff = law.cutoff();
            let mut add = |position: Vector3<f64>, normal, gap, force: Vector3<f64>| {
                let position =
                    t_world_field * Point3::from(query.state.pose.translation.vector + position);
                let [normal, force] =
                    [normal, force * pair.weight].map(|v| t_world_field.rotation * v);
                all.push(PointContact { bodies: pair.bodies, position, normal, gap, force });
            };
            let is_sound = query.for_each_contact(cutoff, true, |touch| {
                let mut contact = touch.contact(cutoff);
                if let Some((bristles, deflection)) = &bristles {
                    contact.slip +=
                        bristles.slip(&(across(&touch.normal, &touch.lever) * deflection));
                }
                let force = law.force(&p, &contact).along(&touch.normal);
                add(touch.lever, touch.normal, contact.gap, force);
            });
            if !is_sound {
                add(Vector3::zeros(), Vector3::zeros(), f64::NAN, Vector3::repeat(f64::NAN));
            }
        }
        Ok(all)
    }
}
