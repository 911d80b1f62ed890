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

    /// What `link` of the body called `name` is called in [`tree`](Self::tree); `None` if there is none.
    fn link_name(&self, name: &str, link: &str) -> Option<String> {
        let at = self.0.iter().position(|placed| placed.body.name == name)?;
        self.0[at].tree.link_index(link)?;
        Some(if at == 0 { link.to_owned() } else { format!("{name}/{link}") })
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
    /// The name of a link that does not exist.
    pub(crate) fn skin(&self, name: &str, taxels: &[Taxel]) -> Result<Vec<Taxel>, String> {
        let named = |taxel: &Taxel| match self.link_name(name, &taxel.link) {
            Some(link) => Ok(Taxel { link, ..taxel.clone() }),
            None => Err(taxel.link.clone()),
        };
        taxels.iter().map(named).collect()
    }

    /// What a sensor that measures no forces says, on links of `tree`, that of all bodies; `layout` are its taxels, if it has such. Forces are no such reading.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(crate) fn reading(
        &self,
        tree: &KinematicTree,
        tactile: &Tactile,
        layout: &[Taxel],
    ) -> Result<Option<TouchReading>, String> {
        let link = |name: &str| {
            let all = self.link_name(&tactile.body, name);
            let found = all.and_then(|all| tree.link_index(&all));
            found.ok_or_else(|| format!("{:?} has no link {name:?}", tactile.body))
        };
        let counted = |readings: usize| match layout.len() == readings {
            true => Ok(()),
            false => {
                let taxels = layout.len();
                Err(format!("expected {taxels} readings, one a taxel, found {readings}"))
            }
        };
        let places = || {
            let place = |taxel: &Taxel| Ok((link(&taxel.link)?, taxel.position));
            layout.iter().map(place).collect::<Result<Vec<(usize, Point3<f64>)>, String>>()
        };
        Ok(Some(match &tactile.reading {
            TactileReading::Force { .. } => return Ok(None),
            TactileReading::Binary { contact, .. } => {
                counted(contact.len())?;
                let places = places()?.into_iter().zip(contact);
                let known = places.filter_map(|((link, position), touched)| {
                    Some(BinaryContact { link, position, touched: (*touched)? })
                });
                TouchReading::Binary(known.collect())
            }
            TactileReading::Proximity { distance, .. } => {
                counted(distance.len())?;
                let places = places()?.into_iter().zip(distance);
                let known = places.filter_map(|((link, position), distance)| {
                    Some(ProximityReading { link, position, distance: (*distance)? })
                });
                TouchReading::Proximity(known.collect())
            }
            TactileReading::Patch { link: name, points, normals } => {
                let (points, normals) = (points.clone(), normals.clone());
                TouchReading::Patch(ContactPatch { link: link(name)?, points, normals })
            }
        }))
    }
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
        let hand = BodyKind::Hand { urdf: PathBuf::new(), joints: BTreeMap::new() };
        let kind = if is_hand { hand } else { BodyKind::Plane };
        let sigmas = [Some(1e-3), None];
        Body { name: name.into(), kind, t_cam_base, sigmas, origin: Origin::default() }
    }

    fn placed(body: &Body) -> PlacedBody<'_> {
        let tree = Arc::new(KinematicTree::rigid("base", vec![plate()]));
        PlacedBody { body, tree, joints: Vec::new() }
    }

    #[test]
    fn the_first_hand_leads_and_all_are_where_they_are_placed() {
        let turn = UnitQuaternion::from_euler_angles(0.4, -1.2, 2.0);
        let place = |x| Isometry3::from_parts([x, 0.1, 0.5].into(), turn);
        let bodies = vec![
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
