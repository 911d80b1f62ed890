//! Loops and couplings of a model.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use prehend_geometry::mjcf::{EqualityKind, Model, SolverParameters};

use super::forces::stiffness;
use super::{MjcfError, MjcfOptions, MjcfRobot};
use crate::joint_law::damper::JointDamper;
use crate::joint_law::spring::JointSpring;
use crate::world::World;
use crate::world::body::Body;
use crate::world::body_id::BodyId;
use crate::world::joint_force::JointAxis;
use crate::world::weld::{Weld, WeldStiffness};

/// Mobility that counts, as part of that of the most mobile direction.
const LEAST_MOBILITY: f64 = 1e-2;

/// Frames at anchors, of the model's world where that is what holds.
fn placed(
    anchors: &[Point3<f64>; 2],
    fixed: [bool; 2],
    t_world_model: &Isometry3<f64>,
) -> [Isometry3<f64>; 2] {
    std::array::from_fn(|end| {
        let frame = Isometry3::from(anchors[end].coords);
        if fixed[end] { t_world_model * frame } else { frame }
    })
}

impl World {
    /// Adds the equality constraints of a model that act from the beginning.
    pub(super) fn add_loops(
        &mut self,
        model: &Model,
        robot: &MjcfRobot,
        options: &MjcfOptions,
        warnings: &mut Vec<String>,
    ) -> Result<(), MjcfError> {
        let ground = std::cell::OnceCell::new();
        for equality in model.equalities.iter().filter(|equality| equality.active) {
            let ends = |world: &mut Self, bodies: &[Option<usize>; 2]| {
                bodies.map(|body| match body {
                    Some(body) => robot.bodies[body],
                    None => *ground.get_or_init(|| world.add(Body::kinematic("model's world"))),
                })
            };
            match &equality.kind {
                EqualityKind::Connect { bodies, anchors } => {
                    let fixed = bodies.map(|body| body.is_none());
                    let bodies = ends(self, bodies);
                    let frames = placed(anchors, fixed, &options.t_world_model);
                    self.add_stiff_weld(bodies, frames, &equality.solver, options.softness, 0.0)?;
                }
                EqualityKind::Weld { bodies, anchors, rotation, torque_scale } => {
                    let fixed = bodies.map(|body| body.is_none());
                    let bodies = ends(self, bodies);
                    let mut frames = placed(anchors, fixed, &options.t_world_model);
                    // Axes of the second body as the first has them.
                    frames[0].rotation *= *rotation;
                    let softness = options.softness;
                    self.add_stiff_weld(bodies, frames, &equality.solver, softness, *torque_scale)?;
                }
                EqualityKind::Joint { joints: (first, second), polynomial } => {
                    let [constant, slope, rest @ ..] = *polynomial;
                    if rest != [0.0; 3] {
                        let name = &equality.name;
                        warnings.push(format!(
                            "equality '{name}': a polynomial of joints beyond the first power"
                        ));
                        continue;
                    }
                    let place = |joint| model.joint_indices().position(|own| own == joint);
                    let axis = |joint| Some(JointAxis::from(robot.moved[place(joint)?].1));
                    let mut axes: Vec<(JointAxis, f64)> = Vec::new();
                    axes.extend(axis(*first).map(|axis| (axis, 1.0)));
                    let mut target = model.joint(*first).reference + constant;
                    if let Some(second) = second {
                        axes.extend(axis(*second).map(|axis| (axis, -slope)));
                        target -= slope * model.joint(*second).reference;
                    }
                    let inertia = self.inertia_along(&self.inverse_mass(), &axes);
                    let [stiffness, damping] =
                        stiffness(&equality.solver, inertia, options.softness);
                    let spring = JointSpring { stiffness, rest: target };
                    self.add_coupled_force(&axes, Arc::new(spring))?;
                    self.add_coupled_force(&axes, Arc::new(JointDamper { damping }))?;
                }
            }
        }
        Ok(())
    }

    fn add_stiff_weld(
        &mut self,
        bodies: [BodyId; 2],
        frames: [Isometry3<f64>; 2],
        solver: &SolverParameters,
        softness: f64,
        torque_scale: f64,
    ) -> Result<(), MjcfError> {
        let mass = self.mass_between(bodies, frames.map(|frame| frame.translation.vector.into()));
        let [linear, linear_damping] = stiffness(solver, mass, softness);
        // Angles count as lengths of this size.
        let square = torque_scale * torque_scale;
        let stiffness = WeldStiffness {
            linear,
            linear_damping,
            angular: linear * square,
            angular_damping: linear_damping * square,
        };
        Ok(self.add_weld(Weld { bodies, frames, stiffness })?)
    }

    /// What a force between points of two bodies of the last articulation has to accelerate at most \[kg\].
    fn mass_between(&self, bodies: [BodyId; 2], points: [Point3<f64>; 2]) -> f64 {
        let tree = &self.articulations[self.articulations.len() - 1].tree;
        let rest = vec![0.0; tree.freedoms()];
        let at = tree.kinematics(&tree.neutral(), &rest);
        let mut relative = nalgebra::Matrix3xX::zeros(tree.freedoms());
        for ((body, point), sign) in bodies.into_iter().zip(points).zip([1.0, -1.0]) {
            if let Ok((_, link)) = self.link_of(body) {
                relative += at.jacobian(link, &point).rows(0, 3) * sign;
            }
        }
        let mobility = &relative * self.inverse_mass() * relative.transpose();
        // By the least mobile direction: others are damped the more. One in which next to nothing moves does not count.
        if mobility.iter().any(|x| !x.is_finite()) {
            return f64::NAN;
        }
        let eigenvalues = mobility.symmetric_eigenvalues();
        let least = LEAST_MOBILITY * eigenvalues.max();
        1.0 / eigenvalues.iter().copied().filter(|x| *x > least).fold(f64::INFINITY, f64::min)
    }
}
