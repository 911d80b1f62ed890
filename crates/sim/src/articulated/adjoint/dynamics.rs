//! Forward dynamics.

use nalgebra::{DVector, Vector3, Vector6};
use prehend_autodiff::{CustomVjp, Scalar};

use super::inputs::{LinkAdjoint, VariedInputs, add_varying};
use super::motion::{Force, mass_adjoint};
use crate::articulated::kinematics::Kinematics;
use crate::articulated::link::Articulation;
use crate::spatial::{angular, cross_force, cross_motion, linear, spatial};

/// Inputs of a tree's accelerations.
pub(crate) struct Acting<'a, S: Scalar> {
    /// Acceleration of free fall \[m/s²\].
    pub(crate) gravity: Vector3<S>,
    pub(crate) coordinates: &'a [S],
    pub(crate) velocities: &'a [S],
    /// One for each degree of freedom \[N m or N\].
    pub(crate) efforts: &'a [S],
    /// On each link: a force and the torque about the link's origin, along the world's axes.
    pub(crate) wrenches: &'a [Vector6<S>],
}

/// [`Kinematics::forward_dynamics_under`]: in reverse mode one node, which keeps what it is a function of.
pub(crate) fn accelerations<S: Scalar>(tree: &Articulation<S>, on: &Acting<'_, S>) -> DVector<S> {
    if !(S::RECORDED && S::ORDER == 1) {
        let at = tree.kinematics(on.coordinates, on.velocities).under(on.gravity);
        return at.forward_dynamics_under(on.efforts, on.wrenches);
    }
    let values = |all: &[S]| all.iter().map(|x| x.value()).collect::<Vec<f64>>();
    let [q, v, efforts] = [on.coordinates, on.velocities, on.efforts].map(values);
    let wrenches: Vec<Vector6<f64>> = on.wrenches.iter().map(|w| w.map(S::value)).collect();
    let (plain, gravity) = (tree.map(S::value), on.gravity.map(S::value));
    let result = {
        let at = plain.kinematics(&q, &v).under(gravity);
        at.forward_dynamics_under(&efforts, &wrenches)
    };
    let first = on.gravity.iter().chain(on.coordinates).chain(on.velocities).chain(on.efforts);
    let first = first.chain(on.wrenches.iter().flat_map(|wrench| wrench.iter())).copied();
    let VariedInputs { varying, varies, links } = VariedInputs::new(first, tree);
    let accelerations = result.clone();
    let node = DynamicsNode { tree: plain, gravity, q, v, wrenches, accelerations, links, varies };
    match S::recorded(&varying, result.as_slice(), node) {
        Some(recorded) => DVector::from_vec(recorded),
        None => result.map(S::constant),
    }
}

struct DynamicsNode {
    tree: Articulation,
    gravity: Vector3<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    wrenches: Vec<Vector6<f64>>,
    accelerations: DVector<f64>,
    links: bool,
    varies: Vec<bool>,
}

impl CustomVjp for DynamicsNode {
    /// With λ = M⁻¹ times the adjoint of the accelerations, adjoints are the derivatives of −λ·(τ(q, v, v̇) − Jᵀf) at fixed v̇: inverse
    /// dynamics swept once more, backward.
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        let at = self.tree.kinematics(&self.q, &self.v).under(self.gravity);
        let (_, factor) = at.articulated(&vec![0.0; self.v.len()], None);
        let multipliers = at.accelerated(&factor, output_adjoints);
        let sweep = AdjointSweep::new(self, &at, multipliers.as_slice());
        let links = if self.links { at.link_adjoints(&sweep.links) } else { Vec::new() };
        let first = sweep.gravity.iter().chain(&sweep.q).chain(&sweep.v).chain(&multipliers);
        let first = first.chain(sweep.wrenches.iter().flat_map(|wrench| wrench.iter()));
        add_varying(&self.varies, first.copied().chain(links), input_adjoints);
    }
}

/// Adjoints, which all are derivatives of −λ·(τ − Jᵀf).
struct AdjointSweep {
    gravity: Vector3<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    wrenches: Vec<Vector6<f64>>,
    links: Vec<LinkAdjoint>,
}

