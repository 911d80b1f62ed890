//! Errors of graspers and grasps.

use prehend_geometry::VolumeError;
use prehend_geometry::closest::ClosestError;
use prehend_geometry::robot::RobotError;
use prehend_sim::contact::LawError;
use prehend_sim::{SimulationError, error::BodyError};
use thiserror::Error;

use crate::error::RefineError;

/// Reason that no grasps of an object can be looked for, or that an attempt at one came to nothing.
#[derive(Debug, Error)]
pub enum GraspError {
    /// A setting is out of its range.
    #[error("{0}")]
    Setting(String),
    /// No joint of the robot closes around anything.
    #[error("the robot has no joint that would close its fingers")]
    NoFingers,
    /// The object of that name cannot be simulated.
    #[error("object {0}: {1}")]
    Object(String, BodyError),
    /// The contact law was refused.
    #[error(transparent)]
    Law(#[from] LawError),
    /// The hand's skin is at fault.
    #[error(transparent)]
    Skin(#[from] RefineError),
    /// An attempt led to no grasp that meets the settings. Another seed may do better.
    #[error("{0}")]
    NoGrasp(String),
    /// The simulation failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The shared volume cannot be computed.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// The hand's surface cannot be searched.
    #[error(transparent)]
    Closest(#[from] ClosestError),
    /// The hand cannot be posed.
    #[error(transparent)]
    Robot(#[from] RobotError),
}
