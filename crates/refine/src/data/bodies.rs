//! Hands, planes and other objects of a frame as one robot.

use std::sync::Arc;

use nalgebra::{Point3, Translation3, Vector3};
use prehend_geometry::TriMesh;
use prehend_geometry::hand::Taxel;
use prehend_geometry::robot::{KinematicTree, RobotError};
use prehend_geometry::shapes::{RoundedBox, rounded_box};

use crate::data::bop::{Body, Tactile, TactileReading};
use crate::scene::{
    BinaryContact, ContactPatch, Hand, HandMeasurement, ProximityReading, TouchReading,
};

/// A body of a frame, with its shape.
pub(crate) struct PlacedBody<'b> {
    pub(crate) body: &'b Body,
    /// A robot's, or of one link.
    pub(crate) tree: Arc<KinematicTree>,
    /// Positions of its own joints \[rad or m\].
    pub(crate) joints: Vec<f64>,
}

/// Edge, thickness and largest face of the plate that stands for a plane \[m\]: faces that reach behind the camera are not drawn.
const PLATE: [f64; 3] = [3.0, 0.2, 0.1];
/// Standard deviation of a place that is said to be exact \[m or rad\].
const EXACT_PLACE: f64 = 1e-6;

/// The half-space below z = 0 about the origin, as a body.
pub(crate) fn plane() -> KinematicTree {
    KinematicTree::rigid("plane", vec![plate()])
}

/// Another object, as a body.
pub(crate) fn solid(mesh: &TriMesh) -> KinematicTree {
    KinematicTree::rigid("object", vec![mesh.cleaned().0])
}

fn plate() -> TriMesh {
    let [edge, thickness, cell] = PLATE;
    let below = Translation3::new(0.0, 0.0, -0.5 * thickness);
    let (size, flat) = (Vector3::new(edge, edge, thickness), Vector3::zeros());
    let shape = RoundedBox { size, radius: 0.0, bulge: flat, arc_steps: 0, cell };
    rounded_box(&shape).welded().transformed(&below.into())
}

/// Bodies of a frame, the one first that the others are placed beside: the first hand, or else the first body. The others are in the order of their
/// names, so that frames which list them in another one have the same robot.
pub(crate) struct Bodies<'b>(Vec<PlacedBody<'b>>);

impl<'b> Bodies<'b> {
    /// `None` of none.
    pub(crate) fn new(mut bodies: Vec<PlacedBody<'b>>) -> Option<Self> {
        let first = bodies.iter().position(|placed| placed.body.as_hand().is_some()).unwrap_or(0);
        if bodies.is_empty() {
            return None;
        }
        bodies[..=first].rotate_right(1);
        bodies[1..].sort_by(|a, b| a.body.name.cmp(&b.body.name));
        Some(Self(bodies))
    }

    /// All bodies as one robot.
    ///
    /// # Errors
    /// If their links cannot be told apart.
    pub(crate) fn tree(&self) -> Result<KinematicTree, RobotError> {
        let first = KinematicTree::clone(&self.0[0].tree);
        let mut others = self.0[1..].iter();
        others.try_fold(first, |all, placed| all.with_floating(&placed.body.name, &placed.tree))
    }

    /// Where they are; `hand` is all of them.
    pub(crate) fn measured(&self, hand: Arc<Hand>) -> HandMeasurement {
        let first = &self.0[0];
        let mut measured = HandMeasurement::new(hand, first.body.t_cam_base, first.joints.clone());
        measured.pose_sigmas =
            first.body.sigmas.map(|sigma| sigma.map(|sigma| sigma.max(EXACT_PLACE)));
        if self.0.len() == 1 {
            return measured;
        }
        measured.joint_sigmas = vec![None; first.joints.len()];
        for PlacedBody { body, joints, .. } in &self.0[1..] {
            let beside = first.body.t_cam_base.inverse() * body.t_cam_base;
            measured.joints.extend(KinematicTree::floating_joints(&beside));
            measured.joints.extend(joints);
            let exact = EXACT_PLACE;
            let [place, turn] = body.sigmas.map(|sigma| sigma.unwrap_or_default().max(exact));
            let said = [[place; 3], [exact; 3], [turn; 3]].concat();
            measured.joint_sigmas.extend(said.into_iter().map(Some));
            measured.joint_sigmas.extend(joints.iter().map(|_| None));
        }
        measured
    }

    /// Name in [`tree`](Self::tree) of `link` of the body called `name`.
    ///
    /// # Errors
    /// If there is none.
    fn link_name(&self, name: &str, link: &str) -> Result<String, String> {
        let mut named = self.0.iter().enumerate().filter(|(_, placed)| placed.body.name == name);
        let found = named.next().filter(|(_, placed)| placed.tree.link_index(link).is_some());
        match found.ok_or_else(|| format!("{name:?} has no link {link:?}"))? {
            (0, _) => Ok(link.to_owned()),
            _ => Ok(format!("{name}/{link}")),
        }
    }

