//! Robots in MJCF.

mod forces;
mod links;
mod loops;
mod shapes;

use nalgebra::{Isometry3, Quaternion, Unit};
use prehend_geometry::mjcf::{JointKind, Model};
use thiserror::Error;

use crate::articulated::Joint;
use crate::error::SimulationError;
use crate::shape::error::ShapeError;
use crate::shape::options::ShapeOptions;
use crate::state::State;
use crate::world::World;
use crate::world::body_id::BodyId;
use crate::world::joint_force::{JointAxis, JointForceId};

/// How a robot in MJCF becomes part of a world.
#[derive(Clone, Debug, PartialEq)]
pub struct MjcfOptions {
    /// Model's world → world.
    pub t_world_model: Isometry3<f64>,
    /// How bodies that would be fixed to the model's world hang on it instead: on a slide that lifts a gripper, for instance.
    pub base: Joint,
    /// Whether bodies get the shapes that collide, as samples and fields; contacts are up to the caller. Meshes are their convex hulls, as in MuJoCo.
    pub shapes: bool,
    /// Lengths of those shapes.
    pub shape_options: ShapeOptions,
    /// Time constants of loops and couplings as a part of those in the file. MuJoCo pushes within its constraints against what would violate them;
    /// springs alone have to be stiffer to give way no more. Limits have those of the file.
    pub softness: f64,
}

impl Default for MjcfOptions {
    /// At the world's origin, with shapes, time constants of loops a fifth of the file's.
    fn default() -> Self {
        let (t_world_model, shape_options) = (Isometry3::identity(), ShapeOptions::default());
        Self { t_world_model, base: Joint::Fixed, shapes: true, shape_options, softness: 0.2 }
    }
}

/// A robot in a world.
#[derive(Clone, Debug)]
pub struct MjcfRobot {
    /// The body of each body of the model, in its order. Its frame is the body's.
    pub bodies: Vec<BodyId>,
    /// Each joint with a name.
    pub joints: Vec<(String, JointAxis)>,
    /// Each actuator with its name, to set its `"control"`.
    pub actuators: Vec<(String, JointForceId)>,
    /// What of the model has no counterpart, in words.
    pub warnings: Vec<String>,
    names: Vec<String>,
    /// Of each joint, in the order of positions in MuJoCo, the link that it moves.
    moved: Vec<(JointKind, BodyId)>,
}

impl MjcfRobot {
    /// The body of that name.
    pub fn body(&self, name: &str) -> Option<BodyId> {
        Some(self.bodies[self.names.iter().position(|own| own == name)?])
    }

    /// The joint of that name.
    pub fn joint(&self, name: &str) -> Option<JointAxis> {
        Some(self.joints.iter().find(|(own, _)| own == name)?.1)
    }

    /// The actuator of that name.
    pub fn actuator(&self, name: &str) -> Option<JointForceId> {
        Some(self.actuators.iter().find(|(own, _)| own == name)?.1)
    }

    /// Sets all joints to positions in MuJoCo's order, its `qpos`, at rest: a keyframe's, for instance.
    ///
    /// # Errors
    /// If they are too few or too many, or the states are not those of the world.
    pub fn set_positions(
        &self,
        world: &World,
        states: &mut [State],
        positions: &[f64],
    ) -> Result<(), MjcfError> {
        let expected = self.moved.iter().map(|(kind, _)| kind.positions()).sum();
        if positions.len() != expected {
            return Err(MjcfError::Positions { given: positions.len(), expected });
        }
        let mut rest = positions;
        for (kind, link) in &self.moved {
            let (own, after) = rest.split_at(kind.positions());
            rest = after;
            let turned = |q: &[f64]| {
                let turn = Unit::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
                [turn.i, turn.j, turn.k, turn.w]
            };
            let position = match kind {
                JointKind::Hinge | JointKind::Slide => own.to_vec(),
                JointKind::Ball => turned(own).to_vec(),
                JointKind::Free => own[..3].iter().copied().chain(turned(&own[3..])).collect(),
            };
            world.write_joint(states, *link, &position, &vec![0.0; kind.velocities()])?;
        }
        world.place_links(states);
        Ok(())
    }
}

