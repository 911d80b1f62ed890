//! Why there is no grasper, or no grasp.

use prehend_geometry::VolumeError;
use prehend_geometry::closest::ClosestError;
use prehend_geometry::robot::RobotError;
use prehend_sim::{BodyError, LawError, SimulationError};
use thiserror::Error;

/// Why no grasps of an object can be looked for.
#[derive(Debug, Error)]
pub enum GraspError {
    /// A setting is out of its range.
    #[error("the setting {name} must be {range}, is {value}")]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        range: &'static str,
    },
    /// The pre-shape is not that of the robot.
    #[error("the pre-shape has {found} {what} for a robot with {expected} joints")]
    Preshape {
        /// What was counted.
        what: &'static str,
        /// How many there were.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// No joint of the robot closes around anything.
    #[error("the robot has no joint that would close its fingers")]
    NoFingers,
    /// The object cannot be simulated.
    #[error("object {object}: {reason}")]
    Object {
        /// Its name.
        object: String,
        /// What is wrong with it.
        reason: BodyError,
    },
    /// The contact law was refused.
    #[error(transparent)]
    Law(#[from] LawError),
    /// The robot's description is at fault.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// A taxel sits on a link that the robot lacks.
    #[error("a taxel is on link {link}, which the robot lacks")]
    TaxelLink {
        /// Name of the link.
        link: String,
    },
}

/// Why one attempt at a grasp, or one trajectory, came to nothing. Another seed may do better.
#[derive(Debug, Error)]
pub enum GraspFault {
    /// The open hand lets the object nowhere near its palm.
    #[error("the fingers keep the object from the palm")]
    NoRoom,
    /// Too few links touch the object.
    #[error("{links} links touch the object")]
    NoContact {
        /// How many.
        links: usize,
    },
    /// Hand or object still moved when time was up.
    #[error("hand and object did not come to rest")]
    Restless,
    /// The object moved in the hand.
    #[error("the object slipped by {:.1} mm and {:.1}°", distance * 1e3, angle.to_degrees())]
    Slipped {
        /// How far \[m\].
        distance: f64,
        /// By what angle \[rad\].
        angle: f64,
    },
    /// The contact area is out of its bounds.
    #[error("the contact area is {area:.1} cm²")]
    ContactArea {
        /// The area \[cm²\].
        area: f64,
    },
    /// Hand and object share too much volume.
    #[error("hand and object share {volume:.2} cm³")]
    TooDeep {
        /// The volume \[cm³\].
        volume: f64,
    },
    /// None of so many attempts led to a grasp.
    #[error("no grasp after {tries} tries; the last: {last}")]
    Exhausted {
        /// How many.
        tries: u64,
        /// What was wrong with the last one.
        last: Box<GraspFault>,
    },
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
