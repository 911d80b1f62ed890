//! Damping, limits and couplings of the joints of a robot, and the inertia that they act on.

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::articulated::tree_factor::TreeFactor;
use crate::error::BuildError;
use crate::joint_law::dynamic::DynJointLaw;
use crate::joint_law::friction::JointFriction;
use crate::joint_law::linear::{JointDamper, JointSpring};
use crate::joint_law::range::JointLimits;
use crate::model::Model;
use crate::model::joint_force::JointAxis;

/// Speed at which dry friction has 1/√2 of its bound \[rad/s or m/s\].
const FRICTION_SCALE: f64 = 0.01;
/// Share of a limit's effort per speed against it \[s/rad or s/m\]: nothing bounces off faster than its inverse.
const LIMIT_DAMPING: f64 = 100.0;

impl Model {
    /// Adds damping \[N m s/rad or N s/m\] and dry friction \[N m or N\] along a sum of joints, where they are positive.
    pub(super) fn add_losses(
        &mut self,
        axes: &[(JointAxis, f64)],
        damping: f64,
        friction: f64,
    ) -> Result<(), BuildError> {
        losses(damping, friction).try_for_each(|law| self.add_coupled_force(axes, law).map(|_| ()))
    }

    /// Adds limits of this stiffness \[N m/rad or N/m\] along a sum of joints.
    pub(super) fn add_limits(
        &mut self,
        axes: &[(JointAxis, f64)],
        range: (f64, f64),
        stiffness: f64,
    ) -> Result<(), BuildError> {
        self.add_coupled_force(axes, limits(range, stiffness)).map(|_| ())
    }

    /// Holds a sum of joints where it is `rest`, with this stiffness and damping.
    pub(super) fn add_coupling(
        &mut self,
        axes: &[(JointAxis, f64)],
        rest: f64,
        [stiffness, damping]: [f64; 2],
    ) -> Result<(), BuildError> {
        self.add_coupled_force(axes, Arc::new(JointSpring { stiffness, rest }))?;
        self.add_coupled_force(axes, Arc::new(JointDamper { damping })).map(|_| ())
    }

    /// The inertia along a sum of joints of the last articulation, whose mobility this is.
    pub(super) fn inertia_along(&self, mobility: &Mobility, axes: &[(JointAxis, f64)]) -> f64 {
        let along = self.slopes_along(axes, mobility.dofs);
        1.0 / along.dot(&mobility.times(&along))
    }

    /// Slopes of a sum of joints by the degrees of freedom of their articulation, one column.
    pub(super) fn slopes_along(&self, axes: &[(JointAxis, f64)], dofs: usize) -> DMatrix<f64> {
        let mut along = DMatrix::zeros(dofs, 1);
        for (JointAxis { link, index }, factor) in axes {
            if let Ok((articulation, own)) = self.link_of(*link) {
                let [_, dofs] = self.articulations[articulation].tree.range(own);
                along[dofs.start + index] += factor;
            }
        }
        along
    }

    /// The mobility of the last articulation, with its joints at coordinates `q`.
    pub(super) fn mobility(&self, q: &[f64]) -> Mobility {
        let tree = &self.articulations[self.articulations.len() - 1].tree;
        let mass = tree.kinematics(q, &vec![0.0; tree.nv()]).mass_matrix();
        let factor = TreeFactor::new(&mass, tree.carriers().to_vec());
        Mobility { dofs: tree.nv(), factor }
    }
}

/// Damping \[N m s/rad or N s/m\] and dry friction \[N m or N\], where they are positive.
pub(super) fn losses(damping: f64, friction: f64) -> impl Iterator<Item = Arc<dyn DynJointLaw>> {
    let damper =
        (damping > 0.0).then(|| -> Arc<dyn DynJointLaw> { Arc::new(JointDamper { damping }) });
    let friction = (friction > 0.0).then(|| -> Arc<dyn DynJointLaw> {
        Arc::new(JointFriction { friction, velocity_scale: FRICTION_SCALE })
    });
    damper.into_iter().chain(friction)
}

/// Limits of this stiffness \[N m/rad or N/m\].
pub(super) fn limits((lower, upper): (f64, f64), stiffness: f64) -> Arc<dyn DynJointLaw> {
    Arc::new(JointLimits { lower, upper, stiffness, damping: LIMIT_DAMPING })
}

/// The inverse of a mass matrix.
pub(super) struct Mobility {
    pub(super) dofs: usize,
    /// Factor of the mass matrix; `None` where something that moves has no mass.
    factor: Option<TreeFactor<'static>>,
}

impl Mobility {
    /// M⁻¹ B; NaN where something that moves has no mass.
    pub(super) fn times(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let Some(factor) = &self.factor else { return b.map(|_| f64::NAN) };
        let mut transposed = b.transpose();
        factor.solve_transposed(&mut transposed);
        transposed.transpose()
    }
}
