//! What drives joints and tendons.

use std::cell::OnceCell;

use super::class::{Classes, MAIN};
use super::compiler::Compiler;
use super::drive::{Drive, DriveKind, Drives};
use super::element::Element;
use super::error::MjcfError;
use super::names::{Names, Taken};
use super::reflected::Reflected;
use super::value::Limited;
use super::{JointIndex, Model};

/// What an actuator pulls at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transmission {
    /// A hinge or slide.
    Joint(JointIndex),
    /// A tendon of the model, by index.
    Tendon(usize),
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
}

/// An actuator. At the length `l` (the joint's position or the tendon's length times `gear`) and its rate `v` its force is
/// `(gain · (1, l, v)) input + bias · (1, l, v)`; what it pulls at feels `gear` times the force.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuator {
    /// Its name, empty where it has none.
    pub name: String,
    /// What it pulls at.
    pub transmission: Transmission,
    /// Its length for that of what it pulls at.
    pub gear: f64,
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
}

/// What is known of an actuator before it is complete.
#[derive(Clone)]
pub(super) struct Spec {
    gear: [f64; 6],
    control: ([f64; 2], Limited),
    force: ([f64; 2], Limited),
    activation: ([f64; 2], Limited),
    drives: Drives,
}

impl Default for Spec {
    fn default() -> Self {
        let free = ([0.0; 2], Limited::Auto);
        let gear = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        Self { gear, control: free, force: free, activation: free, drives: Drives::default() }
    }
}

impl Spec {
    /// Reads an element of a default class, if it is an actuator that is read.
    pub(super) fn read_default(&mut self, e: &Element) -> Result<bool, MjcfError> {
        let Some(kind) = DriveKind::of(&e.tag) else { return Ok(false) };
        self.read(e, kind)?;
        Ok(true)
    }

    fn read(&mut self, e: &Element, kind: DriveKind) -> Result<Drive, MjcfError> {
        e.leading("gear", &mut self.gear)?;
        for (range, limited, value) in [
            ("ctrlrange", "ctrllimited", &mut self.control),
            ("forcerange", "forcelimited", &mut self.force),
            ("actrange", "actlimited", &mut self.activation),
        ] {
            value.0 = e.numbers(range)?.unwrap_or(value.0);
            value.1 = e.limited(limited)?.unwrap_or(value.1);
        }
        self.drives.read(e, kind)
    }
}

/// The actuators of `root` that are read, and for each that is written its index among them.
pub(super) fn read(
    root: &Element,
    compiler: &Compiler,
    classes: &Classes,
    model: &Model,
    names: &Names,
) -> Result<(Vec<Actuator>, Vec<Option<usize>>), MjcfError> {
    // Known when the first damping ratio asks for it.
    let reflected = OnceCell::new();
    let (mut all, mut taken) = (Vec::new(), Taken::default());
    let mut written = Vec::new();
    for e in root.in_sections("actuator") {
        let built = build(e, compiler, classes, (model, names), &reflected)?;
        written.push(built.is_some().then_some(all.len()));
        let Some(actuator) = built else { continue };
        taken.add(e, "actuator")?;
        all.push(actuator);
    }
    Ok((all, written))
}

fn build(
    e: &Element,
    compiler: &Compiler,
    classes: &Classes,
    (model, names): (&Model, &Names),
    reflected: &OnceCell<Option<Reflected>>,
) -> Result<Option<Actuator>, MjcfError> {
    let Some(kind) = DriveKind::of(&e.tag) else {
        e.refuse("left out: actuators of this kind are not read");
        return Ok(None);
    };
    let Some(transmission) = transmission(e, model, names)? else { return Ok(None) };
    e.take();
    let mut spec = classes.of(e, MAIN)?.actuator.clone();
    let drive = spec.read(e, kind)?;
    let Some((mut gain, mut bias, dynamics)) = drive.resolved() else {
        e.refuse("left out: gains, biases or dynamics of its kind are not read");
        return Ok(None);
    };
    let gear = spec.gear[0];
    if drive.has_damping_ratio() {
        let reflected = reflected.get_or_init(|| Reflected::new(model)).as_ref();
        let mass = reflected.map(|r| r.of(model, transmission, gear)).ok_or_else(|| {
            e.invalid("dampratio", "needs mass: some of what moves weighs nothing")
        })?;
        bias[2] = -2.0 * bias[2] * (gain[0] * mass).sqrt();
    }
    // Nothing drives with a gain of minus zero.
    [&mut gain, &mut bias].into_iter().flatten().for_each(|x| *x += 0.0);
    let range =
        |fields, (range, limited): ([f64; 2], Limited)| compiler.range(e, fields, limited, range);
    let mut control_range = range(["ctrllimited", "ctrlrange"], spec.control)?;
    let mut activation_range = range(["actlimited", "actrange"], spec.activation)?;
    if drive.inherit_range > 0.0 {
        let own = match transmission {
            Transmission::Joint(joint) => model.joint(joint).range,
            Transmission::Tendon(tendon) => model.tendons[tendon].range,
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
        force_range: range(["forcelimited", "forcerange"], spec.force)?,
        activation_range,
    }))
}

/// What the actuator `e` pulls at; `None`, after a refusal, where that is not read.
fn transmission(
    e: &Element,
    model: &Model,
    names: &Names,
) -> Result<Option<Transmission>, MjcfError> {
    if e.has("tendon") {
        let found = names.tendon(e, "tendon")?;
        if found.is_none() {
            e.refuse("left out: the tendon that it pulls at is not read");
        }
        return Ok(found.map(Transmission::Tendon));
    }
    let field = ["joint", "jointinparent"].into_iter().find(|f| e.has(f));
    let Some(field) = field else {
        e.refuse("left out: it pulls neither at a joint nor at a tendon");
        return Ok(None);
    };
    let joint = names.joint(e, field)?;
    if model.joint(joint).kind.velocities() > 1 {
        e.refuse("left out: it pulls neither at a hinge nor at a slide");
        return Ok(None);
    }
    Ok(Some(Transmission::Joint(joint)))
}
