//! Why a refinement could not be done.

mod guard;
mod settings;

use prehend_geometry::hand::TaxelError;
use prehend_geometry::robot::RobotError;
use thiserror::Error;

pub use self::guard::guard;
pub use self::settings::SettingsError;

/// Why a pose could not be refined.
#[derive(Debug, Error)]
pub enum RefineError {
    /// The object model cannot be used.
    #[error("object {object}: {reason}")]
    Object {
        /// Name of the object.
        object: String,
        /// Why it cannot be used.
        reason: String,
    },
    /// The mask selects nothing.
    #[error("the object's mask is empty or missing")]
    EmptyMask,
    /// A [`PoseFinder`](crate::PoseFinder) of a user failed.
    #[error("pose finder: {0}")]
    Finder(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// No depth where the object is.
    #[error("no pixel of the object's mask has a depth")]
    NoDepth,
    /// A factor needs something that was not observed.
    #[error("the {factor} factor needs the {what}, which the observation lacks")]
    Missing {
        /// Name of the missing quantity.
        what: &'static str,
        /// The factor that needs it.
        factor: &'static str,
    },
    /// Gravity that presses nothing into the hand.
    #[error("the {factor} factor needs gravity: {problem}")]
    Gravity {
        /// The factor that needs it.
        factor: &'static str,
        /// Reason why the gravity vector is refused.
        problem: String,
    },
    /// Forces and taxels do not match.
    #[error("{forces} taxel forces were given for {taxels} taxels")]
    TaxelCount {
        /// Number of forces.
        forces: usize,
        /// Number of taxels.
        taxels: usize,
    },
    /// A taxel sits on a link that the robot lacks.
    #[error("a taxel is on link {link}, which the robot lacks")]
    TaxelLink {
        /// Name of the link.
        link: String,
    },
    /// The initial pose is unusable.
    #[error("the initial pose puts the object's center at depth {depth:.3} m, behind the camera")]
    BehindCamera {
        /// Depth of the center \[m\].
        depth: f64,
    },
    /// The initial pose is not finite.
    #[error("the initial pose is not finite")]
    NotFinite,
    /// The pose that was found is unusable.
    #[error("the refined pose is not finite")]
    Diverged,
    /// No factor was asked for.
    #[error("no factor to refine by")]
    NoFactors,
    /// Nothing of the object is in the image at its initial pose.
    #[error("nothing of the object is in the image at its initial pose")]
    OutOfView,
    /// No pixel of a detector's box shows the object at its initial pose.
    #[error("nothing of the object at its initial pose is in the box")]
    OutOfBox,
    /// A search has come to nothing.
    #[error("no pose of the object fits what is seen")]
    NothingFits,
    /// A setting is out of range.
    #[error("{name} {problem}")]
    Setting {
        /// The field of the settings.
        name: &'static str,
        /// Reason why the setting is refused, such as `is 0, must be above zero`.
        problem: String,
    },
    /// Kinematics failed.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// A table of taxels cannot be read.
    #[error(transparent)]
    Taxels(#[from] TaxelError),
    /// A part of the program panicked: a fault of its own, which the panic's message tells.
    #[error("the program is at fault: {0}")]
    Panicked(String),
    /// The images of the observation do not fit each other, or their camera is impossible.
    #[error("the images of the observation cannot be used: {0}")]
    Images(String),
}

impl RefineError {
    /// Refuses the first of these settings that is not above zero.
    pub(crate) fn require_positive(settings: &[(&'static str, f64)]) -> Result<(), Self> {
        Self::require(settings, f64::INFINITY)
    }

    /// Refuses the first of these settings that is not above zero and finite.
    pub(crate) fn require_finite(settings: &[(&'static str, f64)]) -> Result<(), Self> {
        Self::require(settings, f64::MAX)
    }

    fn require(settings: &[(&'static str, f64)], most: f64) -> Result<(), Self> {
        let wrong = settings.iter().find(|(_, value)| !(*value > 0.0 && *value <= most));
        wrong.map_or(Ok(()), |(name, value)| {
            let range = if most.is_finite() { "finite and above zero" } else { "above zero" };
            Err(Self::Setting { name, problem: format!("is {value}, must be {range}") })
        })
    }
}
