//! Tendons: sums of joints, and cables through sites, over pulleys and around geoms.

use nalgebra::{Isometry3, Point3};

use super::class::{Class, Classes, MAIN};
use super::compiler::{Compiler, Compilers};
use super::element::Element;
use super::error::Result;
use super::names::{Names, Taken};
use super::solver::SolverParameters;
use super::value::{FORCE_RANGE, Limits, RANGE};
use super::{JointIndex, Model, Shape};

/// A joint's part in a tendon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TendonJoint {
    /// A hinge or a slide.
    pub joint: JointIndex,
    /// Length for its position \[m/rad or 1, or as the file means it\].
    pub coefficient: f64,
}

/// A point or an obstacle along a cable. Of bodies, `None` is the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TendonPart {
    /// It runs through this point.
    Site {
        /// The body.
        body: Option<usize>,
        /// In the body's frame \[m\].
        point: Point3<f64>,
    },
    /// Between the sites before and after, it runs around a sphere, or a cylinder about the z axis.
    Around {
        /// The body.
        body: Option<usize>,
        /// The obstacle's frame → body frame.
        t_body_geom: Isometry3<f64>,
        /// \[m\]
        radius: f64,
        /// Whether it is a cylinder, which has no ends here.
        is_cylinder: bool,
        /// A body and a point in its frame \[m\] on whose side it runs: inside, where the point is in the obstacle.
        side: Option<(Option<usize>, Point3<f64>)>,
    },
    /// From here on its length is divided by `divisor`, and it need not begin where it ended before.
    Pulley {
        /// \[1\]
        divisor: f64,
    },
}

/// A tendon, whose length is a sum of joint positions, each times its coefficient, or that of a cable.
#[derive(Clone, Debug, PartialEq)]
pub struct Tendon {
    /// Its name, empty where it has none.
    pub name: String,
    /// The joints along it; none of a cable.
    pub joints: Vec<TendonJoint>,
    /// The parts of a cable, one after the other.
    pub parts: Vec<TendonPart>,
    /// Smallest and largest length, where it is limited.
    pub range: Option<(f64, f64)>,
    /// Stiffness of its spring, force for length.
    pub stiffness: f64,
    /// Its force by the square and the cube of the deflection, where it is not linear.
    pub higher_stiffness: [f64; 2],
    /// The lengths between which its spring is slack; `None` of a cable is its length with all joints at their spring's reference.
    pub spring_range: Option<(f64, f64)>,
    /// Viscous damping, force for the length's rate.
    pub damping: f64,
    /// The damper's force by v|v| and v³ of the rate v, where it is not linear.
    pub higher_damping: [f64; 2],
    /// Dry friction, a force.
    pub friction_loss: f64,
    /// Inertia of what moves with its length.
    pub armature: f64,
    /// Smallest and largest sum of the actuators' forces on it.
    pub actuator_force_range: Option<(f64, f64)>,
    /// How softly its range ends.
    pub limit_solver: SolverParameters,
}

/// Attributes of a tendon: the defaults of its class, replaced by those of its element.
#[derive(Clone, Default)]
pub(super) struct TendonSpec {
    range: Limits,
    force_range: Limits,
    stiffness: [f64; 3],
    /// Without one, or of −1, it is to be found from the joints.
    spring: Option<[f64; 2]>,
    damping: [f64; 3],
    friction_loss: f64,
    armature: f64,
    limit: SolverParameters,
}

impl TendonSpec {
    pub(super) fn read(&mut self, e: &Element) -> Result<()> {
        self.range.read(e, RANGE)?;
        self.force_range.read(e, FORCE_RANGE)?;
        self.stiffness = e.coefficients("stiffness")?.unwrap_or(self.stiffness);
        if let Some(length) = e.list("springlength", 2)? {
            self.spring = match length[..] {
                [low, high] => Some([low, high]),
                [one] => Some([one; 2]),
                _ => return Err(e.invalid("springlength", "must have 1 or 2 numbers")),
            };
        }
        self.damping = e.coefficients("damping")?.unwrap_or(self.damping);
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
    ) -> Result<Tendon> {
        let (mut joints, mut parts) = (Vec::new(), Vec::new());
        if e.tag == "spatial" {
            parts = cable(e, model, names)?;
        }
        for part in e.sections("joint") {
            let joint = names.single_joint(part, "joint", model)?;
            let coefficient = part.number("coef")?.ok_or_else(|| part.missing("coef"))?;
            joints.push(TendonJoint { joint, coefficient });
        }
        if joints.is_empty() && parts.is_empty() {
            return Err(e.misplaced("a tendon needs a joint"));
        }
        let slack = |t: &TendonJoint| t.coefficient * model.joint(t.joint).spring_reference;
        let spring_range = match self.spring.filter(|lengths| *lengths != [-1.0; 2]) {
            None if !joints.is_empty() => Some([joints.iter().map(slack).sum(); 2]),
            written => written,
        };
        Ok(Tendon {
            name: e.name(),
            joints,
            parts,
            range: compiler.range(e, RANGE, self.range)?,
            stiffness: self.stiffness[0],
            higher_stiffness: [self.stiffness[1], self.stiffness[2]],
            spring_range: spring_range.map(<(f64, f64)>::from),
            damping: self.damping[0],
            higher_damping: [self.damping[1], self.damping[2]],
            friction_loss: self.friction_loss,
            armature: self.armature,
            actuator_force_range: compiler.range(e, FORCE_RANGE, self.force_range)?,
            limit_solver: self.limit,
        })
    }
}

