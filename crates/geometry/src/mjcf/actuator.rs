//! Actuators of joints, tendons, sites and bodies.

use std::collections::BTreeSet;

use nalgebra::Isometry3;

use super::class::{Classes, MAIN};
use super::compiler::Compilers;
use super::drive::{Drive, DriveKind, Drives};
use super::element::Element;
use super::error::Result;
use super::names::{Names, Taken};
use super::value::Limits;
use super::{JointIndex, Model};

/// Transmission of an actuator: the joint, tendon, site or body on which its force acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transmission {
    /// A joint. Of a ball the first three numbers of `gear` are along the body's axes, or the parent's with `in_parent`; of a free
    /// joint the first three along the world's and the others so.
    Joint {
        /// Which.
        joint: JointIndex,
        /// Whether torques are along the axes of the parent.
        in_parent: bool,
    },
    /// A tendon of the model, by index.
    Tendon(usize),
    /// A force and a torque by `gear`, along the axes of a site, or of another that the length is measured from.
    Site {
        /// The frame.
        site: PlacedFrame,
        /// The frame that it is measured from; without one the length is zero.
        reference: Option<PlacedFrame>,
    },
    /// A rod between a crank and a slider, whose position is the length.
    SliderCrank {
        /// Where the rod hangs on the crank.
        crank: PlacedFrame,
        /// Where it hangs on the slider, which moves along the z axis.
        slider: PlacedFrame,
        /// Length of the rod \[m\].
        rod: f64,
    },
    /// The contacts of a body, which it holds on to; `None` is the world.
    Adhesion(Option<usize>),
}

/// A frame on a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedFrame {
    /// The body; `None` is the world.
    pub body: Option<usize>,
    /// The frame → body frame.
    pub t_body_frame: Isometry3<f64>,
}

/// How the control becomes the actuator's input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Dynamics {
    /// It is the input.
    Direct,
    /// The input is the integral of the control.
    Integrator,
    /// The input follows the control with this time constant \[s\].
    Filter(f64),
    /// The activation of a muscle: time constants upwards and downwards \[s\], and over what difference one becomes the other.
    Muscle([f64; 3]),
}

/// Force law of a muscle: by its fiber's length, that of the actuator from `origin` over `unit`, and the rate of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Muscle {
    /// Active force at a fiber's length of one, at rest; without it `scale` times the inertia: one over the size of the acceleration that a unit of
    /// force gives with all joints at their references.
    pub force: Option<f64>,
    /// See `force`.
    pub scale: f64,
    /// Length at which the fiber's is zero.
    pub origin: f64,
    /// Length of a fiber of length one.
    pub unit: f64,
    /// Fiber's lengths between which there is active force.
    pub lengths: [f64; 2],
    /// Rate of shortening at which there is none \[1/s\].
    pub fastest: f64,
    /// Passive force, as part of the active one.
    pub passive: f64,
    /// Active force where the fiber is stretched fast, as part of that at rest.
    pub stretching: f64,
}

/// An actuator. At the length `l` (the joint's position or the tendon's length times `gear`) and its rate `v` its force is
/// `(gain · (1, l, v)) input + bias · (1, l, v)`; what it pulls at feels `gear` times the force.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// Its name, empty where it has none.
    pub name: String,
    /// Transmission: where its force acts.
    pub transmission: Transmission,
    /// Its length for that of what it pulls at: the first number, but of sites, balls and free joints, which have one for each direction.
    pub gear: [f64; 6],
    /// Force for the input: constant, by length and by its rate.
    pub gain: [f64; 3],
    /// Force without input: constant, by length and by its rate.
    pub bias: [f64; 3],
    /// How the control becomes the input.
    pub dynamics: Dynamics,
    /// Smallest and largest control, where it is limited.
    pub control_range: Option<(f64, f64)>,
    /// Smallest and largest force, where it is limited.
    pub force_range: Option<(f64, f64)>,
    /// Smallest and largest input, where it is limited; only of actuators with dynamics.
    pub activation_range: Option<(f64, f64)>,
    /// How far ahead the input is by which it drives \[s\]: by the model's time step where it is to act early.
    pub ahead: f64,
    /// Force law, where it is a muscle: gain and bias are zero then.
    pub muscle: Option<Muscle>,
    /// Share of critical damping that gives the rate's bias of a servo: −2 times it times √(gain · inertia at the length), with all joints at their
    /// references and everything else free to move.
    pub damping_ratio: Option<f64>,
}

