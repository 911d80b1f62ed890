//! Robots in MJCF.

mod actuators;
mod contacts;
mod forces;
mod lengths;
mod links;
mod loops;
mod motion;
mod sensors;
mod shapes;

use nalgebra::Isometry3;
use prehend_geometry::mjcf::{Dynamics, JointKind, Keyframe, Model as MjcfModel, Transmission};
use thiserror::Error;

use crate::articulated::Joint;
use crate::error::{BuildError, SimulationError};
use crate::handle::BodyId;
use crate::handle::JointForceId;
use crate::model::Model;
use crate::model::joint_force::JointAxis;
use crate::shape::error::ShapeError;
use crate::shape::options::ShapeOptions;
use crate::state::State;

/// Options of reading a robot in MJCF.
#[derive(Clone, Debug, PartialEq)]
pub struct MjcfOptions {
    /// World of the file → world.
    pub t_world_mjcf: Isometry3<f64>,
    /// How bodies that would be fixed to the file's world hang on it instead: on a slide that lifts a gripper, for instance.
    pub base: Joint,
    /// True if bodies get the shapes that collide, as samples and fields; contacts are up to the caller. Meshes are their convex hulls, as in MuJoCo.
    pub shapes: bool,
    /// Lengths of those shapes.
    pub shape_options: ShapeOptions,
    /// Time constants of loops and couplings as a part of those in the file. MuJoCo pushes within its constraints against what would violate them;
    /// springs alone have to be stiffer to give way no more. Limits have those of the file.
    pub softness: f64,
    /// Permission to go on without what of the model has no counterpart and yet changes how it moves.
    pub partial: bool,
}

impl Default for MjcfOptions {
    /// At the world's origin, with shapes, time constants of loops a fifth of the file's.
    fn default() -> Self {
        let (t_world_mjcf, shape_options) = (Isometry3::identity(), ShapeOptions::default());
        let (base, partial) = (Joint::Fixed, false);
        Self { t_world_mjcf, base, shapes: true, shape_options, softness: 0.2, partial }
    }
}

/// Robot or scene of a file in a model: handles by the names of the file.
#[derive(Clone, Debug)]
pub struct MjcfRobot {
    /// Link of each body of the file, in its order. Its frame is the body's.
    pub bodies: Vec<BodyId>,
    /// Fixed body of each geom of the file's world that collides, in its order.
    pub fixed: Vec<BodyId>,
    /// Each joint with a name.
    pub joints: Vec<(String, JointAxis)>,
    /// Each actuator with its name, to set its `"control"`.
    pub actuators: Vec<(String, JointForceId)>,
    /// Parts of the model without a counterpart, in words.
    pub warnings: Vec<String>,
    /// The link of each actuator with a state, whose velocity is that state, in the order of MuJoCo's `act`.
    pub activations: Vec<BodyId>,
    /// Keyframes of the file, for [`MjcfRobot::reset_to`].
    pub keyframes: Vec<Keyframe>,
    /// State that the file starts in.
    initial: Keyframe,
    names: Vec<String>,
    mocaps: Vec<BodyId>,
    sensors: sensors::Sensors,
    /// Kind and link of each joint, in MuJoCo's order of positions.
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

    /// Puts a mocap body at `t_world_mjcf`, as MuJoCo's `mocap_pos` and `mocap_quat` do: between steps, for it has no velocity.
    ///
    /// # Errors
    /// If the model has no such mocap body, or it is no state of the model.
    pub fn set_mocap(
        &self,
        model: &Model,
        state: &mut State,
        name: &str,
        t_world_mjcf: &Isometry3<f64>,
    ) -> Result<(), MjcfError> {
        let none = || MjcfError::NoSuch { kind: "mocap body", name: name.to_owned() };
        let body = self.body(name).filter(|body| self.mocaps.contains(body)).ok_or_else(none)?;
        model.joint_place(state.rows(), body)?;
        Ok(model.set_pose(state, body, t_world_mjcf)?)
    }