/// The tendons of `root`.
pub(super) fn read(
    root: &Element,
    compilers: &Compilers,
    classes: &Classes,
    model: &Model,
    names: &Names,
) -> Result<Vec<Tendon>> {
    let (mut all, mut taken) = (Vec::new(), Taken::default());
    for e in root.in_sections("tendon") {
        if !matches!(e.tag.as_str(), "fixed" | "spatial") {
            e.refuse("left out: tendons are fixed or spatial");
            continue;
        }
        e.take();
        let class: &Class = classes.of(e, MAIN)?;
        let mut spec = class.tendon.clone();
        spec.read(e)?;
        taken.add(e, "tendon")?;
        all.push(spec.build(e, compilers.of(e), model, names)?);
    }
    Ok(all)
}

/// The parts of a cable.
fn cable(e: &Element, model: &Model, names: &Names) -> Result<Vec<TendonPart>> {
    let mut parts = Vec::new();
    let point = |part: &Element, field| -> Result<_> {
        let (body, t_body_site) = names.sites.get(part, field)?;
        Ok((body, Point3::from(t_body_site.translation.vector)))
    };
    for part in &e.children {
        part.take();
        parts.push(match part.tag.as_str() {
            "site" => {
                let (body, point) = point(part, "site")?;
                TendonPart::Site { body, point }
            }
            "geom" => {
                let side = part.has("sidesite").then(|| point(part, "sidesite")).transpose()?;
                let (body, geom) = names.geom(part, "geom", model)?;
                let (radius, is_cylinder) = match geom.shape {
                    Shape::Sphere { radius } => (radius, false),
                    Shape::Cylinder { radius, .. } => (radius, true),
                    _ => return Err(part.invalid("geom", "is neither a sphere nor a cylinder")),
                };
                let t_body_geom = geom.t_body_geom;
                TendonPart::Around { body, t_body_geom, radius, is_cylinder, side }
            }
            "pulley" => {
                let divisor = part.number("divisor")?.ok_or_else(|| part.missing("divisor"))?;
                if divisor <= 0.0 {
                    return Err(part.invalid("divisor", "must be positive"));
                }
                TendonPart::Pulley { divisor }
            }
            _ => return Err(part.misplaced("is neither a site nor a geom nor a pulley")),
        });
    }
    // Obstacles lie between sites, and a cable has two ends.
    let is_site = |k: Option<usize>| {
        k.and_then(|k| parts.get(k)).is_some_and(|p| matches!(p, TendonPart::Site { .. }))
    };
    for (k, part) in parts.iter().enumerate() {
        let fits = match part {
            TendonPart::Around { .. } => is_site(k.checked_sub(1)) && is_site(Some(k + 1)),
            TendonPart::Site { .. } => {
                let after =
                    parts.get(k + 1).is_some_and(|p| !matches!(p, TendonPart::Pulley { .. }));
                after || k > 0 && !matches!(parts[k - 1], TendonPart::Pulley { .. })
            }
            TendonPart::Pulley { .. } => is_site(Some(k + 1)),
        };
        if !fits {
            return Err(e.children[k].misplaced("a cable leads from site to site"));
        }
    }
    if parts.is_empty() {
        return Err(e.misplaced("a tendon needs two sites"));
    }
    Ok(parts)
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
        let (low, high) = fixed("").unwrap().spring_range.unwrap();
        assert!((low - 0.1).abs() < 1e-15 && low == high);
        assert_eq!(fixed("springlength=\"0.5\"").unwrap().spring_range, Some((0.5, 0.5)));
        assert_eq!(fixed("springlength=\"0.5 1\"").unwrap().spring_range, Some((0.5, 1.0)));
        assert!(fixed("springlength=\"\"").unwrap_err().contains("springlength must have"));
        assert!(read("<fixed/>").unwrap_err().contains("fixed: a tendon needs a joint"));
        let error = read("<fixed><joint joint=\"z\" coef=\"1\"/></fixed>").unwrap_err();
        assert!(error.contains("joint names 'z'"), "{error}");
        let error = read("<fixed><joint joint=\"x\"/></fixed>").unwrap_err();
        assert!(error.contains("coef is missing"), "{error}");
    }
}
