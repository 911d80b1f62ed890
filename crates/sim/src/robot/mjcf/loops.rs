//! Loops and couplings of a model.

use nalgebra::{DMatrix, Isometry3, Point3};
use prehend_geometry::mjcf::{EqualityKind, Model as MjcfModel, SolverParameters};

use super::super::constraints::Mobility;
use super::forces::stiffness;
use super::{MjcfError, MjcfOptions, MjcfRobot};
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::body::Body;
use crate::model::bushing::{Bushing, BushingStiffness};

/// Mobility that counts, as part of that of the most mobile direction.
const LEAST_MOBILITY: f64 = 1e-2;

/// Frames at anchors, of the file's world where that is what holds.
fn placed(
    anchors: &[Point3<f64>; 2],
    fixed: [bool; 2],
    t_world_mjcf: &Isometry3<f64>,
) -> [Isometry3<f64>; 2] {
    std::array::from_fn(|end| {
        let frame = Isometry3::from(anchors[end].coords);
        if fixed[end] { t_world_mjcf * frame } else { frame }
    })
}

impl Model {
    /// Adds the equality constraints of a model that act from the beginning, with stiffness by its mobility at coordinates, both of which are `at`.
    pub(super) fn add_loops(
        &mut self,
        mjcf: &MjcfModel,
        robot: &MjcfRobot,
        options: &MjcfOptions,
        at: (&Mobility, &[f64]),
    ) -> Result<(), MjcfError> {
        let ground = std::cell::OnceCell::new();
        for equality in mjcf.equalities.iter().filter(|equality| equality.active) {
            let ends = |model: &mut Self, bodies: &[Option<usize>; 2]| {
                bodies.map(|body| match body {
                    Some(body) => robot.bodies[body],
                    None => *ground.get_or_init(|| model.add(Body::fixed("world"))),
                })
            };
            match &equality.kind {
                EqualityKind::Connect { bodies, anchors } => {
                    let fixed = bodies.map(|body| body.is_none());
                    let bodies = ends(self, bodies);
                    let frames = placed(anchors, fixed, &options.t_world_mjcf);
                    let held = self.held(bodies, &frames, at, &equality.solver, options.softness);
                    self.add_bushing(Bushing { bodies, frames, stiffness: bushing(held, 0.0) })?;
                }
                EqualityKind::Weld { bodies, anchors, rotation, torque_scale } => {
                    let fixed = bodies.map(|body| body.is_none());
                    let bodies = ends(self, bodies);
                    let mut frames = placed(anchors, fixed, &options.t_world_mjcf);
                    // Axes of the second body as the first has them.
                    frames[0].rotation *= *rotation;
                    let held = self.held(bodies, &frames, at, &equality.solver, options.softness);
                    let stiffness = bushing(held, *torque_scale);
                    self.add_bushing(Bushing { bodies, frames, stiffness })?;
                }
                // Among the forces.
                EqualityKind::Joint { .. } | EqualityKind::Tendon { .. } => {}
            }
        }
        Ok(())
    }

    /// Stiffness and damping of what holds frames of two bodies together.
    fn held(
        &self,
        bodies: [BodyId; 2],
        frames: &[Isometry3<f64>; 2],
        at: (&Mobility, &[f64]),
        solver: &SolverParameters,
        softness: f64,
    ) -> [f64; 2] {
        let points = frames.map(|frame| frame.translation.vector.into());
        stiffness(solver, self.mass_between(bodies, points, at), softness)
    }

    /// Largest effective mass 1/λ \[kg\] between points of two bodies of the last articulation: λ is the least eigenvalue of
    /// J M⁻¹ Jᵀ that counts, J the Jacobian of the relative velocity.
    fn mass_between(
        &self,
        bodies: [BodyId; 2],
        points: [Point3<f64>; 2],
        (mobility, q): (&Mobility, &[f64]),
    ) -> f64 {
        let tree = &self.articulations[self.articulations.len() - 1].tree;
        let rest = vec![0.0; tree.nv()];
        let at = tree.kinematics(q, &rest);
        let mut relative = DMatrix::zeros(3, tree.nv());
        for ((body, point), sign) in bodies.into_iter().zip(points).zip([1.0, -1.0]) {
            if let Ok((_, link)) = self.link_of(body) {
                relative += at.jacobian(link, &point).rows(0, 3) * sign;
            }
        }
        let mobility = &relative * mobility.times(&relative.transpose());
        // By the least mobile direction: others are damped the more. One in which next to nothing moves does not count.
        if mobility.iter().any(|x| !x.is_finite()) {
            return f64::NAN;
        }
        let eigenvalues = mobility.symmetric_eigenvalues();
        let least = LEAST_MOBILITY * eigenvalues.max();
        1.0 / eigenvalues.iter().copied().filter(|x| *x > least).fold(f64::INFINITY, f64::min)
    }
}

/// A bushing of this stiffness and damping, whose angles count as lengths by `torque_scale` \[m/rad\].
fn bushing([linear, linear_damping]: [f64; 2], torque_scale: f64) -> BushingStiffness {
    let square = torque_scale * torque_scale;
    let (angular, angular_damping) = (linear * square, linear_damping * square);
    BushingStiffness { linear, linear_damping, angular, angular_damping }
}