    /// The actuator of that name.
    pub fn actuator(&self, name: &str) -> Option<JointForceId> {
        Some(self.actuators.iter().find(|(own, _)| own == name)?.1)
    }
}

/// Why a robot in MJCF cannot become part of a model.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MjcfError {
    /// A shape cannot be.
    #[error("body '{body}': {error}")]
    Shape {
        /// The body's name.
        body: String,
        /// Error of the shape.
        error: ShapeError,
    },
    /// Its bodies are no articulation, or a force does not fit.
    #[error(transparent)]
    Model(#[from] BuildError),
    /// A state does not fit.
    #[error(transparent)]
    State(#[from] SimulationError),
    /// Positions, velocities or activations that are too few or too many.
    #[error("{given} {what} for a model of {expected}")]
    Count {
        /// Quantity.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// How many it has.
        expected: usize,
    },
    /// A mocap body, actuator or keyframe that the file has not.
    #[error("there is no {kind} '{name}'")]
    NoSuch {
        /// Kind of the element.
        kind: &'static str,
        /// Its name.
        name: String,
    },
    /// A sensor that the model has not, or whose reading more than a state determines.
    #[error("there is no sensor '{name}' whose reading the state determines")]
    NoSensor {
        /// Its name.
        name: String,
    },
    /// Something that changes how the model moves, and that a model has no counterpart of.
    #[error("{what}: there is no counterpart (with `partial`, it is left out)")]
    NoCounterpart {
        /// Name of the element, and its part that a model cannot represent.
        what: String,
    },
}

impl Model {
    /// Adds the bodies of an MJCF file as links of one articulation, with its joints, springs, dampers, limits, tendons, actuators and loops.
    /// Geoms of the file's world become fixed bodies. Everything starts at neutral coordinates: [`MjcfRobot::reset`] puts it where the
    /// file has it.
    ///
    /// Gravity stays that of this model, and contacts are the caller's to add ([`Model::add_contacts`], [`Model::add_contacts_between`]);
    /// [`Model::from_mjcf`] takes both from the file.
    ///
    /// # Errors
    /// If a body weighs nothing and yet should move by itself, or a shape cannot be. The model is then as it was.
    pub fn add_mjcf(
        &mut self,
        mjcf: &MjcfModel,
        options: &MjcfOptions,
    ) -> Result<MjcfRobot, MjcfError> {
        let mut grown = self.clone();
        let robot = grown.insert_mjcf(mjcf, options)?;
        *self = grown;
        Ok(robot)
    }

    /// [`Model::add_mjcf`], which on an error leaves a part behind.
    fn insert_mjcf(
        &mut self,
        mjcf: &MjcfModel,
        options: &MjcfOptions,
    ) -> Result<MjcfRobot, MjcfError> {
        let mut warnings: Vec<String> = mjcf.warnings.iter().map(ToString::to_string).collect();
        for (what, changes) in left_out(mjcf, options) {
            if changes && !options.partial {
                return Err(MjcfError::NoCounterpart { what });
            }
            warnings.push(what);
        }
        let mut chain = links::LinkChain::new(mjcf, options);
        let activated = mjcf.actuators.iter().filter(|own| own.dynamics != Dynamics::Direct);
        let first = chain.links.len();
        chain.links.extend(activated.map(|own| links::activation(&own.name)));
        let links = self.add_articulation(chain.links)?;
        let mut states = links[first..].iter().copied();
        let activations = mjcf.actuators.iter().map(|own| match own.dynamics {
            Dynamics::Direct => None,
            _ => states.next(),
        });
        let activations: Vec<Option<BodyId>> = activations.collect();
        let mut robot = MjcfRobot {
            fixed: Vec::new(),
            bodies: chain.bodies.iter().map(|link| links[*link]).collect(),
            joints: named(&chain.joints, |link| links[link]),
            actuators: Vec::new(),
            warnings,
            activations: links[first..].to_vec(),
            keyframes: mjcf.keyframes.clone(),
            initial: mjcf.reference_state(),
            names: mjcf.bodies.iter().map(|body| body.name.clone()).collect(),
            sensors: sensors::Sensors::default(),
            mocaps: chain.mocaps.iter().map(|link| links[*link]).collect(),
            moved: chain.joints.iter().map(|joint| (joint.kind, links[joint.link])).collect(),
        };
        if options.shapes {
            robot.fixed = self.add_shapes(mjcf, &robot, options)?;
        }
        for (body, id) in mjcf.bodies.iter().zip(&robot.bodies) {
            if body.gravity_compensation != 0.0 {
                self.transmissions.carried.push((*id, body.gravity_compensation));
            }
        }
        let Some(link) = links.first().copied() else { return Ok(robot) };
        let joints = mjcf.joint_indices().zip(&chain.joints);
        let axes: Vec<_> =
            joints.map(|(index, own)| (index, links[own.link].into(), own.link)).collect();
        let lengths = lengths::PathLengths {
            mjcf,
            bodies: &chain.bodies,
            axes: &axes,
            t_world_mjcf: options.t_world_mjcf,
        };
        let sensors = sensors::Sensors::new(&lengths);
        let references = self.reference_coordinates(mjcf, &robot)?;
        let mobility = self.mobility(&references[0]);
        let mut forces = forces::Forces {
            model: self,
            mjcf,
            lengths,
            link,
            activations,
            mobility: &mobility,
            references: &references,
            softness: options.softness,
            rotors: Vec::new(),
            actuators: Vec::new(),
        };
        forces.add_all()?;
        let actuators = forces.actuators;
        self.add_loops(mjcf, &robot, options, (&mobility, &references[0]))?;
        Ok(MjcfRobot { actuators, sensors, ..robot })
    }
}

/// Parts of the model without a counterpart, and whether they change how it moves.
fn left_out(mjcf: &MjcfModel, options: &MjcfOptions) -> impl Iterator<Item = (String, bool)> {
    let joints = mjcf.joint_indices().map(|index| mjcf.joint(index));
    let joints = joints.flat_map(|joint| {
        let bends = joint.kind == JointKind::Free && joint.higher_stiffness != [0.0; 2];
        let left = [
            (joint.limit_margin != 0.0, "the margin of its limits", false),
            (bends, "the polynomial of a free joint's spring", true),
        ];
        let name = joint.name.clone();
        let left = left.into_iter().filter(|(is, ..)| *is);
        left.map(move |(_, what, changes)| (format!("joint '{name}': {what}"), changes))
    });
    let bounded = mjcf.actuators.iter().filter(|own| {
        own.muscle.is_some() && (own.force_range.is_some() || own.activation_range.is_some())
    });
    let bounded = bounded.map(|own| (format!("actuator '{}': bounds of a muscle", own.name), true));
    let actuators = mjcf.actuators.iter().filter_map(|own| match own.transmission {
        Transmission::Adhesion(_) if options.shapes => {
            Some((format!("actuator '{}': its hold on what touches a body", own.name), true))
        }
        _ => None,
    });
    let of_bodies = mjcf.bodies.iter().flat_map(|body| &body.geoms).map(|geom| (geom, true));
    let geoms = mjcf.world_geoms.iter().map(|geom| (geom, false)).chain(of_bodies);
    let terrain =
        geoms.filter(|(geom, _)| options.shapes && geom.collides() && shapes::is_terrain(geom));
    let terrain = terrain.map(|(geom, of_body)| {
        let left = if of_body { "contacts of a body's height field" } else { "its field's border" };
        (format!("geom '{}': {left}", geom.name), of_body)
    });
    joints.chain(actuators).chain(bounded).chain(terrain)
}

fn named(joints: &[links::ChainJoint], body: impl Fn(usize) -> BodyId) -> Vec<(String, JointAxis)> {
    let named = joints.iter().filter(|joint| !joint.name.is_empty());
    named.map(|joint| (joint.name.clone(), body(joint.link).into())).collect()
}
