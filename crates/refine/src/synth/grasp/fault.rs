//! Errors of graspers and grasps.

use prehend_geometry::VolumeError;
use prehend_geometry::closest::ClosestError;
use prehend_geometry::robot::RobotError;
use prehend_sim::contact::LawError;
use prehend_sim::{BodyError, SimulationError};
use thiserror::Error;

use crate::error::RefineError;

/// Reason that no grasps of an object can be looked for.
#[derive(Debug, Error)]
pub enum GraspError {
    /// A setting is out of its range, or the pre-shape is not that of the robot.
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
}

/// Reason that one attempt at a grasp, or one trajectory, came to nothing. Another seed may do better.
#[derive(Debug, Error)]
pub enum GraspFault {
    /// The open hand lets the object nowhere near its palm.
    #[error("the fingers keep the object from the palm")]
    NoRoom,
    /// Only so many links touch the object.
    #[error("{0} links touch the object")]
    NoContact(usize),
    /// Hand or object still moved when time was up.
    #[error("hand and object did not come to rest")]
    Restless,
    /// The object moved in the hand.
    #[error("the object slipped by {:.1} mm and {:.1}°", distance * 1e3, angle.to_degrees())]
    Slipped {
        /// Distance \[m\].
        distance: f64,
        /// By what angle \[rad\].
        angle: f64,
    },
    /// The contact area \[cm²\] is out of its bounds.
    #[error("the contact area is {0:.1} cm²")]
    ContactArea(f64),
    /// Hand and object share too much volume \[cm³\].
    #[error("hand and object share {0:.2} cm³")]
    TooDeep(f64),
    /// None of so many attempts led to a grasp; the last failed for that reason.
    #[error("no grasp after {0} tries; the last: {1}")]
    Exhausted(u64, Box<GraspFault>),
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
