//! Robots: kinematic trees with collision shapes, read from URDF and MJCF.

mod articulated;
mod assembly;
mod collision;
mod dynamics;
mod error;
mod kinematics;
mod limits;
mod mjcf;
mod posed;
mod screw;
mod shape;
mod tree;
mod urdf;
mod urdf_reader;

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Unit, Vector3};

pub use articulated::{ArticulatedRobot, RobotSample};
use error::Result;
pub use error::RobotError;
pub use mjcf::outermost_element;
pub use posed::PosedRobot;
pub use screw::Screw;
pub use shape::{LinkShape, RobotShape};

use crate::inertial::Inertial;
use crate::mesh::TriMesh;

/// A rigid body of a robot.
#[derive(Clone, Debug)]
pub struct Link {
    /// Its name.
    pub name: String,
    /// Collision bodies in the link frame \[m\], one a collision tag; they may overlap each other.
    pub parts: Vec<TriMesh>,
    /// Mass and inertia in the link frame, where the description has them.
    pub inertial: Option<Inertial>,
}

/// How a joint lets its child link move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Not at all.
    Fixed,
    /// By turning about the axis \[rad\].
    Revolute,
    /// By sliding along the axis \[m\].
    Prismatic,
}

/// Where the position of a joint comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// It has none (a fixed joint).
    None,
    /// `multiplier * joints[index] + offset` of the joint vector; (1, 0) unless it mimics another joint.
    Variable {
        /// Index in the joint vector.
        index: usize,
        /// Factor \[1\].
        multiplier: f64,
        /// Offset \[rad or m\].
        offset: f64,
    },
}

/// A connection between two links.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// How it moves.
    pub motion: Motion,
    /// Index of the link it is mounted on.
    pub parent: usize,
    /// Index of the link it moves.
    pub child: usize,
    /// The joint frame at position zero in the parent link frame \[m\].
    pub t_parent_joint: Isometry3<f64>,
    /// The axis in the joint frame.
    pub axis: Unit<Vector3<f64>>,
    /// Smallest and largest position \[rad or m\], where the joint has limits.
    pub limits: Option<(f64, f64)>,
    /// Where its position comes from.
    pub drive: Drive,
    /// Viscous damping \[N m s/rad or N s/m\], where the description tells it.
    pub damping: Option<f64>,
    /// Dry friction \[N m or N\], where the description tells it.
    pub friction: Option<f64>,
    /// Largest speed \[rad/s or m/s\], where the joint has such a limit.
    pub velocity_limit: Option<f64>,
    /// Largest torque or force of its motor \[N m or N\], where the joint has such a limit.
    pub effort_limit: Option<f64>,
}

/// A tree of links and joints with one root, the base.
#[derive(Clone, Debug)]
pub struct KinematicTree {
    name: String,
    links: Vec<Link>,
    joints: Vec<Joint>,
    /// Joints, every parent before its children.
    order: Vec<usize>,
    root: usize,
    /// Names of the entries of the joint vector.
    variables: Vec<String>,
    /// Limits of those entries.
    ranges: Vec<limits::Range>,
    /// The first link of each body that floats beside the base.
    floating: Vec<usize>,
    warnings: Vec<String>,
}

impl KinematicTree {
    /// Name of the robot.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The links in the order of the description: link poses come in this order.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// All joints in the order of the description, fixed ones included.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Names of the joints that a joint vector holds, in its order: those that are neither fixed nor
    /// mimic another, in the order of the description.
    pub fn joint_names(&self) -> &[String] {
        &self.variables
    }

    /// Index of the base: the link that no joint moves.
    pub fn root(&self) -> usize {
        self.root
    }

    /// The first link of each body that floats beside the base ([`with_floating`](Self::with_floating)), ascending: the links from there to the next
    /// are its own.
    pub fn floating_bodies(&self) -> &[usize] {
        &self.floating
    }

    /// Parts of its description that are against the format and were put right, or that are not kept.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Index of the link of that name.
    pub fn link_index(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|l| l.name == name)
    }

    /// The joint vector of a state given by name \[rad or m\].
    ///
    /// Values of fixed and mimicking joints, which some sources list, are ignored.
    ///
    /// # Errors
    /// [`RobotError::MissingJoint`], [`RobotError::UnknownJoint`] or [`RobotError::Number`].
    pub fn joint_vector(&self, state: &BTreeMap<String, f64>) -> Result<Vec<f64>> {
        for name in state.keys() {
            if !self.joints.iter().any(|j| j.name == *name) {
                return Err(RobotError::UnknownJoint {
                    joint: name.clone(),
                    by: "the joint state".into(),
                });
            }
        }
        self.variables
            .iter()
            .map(|name| match state.get(name) {
                None => Err(RobotError::MissingJoint { joint: name.clone() }),
                Some(q) if !q.is_finite() => Err(RobotError::Number {
                    owner: format!("joint '{name}'"),
                    field: "position",
                    requirement: "must be finite",
                }),
                Some(&q) => Ok(q),
            })
            .collect()
    }
}
