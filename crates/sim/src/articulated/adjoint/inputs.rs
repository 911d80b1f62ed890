//! Inputs of a node, and their adjoints in a row.

use nalgebra::{Matrix3, Quaternion, Vector3, Vector6};
use prehend_autodiff::Scalar;

use crate::articulated::joint::{CustomJoint, Joint, quaternion};
use crate::articulated::joint_model::{MAX_NV, inputs};
use crate::articulated::kinematics::Kinematics;
use crate::articulated::link::{Articulation, Link, NUMBERS};
use crate::spatial::{angular, linear, spatial};

/// Adjoints of what a link is made of.
#[derive(Clone, Copy, Default)]
pub(super) struct LinkAdjoint {
    /// Along a displacement of the joint's frame and all that hangs on it: a force about the origin.
    pub(super) displacement: Vector6<f64>,
    pub(super) mass: f64,
    pub(super) com: Vector3<f64>,
    pub(super) inertia: Matrix3<f64>,
    pub(super) armature: f64,
}

/// Inputs of a node that vary: constants are not recorded.
pub(super) struct VariedInputs<S> {
    /// The numbers that vary.
    pub(super) varying: Vec<S>,
    /// True for each number that varies, among all in their order.
    pub(super) varies: Vec<bool>,
    /// True if numbers of links are among them.
    pub(super) links: bool,
}

impl<S: Scalar> VariedInputs<S> {
    /// Inputs `first` and, if any number of a link varies, those of all links.
    pub(super) fn new(first: impl Iterator<Item = S>, tree: &Articulation<S>) -> Self {
        let links = tree.links().iter().any(|link| link.numbers().any(|x| !x.is_constant()));
        let mut inputs = Self { varying: Vec::new(), varies: Vec::new(), links };
        first.for_each(|x| inputs.push(x));
        if links {
            tree.links().iter().flat_map(Link::numbers).for_each(|x| inputs.push(x));
        }
        inputs
    }

    fn push(&mut self, x: S) {
        let varies = !x.is_constant();
        self.varies.push(varies);
        if varies {
            self.varying.push(x);
        }
    }
}

/// Adds those of `adjoints`, in the order of the inputs, that vary.
pub(super) fn add_varying(varies: &[bool], adjoints: impl Iterator<Item = f64>, into: &mut [f64]) {
    let varying = varies.iter().zip(adjoints).filter(|(varies, _)| **varies);
    into.iter_mut().zip(varying).for_each(|(sum, (_, x))| *sum += x);
}

impl Kinematics<'_> {
    /// The adjoints of all numbers of the links, in their order.
    pub(super) fn link_adjoints(&self, adjoints: &[LinkAdjoint]) -> Vec<f64> {
        let mut all = Vec::with_capacity(NUMBERS * adjoints.len());
        for (link, adjoint) in self.tree.links().iter().zip(adjoints) {
            let (rotation, place) = match link.parent {
                Some(parent) => (self.rotations[parent], self.places[parent]),
                None => (Matrix3::identity(), -self.origin),
            };
            let joint = place + rotation * link.t_parent_joint.translation.vector;
            // The frame of a placed joint holds nothing.
            let displacement =
                adjoint.displacement * f64::from(!matches!(link.joint, Joint::Placed));
            let (push, moment) = (linear(&displacement), angular(&displacement));
            let turn = rotation.tr_mul(&(moment - joint.cross(&push)));
            all.extend((rotation.tr_mul(&push)).iter());
            let turned = Quaternion::from_imag(turn) * link.t_parent_joint.rotation.into_inner();
            all.extend(turned.coords.iter().map(|x| 2.0 * x));
            all.push(adjoint.mass);
            all.extend(adjoint.com.iter());
            let i = &adjoint.inertia;
            all.extend([i.m11, i.m22, i.m33]);
            all.extend([i.m12 + i.m21, i.m13 + i.m31, i.m23 + i.m32]);
            all.push(adjoint.armature);
        }
        all
    }

    /// Adds to the adjoints of the coordinates `q` of a link's joint those of displacements of the link along the joint's axes:
    /// `displacement` is a force about the origin.
    pub(super) fn coordinate_adjoint(
        &self,
        link: usize,
        q: &[f64],
        displacement: &Vector6<f64>,
        adjoints: &mut [f64],
    ) {
        let [_, dofs] = self.tree.range(link);
        let along: Vec<f64> = match self.tree.links()[link].joint {
            Joint::Placed => self.local(link, displacement).as_slice().to_vec(),
            _ => dofs.map(|k| self.axes[k].dot(displacement)).collect(),
        };
        let by_turn = |q: &[f64], turn: &[f64], adjoints: &mut [f64]| {
            let rotation = Quaternion::new(q[3], q[0], q[1], q[2]);
            let square = rotation.norm_squared();
            let turned = rotation * Quaternion::from_imag(Vector3::from_column_slice(turn));
            adjoints.iter_mut().zip(turned.coords.iter()).for_each(|(a, x)| *a += 2.0 * x / square);
        };
        match &self.tree.links()[link].joint {
            Joint::Spherical => by_turn(q, &along, adjoints),
            Joint::Floating | Joint::Placed => {
                let place = quaternion(&q[3..]) * Vector3::from_column_slice(&along[..3]);
                adjoints.iter_mut().zip(&place).for_each(|(a, x)| *a += x);
                by_turn(&q[3..], &along[3..], &mut adjoints[3..]);
            }
            Joint::Fixed | Joint::Revolute(_) | Joint::Prismatic(_) | Joint::Custom(_) => {
                adjoints.iter_mut().zip(along).for_each(|(a, x)| *a += x);
            }
        }
    }

    /// Adds to the adjoints of coordinates and velocities of a joint of one's own those of changes of its axes and of its drift, in
    /// the link's frame: forces about the origin.
    pub(super) fn custom_adjoint(
        &self,
        link: usize,
        [q, v]: [&[f64]; 2],
        by_axes: &[Vector6<f64>],
        by_drift: Option<&Vector6<f64>>,
        [q_adjoint, v_adjoint]: [&mut [f64]; 2],
    ) {
        let Joint::Custom(CustomJoint(model)) = &self.tree.links()[link].joint else { return };
        let (_, jacobian) = model.linearized(inputs(q, v));
        let mut add = |first: usize, force: Vector6<f64>| {
            for (row, force) in jacobian[first..].iter().zip(&force) {
                q_adjoint.iter_mut().zip(row).for_each(|(a, slope)| *a += slope * force);
                v_adjoint.iter_mut().zip(&row[MAX_NV..]).for_each(|(a, slope)| *a += slope * force);
            }
        };
        by_axes.iter().enumerate().for_each(|(k, force)| add(12 + 6 * k, self.local(link, force)));
        if let Some(force) = by_drift {
            add(12 + 6 * MAX_NV, self.local(link, force));
        }
    }

    /// A force about the origin as one in a link's frame.
    fn local(&self, link: usize, force: &Vector6<f64>) -> Vector6<f64> {
        let (push, moment) = (linear(force), angular(force));
        let moment = moment - self.places[link].cross(&push);
        let rotation = &self.rotations[link];
        spatial(&rotation.tr_mul(&push), &rotation.tr_mul(&moment))
    }
}
