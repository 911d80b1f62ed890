//! Fastest rate of stiffness and damping of contacts and forces along joints.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Matrix6xX, Point3};

use super::Model;
use super::joint_force::{ForceAxes, JointForce};
use crate::body_state::{BodyState, Rows};
use crate::handle::BodyId;
use crate::state::State;

impl Model {
    /// The largest of natural frequency ω_max and damping rate \[1/s\] of contacts and forces along joints at a state: of M⁻¹K and
    /// M⁻¹D, with the symmetric parts of their stiffness K and damping D; NaN for a state that is.
    ///
    /// # Panics
    /// If it is no state of this model.
    pub fn contact_frequency(&self, state: &State) -> f64 {
        self.contact_frequency_of(state.rows())
    }

    pub(crate) fn contact_frequency_of(&self, states: &Rows) -> f64 {
        let near = self.with_touching(states, 0.0).to_f64();
        let UnitMotions { motions, roots, size } = self.unit_motions(states);
        let (mut stiffness, mut damping) = (DMatrix::zeros(size, size), DMatrix::zeros(size, size));
        for pair in near.pair_jacobians(states, 0) {
            for (of, moving) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let ends = [of, moving].map(|end| motions[pair.bodies[end].index()].as_ref());
                let [Some(own), Some(moved)] = ends else { continue };
                for (matrix, from) in [(&mut stiffness, 0), (&mut damping, 6)] {
                    let slopes = pair.by[of][moving].fixed_columns::<6>(from);
                    let block = own.by.tr_mul(&(slopes * &moved.by));
                    let mut view = matrix.view_mut((own.first, moved.first), block.shape());
                    view -= block;
                }
            }
        }
        for (first, direction, slopes) in self.slopes_along_joints(states, &roots) {
            let outer = &direction * direction.transpose();
            for (matrix, slope) in [&mut stiffness, &mut damping].into_iter().zip(slopes) {
                let mut view = matrix.view_mut((first, first), outer.shape());
                view -= &outer * slope;
            }
        }
        let largest = |m: DMatrix<f64>| {
            if m.iter().any(|x| x.is_nan()) {
                return f64::NAN;
            }
            let symmetric = (&m + m.transpose()) * 0.5;
            symmetric.symmetric_eigenvalues().iter().fold(0.0, |a: f64, b| a.max(*b))
        };
        if size == 0 {
            return 0.0;
        }
        let (stiffness, damping) = (largest(stiffness), largest(damping));
        // Bristles are springs behind the damping of friction.
        let bristles =
            self.bristle_contacts().map(|(_, bristles)| bristles.fastest()).fold(0.0, f64::max);
        let fastest = if damping > 0.0 { damping.max(bristles) } else { damping };
        let frequency = (stiffness + damping * bristles).sqrt();
        if frequency.is_nan() { frequency } else { fastest.max(frequency) }
    }

    /// The motions of all bodies that forces move.
    fn unit_motions(&self, states: &Rows) -> UnitMotions {
        let (mut motions, mut roots, mut first) = (Vec::new(), Vec::new(), 0);
        motions.resize_with(self.bodies.len(), || None);
        for body in self.free_bodies() {
            let root = self.inverse_mass_root(body, &states[body]);
            let by = Matrix6xX::from_columns(&root.column_iter().collect::<Vec<_>>());
            motions[body.index()] = Some(Motions { first, by });
            first += 6;
        }
        for (own, joints) in self.articulated(states) {
            let [q, v] = own.coordinates(joints);
            let at = own.tree.kinematics(&q, &v);
            let root = at.inverse_mass_root();
            for (link, body) in own.bodies().iter().enumerate() {
                let by = at.jacobian(link, &Point3::origin()) * &root;
                motions[body.index()] = Some(Motions { first, by });
            }
            roots.push((first, root));
            first += v.len();
        }
        UnitMotions { motions, roots, size: first }
    }

    /// For each force along joints: the first of its articulation's motions of unit energy, what they are along it, and the slopes of its effort.
    fn slopes_along_joints(
        &self,
        states: &Rows,
        roots: &[(usize, DMatrix<f64>)],
    ) -> Vec<(usize, DVector<f64>, [f64; 2])> {
        let slopes = |force: &JointForce| {
            let ForceAxes { articulation, dofs, position, velocity } = self.along(force, states)?;
            let (first, root) = &roots[articulation];
            let mut along = DVector::zeros(root.nrows());
            dofs.iter().for_each(|(dof, factor)| along[*dof] += factor);
            let effort = force.law().effort_by_motion(force.params(), position, velocity);
            Some((*first, root.tr_mul(&along), effort.derivative))
        };
        self.joint_forces.iter().filter_map(slopes).collect()
    }

    /// The root of the inverse mass matrix of a free body.
    fn inverse_mass_root(&self, body: BodyId, state: &BodyState) -> Matrix6<f64> {
        let Some(rigid) = self.bodies[body].rigid() else { return Matrix6::zeros() };
        let mut root = Matrix6::identity() / rigid.mass().sqrt();
        let eigen = rigid.inverse_world_inertia(&state.pose.rotation).symmetric_eigen();
        let turn = eigen.eigenvectors
            * Matrix3::from_diagonal(&eigen.eigenvalues.map(|x| x.max(0.0).sqrt()))
            * eigen.eigenvectors.transpose();
        root.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
        root
    }
}

/// Motions of unit kinetic energy (½).
struct UnitMotions {
    /// Of each body, if forces move it.
    motions: Vec<Option<Motions>>,
    /// For each articulation, the first of them, and the joints' velocities that they are.
    roots: Vec<(usize, DMatrix<f64>)>,
    /// Number of all.
    size: usize,
}

/// Motions of a body: its velocity and angular velocity by each of them.
struct Motions {
    /// The first of them among those of all.
    first: usize,
    by: Matrix6xX<f64>,
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Vector3};

    use super::*;
    use crate::scenes::{floor, on_ground, penalty};
    use crate::{Body, GapSmoothing, RigidBody, SemiImplicitEuler, Surface, TimeSteps};

    #[test]
    fn frequency_of_a_point_mass_on_a_spring() {
        let rigid = RigidBody::new(0.5, Matrix3::identity(), Point3::origin()).unwrap();
        let surface = Surface::new(&[Point3::origin()], &[1e-4]).unwrap();
        let mass = Body::dynamic("mass", rigid).with_surface(surface);
        let law = Arc::new(penalty(2e8, 1e3, 0.0, 1e-3));
        let model = on_ground(Vector3::zeros(), floor(), mass, law, GapSmoothing::Hard);
        let at_rest = |z| BodyState::at_rest(Isometry3::translation(0.0, 0.0, z));
        let states = State::new([at_rest(0.0), at_rest(-1e-3)]);
        let omega = 200.0;
        assert!((model.contact_frequency(&states) - omega).abs() < 1e-9);
        let check = |dt| model.check_time_step(&SemiImplicitEuler, &states, dt);
        assert_eq!(check(6.1e-3), Ok(()));
        let error = check(7e-3).unwrap_err();
        assert!((error.limit - 6.18e-3).abs() < 1e-12);
        let fine = TimeSteps { dt: 7e-3, steps: 10 }.refined(error.limit, 100);
        assert_eq!((fine.steps, check(fine.dt)), (12, Ok(())));
        assert_eq!(model.contact_frequency(&State::new([at_rest(0.0), at_rest(1.0)])), 0.0);
    }
}