const CONTROL_RANGE: [&str; 2] = ["ctrllimited", "ctrlrange"];
const FORCE_RANGE: [&str; 2] = ["forcelimited", "forcerange"];
const ACTIVATION_RANGE: [&str; 2] = ["actlimited", "actrange"];

/// Attributes of an actuator: the defaults of its class, replaced by those of its element.
#[derive(Clone)]
pub(super) struct ActuatorSpec {
    gear: [f64; 6],
    /// Length of a crank's rod \[m\].
    rod: f64,
    is_early: bool,
    control: Limits,
    force: Limits,
    activation: Limits,
    drives: Drives,
    group: i32,
    length_range: Option<[f64; 2]>,
}

impl Default for ActuatorSpec {
    fn default() -> Self {
        let free = Limits::default();
        Self {
            gear: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            rod: 0.0,
            is_early: false,
            control: free,
            force: free,
            activation: free,
            drives: Drives::default(),
            group: 0,
            length_range: None,
        }
    }
}

impl ActuatorSpec {
    /// Reads an element of a default class, if it is an actuator that is read.
    pub(super) fn read_default(&mut self, e: &Element) -> Result<bool> {
        let Some(kind) = DriveKind::of(&e.tag) else { return Ok(false) };
        self.read(e, kind)?;
        Ok(true)
    }

    fn read(&mut self, e: &Element, kind: DriveKind) -> Result<Drive> {
        e.leading("gear", &mut self.gear)?;
        self.is_early = e.switch("actearly")?.unwrap_or(self.is_early);
        self.rod = e.number("cranklength")?.unwrap_or(self.rod);
        self.group = e.integer("group")?.unwrap_or(self.group);
        self.length_range = e.numbers("lengthrange")?.or(self.length_range);
        for field in ["armature", "damping"] {
            if e.list(field, 3)?.is_some_and(|list| list.iter().any(|x| *x != 0.0)) {
                e.refuse_attribute(field, "of actuators is not read");
            }
        }
        self.control.read(e, CONTROL_RANGE)?;
        self.force.read(e, FORCE_RANGE)?;
        self.activation.read(e, ACTIVATION_RANGE)?;
        self.drives.read(e, kind)
    }
}

/// The actuators of `root` that are read, and for each that is written its index among them.
pub(super) fn read(
    root: &Element,
    compilers: &Compilers,
    classes: &Classes,
    model: &Model,
    names: &Names,
) -> Result<(Vec<Actuator>, Vec<Option<usize>>)> {
    let (mut all, mut taken) = (Vec::new(), Taken::default());
    let mut written = Vec::new();
    let mut disabled = BTreeSet::new();
    for e in root.sections("option") {
        let groups = e.list("actuatorgroupdisable", 31)?.unwrap_or_default();
        disabled.extend(groups.into_iter().map(|group| group as i32));
    }
    for e in root.in_sections("actuator") {
        let built = build(e, compilers, classes, (model, names), &disabled)?;
        written.push(built.is_some().then_some(all.len()));
        let Some(actuator) = built else { continue };
        taken.add(e, "actuator")?;
        all.push(actuator);
    }
    Ok((all, written))
}