    /// Whether there is a body of that name.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|placed| placed.body.name == name)
    }

    /// Their names, for messages.
    pub(crate) fn names(&self) -> String {
        let quoted = self.0.iter().map(|placed| format!("{:?}", placed.body.name));
        quoted.collect::<Vec<_>>().join(", ")
    }

    /// `taxels` of the body called `name` as those of the whole robot.
    ///
    /// # Errors
    /// If one is on a link that does not exist.
    pub(crate) fn skin(&self, name: &str, taxels: &[Taxel]) -> Result<Vec<Taxel>, String> {
        let named =
            |taxel: &Taxel| Ok(Taxel { link: self.link_name(name, &taxel.link)?, ..taxel.clone() });
        taxels.iter().map(named).collect()
    }

    /// Reading of a sensor on links of `tree`, that of all bodies; `layout` are its taxels, if it has such. `None` of one that measures forces.
    ///
    /// # Errors
    /// If a link does not exist, or there is not one value a taxel.
    pub(crate) fn reading(
        &self,
        tree: &KinematicTree,
        tactile: &Tactile,
        layout: &[Taxel],
    ) -> Result<Option<TouchReading>, String> {
        let link = |name: &str| {
            let found = tree.link_index(&self.link_name(&tactile.body, name)?);
            found.ok_or_else(|| format!("the robot has no link {name:?}"))
        };
        Ok(Some(match &tactile.reading {
            TactileReading::Force(_) => return Ok(None),
            TactileReading::Binary(contact) => {
                let probe = |link, position, touched| BinaryContact { link, position, touched };
                TouchReading::Binary(probes(layout, contact, link, probe)?)
            }
            TactileReading::Proximity(distance) => {
                let probe =
                    |link, position, distance| ProximityReading { link, position, distance };
                TouchReading::Proximity(probes(layout, distance, link, probe)?)
            }
            TactileReading::Patch { link: name, points, normals } => {
                let (points, normals) = (points.clone(), normals.clone());
                TouchReading::Patch(ContactPatch { link: link(name)?, points, normals })
            }
        }))
    }
}

/// Readings of the taxels of `layout` whose `values` are known.
///
/// # Errors
/// If there is not one value a taxel, or a link does not exist.
fn probes<T: Copy, R>(
    layout: &[Taxel],
    values: &[Option<T>],
    link: impl Fn(&str) -> Result<usize, String>,
    probe: impl Fn(usize, Point3<f64>, T) -> R,
) -> Result<Vec<R>, String> {
    let (taxels, readings) = (layout.len(), values.len());
    if taxels != readings {
        return Err(format!("expected {taxels} readings, one a taxel, found {readings}"));
    }
    let read = layout.iter().zip(values).map(|(taxel, value)| {
        let link = link(&taxel.link)?;
        Ok(value.map(|value| probe(link, taxel.position, value)))
    });
    read.filter_map(Result::transpose).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::PathBuf;

    use nalgebra::{Isometry3, UnitQuaternion};
    use prehend_geometry::DistanceField;
    use prehend_geometry::robot::RobotShape;

    use super::*;
    use crate::data::bop::{BodyKind, Origin};

    fn body(name: &str, is_hand: bool, t_cam_base: Isometry3<f64>) -> Body {
        let hand = BodyKind::Hand { urdf: PathBuf::new() };
        let kind = if is_hand { hand } else { BodyKind::Plane };
        let sigmas = [Some(1e-3), None];
        let (joints, origin) = (BTreeMap::new(), Origin::default());
        Body { name: name.into(), kind, joints, t_cam_base, sigmas, origin }
    }

    fn placed(body: &Body) -> PlacedBody<'_> {
        let tree = Arc::new(KinematicTree::rigid("base", vec![plate()]));
        PlacedBody { body, tree, joints: Vec::new() }
    }

    #[test]
    fn the_first_hand_leads_and_all_are_where_they_are_placed() {
        let turn = UnitQuaternion::from_euler_angles(0.4, -1.2, 2.0);
        let place = |x| Isometry3::from_parts([x, 0.1, 0.5].into(), turn);
        let bodies = [
            body("table", false, place(0.0)),
            body("left", true, place(0.2)),
            body("right", true, Isometry3::translation(0.0, 0.0, 0.7)),
        ];
        let bodies = Bodies::new(bodies.iter().map(placed).collect()).unwrap();
        assert_eq!(bodies.names(), "\"left\", \"right\", \"table\"");
        let tree = bodies.tree().unwrap();
        let hand = Arc::new(Hand::new(tree.clone(), Vec::new()).unwrap());
        let measured = bodies.measured(hand);
        let poses = tree.forward_kinematics(&measured.joints);
        let of = |link: &str| measured.t_cam_hand * poses[tree.link_index(link).unwrap()];
        let near = |a: Isometry3<f64>, b: Isometry3<f64>| {
            let off = a.inverse() * b;
            off.translation.vector.norm() < 1e-9 && off.rotation.angle() < 1e-7
        };
        assert!(near(of("base"), place(0.2)) && near(of("table/base"), place(0.0)));
        assert!(near(of("right/base"), Isometry3::translation(0.0, 0.0, 0.7)));
        assert_eq!(measured.joint_sigmas.len(), measured.joints.len());
        assert_eq!(measured.joint_sigmas[0], Some(1e-3));
        assert_eq!(measured.joint_sigmas[8], Some(EXACT_PLACE));
        assert_eq!(measured.pose_sigmas, [Some(1e-3), None]);
        assert!(Bodies::new(Vec::new()).is_none());
    }

    #[test]
    fn a_plane_is_one_up_to_its_edge() {
        let (spacing, margin) = (RobotShape::DEFAULT_SPACING, RobotShape::DEFAULT_MARGIN);
        let shape = RobotShape::new(&plane(), spacing, margin).unwrap();
        let grid = shape.links()[0].grid().unwrap();
        for (x, y, z) in [(0.3, -1.2, 4e-3), (-1.37, 0.01, -7e-3), (0.013, 0.42, 0.0)] {
            let sample = grid.sample(&Point3::new(x, y, z), 0.01).unwrap();
            assert!((sample.distance - z).abs() < 1e-6, "{x} {y} {z}: {}", sample.distance);
            let off = (sample.gradient - Vector3::z()).norm();
            assert!(off < 1e-3, "{x} {y} {z}: {off}");
        }
    }
}
