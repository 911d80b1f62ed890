//! Errors of building a model, and of simulating it.

pub use crate::body::error::BodyError;
pub use crate::contact::error::LawError;
pub use crate::shape::error::ShapeError;

use thiserror::Error;

use crate::articulated::ArticulationError;
use crate::handle::BodyId;

/// Result of what simulates.
pub type Result<T, E = SimulationError> = std::result::Result<T, E>;

/// Error of building or changing a model.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BuildError {
    /// A body is not of this model.
    #[error("there is no body {body}: the model has {bodies}")]
    NoBody {
        /// The body.
        body: BodyId,
        /// Number of bodies.
        bodies: usize,
    },
    /// A body that should touch others has no samples.
    #[error("body '{body}' has no surface samples to touch others with")]
    NoSamples {
        /// Its name.
        body: String,
    },
    /// A body that should be touched has no distance field.
    #[error("body '{body}' has no distance field to be touched")]
    NoField {
        /// Its name.
        body: String,
    },
    /// Lists of bodies of which no two can move against each other.
    #[error("no two of these bodies can move against each other")]
    NoContacts,
    /// A body cannot touch itself.
    #[error("body '{body}' cannot touch itself")]
    Itself {
        /// Its name.
        body: String,
    },
    /// A parameter of a contact is out of its range.
    #[error(transparent)]
    Law(#[from] LawError),
    /// Links are no articulation.
    #[error(transparent)]
    Articulation(#[from] ArticulationError),
    /// A body that is no link has no joint.
    #[error("body '{body}' is no link of an articulation")]
    NotALink {
        /// Its name.
        body: String,
    },
    /// A link is where its joints put it.
    #[error("body '{body}' is a link, which its joints put where it is: use set_joint")]
    IsALink {
        /// Its name.
        body: String,
    },
    /// A joint has no such axis.
    #[error(
        "the joint of link '{link}' has no axis {axis} to act along: a fixed or a floating one has none"
    )]
    NoAxis {
        /// Its name.
        link: String,
        /// Index of the axis, from 0.
        axis: usize,
    },
    /// A force along joints of several articulations.
    #[error("links '{}' and '{}' are of different articulations", .links[0], .links[1])]
    Apart {
        /// Their names.
        links: [String; 2],
    },
    /// A law along a joint does not take its parameters.
    #[error("the law along the joint of link '{link}': {error}")]
    JointLaw {
        /// Its name.
        link: String,
        /// Cause.
        error: LawError,
    },
    /// A force along no joint.
    #[error("a force along joints needs an axis to act along")]
    NoAxes,
    /// Parameters of a model that are too few or too many.
    #[error("{given} parameters for a model of {expected}")]
    Parameters {
        /// Number given.
        given: usize,
        /// Number that it has.
        expected: usize,
    },
    /// A body has an impossible mass, inertia or center of mass.
    #[error("body '{body}': {error}")]
    Body {
        /// Its name.
        body: String,
        /// Cause.
        error: BodyError,
    },
    /// A body has impossible dimensions.
    #[error("body '{body}': {error}")]
    Shape {
        /// Its name.
        body: String,
        /// Cause.
        error: ShapeError,
    },
    /// A robot and its shape do not belong together.
    #[error("{found} {what} for a robot that has {expected}")]
    Robot {
        /// Name of what was counted.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Number that the robot has.
        expected: usize,
    },

    /// A trajectory that carries derivatives, where only values of it would be kept.
    #[error(
        "body '{body}' is driven by a trajectory that carries derivatives: checkpoints and parameters in a row know its values \
         only, so record the simulation as it is"
    )]
    TrajectoryDerivatives {
        /// Its name.
        body: String,
    },
    /// A stiffness or damping of a bushing is negative or not finite.
    #[error(
        "stiffness and damping of a bushing must be zero or positive, and finite, one is {value}"
    )]
    BushingStiffness {
        /// Its value.
        value: f64,
    },
}

