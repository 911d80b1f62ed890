//! States of links.

use nalgebra::{Point3, Quaternion, Vector3, Vector6};
use prehend_autodiff::{CustomVjp, Scalar};

use super::inputs::{LinkAdjoint, VariedInputs, add_varying};
use crate::articulated::kinematics::Kinematics;
use crate::articulated::link::Articulation;
use crate::body_state::{BodyState, STATE, coordinates_of, states_of};
use crate::spatial::{angular, cross_force, spatial};

/// The states of all links, at the origins of their frames, at coordinates `q` with velocities `v`: in reverse mode one node.
pub(crate) fn link_states<S: Scalar>(
    tree: &Articulation<S>,
    q: &[S],
    v: &[S],
) -> Vec<BodyState<S>> {
    if !(S::RECORDED && S::ORDER == 1) {
        return tree.motion(q, v).link_states().collect();
    }
    let [plain_q, plain_v] = [q, v].map(|all| all.iter().map(|x| x.value()).collect::<Vec<f64>>());
    let plain = tree.map(S::value);
    let result: Vec<BodyState> = plain.motion(&plain_q, &plain_v).link_states().collect();
    let VariedInputs { varying, varies, links } =
        VariedInputs::new(q.iter().chain(v).copied(), tree);
    let outputs: Vec<f64> = coordinates_of(&result).collect();
    let node = PosesNode { tree: plain, q: plain_q, v: plain_v, links, varies };
    match S::recorded(&varying, &outputs, node) {
        Some(recorded) => states_of(&recorded).collect(),
        None => result.iter().map(BodyState::cast).collect(),
    }
}

impl<S: Scalar> Kinematics<'_, S> {
    /// The states of all links, at the origins of their frames.
    pub(crate) fn link_states(&self) -> impl Iterator<Item = BodyState<S>> {
        (0..self.tree.links().len()).map(|link| {
            let [linear, angular] = self.velocity(link, &Point3::origin());
            BodyState { pose: self.pose(link), linear, angular }
        })
    }
}

struct PosesNode {
    tree: Articulation,
    q: Vec<f64>,
    v: Vec<f64>,
    links: bool,
    varies: Vec<bool>,
}

impl CustomVjp for PosesNode {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        let at = self.tree.motion(&self.q, &self.v);
        let count = self.tree.links().len();
        let (mut q, mut v) = (vec![0.0; self.q.len()], vec![0.0; self.v.len()]);
        let mut links = vec![LinkAdjoint::default(); count];
        // Adjoints of each link's place and of its velocity, with all that hangs on it.
        let mut placed = vec![Vector6::zeros(); count];
        let mut moving = vec![Vector6::zeros(); count];
        for (index, link) in self.tree.links().iter().enumerate().rev() {
            let adjoint = &output_adjoints[STATE * index..][..STATE];
            let part = |from: usize| Vector3::from_column_slice(&adjoint[from..from + 3]);
            let (by_place, by_velocity, by_spin) = (part(0), part(7), part(10));
            let (place, spin) = (at.places[index], angular(&at.velocities[index]));
            // A turn θ moves a quaternion by ½ (θ, 0) q.
            let turned = at.pose(index).rotation;
            let by_rotation = Quaternion::new(adjoint[6], adjoint[3], adjoint[4], adjoint[5]);
            let by_turn = (by_rotation * turned.conjugate().into_inner()).imag() * 0.5;
            let push = by_place + by_velocity.cross(&spin);
            let velocity = spatial(&by_velocity, &(by_spin + place.cross(&by_velocity)));
            moving[index] += velocity;
            placed[index] += spatial(&push, &(by_turn + place.cross(&push)))
                + cross_force(&at.velocities[index], &velocity);
            let of_parent = link.parent.map_or_else(Vector6::zeros, |p| at.velocities[p]);
            let (placed_here, moving_here) = (placed[index], moving[index]);
            let displacement = placed_here - cross_force(&of_parent, &moving_here);
            let [coordinates, dofs] = self.tree.range(index);
            let own = &self.q[coordinates.clone()];
            at.coordinate_adjoint(index, own, &displacement, &mut q[coordinates.clone()]);
            dofs.clone().for_each(|k| v[k] += at.axes[k].dot(&moving_here));
            let by_axes: Vec<Vector6<f64>> =
                dofs.clone().map(|k| moving_here * self.v[k]).collect();
            at.custom_adjoint(
                index,
                [own, &self.v[dofs.clone()]],
                &by_axes,
                None,
                [&mut q[coordinates], &mut v[dofs]],
            );
            links[index].displacement = displacement;
            if let Some(parent) = link.parent {
                placed[parent] += placed_here;
                moving[parent] += moving_here;
            }
        }
        let links = if self.links { at.link_adjoints(&links) } else { Vec::new() };
        let first = q.into_iter().chain(v);
        add_varying(&self.varies, first.chain(links), input_adjoints);
    }
}
