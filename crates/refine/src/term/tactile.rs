//! Mesh-to-tactile: taxels that feel force touch the object, quiet taxels do not reach into it.

use std::sync::Arc;

use nalgebra::{Matrix6, Point3, SMatrix, SVector, Vector3, Vector6};

use super::Term;
use crate::{Block, Cauchy, Normal, Object, Observation, RefineError, Robot, State};

/// Settings of the mesh-to-tactile term.
#[derive(Clone, Debug, PartialEq)]
pub struct TactileSettings {
    /// Force above which a taxel counts as touched, the paper's γ \[N\].
    pub touch_force: f64,
    /// Standard deviation of a touched taxel from the object's surface \[m\]: a contact spreads over
    /// the taxels around it, so a touched taxel may itself be a few millimetres away.
    pub sigma: f64,
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
            quiet_sigma: 1e-3,
            outlier: 10e-3,
            effective_taxels: 8.0,
        }
    }
}

/// A taxel in hand base coordinates.
struct Touch {
    position: Point3<f64>,
    touched: bool,
}

/// The paper's distance between the mesh and the taxels in contact, and the evidence of the others.
///
/// Touched taxels are drawn to the surface from either side; quiet ones are pushed out of it, which the
/// paper leaves unused. Both go through Cauchy's loss, because some taxels are dead and some ring false.
pub struct TactileTerm {
    object: Arc<Object>,
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
        robot: &Robot,
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
        let links = robot.tree.forward_kinematics(&hand.joints);
        let touches = robot
            .taxels
            .iter()
            .zip(&hand.forces)
            .map(|(taxel, force)| {
                let link = robot.tree.link_index(&taxel.link).and_then(|i| links.get(i));
                let link =
                    link.ok_or_else(|| RefineError::TaxelLink { link: taxel.link.clone() })?;
                Ok(Touch {
                    position: link * taxel.position,
                    touched: force.norm() > settings.touch_force,
                })
            })
            .collect::<Result<_, RefineError>>()?;
        Ok(Self { object, touches, settings })
    }

    /// Signed distance \[m\] of each taxel that matters to the surface, its outward gradient and its
    /// lever arm about the object's centre (camera frame), with the nats per square metre it weighs.
    fn residuals<'a>(&'a self, state: &'a State) -> impl Iterator<Item = Residual> + 'a {
        let t_object_cam = state.t_cam_object.inverse();
        let centre = state.centre();
        let touched = self.touches.iter().filter(|t| t.touched).count().max(1) as f64;
        let share = (self.settings.effective_taxels / touched).min(1.0);
        let touch_weight = share / self.settings.sigma.powi(2);
        let quiet_weight = self.settings.quiet_sigma.powi(-2);
        let reach = self.object.radius;
        self.touches.iter().filter_map(move |touch| {
            let point = state.t_cam_hand * touch.position;
            let local = t_object_cam * point;
            // Far outside everything a quiet taxel says nothing, and no exact distance is needed.
            if !touch.touched && (local - self.object.centre).norm() > reach {
                return None;
            }
            let (distance, closest) = self.object.surface.signed_distance(&local);
            if !touch.touched && distance >= 0.0 {
                return None;
            }
            let along = (local - closest.point) * distance.signum();
            let gradient =
                along.try_normalize(1e-12).map_or_else(Vector3::zeros, |n| state.t_cam_object * n);
            let weight = if touch.touched { touch_weight } else { quiet_weight };
            Some(Residual { distance, gradient, arm: point.coords - centre, weight })
        })
    }
}

struct Residual {
    distance: f64,
    gradient: Vector3<f64>,
    arm: Vector3<f64>,
    weight: f64,
}

impl Term for TactileTerm {
    fn name(&self) -> &'static str {
        "tactile"
    }

    fn blocks(&self) -> &'static [Block] {
        &[Block::ObjectPose, Block::HandPose]
    }

    fn value(&self, state: &State) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        self.residuals(state).map(|r| r.weight * cauchy.loss(r.distance.powi(2))).sum()
    }

    fn linearise(&self, state: &State, normal: &mut Normal) -> f64 {
        let cauchy = Cauchy { scale: self.settings.outlier };
        let mut value = 0.0;
        let mut gradient = Vector6::zeros();
        let mut hessian = Matrix6::zeros();
        for r in self.residuals(state) {
            let r2 = r.distance * r.distance;
            let weight = r.weight * cauchy.weight(r2);
            let turn = r.arm.cross(&r.gradient);
            let n = r.gradient;
            let row = Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
            value += r.weight * cauchy.loss(r2);
            gradient += row * (weight * r.distance);
            hessian += row * row.transpose() * weight;
        }
        // Only where the taxels are relative to the object matters: moving the object by a twist is
        // moving the hand by its opposite.
        let mut both_gradient = SVector::<f64, 12>::zeros();
        let mut both_hessian = SMatrix::<f64, 12, 12>::zeros();
        for (i, sign_i) in [(0, -1.0), (6, 1.0)] {
            both_gradient.fixed_rows_mut::<6>(i).copy_from(&(gradient * sign_i));
            for (j, sign_j) in [(0, -1.0), (6, 1.0)] {
                both_hessian.fixed_view_mut::<6, 6>(i, j).copy_from(&(hessian * (sign_i * sign_j)));
            }
        }
        normal.add(self.blocks(), &both_gradient, &both_hessian);
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
        TactileTerm::new(observation, object, &scene.robot, TactileSettings::default())
    }

    #[test]
    fn gradients_by_object_and_hand_match_differences() {
        for seed in 0..3 {
            let (scene, state, _) = fixture(seed);
            let term = term(&scene.observation).unwrap();
            for block in [Block::ObjectPose, Block::HandPose] {
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
