//! How a body moves with respect to its parent.

use nalgebra::{Isometry3, Point3, Unit, Vector3};

use super::compiler::Compiler;
use super::element::Element;
use super::error::Result;
use super::solver::SolverParameters;
use super::value::{FORCE_RANGE, Limits, RANGE};

/// The motions that a joint allows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JointKind {
    /// Turning about the axis through the anchor \[rad\].
    #[default]
    Hinge,
    /// Sliding along the axis \[m\].
    Slide,
    /// Any rotation about the anchor.
    Ball,
    /// Any motion; of bodies in the world only.
    Free,
}

impl JointKind {
    /// Numbers of its position: quaternions (w, x, y, z) have four, and the position of a free body comes before its.
    pub fn positions(self) -> usize {
        match self {
            Self::Hinge | Self::Slide => 1,
            Self::Ball => 4,
            Self::Free => 7,
        }
    }

    /// Its degrees of freedom.
    pub fn velocities(self) -> usize {
        match self {
            Self::Hinge | Self::Slide => 1,
            Self::Ball => 3,
            Self::Free => 6,
        }
    }
}

/// A joint of a body. Where a body has several, they act one after the other, the first nearest to the parent.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name, empty where it has none.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// The axis of a hinge or slide, in the body's frame.
    pub axis: Unit<Vector3<f64>>,
    /// The point that a hinge or ball turns about, in the body's frame \[m\].
    pub anchor: Point3<f64>,
    /// Smallest and largest position \[rad or m\], where it is limited; the second is a ball's largest angle.
    pub range: Option<(f64, f64)>,
    /// Its position \[rad or m\] while the bodies are as the file places them: they move by the difference from it.
    pub reference: f64,
    /// Stiffness of its spring \[N m/rad or N/m\].
    pub stiffness: f64,
    /// Its force by the square and the cube of the deflection, where it is not linear.
    pub higher_stiffness: [f64; 2],
    /// The position at which that spring is slack \[rad or m\].
    pub spring_reference: f64,
    /// Viscous damping \[N m s/rad or N s/m\].
    pub damping: f64,
    /// The damper's force by v|v| and v³ of the rate v, where it is not linear.
    pub higher_damping: [f64; 2],
    /// Dry friction \[N m or N\].
    pub friction_loss: f64,
    /// Inertia of what turns with it behind gears \[kg m² or kg\].
    pub armature: f64,
    /// Smallest and largest sum of the actuators' forces on it \[N m or N\].
    pub actuator_force_range: Option<(f64, f64)>,
    /// How softly its range ends.
    pub limit_solver: SolverParameters,
    /// How far from the end of the range the limit begins to act \[rad or m\].
    pub limit_margin: f64,
    /// Whether the weight that is carried along it counts as an actuator's.
    pub carries_by_actuator: bool,
    /// Time constant \[s\] and damping ratio \[1\], both positive, that take the place of stiffness and damping: those of the inertia that the joint
    /// moves with all joints at their references, everything else free to move.
    pub spring_damper: Option<[f64; 2]>,
}

/// Attributes of a joint: the defaults of its class, replaced by those of its element.
#[derive(Clone, Default)]
pub(super) struct JointSpec {
    kind: JointKind,
    anchor: Vector3<f64>,
    /// Without one, z.
    axis: Option<Vector3<f64>>,
    range: Limits,
    /// Still in the angles of the file.
    reference: f64,
    spring_reference: f64,
    force_range: Limits,
    stiffness: [f64; 3],
    damping: [f64; 3],
    friction_loss: f64,
    armature: f64,
    limit: SolverParameters,
    margin: f64,
    carries_by_actuator: bool,
    spring_damper: Option<[f64; 2]>,
}

impl JointSpec {
    pub(super) fn read(&mut self, e: &Element, _: &Compiler) -> Result<()> {
        let kinds = [
            ("hinge", JointKind::Hinge),
            ("slide", JointKind::Slide),
            ("ball", JointKind::Ball),
            ("free", JointKind::Free),
        ];
        self.kind = e.keyword("type", &kinds)?.unwrap_or(self.kind);
        self.anchor = e.numbers("pos")?.map_or(self.anchor, Vector3::from);
        self.axis = e.numbers("axis")?.map(Vector3::from).or(self.axis);
        self.range.read(e, RANGE)?;
        self.reference = e.number("ref")?.unwrap_or(self.reference);
        self.spring_reference = e.number("springref")?.unwrap_or(self.spring_reference);
        self.force_range.read(e, FORCE_RANGE)?;
        self.stiffness = e.coefficients("stiffness")?.unwrap_or(self.stiffness);
        self.damping = e.coefficients("damping")?.unwrap_or(self.damping);
        self.friction_loss = e.magnitude("frictionloss")?.unwrap_or(self.friction_loss);
        self.armature = e.magnitude("armature")?.unwrap_or(self.armature);
        self.margin = e.number("margin")?.unwrap_or(self.margin);
        self.carries_by_actuator =
            e.switch("actuatorgravcomp")?.unwrap_or(self.carries_by_actuator);
        self.spring_damper = e.numbers("springdamper")?.or(self.spring_damper);
        self.limit.read(e, ["solreflimit", "solimplimit"])
    }

    /// The joint of `e`, which lies in a frame of its body's.
    pub(super) fn build(
        self,
        e: &Element,
        compiler: &Compiler,
        t_body_frame: &Isometry3<f64>,
    ) -> Result<Joint> {
        let axis = Unit::try_new(t_body_frame * self.axis.unwrap_or(Vector3::z()), 1e-14)
            .ok_or_else(|| e.invalid("axis", "must not be zero"))?;
        let is_angle = matches!(self.kind, JointKind::Hinge | JointKind::Ball);
        let angle = |x: f64| if is_angle { compiler.angle(x) } else { x };
        let range = match self.kind {
            JointKind::Free => None,
            _ => compiler.range(e, RANGE, self.range)?,
        };
        if self.kind == JointKind::Ball && range.is_some_and(|(low, _)| low != 0.0) {
            return Err(e.invalid("range", "of a ball must begin at zero"));
        }
        let single = matches!(self.kind, JointKind::Hinge | JointKind::Slide);
        let position = |x: f64| if single { angle(x) } else { 0.0 };
        let force = match single {
            true => compiler.range(e, FORCE_RANGE, self.force_range)?,
            false => None,
        };
        Ok(Joint {
            name: e.name(),
            kind: self.kind,
            axis,
            anchor: t_body_frame * Point3::from(self.anchor),
            range: range.map(|(low, high)| (angle(low), angle(high))),
            reference: position(self.reference),
            stiffness: self.stiffness[0],
            higher_stiffness: [self.stiffness[1], self.stiffness[2]],
            spring_reference: position(self.spring_reference),
            damping: self.damping[0],
            higher_damping: [self.damping[1], self.damping[2]],
            friction_loss: self.friction_loss,
            armature: self.armature,
            actuator_force_range: force,
            limit_solver: self.limit,
            limit_margin: self.margin,
            carries_by_actuator: self.carries_by_actuator,
            spring_damper: self.spring_damper.filter(|of| of.iter().all(|x| *x > 0.0)),
        })
    }

    /// The joint of a `freejoint` element, which has no class.
    pub(super) fn free(e: &Element, compiler: &Compiler) -> Result<Joint> {
        let free = Self { kind: JointKind::Free, ..Self::default() };
        free.build(e, compiler, &Isometry3::identity())
    }
}
