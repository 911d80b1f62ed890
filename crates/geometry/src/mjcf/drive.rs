//! Gains and biases of actuators, and the shorthands for them.

use super::actuator::{Dynamics, Muscle};
use super::element::Element;
use super::error::Result;

/// The elements for actuators that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DriveKind {
    General,
    Motor,
    Position,
    Velocity,
    IntegratedVelocity,
    Damper,
    Cylinder,
    Adhesion,
    Muscle,
}

impl DriveKind {
    const ALL: [(&str, Self); 9] = [
        ("general", Self::General),
        ("motor", Self::Motor),
        ("position", Self::Position),
        ("velocity", Self::Velocity),
        ("intvelocity", Self::IntegratedVelocity),
        ("damper", Self::Damper),
        ("cylinder", Self::Cylinder),
        ("adhesion", Self::Adhesion),
        ("muscle", Self::Muscle),
    ];

    pub(super) fn of(tag: &str) -> Option<Self> {
        Self::ALL.iter().find(|(word, _)| *word == tag).map(|(_, kind)| *kind)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum DriveForm {
    /// No force at all, for biases.
    None,
    /// The first parameter.
    Fixed,
    /// Three parameters: constant, by length, by rate.
    Affine,
    Muscle,
    /// Motors with electrical parts, functions of users.
    Other,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Activation {
    None,
    Integrator,
    Filter,
    ExactFilter,
    Muscle,
    Other,
}

/// How an actuator makes force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drive {
    gain_form: DriveForm,
    gain: [f64; 3],
    bias_form: DriveForm,
    /// The last, where it is positive and the others are those of a spring, is a damping ratio.
    bias: [f64; 3],
    activation: Activation,
    time_constant: f64,
    /// Parameters of a muscle: two time constants and the width between, and the parameters of its gain.
    muscle: ([f64; 3], [f64; 9]),
    /// The control's range in half ranges of what the actuator pulls at; zero does not set it.
    pub(super) inherit_range: f64,
}

impl Drive {
    const GENERAL: Self = Self {
        gain_form: DriveForm::Fixed,
        gain: [1.0, 0.0, 0.0],
        bias_form: DriveForm::None,
        bias: [0.0; 3],
        activation: Activation::None,
        time_constant: 1.0,
        muscle: ([0.01, 0.04, 0.0], [0.75, 1.05, -1.0, 200.0, 0.5, 1.6, 1.5, 1.3, 1.2]),
        inherit_range: 0.0,
    };

    /// Gain, bias and dynamics; `None` where they are of a form that is not read.
    pub(super) fn resolved(&self) -> Option<([f64; 3], [f64; 3], Dynamics)> {
        let of = |form, values: [f64; 3]| match form {
            DriveForm::None | DriveForm::Muscle => Some([0.0; 3]),
            DriveForm::Fixed => Some([values[0], 0.0, 0.0]),
            DriveForm::Affine => Some(values),
            DriveForm::Other => None,
        };
        let dynamics = match self.activation {
            Activation::None => Dynamics::Direct,
            Activation::Integrator => Dynamics::Integrator,
            Activation::Filter | Activation::ExactFilter => Dynamics::Filter(self.time_constant),
            Activation::Muscle => Dynamics::Muscle(self.muscle.0),
            Activation::Other => return None,
        };
        Some((of(self.gain_form, self.gain)?, of(self.bias_form, self.bias)?, dynamics))
    }

    /// The muscle that it is, where it is one wholly, whose lengths have this range.
    pub(super) fn muscle(&self, length_range: Option<[f64; 2]>) -> Option<Muscle> {
        let [low, high, force, scale, shortest, longest, fastest, passive, stretching] =
            self.muscle.1;
        let [from, to] = length_range.filter(|[from, to]| from < to && low < high)?;
        let unit = (to - from) / (high - low);
        Some(Muscle {
            force: (force >= 0.0).then_some(force),
            scale,
            origin: from - low * unit,
            unit,
            lengths: [shortest, longest],
            fastest,
            passive,
            stretching,
        })
    }

    /// True if its gain, bias or dynamics are a muscle's, and whether all are.
    pub(super) fn is_muscle(&self) -> [bool; 2] {
        let parts = [
            self.gain_form == DriveForm::Muscle,
            self.bias_form == DriveForm::Muscle,
            self.activation == Activation::Muscle,
        ];
        [parts.contains(&true), !parts.contains(&false)]
    }

    /// Whether its filter is integrated exactly.
    pub(super) fn is_exact(&self) -> bool {
        self.activation == Activation::ExactFilter
    }

    /// Whether the last bias is the damping ratio of a servo of positions.
    pub(super) fn has_damping_ratio(&self) -> bool {
        let is_servo = self.gain_form == DriveForm::Fixed && self.bias_form == DriveForm::Affine;
        is_servo && self.bias[2] > 0.0 && self.gain[0] >= 0.0 && self.gain[0] == -self.bias[1]
    }

    fn read_general(&mut self, e: &Element) -> Result<()> {
        let gains = [
            ("fixed", DriveForm::Fixed),
            ("affine", DriveForm::Affine),
            ("muscle", DriveForm::Muscle),
            ("user", DriveForm::Other),
        ];
        let biases = [
            ("none", DriveForm::None),
            ("affine", DriveForm::Affine),
            ("muscle", DriveForm::Muscle),
            ("user", DriveForm::Other),
        ];
        let dynamics = [
            ("none", Activation::None),
            ("integrator", Activation::Integrator),
            ("filter", Activation::Filter),
            ("filterexact", Activation::ExactFilter),
            ("muscle", Activation::Muscle),
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
        if self.is_muscle()[0] {
            let (times, gain) = &mut self.muscle;
            for (field, values) in [("dynprm", &mut times[..]), ("gainprm", &mut gain[..])] {
                let list = e.list(field, 10)?.unwrap_or_default();
                values.iter_mut().zip(list).for_each(|(old, new)| *old = new);
            }
        }
        Ok(())
    }

    fn read_muscle(&mut self, e: &Element) -> Result<()> {
        (self.gain_form, self.bias_form) = (DriveForm::Muscle, DriveForm::Muscle);
        self.activation = Activation::Muscle;
        let (times, gain) = &mut self.muscle;
        e.leading("timeconst", &mut times[..2])?;
        e.leading("range", &mut gain[..2])?;
        times[2] = e.magnitude("tausmooth")?.unwrap_or(times[2]);
        let fields = ["force", "scale", "lmin", "lmax", "vmax", "fpmax", "fvmax"];
        for (field, value) in fields.into_iter().zip(&mut gain[2..]) {
            *value = e.number(field)?.unwrap_or(*value);
        }
        Ok(())
    }

    /// Reads a position servo: force kp (u − l) − kv v at the input u, the length l and its rate v.
    fn read_position(&mut self, e: &Element) -> Result<()> {
        let stiffness = e.number("kp")?.unwrap_or(self.gain[0]);
        let damping = e.magnitude("kv")?.map(|kv| -kv);
        let ratio = e.magnitude("dampratio")?;
        if damping.is_some() && ratio.is_some() {
            return Err(e.invalid("dampratio", "is given beside kv"));
        }
        if ratio.is_some() && stiffness < 0.0 {
            return Err(e.invalid("kp", "must not be negative beside a damping ratio"));
        }
        let last = damping.or(ratio).unwrap_or(self.bias[2]);
        (self.gain_form, self.gain) = (DriveForm::Fixed, [stiffness, 0.0, 0.0]);
        (self.bias_form, self.bias) = (DriveForm::Affine, [0.0, -stiffness, last]);
        self.inherit_range = e.magnitude("inheritrange")?.unwrap_or(self.inherit_range);
        Ok(())
    }
}

/// A drive for each element that an actuator may be written with.
///
/// In a default class, a shorthand also sets the defaults of `general`, and `general` sets gain and bias of all
/// shorthands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drives([Drive; 9]);

impl Default for Drives {
    fn default() -> Self {
        Self([Drive::GENERAL; 9])
    }
}

impl Drives {
    /// Reads `e` and returns what it has become.
    pub(super) fn read(&mut self, e: &Element, kind: DriveKind) -> Result<Drive> {
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
                    bias_form: DriveForm::Affine,
                    bias: [0.0, 0.0, -damping],
                    ..Drive::GENERAL
                };
            }
            DriveKind::IntegratedVelocity => {
                drive.read_position(e)?;
                drive.activation = Activation::Integrator;
            }
            DriveKind::Cylinder => {
                drive.time_constant = e.magnitude("timeconst")?.unwrap_or(drive.time_constant);
                drive.activation = Activation::Filter;
                let diameter = e.magnitude("diameter")?;
                let area = diameter.map(|d| 0.25 * std::f64::consts::PI * d * d);
                drive.gain[0] = area.or(e.magnitude("area")?).unwrap_or(drive.gain[0]);
                (drive.gain_form, drive.bias_form) = (DriveForm::Fixed, DriveForm::Affine);
                e.leading("bias", &mut drive.bias)?;
            }
            DriveKind::Adhesion => {
                let gain = e.magnitude("gain")?.unwrap_or(drive.gain[0]);
                *drive = Drive { gain: [gain, 0.0, 0.0], ..Drive::GENERAL };
            }
            DriveKind::Muscle => drive.read_muscle(e)?,
            DriveKind::Damper => {
                let damping = e.magnitude("kv")?.unwrap_or(-drive.gain[2]);
                let gain = [0.0, 0.0, -damping];
                *drive = Drive { gain_form: DriveForm::Affine, gain, ..Drive::GENERAL };
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

#[cfg(test)]
mod tests {
    use super::super::{Actuator, Dynamics, Model};

    fn actuators(defaults: &str, elements: &str) -> Result<Vec<Actuator>, String> {
        let xml = format!(
            "<mujoco><default>{defaults}</default><worldbody><body><joint name=\"y\" type=\"slide\" range=\"-1 3\"/>\
            <geom size=\"0.2\" mass=\"2\"/></body></worldbody><actuator>{elements}</actuator></mujoco>"
        );
        Model::from_str(&xml, None).map(|m| m.actuators).map_err(|e| e.to_string())
    }

    fn check(defaults: &str, element: &str, gain: [f64; 3], bias: [f64; 3]) {
        let found = actuators(defaults, &format!("<{element}/>")).unwrap();
        assert_eq!((found[0].gain, found[0].bias), (gain, bias), "{element} in {defaults}");
    }

    #[test]
    fn shorthands_are_gains_and_biases() {
        check("", "motor joint=\"y\"", [1.0, 0.0, 0.0], [0.0; 3]);
        check("", "position joint=\"y\" kp=\"5\" kv=\"2\"", [5.0, 0.0, 0.0], [0.0, -5.0, -2.0]);
        check("", "velocity joint=\"y\" kv=\"3\"", [3.0, 0.0, 0.0], [0.0, 0.0, -3.0]);
        check("", "damper joint=\"y\" kv=\"3\" ctrlrange=\"0 1\"", [0.0, 0.0, -3.0], [0.0; 3]);
        let bias = "biasprm=\"1 2 3\"";
        check(
            "",
            &format!("general joint=\"y\" gainprm=\"3 1\" {bias}"),
            [3.0, 0.0, 0.0],
            [0.0; 3],
        );
        let affine = format!("general joint=\"y\" biastype=\"affine\" {bias}");
        check("", &affine, [1.0, 0.0, 0.0], [1.0, 2.0, 3.0]);
    }

    /// All found with MuJoCo.
    #[test]
    fn classes_keep_a_drive_for_each_shorthand() {
        let (main, class) = ("joint=\"y\"", "joint=\"y\" class=\"r\"");
        let nested =
            "<position kp=\"5\" kv=\"2\"/><default class=\"r\"><velocity kv=\"3\"/></default>";
        check(nested, &format!("general {main}"), [5.0, 0.0, 0.0], [0.0, -5.0, -2.0]);
        check(nested, &format!("general {class}"), [3.0, 0.0, 0.0], [0.0, 0.0, -3.0]);
        check(nested, &format!("position {class}"), [5.0, 0.0, 0.0], [0.0, -5.0, -2.0]);
        check(nested, &format!("velocity {main}"), [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]);
        check(nested, &format!("intvelocity {class}"), [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]);
        check(nested, &format!("motor {class}"), [1.0, 0.0, 0.0], [0.0; 3]);
        let nested =
            "<velocity kv=\"7\"/><default class=\"r\"><general gainprm=\"2 1\"/></default>";
        check(nested, &format!("general {class}"), [2.0, 0.0, 0.0], [0.0, 0.0, -7.0]);
        check(nested, &format!("position {class}"), [2.0, 0.0, 0.0], [0.0, -2.0, -7.0]);
        check(nested, &format!("position {main}"), [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]);
    }

    #[test]
    fn damping_ratios_and_ranges_of_the_joint() {
        let servo = |more: &str| {
            actuators("", &format!("<position joint=\"y\" kp=\"8\" {more}/>")).unwrap()
        };
        let damped = &servo("dampratio=\"0.5\"")[0];
        assert_eq!((damped.damping_ratio, damped.bias), (Some(0.5), [0.0, -8.0, 0.0]));
        assert_eq!(servo("inheritrange=\"0.5\"")[0].control_range, Some((0.0, 2.0)));
        assert_eq!(servo("timeconst=\"0.1\"")[0].dynamics, Dynamics::Filter(0.1));
        let both = actuators("", "<position joint=\"y\" kv=\"1\" dampratio=\"1\"/>").unwrap_err();
        assert!(both.contains("position: dampratio is given beside kv"), "{both}");
        let none = actuators("", "<position joint=\"x\"/>").unwrap_err();
        assert!(none.contains("joint names 'x'"), "{none}");
    }
}
