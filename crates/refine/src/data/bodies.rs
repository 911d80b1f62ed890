//! Hands, planes and other objects of a frame as one robot.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use prehend_geometry::TriMesh;
use prehend_geometry::hand::Taxel;
use prehend_geometry::robot::{KinematicTree, RobotError};
use prehend_geometry::shapes::cuboid;

use crate::data::bop::{Tactile, TactileReading};
use crate::scene::{BinaryContact, ContactPatch, HandMeasurement, ProximityReading, TouchReading};

/// A body of a frame.
pub(crate) struct PlacedBody {
    pub(crate) name: String,
    /// A robot's, or of one link.
    pub(crate) tree: Arc<KinematicTree>,
    /// Positions of its own joints \[rad or m\].
    pub(crate) joints: Vec<f64>,
    pub(crate) is_hand: bool,
    /// Its coordinates → camera coordinates \[m\].
    pub(crate) t_cam_body: Isometry3<f64>,
    /// Standard deviations of that in each direction and about each axis \[m, rad\], where they are said.
    pub(crate) sigmas: Option<[f64; 2]>,
}

/// Edge and thickness of the plate that stands for a plane \[m\].
const PLATE: [f64; 2] = [1.0, 0.03];
/// A plane is used about where the camera looks, if that is no farther away \[m\].
const FARTHEST: f64 = 5.0;
/// Standard deviation of what is exact \[m or rad\].
const EXACT: f64 = 1e-6;

/// The half-space below z = 0, as a plate.
pub(crate) fn plate() -> TriMesh {
    let [edge, thickness] = PLATE;
    let below = Translation3::new(0.0, 0.0, -0.5 * thickness);
    cuboid(Vector3::new(edge, edge, thickness)).transformed(&below.into())
}

/// A plane's pose with its origin where the camera looks at it.
pub(crate) fn in_view(t_cam_plane: &Isometry3<f64>) -> Isometry3<f64> {
    let normal = t_cam_plane * Vector3::z();
    let depth = normal.dot(&t_cam_plane.translation.vector) / normal.z;
    if depth > 0.0 && depth < FARTHEST {
        Isometry3::from_parts(Translation3::new(0.0, 0.0, depth), t_cam_plane.rotation)
    } else {
        *t_cam_plane
    }
}

/// Bodies of a frame, the one first that the others are placed beside: the first hand, or else the first body.
pub(crate) struct Bodies(Vec<PlacedBody>);

impl Bodies {
    /// `None` of none.
    pub(crate) fn new(mut bodies: Vec<PlacedBody>) -> Option<Self> {
        let first = bodies.iter().position(|body| body.is_hand).unwrap_or(0);
        if bodies.is_empty() {
            return None;
        }
        bodies[..=first].rotate_right(1);
        Some(Self(bodies))
    }

    /// All bodies as one robot.
    ///
    /// # Errors
    /// If their links cannot be told apart.
    pub(crate) fn tree(&self) -> Result<KinematicTree, RobotError> {
        let first = KinematicTree::clone(&self.0[0].tree);
        self.0[1..].iter().try_fold(first, |all, body| all.with_floating(&body.name, &body.tree))
    }

    /// Where they are.
    pub(crate) fn measured(&self) -> HandMeasurement {
        let first = &self.0[0];
        let mut measured = HandMeasurement::new(first.t_cam_body, first.joints.clone());
        measured.pose_sigmas = first.sigmas.map(|sigmas| sigmas.map(|sigma| sigma.max(EXACT)));
        if self.0.len() == 1 {
            return measured;
        }
        measured.joint_sigmas = vec![None; first.joints.len()];
        for body in &self.0[1..] {
            let beside = first.t_cam_body.inverse() * body.t_cam_body;
            measured.joints.extend(KinematicTree::floating_joints(&beside));
            measured.joints.extend(&body.joints);
            let [place, turn] = body.sigmas.unwrap_or_default().map(|sigma| sigma.max(EXACT));
            let said = [[place; 3], [EXACT; 3], [turn; 3]].concat();
            measured.joint_sigmas.extend(said.into_iter().map(Some));
            measured.joint_sigmas.extend(body.joints.iter().map(|_| None));
        }
        measured
    }

    /// What `link` of the body called `name` is called in [`tree`](Self::tree); `None` if there is none.
    fn link_name(&self, name: &str, link: &str) -> Option<String> {
        let at = self.0.iter().position(|body| body.name == name)?;
        self.0[at].tree.link_index(link)?;
        Some(if at == 0 { link.to_owned() } else { format!("{name}/{link}") })
    }

    /// Whether there is a body of that name.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|body| body.name == name)
    }

    /// Its name where there is one alone.
    pub(crate) fn first_name(&self) -> &str {
        &self.0[0].name
    }

    /// `taxels` of the body called `name` as those of the whole robot.
    ///
    /// # Errors
    /// The name of a link that does not exist.
    pub(crate) fn skin(&self, name: &str, taxels: Vec<Taxel>) -> Result<Vec<Taxel>, String> {
        let named = |taxel: Taxel| match self.link_name(name, &taxel.link) {
            Some(link) => Ok(Taxel { link, ..taxel }),
            None => Err(taxel.link),
        };
        taxels.into_iter().map(named).collect()
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
    use nalgebra::UnitQuaternion;

    use super::*;

    fn body(name: &str, is_hand: bool, t_cam_body: Isometry3<f64>) -> PlacedBody {
        let tree = Arc::new(KinematicTree::rigid("base", vec![plate()]));
        let sigmas = Some([1e-3, 0.0]);
        PlacedBody { name: name.into(), tree, joints: Vec::new(), is_hand, t_cam_body, sigmas }
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
        let bodies = Bodies::new(bodies).unwrap();
        assert_eq!(bodies.first_name(), "left");
        let (tree, measured) = (bodies.tree().unwrap(), bodies.measured());
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
        assert_eq!(measured.joint_sigmas[8], Some(EXACT));
        assert!(Bodies::new(Vec::new()).is_none());
    }

    #[test]
    fn a_plane_is_used_where_the_camera_looks() {
        // A table below, seen at a slant: its origin is far to the side.
        let turn = UnitQuaternion::from_euler_angles(2.2, 0.0, 0.0);
        let table = Isometry3::from_parts([3.0, 0.4, 0.6].into(), turn);
        let moved = in_view(&table);
        assert_eq!(moved.translation.vector.xy(), Vector3::zeros().xy());
        // The same plane.
        let local = table.inverse() * Point3::from(moved.translation.vector);
        assert!(local.z.abs() < 1e-12);
        let behind = Isometry3::translation(0.0, 0.0, -1.0);
        assert_eq!(in_view(&behind), behind);
    }
}
