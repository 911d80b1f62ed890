//! Gains and biases of actuators, and the shorthands for them.

use super::actuator::Dynamics;
use super::element::Element;
use super::error::MjcfError;

/// The elements for actuators that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DriveKind {
    General,
    Motor,
    Position,
    Velocity,
    IntegratedVelocity,
    Damper,
}

impl DriveKind {
    const ALL: [(&str, Self); 6] = [
        ("general", Self::General),
        ("motor", Self::Motor),
        ("position", Self::Position),
        ("velocity", Self::Velocity),
        ("intvelocity", Self::IntegratedVelocity),
        ("damper", Self::Damper),
    ];

    pub(super) fn of(tag: &str) -> Option<Self> {
        Self::ALL.iter().find(|(word, _)| *word == tag).map(|(_, kind)| *kind)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// No force at all, for biases.
    None,
    /// The first parameter.
    Fixed,
    /// Three parameters: constant, by length, by rate.
    Affine,
    /// Muscles, motors with electrical parts, functions of users.
    Other,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Activation {
    None,
    Integrator,
    Filter,
    Other,
}

/// How an actuator makes force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drive {
    gain_form: Form,
    gain: [f64; 3],
    bias_form: Form,
    /// The last, where it is positive and the others are those of a spring, is a damping ratio.
    bias: [f64; 3],
    activation: Activation,
    time_constant: f64,
    /// The control's range in half ranges of what the actuator pulls at; zero does not set it.
    pub(super) inherit_range: f64,
}

impl Drive {
    const GENERAL: Self = Self {
        gain_form: Form::Fixed,
        gain: [1.0, 0.0, 0.0],
        bias_form: Form::None,
        bias: [0.0; 3],
        activation: Activation::None,
        time_constant: 1.0,
        inherit_range: 0.0,
    };

    /// Gain, bias and dynamics; `None` where they are of a form that is not read.
    pub(super) fn resolved(&self) -> Option<([f64; 3], [f64; 3], Dynamics)> {
        let of = |form, values: [f64; 3]| match form {
            Form::None => Some([0.0; 3]),
            Form::Fixed => Some([values[0], 0.0, 0.0]),
            Form::Affine => Some(values),
            Form::Other => None,
        };
        let dynamics = match self.activation {
            Activation::None => Dynamics::Direct,
            Activation::Integrator => Dynamics::Integrator,
            Activation::Filter => Dynamics::Filter(self.time_constant),
            Activation::Other => return None,
        };
        Some((of(self.gain_form, self.gain)?, of(self.bias_form, self.bias)?, dynamics))
    }

    /// Whether the last bias is the damping ratio of a servo of positions.
    pub(super) fn has_damping_ratio(&self) -> bool {
        let is_servo = self.gain_form == Form::Fixed && self.bias_form == Form::Affine;
        is_servo && self.bias[2] > 0.0 && self.gain[0] == -self.bias[1]
    }

    fn read_general(&mut self, e: &Element) -> Result<(), MjcfError> {
        let gains = [
            ("fixed", Form::Fixed),
            ("affine", Form::Affine),
            ("muscle", Form::Other),
            ("user", Form::Other),
        ];
        let biases = [
            ("none", Form::None),
            ("affine", Form::Affine),
            ("muscle", Form::Other),
            ("user", Form::Other),
        ];
        let dynamics = [
            ("none", Activation::None),
            ("integrator", Activation::Integrator),
            ("filter", Activation::Filter),
            ("filterexact", Activation::Filter),
            ("muscle", Activation::Other),
            ("user", Activation::Other),
        ];
        self.gain_form = e.keyword("gaintype", &gains)?.unwrap_or(self.gain_form);
        self.bias_form = e.keyword("biastype", &biases)?.unwrap_or(self.bias_form);
        self.activation = e.keyword("dyntype", &dynamics)?.unwrap_or(self.activation);
        for (field, values) in [("gainprm", &mut self.gain), ("biasprm", &mut self.bias)] {
            for (old, new) in values.iter_mut().zip(e.list(field, 10)?.unwrap_or_default()) {
                *old = new;
            }
        }
        let constant = e.list("dynprm", 10)?.and_then(|list| list.first().copied());
        self.time_constant = constant.unwrap_or(self.time_constant);
        Ok(())
    }

    /// Of a servo that holds the length at its input.
    fn read_position(&mut self, e: &Element) -> Result<(), MjcfError> {
        let stiffness = e.number("kp")?.unwrap_or(self.gain[0]);
        let damping = e.magnitude("kv")?.map(|kv| -kv);
        let ratio = e.magnitude("dampratio")?;
        if damping.is_some() && ratio.is_some() {
            return Err(e.invalid("dampratio", "is given beside kv"));
        }
        let last = damping.or(ratio).unwrap_or(self.bias[2]);
        (self.gain_form, self.gain) = (Form::Fixed, [stiffness, 0.0, 0.0]);
        (self.bias_form, self.bias) = (Form::Affine, [0.0, -stiffness, last]);
        self.inherit_range = e.magnitude("inheritrange")?.unwrap_or(self.inherit_range);
        Ok(())
    }
}

/// A drive for each element that an actuator may be written with.
///
/// What a default class says of one of the shorthands also is what `general` begins with, and what it says of `general`
/// all of them begin with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drives([Drive; 6]);

impl Default for Drives {
    fn default() -> Self {
        Self([Drive::GENERAL; 6])
    }
}

impl Drives {
    /// Reads `e` and returns what it has become.
    pub(super) fn read(&mut self, e: &Element, kind: DriveKind) -> Result<Drive, MjcfError> {
        let drive = &mut self.0[kind as usize];
        match kind {
            DriveKind::General => drive.read_general(e)?,
            DriveKind::Motor => *drive = Drive::GENERAL,
            DriveKind::Position => {
                drive.read_position(e)?;
                if let Some(constant) = e.magnitude("timeconst")? {
                    drive.time_constant = constant;
                    drive.activation =
                        if constant > 0.0 { Activation::Filter } else { Activation::None };
                }
            }
            DriveKind::Velocity => {
                let damping = e.number("kv")?.unwrap_or(drive.gain[0]);
                *drive = Drive {
                    gain: [damping, 0.0, 0.0],
                    bias_form: Form::Affine,
                    bias: [0.0, 0.0, -damping],
                    ..Drive::GENERAL
                };
            }
            DriveKind::IntegratedVelocity => {
                drive.read_position(e)?;
                drive.activation = Activation::Integrator;
            }
            DriveKind::Damper => {
                let damping = e.magnitude("kv")?.unwrap_or(-drive.gain[2]);
                let gain = [0.0, 0.0, -damping];
                *drive = Drive { gain_form: Form::Affine, gain, ..Drive::GENERAL };
            }
        }
        let drive = *drive;
        if kind == DriveKind::General {
            for other in &mut self.0[1..] {
                (other.gain, other.bias) = (drive.gain, drive.bias);
            }
        } else {
            self.0[DriveKind::General as usize] = drive;
        }
        Ok(drive)
    }
}
