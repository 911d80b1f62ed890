//! Tendons that are sums of joints.

use super::class::{Class, Classes, MAIN};
use super::compiler::Compiler;
use super::element::Element;
use super::error::MjcfError;
use super::names::{Names, Taken};
use super::solver::SolverParameters;
use super::value::Limited;
use super::{JointIndex, Model};

/// A joint's part in a tendon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TendonJoint {
    /// A hinge or a slide.
    pub joint: JointIndex,
    /// Length for its position \[m/rad or 1, or as the file means it\].
    pub coefficient: f64,
}

/// A tendon whose length is a sum of joint positions, each times its coefficient.
#[derive(Clone, Debug, PartialEq)]
pub struct Tendon {
    /// Its name, empty where it has none.
    pub name: String,
    /// The joints along it.
    pub joints: Vec<TendonJoint>,
    /// Smallest and largest length, where it is limited.
    pub range: Option<(f64, f64)>,
    /// Stiffness of its spring, force for length.
    pub stiffness: f64,
    /// The lengths between which its spring is slack.
    pub spring_range: (f64, f64),
    /// Viscous damping, force for the length's rate.
    pub damping: f64,
    /// Dry friction, a force.
    pub friction_loss: f64,
    /// Inertia of what moves with its length.
    pub armature: f64,
    /// Smallest and largest sum of the actuators' forces on it.
    pub actuator_force_range: Option<(f64, f64)>,
    /// How softly its range ends.
    pub limit_solver: SolverParameters,
}

/// What is known of a tendon before it is complete.
#[derive(Clone)]
pub(super) struct Spec {
    range: [f64; 2],
    limited: Limited,
    force_range: [f64; 2],
    force_limited: Limited,
    stiffness: f64,
    /// Negative where it is to be found from the joints.
    spring: [f64; 2],
    damping: f64,
    friction_loss: f64,
    armature: f64,
    limit: SolverParameters,
}

impl Default for Spec {
    fn default() -> Self {
        Self {
            range: [0.0; 2],
            limited: Limited::Auto,
            force_range: [0.0; 2],
            force_limited: Limited::Auto,
            stiffness: 0.0,
            spring: [-1.0; 2],
            damping: 0.0,
            friction_loss: 0.0,
            armature: 0.0,
            limit: SolverParameters::default(),
        }
    }
}

impl Spec {
    pub(super) fn read(&mut self, e: &Element) -> Result<(), MjcfError> {
        self.range = e.numbers("range")?.unwrap_or(self.range);
        self.limited = e.limited("limited")?.unwrap_or(self.limited);
        self.force_range = e.numbers("actuatorfrcrange")?.unwrap_or(self.force_range);
        self.force_limited = e.limited("actuatorfrclimited")?.unwrap_or(self.force_limited);
        self.stiffness = e.coefficient("stiffness")?.unwrap_or(self.stiffness);
        if let Some(length) = e.list("springlength", 2)? {
            self.spring = match length[..] {
                [low, high] => [low, high],
                [one] => [one; 2],
                _ => return Err(e.invalid("springlength", "must have 1 or 2 numbers")),
            };
        }
        self.damping = e.coefficient("damping")?.unwrap_or(self.damping);
        self.friction_loss = e.magnitude("frictionloss")?.unwrap_or(self.friction_loss);
        self.armature = e.magnitude("armature")?.unwrap_or(self.armature);
        self.limit.read(e, ["solreflimit", "solimplimit"])
    }

    fn build(
        self,
        e: &Element,
        compiler: &Compiler,
        model: &Model,
        names: &Names,
    ) -> Result<Tendon, MjcfError> {
        let mut joints = Vec::new();
        for part in e.sections("joint") {
            let joint = names.single_joint(part, "joint", model)?;
            let coefficient = part.number("coef")?.ok_or_else(|| part.missing("coef"))?;
            joints.push(TendonJoint { joint, coefficient });
        }
        if joints.is_empty() {
            return Err(e.misplaced("a tendon needs a joint"));
        }
        let slack = |t: &TendonJoint| t.coefficient * model.joint(t.joint).spring_reference;
        let spring_range = match self.spring {
            [-1.0, -1.0] => [joints.iter().map(slack).sum(); 2],
            written => written,
        };
        let force = ["actuatorfrclimited", "actuatorfrcrange"];
        Ok(Tendon {
            name: e.name(),
            joints,
            range: compiler.range(e, ["limited", "range"], self.limited, self.range)?,
            stiffness: self.stiffness,
            spring_range: spring_range.into(),
            damping: self.damping,
            friction_loss: self.friction_loss,
            armature: self.armature,
            actuator_force_range: compiler.range(e, force, self.force_limited, self.force_range)?,
            limit_solver: self.limit,
        })
    }
}

/// The fixed tendons of `root`.
pub(super) fn read(
    root: &Element,
    compiler: &Compiler,
    classes: &Classes,
    model: &Model,
    names: &Names,
) -> Result<Vec<Tendon>, MjcfError> {
    let (mut all, mut taken) = (Vec::new(), Taken::default());
    for e in root.in_sections("tendon") {
        if e.tag != "fixed" {
            e.refuse("left out: only tendons that are sums of joints are read");
            continue;
        }
        e.take();
        let class: &Class = classes.of(e, MAIN)?;
        let mut spec = class.tendon.clone();
        spec.read(e)?;
        taken.add(e, "tendon")?;
        all.push(spec.build(e, compiler, model, names)?);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(tendon: &str) -> Result<Tendon, String> {
        let xml = format!(
            "<mujoco><worldbody><body><joint name=\"x\" type=\"slide\" springref=\"0.2\"/><joint name=\"y\" type=\"slide\" \
            springref=\"0.3\"/><geom size=\"1\"/></body></worldbody><tendon>{tendon}</tendon></mujoco>"
        );
        let mut model = Model::from_str(&xml, None).map_err(|e| e.to_string())?;
        Ok(model.tendons.remove(0))
    }

    #[test]
    fn springs_are_slack_where_those_of_the_joints_are() {
        let fixed = |attributes: &str| {
            read(&format!(
                "<fixed name=\"t\" {attributes}><joint joint=\"x\" coef=\"2\"/><joint joint=\"y\" coef=\"-1\"/></fixed>"
            ))
        };
        let (low, high) = fixed("").unwrap().spring_range;
        assert!((low - 0.1).abs() < 1e-15 && low == high);
        assert_eq!(fixed("springlength=\"0.5\"").unwrap().spring_range, (0.5, 0.5));
        assert_eq!(fixed("springlength=\"0.5 1\"").unwrap().spring_range, (0.5, 1.0));
        assert!(fixed("springlength=\"\"").unwrap_err().contains("springlength must have"));
        assert!(read("<fixed/>").unwrap_err().contains("fixed: a tendon needs a joint"));
        let error = read("<fixed><joint joint=\"z\" coef=\"1\"/></fixed>").unwrap_err();
        assert!(error.contains("joint names 'z'"), "{error}");
        let error = read("<fixed><joint joint=\"x\"/></fixed>").unwrap_err();
        assert!(error.contains("coef is missing"), "{error}");
    }
}
