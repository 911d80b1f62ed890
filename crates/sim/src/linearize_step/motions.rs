//! Changes of a body's state with the coordinates that move it.

use nalgebra::{SVector, Vector6};

use crate::articulated::Kinematics;
use crate::spatial::{angular, cross_motion, linear, spatial};

/// Changes of a body's state, in the order of [`BodyState::tangent`](crate::BodyState::tangent), by one coordinate.
pub(super) struct BodyMotion {
    /// Index of the coordinate.
    pub(super) dof: usize,
    /// By its displacement.
    pub(super) displaced: SVector<f64, 12>,
    /// By its velocity: velocity and angular velocity, and by the displacement place and turn.
    pub(super) unit: Vector6<f64>,
}

/// Motions of a free body whose first coordinate is `first`.
pub(super) fn of_free_body(first: usize) -> Vec<BodyMotion> {
    let motion = |k: usize| BodyMotion {
        dof: first + k,
        displaced: SVector::ith(k, 1.0),
        unit: Vector6::ith(k, 1.0),
    };
    (0..6).map(motion).collect()
}

/// Motions of a link of a tree whose first coordinate is `first`.
pub(super) fn of_link(at: &Kinematics<'_>, link: usize, first: usize) -> Vec<BodyMotion> {
    let place = at.places[link];
    let spin = angular(&at.velocities[link]);
    let mut motions = Vec::with_capacity(at.axes.len());
    for dof in at.tree.dofs_of(link) {
        let axis = &at.axes[dof];
        let carrier = at.tree.links()[at.tree.link_of(dof)].parent;
        let relative = match carrier {
            Some(parent) => at.velocities[link] - at.velocities[parent],
            None => at.velocities[link],
        };
        let change = cross_motion(axis, &relative);
        let (moved, turned) = (linear(axis) + angular(axis).cross(&place), angular(axis));
        let velocity = linear(&change) + angular(&change).cross(&place) + spin.cross(&moved);
        let mut displaced = SVector::<f64, 12>::zeros();
        displaced.fixed_rows_mut::<6>(0).copy_from(&spatial(&moved, &turned));
        displaced.fixed_rows_mut::<6>(6).copy_from(&spatial(&velocity, &angular(&change)));
        motions.push(BodyMotion { dof: first + dof, displaced, unit: spatial(&moved, &turned) });
    }
    motions
}
