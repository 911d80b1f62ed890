//! Constraints that hold bodies or joints together.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::class::{Classes, MAIN};
use super::element::Element;
use super::error::Result;
use super::names::Names;
use super::orientation::quaternion_wxyz;
use super::solver::SolverParameters;
use super::{JointIndex, Model};

/// A constraint between two bodies or joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Equality {
    /// Its name, empty where it has none.
    pub name: String,
    /// Kind, with the bodies, joints or tendons that it constrains.
    pub kind: EqualityKind,
    /// Whether it acts from the beginning.
    pub active: bool,
    /// How softly it holds.
    pub solver: SolverParameters,
}

/// Kind of an equality constraint. A body of `None` is the world.
#[derive(Clone, Debug, PartialEq)]
pub enum EqualityKind {
    /// A point of one body is at a point of the other.
    Connect {
        /// The bodies.
        bodies: [Option<usize>; 2],
        /// The point, in the frame of each body \[m\].
        anchors: [Point3<f64>; 2],
    },
    /// One body keeps its pose in the other.
    Weld {
        /// The bodies.
        bodies: [Option<usize>; 2],
        /// A point that stays together, in the frame of each body \[m\].
        anchors: [Point3<f64>; 2],
        /// Axes of the second body → axes of the first.
        rotation: UnitQuaternion<f64>,
        /// Length by which the error of the rotation is multiplied \[m/rad\].
        torque_scale: f64,
    },
    /// The first joint follows the second, or stays where it is.
    Joint {
        /// The first joint, and the second where there is one: hinges or slides.
        joints: (JointIndex, Option<JointIndex>),
        /// Coefficients c of q₁ − r₁ = c₀ + c₁x + … + c₄x⁴ with x = q₂ − r₂, both from their references r \[rad or m\]; x is
        /// zero without a second joint.
        polynomial: [f64; 5],
    },
    /// The length of the first tendon follows that of the second, or stays as it is.
    Tendon {
        /// The first tendon, and the second where there is one.
        tendons: (usize, Option<usize>),
        /// Coefficients as of joints, from their lengths with all joints at their references.
        polynomial: [f64; 5],
    },
}

/// Attributes of an equality constraint: the defaults of its class, replaced by those of its element.
#[derive(Clone)]
pub(super) struct EqualitySpec {
    active: bool,
    solver: SolverParameters,
}

impl Default for EqualitySpec {
    fn default() -> Self {
        Self { active: true, solver: SolverParameters::default() }
    }
}

impl EqualitySpec {
    pub(super) fn read(&mut self, e: &Element) -> Result<()> {
        self.active = e.switch("active")?.unwrap_or(self.active);
        self.solver.read(e, ["solref", "solimp"])
    }
}

/// The constraints of `root`.
pub(super) fn read(
    root: &Element,
    classes: &Classes,
    model: &Model,
    names: &Names,
) -> Result<Vec<Equality>> {
    let reader = EqualityReader { names, model, t_world_bodies: model.reference_poses() };
    let mut all = Vec::new();
    for e in root.in_sections("equality") {
        e.take();
        let mut spec = classes.of(e, MAIN)?.equality.clone();
        let kind = match e.tag.as_str() {
            "connect" => reader.connect(e)?,
            "weld" => reader.weld(e)?,
            "joint" => reader.joint(e)?,
            "tendon" => {
                let first = names.tendons.get(e, "tendon1")?;
                let second = if e.has("tendon2") { names.tendons.get(e, "tendon2")? } else { None };
                let Some(first) = first else { continue };
                let mut polynomial = [0.0, 1.0, 0.0, 0.0, 0.0];
                e.leading("polycoef", &mut polynomial)?;
                EqualityKind::Tendon { tendons: (first, second), polynomial }
            }
            _ => {
                e.refuse("left out: only connect, weld, joint and tendon are read");
                continue;
            }
        };
        spec.read(e)?;
        all.push(Equality { name: e.name(), kind, active: spec.active, solver: spec.solver });
    }
    Ok(all)
}

type Sites = ([Option<usize>; 2], [Isometry3<f64>; 2]);

struct EqualityReader<'a> {
    names: &'a Names,
    model: &'a Model,
    t_world_bodies: Vec<Isometry3<f64>>,
}

