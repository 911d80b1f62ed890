//! The links that bodies with their joints are.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use prehend_geometry::mjcf::{Body, Joint as MjcfJoint, JointKind, Model as MjcfModel};

use super::MjcfOptions;
use crate::articulated::{Joint, Link};

/// The links of a model: one for each joint, one more where a body's frame is not that of its last joint.
#[derive(Default)]
pub(super) struct LinkChain {
    pub(super) links: Vec<Link>,
    /// The link that each body is.
    pub(super) bodies: Vec<usize>,
    /// The links that mocap bodies are.
    pub(super) mocaps: Vec<usize>,
    /// In the order of the model.
    pub(super) joints: Vec<ChainJoint>,
}

/// A joint and the link that it moves.
pub(super) struct ChainJoint {
    pub(super) name: String,
    pub(super) kind: JointKind,
    pub(super) link: usize,
}

impl LinkChain {
    pub(super) fn new(mjcf: &MjcfModel, options: &MjcfOptions) -> Self {
        let mut chain = Self::default();
        for body in &mjcf.bodies {
            chain.add(body, options);
        }
        chain
    }

    fn add(&mut self, body: &Body, MjcfOptions { t_world_mjcf, base, .. }: &MjcfOptions) {
        let mut parent = body.parent.map(|parent| self.bodies[parent]);
        // From what the next link hangs on to where it is while its joint is at its reference.
        let mut place = match parent {
            Some(_) => body.t_parent_body,
            None => t_world_mjcf * body.t_parent_body,
        };
        for (number, joint) in body.joints.iter().enumerate() {
            let anchor = Translation3::from(joint.anchor.coords);
            let (moves, t_body_joint) = match joint.kind {
                JointKind::Hinge => {
                    let back = UnitQuaternion::from_axis_angle(&joint.axis, -joint.reference);
                    (Joint::Revolute(joint.axis), anchor * back)
                }
                JointKind::Slide => {
                    let back = Translation3::from(joint.axis.into_inner() * -joint.reference);
                    (Joint::Prismatic(joint.axis), Isometry3::from(back))
                }
                JointKind::Ball => (Joint::Spherical, Isometry3::from(anchor)),
                // Its position is one in the model.
                JointKind::Free => {
                    place = *t_world_mjcf;
                    (Joint::Floating, Isometry3::identity())
                }
            };
            let shifted = matches!(joint.kind, JointKind::Hinge | JointKind::Ball)
                && joint.anchor != Point3::origin();
            let name = name_of(joint, body, number);
            // The last link is the body.
            let own = match joint.name.as_str() {
                "" => format!("{}:{number}", body.name),
                joint => format!("{}:{joint}", body.name),
            };
            let link = self.push(&own, parent, place * t_body_joint, moves);
            self.links[link].armature = joint.armature;
            self.joints.push(ChainJoint { name, kind: joint.kind, link });
            parent = Some(link);
            place = if shifted { anchor.inverse().into() } else { Isometry3::identity() };
        }
        let link =
            match parent.filter(|_| !body.joints.is_empty() && place == Isometry3::identity()) {
                Some(link) => link,
                None if parent.is_none() && !body.is_mocap => {
                    self.push(&body.name, None, place, base.clone())
                }
                None if body.is_mocap => self.push(&body.name, None, place, Joint::Placed),
                None => self.push(&body.name, parent, place, Joint::Fixed),
            };
        let own = &mut self.links[link];
        own.name.clone_from(&body.name);
        if let Some(inertial) = &body.inertial {
            (own.mass, own.com, own.inertia) = (inertial.mass, inertial.com, inertial.inertia);
        }
        self.bodies.push(link);
        self.mocaps.extend(body.is_mocap.then_some(link));
    }

    fn push(
        &mut self,
        name: &str,
        parent: Option<usize>,
        t_parent_joint: Isometry3<f64>,
        joint: Joint,
    ) -> usize {
        let link = Link { parent, t_parent_joint, ..Link::massless(name, joint) };
        self.links.push(link);
        self.links.len() - 1
    }
}

/// A joint's name, or its body's if it has none, with the joint's number among several.
fn name_of(joint: &MjcfJoint, body: &Body, number: usize) -> String {
    match (joint.name.as_str(), body.joints.len()) {
        ("", 1) => body.name.clone(),
        ("", _) => format!("{}:{number}", body.name),
        (name, _) => name.to_owned(),
    }
}

/// The link whose velocity is the state of an actuator: it moves nothing.
pub(super) fn activation(actuator: &str) -> Link {
    let joint = Joint::Revolute(nalgebra::Vector3::z_axis());
    Link::massless(format!("activation of {actuator}"), joint).with_armature(1.0)
}
