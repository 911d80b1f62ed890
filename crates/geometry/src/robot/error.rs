//! Errors of robot descriptions and joint states.

use std::path::PathBuf;

use crate::mjcf::MjcfError;

/// Result of reading or posing a robot.
pub(super) type Result<T, E = RobotError> = std::result::Result<T, E>;

/// Why a robot could not be read or posed.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// The description file cannot be read.
    #[error("cannot read robot description {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The description is not valid URDF.
    #[error("invalid URDF: {message}")]
    Urdf {
        /// The error of the parser.
        message: String,
    },
    /// The description is not valid MJCF, or has what is not supported.
    #[error(transparent)]
    Mjcf(Box<MjcfError>),
    /// An error in the description that was read from a file.
    #[error("{path}: {source}")]
    InFile {
        /// The file.
        path: PathBuf,
        /// Error of the description in that file.
        source: Box<RobotError>,
    },
    /// Names that are not unique or name nothing, or links, joints and mimics that do not form one tree.
    #[error("{reason}")]
    Structure {
        /// Reason, with the links and joints at fault.
        reason: String,
    },
    /// A joint that does not exist is named by a mimic tag or a joint state.
    #[error("joint '{joint}', named by {by}, does not exist")]
    UnknownJoint {
        /// The missing joint.
        joint: String,
        /// Who names it.
        by: String,
    },
    /// A joint of a kind that has no place in a tree of single-axis joints.
    #[error("joint '{joint}' is of the unsupported kind {kind}")]
    UnsupportedJoint {
        /// The joint.
        joint: String,
        /// Its kind.
        kind: String,
    },
    /// A number that is NaN, infinite, or out of its range.
    #[error("{owner}: {field} is not valid ({requirement})")]
    Number {
        /// "link 'name'" or "joint 'name'".
        owner: String,
        /// Which number.
        field: &'static str,
        /// Requirement that it breaks, such as `must be finite`.
        requirement: &'static str,
    },
    /// No position of a joint is within all its limits and those of the joints that mimic it.
    #[error(
        "joint '{joint}': no position is within the limits {lower} to {upper}, imposed by {by}"
    )]
    Limits {
        /// The joint.
        joint: String,
        /// The largest of the lower limits \[rad or m\].
        lower: f64,
        /// The smallest of the upper limits \[rad or m\].
        upper: f64,
        /// The joints whose limits these are.
        by: String,
    },
    /// A joint position outside the limits of the joint, or of one that mimics it.
    #[error("joint '{joint}' at {position} is outside {lower} to {upper}, imposed by {by}")]
    OutsideLimits {
        /// The joint.
        joint: String,
        /// Its position \[rad or m\].
        position: f64,
        /// Smallest position \[rad or m\].
        lower: f64,
        /// Largest position \[rad or m\].
        upper: f64,
        /// The joints whose limits these are.
        by: String,
    },
    /// A description too large.
    #[error("the description is too large: {count} {what}, at most {limit} are read")]
    TooLarge {
        /// Bytes.
        what: &'static str,
        /// How many.
        count: usize,
        /// How many are read.
        limit: usize,
    },
    /// A joint has no value in a joint state.
    #[error("joint '{joint}' is missing from the joint state")]
    MissingJoint {
        /// The joint.
        joint: String,
    },
    /// A collision mesh cannot be used.
    #[error("link '{link}': collision mesh '{file}': {reason}")]
    Mesh {
        /// The link.
        link: String,
        /// The file as the description names it.
        file: String,
        /// Why not.
        reason: String,
    },
    /// The collision bodies of a link cannot be used.
    #[error("link '{link}': {reason}")]
    Shape {
        /// The link.
        link: String,
        /// Why not.
        reason: String,
    },
    /// A joint vector that does not fit the robot.
    #[error("{given} joint positions were given for a robot of {expected}")]
    JointCount {
        /// Positions given.
        given: usize,
        /// Entries of the robot's joint vector.
        expected: usize,
    },
    /// A pose list that does not fit the robot.
    #[error("{given} link poses were given for a robot of {expected} links")]
    PoseCount {
        /// Poses given.
        given: usize,
        /// Links of the robot.
        expected: usize,
    },
}

impl RobotError {
    pub(super) fn structure(reason: impl Into<String>) -> Self {
        Self::Structure { reason: reason.into() }
    }
}