impl EqualityReader<'_> {
    fn bodies(&self, e: &Element) -> Result<[Option<usize>; 2]> {
        let first = self.names.bodies.get(e, "body1")?;
        let second = if e.has("body2") { self.names.bodies.get(e, "body2")? } else { None };
        Ok([first, second])
    }

    /// Pose of the second body in the first, with all joints at their references.
    fn t_first_second(&self, bodies: [Option<usize>; 2]) -> Isometry3<f64> {
        let [first, second] =
            bodies.map(|b| b.map_or(Isometry3::identity(), |b| self.t_world_bodies[b]));
        first.inv_mul(&second)
    }

    /// The bodies of the two sites, and their poses there.
    fn sites(&self, e: &Element) -> Result<Sites> {
        if let Some(field) = ["body1", "body2", "anchor", "relpose"].iter().find(|f| e.has(f)) {
            return Err(e.invalid(field, "is given beside site1 and site2"));
        }
        let (first, second) =
            (self.names.sites.get(e, "site1")?, self.names.sites.get(e, "site2")?);
        Ok(([first.0, second.0], [first.1, second.1]))
    }

    fn connect(&self, e: &Element) -> Result<EqualityKind> {
        if e.has("site1") || e.has("site2") {
            let (bodies, poses) = self.sites(e)?;
            let anchors = poses.map(|t| t.translation.vector.into());
            return Ok(EqualityKind::Connect { bodies, anchors });
        }
        let bodies = self.bodies(e)?;
        let anchor = e.numbers::<3>("anchor")?.ok_or_else(|| e.missing("anchor"))?;
        let first = Point3::from(anchor);
        let anchors = [first, self.t_first_second(bodies).inverse_transform_point(&first)];
        Ok(EqualityKind::Connect { bodies, anchors })
    }

    fn weld(&self, e: &Element) -> Result<EqualityKind> {
        let torque_scale = e.number("torquescale")?.unwrap_or(1.0);
        if e.has("site1") || e.has("site2") {
            let (bodies, poses) = self.sites(e)?;
            let anchors = poses.map(|t| t.translation.vector.into());
            let rotation = poses[0].rotation * poses[1].rotation.inverse();
            return Ok(EqualityKind::Weld { bodies, anchors, rotation, torque_scale });
        }
        let bodies = self.bodies(e)?;
        let second = Point3::from(e.numbers::<3>("anchor")?.unwrap_or_default());
        let written = e.numbers::<7>("relpose")?;
        let pose = written.and_then(|[x, y, z, q0, q1, q2, q3]| {
            Some((Vector3::new(x, y, z), quaternion_wxyz([q0, q1, q2, q3])?))
        });
        // A quaternion of zeros asks for the pose as it is. A pose that is written is that of the first body's anchor.
        let (first, rotation) = match pose {
            Some((first, rotation)) => (first.into(), rotation),
            None => {
                let t = self.t_first_second(bodies);
                (t * second, t.rotation)
            }
        };
        Ok(EqualityKind::Weld { bodies, anchors: [first, second], rotation, torque_scale })
    }

    fn joint(&self, e: &Element) -> Result<EqualityKind> {
        let first = self.names.single_joint(e, "joint1", self.model)?;
        let second = match e.has("joint2") {
            true => Some(self.names.single_joint(e, "joint2", self.model)?),
            false => None,
        };
        let mut polynomial = [0.0, 1.0, 0.0, 0.0, 0.0];
        e.leading("polycoef", &mut polynomial)?;
        Ok(EqualityKind::Joint { joints: (first, second), polynomial })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(element: &str) -> Result<Equality, String> {
        let xml = format!(
            "<mujoco><worldbody><body name=\"a\" pos=\"0 0 1\"><joint name=\"x\"/><geom size=\"1\"/><site name=\"s\" pos=\"0 1 0\"/>\
            </body><body name=\"b\" pos=\"0 1 1\" euler=\"0 0 90\"><joint type=\"ball\" name=\"y\"/><geom size=\"1\"/></body>\
            </worldbody><equality><{element}/></equality></mujoco>"
        );
        let mut model = Model::from_str(&xml, None).map_err(|e| e.to_string())?;
        Ok(model.equalities.remove(0))
    }

    #[test]
    fn points_and_poses_are_those_of_the_references() {
        let near = |a: Point3<f64>, b: [f64; 3]| (a - Point3::from(b)).norm() < 1e-15;
        let EqualityKind::Connect { bodies, anchors } =
            read("connect body1=\"a\" body2=\"b\" anchor=\"0 0 0.3\"").unwrap().kind
        else {
            panic!()
        };
        assert_eq!(bodies, [Some(0), Some(1)]);
        assert!(near(anchors[0], [0.0, 0.0, 0.3]) && near(anchors[1], [-1.0, 0.0, 0.3]));
        let EqualityKind::Weld { bodies, anchors, rotation, .. } =
            read("weld body1=\"b\" anchor=\"1 0 0\"").unwrap().kind
        else {
            panic!()
        };
        assert_eq!(bodies, [Some(1), None]);
        // The world's (1, 0, 0), seen by the turned body at (0, 1, 1).
        assert!(near(anchors[0], [-1.0, -1.0, -1.0]) && near(anchors[1], [1.0, 0.0, 0.0]));
        assert!((rotation.angle() - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    }

    #[test]
    fn what_is_held_together_must_exist() {
        for (element, part) in [
            ("connect body1=\"a\"", "connect: anchor is missing"),
            ("connect body1=\"c\" anchor=\"0 0 0\"", "body1 names 'c'"),
            ("weld body2=\"a\"", "weld: body1 is missing"),
            ("weld site1=\"s\" body2=\"a\"", "body2 is given beside site1 and site2"),
            ("connect site1=\"s\"", "site2 is missing"),
            ("joint joint1=\"x\" joint2=\"y\"", "joint2 names neither a hinge nor a slide"),
        ] {
            let error = read(element).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