/// Why a robot in MJCF cannot become part of a world.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MjcfError {
    /// A shape cannot be.
    #[error("body '{body}': {error}")]
    Shape {
        /// The body's name.
        body: String,
        /// What is wrong.
        error: ShapeError,
    },
    /// Its bodies are no articulation, or a force or state does not fit.
    #[error(transparent)]
    World(#[from] SimulationError),
    /// Positions that are too few or too many.
    #[error("{given} positions for a model of {expected}")]
    Positions {
        /// How many were given.
        given: usize,
        /// How many it has.
        expected: usize,
    },
}

impl World {
    /// Adds the bodies of a model as links of one articulation, with its joints, springs, dampers, limits, tendons, actuators and loops. Geoms
    /// of the model's world become fixed bodies. Everything starts at neutral coordinates: [`MjcfRobot::set_positions`] with
    /// [`Model::reference_positions`] puts it where the file has it.
    ///
    /// Contacts are the caller's to add, with [`World::add_contacts_between`].
    ///
    /// # Errors
    /// If a body weighs nothing and yet should move by itself, or a shape cannot be. The world is then as it was.
    pub fn add_mjcf(
        &mut self,
        model: &Model,
        options: &MjcfOptions,
    ) -> Result<MjcfRobot, MjcfError> {
        let mut grown = self.clone();
        let robot = grown.insert_mjcf(model, options)?;
        *self = grown;
        Ok(robot)
    }

    /// [`World::add_mjcf`], which on an error leaves a part behind.
    fn insert_mjcf(
        &mut self,
        model: &Model,
        options: &MjcfOptions,
    ) -> Result<MjcfRobot, MjcfError> {
        let mut warnings: Vec<String> = model.warnings.iter().map(ToString::to_string).collect();
        warnings.extend(left_out(model));
        let chain = links::Chain::new(model, options);
        let links = self.add_articulation(chain.links)?;
        let robot = MjcfRobot {
            bodies: chain.bodies.iter().map(|link| links[*link]).collect(),
            joints: named(&chain.joints, |link| links[link]),
            actuators: Vec::new(),
            warnings: Vec::new(),
            names: model.bodies.iter().map(|body| body.name.clone()).collect(),
            moved: chain.joints.iter().map(|joint| (joint.kind, links[joint.link])).collect(),
        };
        if options.shapes {
            self.add_shapes(model, &robot, options)?;
        }
        let axes: Vec<JointAxis> =
            chain.joints.iter().map(|joint| links[joint.link].into()).collect();
        let inverse = self.inverse_mass();
        let mut forces = forces::Forces::new(self, model, axes, &inverse, &mut warnings);
        forces.add_all()?;
        let actuators = forces.actuators;
        self.add_loops(model, &robot, options, &inverse, &mut warnings)?;
        Ok(MjcfRobot { actuators, warnings, ..robot })
    }
}

/// What of the model has no counterpart.
fn left_out(model: &Model) -> impl Iterator<Item = String> {
    let bodies = model.bodies.iter().filter(|body| body.gravity_compensation != 0.0);
    let bodies =
        bodies.map(|body| format!("body '{}': its weight is not carried for it", body.name));
    let joints = model.joint_indices().map(|index| model.joint(index));
    let joints = joints.flat_map(|joint| {
        let free = joint.kind == JointKind::Free;
        let acts = joint.damping > 0.0 || joint.stiffness > 0.0 || joint.friction_loss > 0.0;
        let left = [
            (joint.actuator_force_range.is_some(), "its bound on actuators' forces"),
            (joint.limit_margin != 0.0, "the margin of its limits"),
            (free && acts, "what acts along a free joint"),
        ];
        let name = joint.name.clone();
        left.into_iter()
            .filter(|(is, _)| *is)
            .map(move |(_, what)| format!("joint '{name}': {what}"))
    });
    let tendons = model.tendons.iter().filter(|tendon| tendon.actuator_force_range.is_some());
    let tendons =
        tendons.map(|tendon| format!("tendon '{}': its bound on actuators' forces", tendon.name));
    bodies.chain(joints).chain(tendons)
}

fn named(joints: &[links::ChainJoint], body: impl Fn(usize) -> BodyId) -> Vec<(String, JointAxis)> {
    let named = joints.iter().filter(|joint| !joint.name.is_empty());
    named.map(|joint| (joint.name.clone(), body(joint.link).into())).collect()
}
