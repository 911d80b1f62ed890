//! Mesh-to-tactile: taxels that feel force touch the object, quiet taxels do not reach into it.

use std::sync::Arc;

use nalgebra::{Point3, Vector3, Vector6};
use prehend_geometry::robot::ArticulatedRobot;

use super::{Term, share};
use crate::{Block, Cauchy, Normal, Object, Observation, RefineError, Robot, State};

/// Settings of the mesh-to-tactile term.
#[derive(Clone, Debug, PartialEq)]
pub struct TactileSettings {
    /// Force above which a taxel counts as touched, the paper's γ \[N\].
    pub touch_force: f64,
    /// Standard deviation of a touched taxel from the object's surface \[m\]: a contact spreads over
    /// the taxels around it, so a touched taxel may itself be a few millimetres away.
    pub sigma: f64,
    /// How far outside the surface a touched taxel is on average \[m\]: it lies under a skin, and feels what its neighbours
    /// touch.
    pub standoff: f64,
    /// Standard deviation of how deep a quiet taxel may lie inside the object \[m\].
    pub quiet_sigma: f64,
    /// Distance at which a taxel counts as an outlier (dead, false) \[m\].
    pub outlier: f64,
    /// How many independent measurements the touched taxels amount to at most: one contact lights up
    /// a whole patch.
    pub effective_taxels: f64,
}

impl Default for TactileSettings {
    fn default() -> Self {
        Self {
            touch_force: 0.1,
            sigma: 3e-3,
            standoff: 0.0,
            quiet_sigma: 1e-3,
            outlier: 10e-3,
            effective_taxels: 8.0,
        }
    }
}

/// A taxel.
struct Touch {
    link: usize,
    /// In link coordinates \[m\].
    position: Point3<f64>,
    touched: bool,
}

/// The paper's distance between the mesh and the taxels in contact, and the evidence of the others.
///
/// Touched taxels are drawn to the surface from either side; quiet ones are pushed out of it, which the
/// paper leaves unused. Both go through Cauchy's loss, because some taxels are dead and some ring false.
pub struct TactileTerm {
    object: Arc<Object>,
    robot: Arc<Robot>,
    touches: Vec<Touch>,
    settings: TactileSettings,
}

impl TactileTerm {
    /// Reads the taxels of `robot` from `observation`.
    ///
    /// # Errors
    /// If the hand is unknown, or its forces are not one a taxel.
    pub fn new(
        observation: &Observation,
        object: Arc<Object>,
        robot: Arc<Robot>,
        settings: TactileSettings,
    ) -> Result<Self, RefineError> {
        let hand = observation
            .hand
            .as_ref()
            .ok_or(RefineError::Missing { what: "hand state", term: "tactile" })?;
        if hand.forces.len() != robot.taxels.len() {
            return Err(RefineError::TaxelCount {
                forces: hand.forces.len(),
                taxels: robot.taxels.len(),
            });
        }
        robot.check_joints(&hand.joints)?;
        let touches = robot
            .taxels
            .iter()
            .zip(&hand.forces)
            .map(|(taxel, force)| {
                let link = robot.tree.link_index(&taxel.link);
                Ok(Touch {
                    link: link
                        .ok_or_else(|| RefineError::TaxelLink { link: taxel.link.clone() })?,
                    position: taxel.position,
                    touched: force.norm() > settings.touch_force,
                })
            })
            .collect::<Result<_, RefineError>>()?;
        Ok(Self { object, robot, touches, settings })
    }

    /// Calls `f` with each taxel that matters. A hand that cannot be posed says nothing.
    fn residuals(&self, state: &State, mut f: impl FnMut(&ArticulatedRobot, Residual)) {
        let Ok(hand) = self.robot.articulated(&state.t_cam_hand, &state.joints) else { return };
        let t_object_cam = state.t_cam_object.inverse();
        let touched = self.touches.iter().filter(|t| t.touched).count().max(1) as f64;
        let touch_weight = share(self.settings.effective_taxels, touched, self.settings.sigma);
        let quiet_weight = self.settings.quiet_sigma.powi(-2);
        let reach = self.object.radius;
        for touch in &self.touches {
            let point = hand.posed().t_world_links()[touch.link] * touch.position;
            let local = t_object_cam * point;
            // Far outside everything a quiet taxel says nothing, and no exact distance is needed.
            if !touch.touched && (local - self.object.centre).norm() > reach {
                continue;
            }
            let (distance, closest) = self.object.surface.signed_distance(&local);
            if !touch.touched && distance >= 0.0 {
                continue;
            }
            let along = (local - closest.point) * distance.signum();
            let gradient =
                along.try_normalize(1e-12).map_or_else(Vector3::zeros, |n| state.t_cam_object * n);
            let (value, weight) = match touch.touched {
                true => (distance - self.settings.standoff, touch_weight),
                false => (distance, quiet_weight),
            };
            f(&hand, Residual { value, gradient, link: touch.link, point, weight });
        }
    }
}

/// What a taxel's distance from the surface is too much.
struct Residual {
    /// Signed, positive outside \[m\].
    value: f64,
    /// Its derivative by the taxel's place: the outward direction (camera frame).
    gradient: Vector3<f64>,
    link: usize,
    /// The taxel (camera frame).
    point: Point3<f64>,
    /// Nats per square metre.
    weight: f64,
}

impl Term for TactileTerm {
    fn name(&self) -> &'static str {
        "tactile"
    }

    fn value(&self, state: &State) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let mut value = 0.0;
        self.residuals(state, |_, r| value += r.weight * cauchy.loss(r.value * r.value));
        value
    }

    fn linearise(&self, state: &State, normal: &mut Normal) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let centre = state.centre();
        let mut value = 0.0;
        let mut joints = vec![0.0; state.joints.len()];
        self.residuals(state, |hand, r| {
            let squared = r.value * r.value;
            value += r.weight * cauchy.loss(squared);
            let n = r.gradient;
            let turn = (r.point.coords - centre).cross(&n);
            // Only where the taxels are relative to the object matters: moving the object by a twist is
            // moving the hand by its opposite.
            let of_hand = Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
            let of_object = -of_hand;
            joints.fill(0.0);
            for (joint, velocity) in hand.velocities(r.link, &r.point) {
                joints[joint] += n.dot(&velocity);
            }
            let row = [
                (Block::ObjectPose, of_object.as_slice()),
                (Block::HandPose, of_hand.as_slice()),
                (Block::Joints(joints.len()), joints.as_slice()),
            ];
            normal.add_row(&row, r.value, r.weight * cauchy.weight(squared));
        });
        value
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture};
    use super::*;

    fn term(observation: &Observation) -> Result<TactileTerm, RefineError> {
        let (scene, _, _) = fixture(0);
        let object = Arc::clone(&scene.object);
        let robot = Arc::clone(&scene.robot);
        TactileTerm::new(observation, object, robot, TactileSettings::default())
    }

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (scene, state, _) = fixture(seed);
            let term = term(&scene.observation).unwrap();
            for block in [Block::ObjectPose, Block::HandPose, Block::Joints(16)] {
                assert_gradient(&term, &state, block, 1e-7, 1e-4);
            }
        }
    }

    #[test]
    fn forces_must_fit_the_skin() {
        let (scene, _, _) = fixture(0);
        let mut observation = scene.observation.clone();
        if let Some(hand) = &mut observation.hand {
            hand.forces.pop();
        }
        let error = term(&observation).err().unwrap().to_string();
        assert_eq!(error, "367 taxel forces were given for 368 taxels");
        observation.hand = None;
        assert!(matches!(term(&observation), Err(RefineError::Missing { .. })));
    }
}
