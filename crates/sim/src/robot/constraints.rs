//! What damps, bounds and couples the joints of a robot, and what these constraints have to move.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::error::SimulationError;
use crate::joint_law::damper::JointDamper;
use crate::joint_law::friction::JointFriction;
use crate::joint_law::limits::JointLimits;
use crate::joint_law::spring::JointSpring;
use crate::world::World;
use crate::world::joint_force::JointAxis;

/// Speed at which dry friction has 1/√2 of its bound \[rad/s or m/s\].
const FRICTION_SCALE: f64 = 0.01;
/// Share of a limit's effort per speed against it \[s/rad or s/m\]: nothing bounces off faster than its inverse.
const LIMIT_DAMPING: f64 = 100.0;

impl World {
    /// Adds damping \[N m s/rad or N s/m\] and dry friction \[N m or N\] along a sum of joints, where they are positive.
    pub(super) fn add_losses(
        &mut self,
        axes: &[(JointAxis, f64)],
        damping: f64,
        friction: f64,
    ) -> Result<(), SimulationError> {
        if damping > 0.0 {
            self.add_coupled_force(axes, Arc::new(JointDamper { damping }))?;
        }
        if friction > 0.0 {
            let law = JointFriction { friction, velocity_scale: FRICTION_SCALE };
            self.add_coupled_force(axes, Arc::new(law))?;
        }
        Ok(())
    }

    /// Adds limits of this stiffness \[N m/rad or N/m\] along a sum of joints.
    pub(super) fn add_limits(
        &mut self,
        axes: &[(JointAxis, f64)],
        (lower, upper): (f64, f64),
        stiffness: f64,
    ) -> Result<(), SimulationError> {
        let limits = JointLimits { lower, upper, stiffness, damping: LIMIT_DAMPING };
        self.add_coupled_force(axes, Arc::new(limits)).map(|_| ())
    }

    /// Holds a sum of joints where it is `rest`, with this stiffness and damping.
    pub(super) fn add_coupling(
        &mut self,
        axes: &[(JointAxis, f64)],
        rest: f64,
        [stiffness, damping]: [f64; 2],
    ) -> Result<(), SimulationError> {
        self.add_coupled_force(axes, Arc::new(JointSpring { stiffness, rest }))?;
        self.add_coupled_force(axes, Arc::new(JointDamper { damping })).map(|_| ())
    }

    /// The inertia along a sum of joints of the last articulation, whose mass matrix has this inverse.
    pub(super) fn inertia_along(&self, inverse: &DMatrix<f64>, axes: &[(JointAxis, f64)]) -> f64 {
        let mut along = DVector::zeros(inverse.nrows());
        for (JointAxis { link, index }, factor) in axes {
            if let Ok((articulation, own)) = self.link_of(*link) {
                let [_, freedoms] = self.articulations[articulation].tree.range(own);
                along[freedoms.start + index] += factor;
            }
        }
        1.0 / along.dot(&(inverse * &along))
    }

    /// The inverse of the last articulation's mass matrix, with its joints at their neutral coordinates.
    pub(super) fn inverse_mass(&self) -> DMatrix<f64> {
        let tree = &self.articulations[self.articulations.len() - 1].tree;
        tree.kinematics(&tree.neutral(), &vec![0.0; tree.freedoms()]).inverse_mass_matrix()
    }
}