fn build(
    e: &Element,
    compilers: &Compilers,
    classes: &Classes,
    (model, names): (&Model, &Names),
    disabled: &BTreeSet<i32>,
) -> Result<Option<Actuator>> {
    let Some(kind) = DriveKind::of(&e.tag) else {
        e.refuse("left out: actuators of this kind are not read");
        return Ok(None);
    };
    let mut spec = classes.of(e, MAIN)?.actuator.clone();
    let drive = spec.read(e, kind)?;
    let Some(transmission) = transmission(e, &spec, model, names)? else { return Ok(None) };
    e.take();
    let Some((mut gain, mut bias, dynamics)) = drive.resolved() else {
        e.refuse("left out: gains, biases or dynamics of its kind are not read");
        return Ok(None);
    };
    let [is_partly, is_wholly] = drive.is_muscle();
    let muscle = drive.muscle(spec.length_range).filter(|_| is_wholly);
    if is_partly && muscle.is_none() {
        e.refuse("left out: a muscle needs a lengthrange, and gain, bias and dynamics of its own");
        return Ok(None);
    }
    let (gear, compiler) = (spec.gear, compilers.of(e));
    let damping_ratio = drive.has_damping_ratio().then(|| std::mem::take(&mut bias[2]));
    // The rate of a filter that is integrated exactly fades within the step.
    let ahead = match dynamics {
        Dynamics::Filter(time) if drive.is_exact() && time > 0.0 => {
            time * -(-model.time_step / time).exp_m1()
        }
        _ => model.time_step,
    };
    let ahead = if spec.is_early && dynamics != Dynamics::Direct { ahead } else { 0.0 };
    // Of a group that is turned off.
    if disabled.contains(&spec.group) {
        (gain, bias) = ([0.0; 3], [0.0; 3]);
    }
    // Nothing drives with a gain of minus zero.
    [&mut gain, &mut bias].into_iter().flatten().for_each(|x| *x += 0.0);
    let mut control_range = compiler.range(e, CONTROL_RANGE, spec.control)?;
    let mut activation_range = compiler.range(e, ACTIVATION_RANGE, spec.activation)?;
    if drive.inherit_range > 0.0 {
        let own = match transmission {
            Transmission::Joint { joint, .. } => model.joint(joint).range,
            Transmission::Tendon(tendon) => model.tendons[tendon].range,
            _ => None,
        };
        let (low, high) = own.ok_or_else(|| {
            e.invalid("inheritrange", "needs a range of what the actuator pulls at")
        })?;
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low) * drive.inherit_range);
        let inherited = Some((middle - half, middle + half));
        if kind == DriveKind::IntegratedVelocity {
            activation_range = inherited
        } else {
            control_range = inherited
        }
    }
    Ok(Some(Actuator {
        name: e.name(),
        transmission,
        gear,
        gain,
        bias,
        dynamics,
        control_range,
        force_range: compiler.range(e, FORCE_RANGE, spec.force)?,
        activation_range,
        ahead,
        muscle,
        damping_ratio,
    }))
}

/// The transmission of the actuator `e`; `None`, after a refusal, where it is not read.
fn transmission(
    e: &Element,
    spec: &ActuatorSpec,
    model: &Model,
    names: &Names,
) -> Result<Option<Transmission>> {
    let frame = |field| -> Result<PlacedFrame> {
        let (body, t_body_frame) = names.sites.get(e, field)?;
        Ok(PlacedFrame { body, t_body_frame })
    };
    Ok(Some(if e.has("tendon") {
        let found = names.tendons.get(e, "tendon")?;
        if found.is_none() {
            e.refuse("left out: the tendon that it pulls at is not read");
        }
        return Ok(found.map(Transmission::Tendon));
    } else if e.has("site") {
        let site = frame("site")?;
        let reference = e.has("refsite").then(|| frame("refsite")).transpose()?;
        Transmission::Site { site, reference }
    } else if e.has("cranksite") {
        let (crank, slider) = (frame("cranksite")?, frame("slidersite")?);
        if spec.rod <= 0.0 {
            return Err(e.invalid("cranklength", "must be positive"));
        }
        Transmission::SliderCrank { crank, slider, rod: spec.rod }
    } else if e.has("body") {
        Transmission::Adhesion(names.bodies.get(e, "body")?)
    } else {
        let field = ["joint", "jointinparent"].into_iter().find(|f| e.has(f));
        let Some(field) = field else {
            return Err(e.misplaced("pulls at nothing"));
        };
        let joint = names.joints.get(e, field)?;
        let in_parent = field == "jointinparent" && model.joint(joint).kind.velocities() > 1;
        Transmission::Joint { joint, in_parent }
    }))
}