/// Error of a simulation.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SimulationError {
    /// An integrator was told to stop.
    #[error("interrupted")]
    Interrupted,
    /// The model is none that can be simulated.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A parameter of a contact is out of its range.
    #[error(transparent)]
    Law(#[from] LawError),
    /// Coordinates and velocities of a joint that are too few or too many.
    #[error(
        "{} coordinates and {} velocities for the joint of link '{link}', which has {} and {}", .given[0], .given[1], .expected[0],
        .expected[1]
    )]
    JointNumbers {
        /// Its name.
        link: String,
        /// Numbers of coordinates and velocities given.
        given: [usize; 2],
        /// Number that it has.
        expected: [usize; 2],
    },
    /// A rotation of a body, or of a link's joint, that is none.
    #[error(
        "the rotation of '{body}' is a quaternion of the length {norm}, which has no direction"
    )]
    Rotation {
        /// Its name.
        body: String,
        /// The length of the quaternion.
        norm: f64,
    },
    /// Too few or too many generalized coordinates.
    #[error(
        "{} positions and {} velocities were given: the model has {} and {}",
        .given[0],
        .given[1],
        .expected[0],
        .expected[1]
    )]
    GeneralizedCoordinates {
        /// Numbers of positions and velocities given.
        given: [usize; 2],
        /// Numbers that the model has.
        expected: [usize; 2],
    },
    /// An integrator that knows no joints.
    #[error("{integrator} does not move articulations")]
    Joints {
        /// Its name.
        integrator: &'static str,
    },
    /// An integrator that knows no bushings.
    #[error("{integrator} knows nothing of bushings")]
    Bushings {
        /// Its name.
        integrator: &'static str,
    },
    /// States and bodies differ in number.
    #[error(
        "{states} states for {bodies} bodies, {joints} joints and {bristles} contacts with bristles"
    )]
    States {
        /// Number of states.
        states: usize,
        /// Number of bodies.
        bodies: usize,
        /// Number of joints of articulations, whose states follow those of the bodies.
        joints: usize,
        /// Number of contacts with a deflection, whose states come last.
        bristles: usize,
    },
    /// A number of an integrator is out of its range.
    #[error("{setting} must be {range}, is {value}")]
    Setting {
        /// Type and field.
        setting: &'static str,
        /// Range that it has to be in.
        range: &'static str,
        /// Its value.
        value: f64,
    },
    /// A model has no parameter of that name, or it was named before.
    #[error("the model has no parameter called '{name}', or it was named twice: see its names")]
    NoParameter {
        /// The name.
        name: String,
    },
    /// A body, or a link's joint, whose rotation is no unit quaternion.
    #[error("the quaternion of '{body}' has the length {norm}, not 1")]
    Quaternion {
        /// Its name.
        body: String,
        /// The length of its quaternion.
        norm: f64,
    },
    /// A rollout too long to keep.
    #[error("there is no memory for the states of {steps} steps")]
    Memory {
        /// The number of its steps.
        steps: usize,
    },
    /// Inputs of a function of numbers that are too few or too many.
    #[error("{given} {what}: {expected} are expected")]
    Inputs {
        /// Name of what was given.
        what: &'static str,
        /// Number given.
        given: usize,
        /// Number expected.
        expected: usize,
    },
    /// A model that differs in more than parameters from the one its integrator was made for.
    #[error("the integrator was made for a model of other bodies or contacts")]
    AnotherModel,
    /// The velocity of a trajectory is not the rate of its pose.
    #[error(
        "body '{body}' is driven by a trajectory whose velocity at {time} s is far from the rate of its pose, which what touches it \
         should feel: give its state `linear` and `angular`"
    )]
    TrajectoryVelocity {
        /// Its name.
        body: String,
        /// Time \[s\].
        time: f64,
    },
    /// The time step is not a positive number.
    #[error("a time, or a time step, must be positive and finite, is {0} s")]
    TimeStep(f64),
    /// A state at no time.
    #[error("the time of a state must be finite, is {0} s")]
    Time(f64),
    /// A body's state, its square or a derivative of it, is not finite: given so, or blown up.
    #[error(
        "the state of body '{body}', its square or a derivative of it, is not finite at {time} s{}: bad input, or a time step too long for the \
         contacts",
        touching(contact)
    )]
    NotFinite {
        /// Its name.
        body: String,
        /// The body that presses hardest on it.
        contact: Option<String>,
        /// Time \[s\].
        time: f64,
    },
    /// Contacts or steps have made energy. Not asked in a model where a body is kinematic, or fixed and given a velocity.
    #[error(
        "{} made {energy:.3e} J by {time} s, most of it in body '{body}'{}: time steps that are too long, or a law that is not passive",
        if contact.is_some() { "contacts have" } else { "the motion has" },
        touching(contact)
    )]
    Energy {
        /// The body that moves with most energy.
        body: String,
        /// The body that presses hardest on it.
        contact: Option<String>,
        /// When it was noticed \[s\].
        time: f64,
        /// Amount \[J\].
        energy: f64,
    },
    /// Forces change so fast that no step is short enough.
    #[error(
        "body '{body}'{} needs steps shorter than {dt:.3e} s at {time} s: a force that jumps, or contacts far too stiff",
        touching(contact)
    )]
    Stalled {
        /// The body that is accelerated most.
        body: String,
        /// The body that presses hardest on it.
        contact: Option<String>,
        /// Time \[s\].
        time: f64,
        /// The last step that was tried \[s\].
        dt: f64,
    },
    /// A body was pressed past the middle of another, which would push it out on the other side.
    #[error(
        "body '{body}' passes through '{contact}' at {time} s: contacts too soft for such an impact or load (see \
         ContactCalibration::impact_depth)"
    )]
    PassedThrough {
        /// The body with the samples.
        body: String,
        /// The body with the field.
        contact: String,
        /// Time \[s\].
        time: f64,
    },
    /// A step had to be divided into too many parts.
    #[error(
        "a step took more than {max_substeps} parts by {time} s, body '{body}' accelerated most{}: contacts too stiff for so long a \
         time, or `Adaptive::max_substeps` too small",
        touching(contact)
    )]
    TooManySubsteps {
        /// The body that is accelerated most.
        body: String,
        /// The body that presses hardest on it.
        contact: Option<String>,
        /// Parts that are allowed.
        max_substeps: usize,
        /// Time that they have led to \[s\].
        time: f64,
    },
    /// A force that jumps at touch has derivatives that no step gets right. Tried at a normal speed of 1 m/s; no other jump is looked
    /// for.
    #[error(
        "the force between '{body}' and '{contact}' jumps at touch, so that derivatives through impacts would be wrong: let it \
         fade in (GapSmoothing::Softplus), or choose a law whose damping and friction grow with penetration (HuntCrossley, Coulomb)"
    )]
    ForceJumps {
        /// The body with the samples.
        body: String,
        /// The body with the field.
        contact: String,
    },
    /// An implicit step found no solution.
    #[error(
        "the equations of step {step}, at {time} s, were not solved: residual {residual:.3e} after {iterations} iterations; body '{body}'{} \
         is accelerated most",
        touching(contact)
    )]
    Unsolved {
        /// Number of the step.
        step: usize,
        /// Time \[s\].
        time: f64,
        /// The body that is accelerated most.
        body: String,
        /// The body that presses hardest on it.
        contact: Option<String>,
        /// Norm of what remained, as a velocity \[m/s, rad/s\].
        residual: f64,
        /// Newton iterations.
        iterations: usize,
    },
    /// Contacts are too stiff or damped for the parts into which a step may be divided.
    #[error(
        "the contacts of step {step}, at {time} s, need {needed} parts of it, and {max_substeps} are allowed; body '{body}'{} is \
         accelerated most",
        touching(contact)
    )]
    SubSteps {
        /// Number of the step.
        step: usize,
        /// Time \[s\].
        time: f64,
        /// The body that is accelerated most.
        body: String,
        /// The body that presses hardest on it.
        contact: Option<String>,
        /// Parts that would be needed.
        needed: f64,
        /// Parts that are allowed.
        max_substeps: usize,
    },
}

fn touching(contact: &Option<String>) -> String {
    contact.as_ref().map(|name| format!(" (touching '{name}')")).unwrap_or_default()
}