impl AdjointSweep {
    fn new(node: &DynamicsNode, at: &Kinematics<'_>, multipliers: &[f64]) -> Self {
        let (tree, count) = (&node.tree, node.tree.links().len());
        let effort = at.effort(node.accelerations.as_slice());
        // The motion of each link if λ were velocities.
        let mut virtual_motions: Vec<Vector6<f64>> = Vec::with_capacity(count);
        for (index, link) in tree.links().iter().enumerate() {
            let mut motion = link.parent.map_or_else(Vector6::zeros, |p| virtual_motions[p]);
            tree.range(index)[1].clone().for_each(|k| motion += at.axes[k] * multipliers[k]);
            virtual_motions.push(motion);
        }
        let mut sweep = Self {
            gravity: Vector3::zeros(),
            q: vec![0.0; node.q.len()],
            v: vec![0.0; node.v.len()],
            wrenches: Vec::with_capacity(count),
            links: vec![LinkAdjoint::default(); count],
        };
        // Adjoints of each link's velocity, acceleration and virtual motion, and of the forces' turn with it.
        let mut by = vec![Force::default(); count];
        for index in (0..count).rev() {
            let link = &tree.links()[index];
            let (inertia, moves, pushed) =
                (&at.inertias[index], &at.velocities[index], &virtual_motions[index]);
            let acceleration = &effort.accelerations[index];
            let momentum = inertia.times(moves);
            let wrench = at.about_origin(index, &node.wrenches[index]);
            let turned = cross_motion(moves, pushed);
            let [force, torque] = [linear(&node.wrenches[index]), angular(&node.wrenches[index])];
            let place = &at.places[index];
            let point = linear(pushed) + angular(pushed).cross(place);
            let own = &mut by[index];
            own.velocity -= cross_force(pushed, &momentum) + inertia.times(&turned);
            own.acceleration += inertia.times(pushed);
            own.motion += inertia.times(acceleration) + cross_force(moves, &momentum) - wrench;
            own.turn += force.cross(&point) + torque.cross(&angular(pushed));
            let joint_velocity = &at.joint_velocities[index];
            own.velocity += cross_force(joint_velocity, &own.acceleration);
            let of_joint = own.velocity - cross_force(moves, &own.acceleration);
            let own = *own;
            let [coordinates, dofs] = tree.range(index);
            let (of_parent, acceleration_of_parent, motion_of_parent) = match link.parent {
                Some(p) => (at.velocities[p], effort.accelerations[p], virtual_motions[p]),
                None => (Vector6::zeros(), at.rest(), Vector6::zeros()),
            };
            let displacement = cross_force(&of_parent, &own.velocity)
                + cross_force(&acceleration_of_parent, &own.acceleration)
                + cross_force(&motion_of_parent, &own.motion)
                - spatial(&Vector3::zeros(), &own.turn);
            // All with the sign of the adjoint.
            at.coordinate_adjoint(
                index,
                &node.q[coordinates.clone()],
                &displacement,
                &mut sweep.q[coordinates.clone()],
            );
            for k in dofs.clone() {
                sweep.v[k] -= at.axes[k].dot(&of_joint);
                sweep.links[index].armature -= multipliers[k] * node.accelerations[k];
            }
            let by_axis = |k: usize| {
                -(of_joint * node.v[k]
                    + own.acceleration * node.accelerations[k]
                    + own.motion * multipliers[k])
            };
            let by_axes: Vec<Vector6<f64>> = dofs.clone().map(by_axis).collect();
            at.custom_adjoint(
                index,
                [&node.q[coordinates.clone()], &node.v[dofs.clone()]],
                &by_axes,
                Some(&-own.acceleration),
                [&mut sweep.q[coordinates], &mut sweep.v[dofs]],
            );
            let adjoint = &mut sweep.links[index];
            adjoint.displacement = displacement;
            if node.links {
                mass_adjoint(at, index, [pushed, acceleration], -1.0, adjoint);
                mass_adjoint(at, index, [&turned, moves], 1.0, adjoint);
            }
            match link.parent {
                Some(parent) => by[parent] += own,
                None => sweep.gravity += linear(&own.acceleration),
            }
            sweep.wrenches.push(spatial(&point, &angular(pushed)));
        }
        sweep.wrenches.reverse();
        sweep
    }
}
