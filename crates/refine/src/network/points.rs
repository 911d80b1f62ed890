//! Points of a frame, as the network reads them: the visible surface by depth and color, and the skin where it is touched.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use prehend_geometry::KdTree;
use prehend_geometry::cloud::estimate_normals;

use crate::error::RefineError;
use crate::scene::{HandMeasurement, PreparedFrame, TouchReading, median};

/// Number of [input channels](super) of a point.
pub const CHANNELS: usize = 15;

/// Neighbors that a normal is estimated from.
const NEIGHBORS: usize = 20;
/// Force above which a taxel is touched \[N\].
const CONTACT: f64 = 0.05;
/// Force that is scaled to one half \[N\].
const FORCE: f64 = 0.5;
/// Points farther from the middle than this many radii of the object are of something else.
const REACH: f64 = 2.0;

/// A point of the object's surface that was seen or felt, in the camera frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensedPoint {
    /// Position \[m\].
    pub position: Point3<f64>,
    /// Outward unit normal of the object; of a contact, against that of the skin. Zero where unknown.
    pub normal: Vector3<f64>,
    /// Color, 0 to 1 a channel, of a point that was seen.
    pub color: Option<[f32; 3]>,
    /// Force of the object on the skin \[N\].
    pub force: Option<Vector3<f64>>,
    /// True of a point that was felt.
    pub is_contact: bool,
}

/// Points of a frame that the network reads, in the camera frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensedPoints {
    /// Points that were seen, at least one.
    pub seen: Vec<SensedPoint>,
    /// Points that were felt.
    pub felt: Vec<SensedPoint>,
}

impl SensedPoints {
    /// Points with depth that are looked at, about; normals come of them.
    pub const POINTS: usize = 700;

    /// Some [`POINTS`](Self::POINTS) points with depth of the mask of `frame`, within reach of an object of that `radius` \[m\], and all touched places of the skin.
    ///
    /// # Errors
    /// If no pixel of the mask has a depth, or forces do not fit the taxels.
    pub fn new(frame: &PreparedFrame<'_>, radius: f64) -> Result<Self, RefineError> {
        let observation = frame.observation();
        let depths = frame.masked_depths(Self::POINTS)?;
        let place =
            |&(x, y, z): &(usize, usize, f64)| observation.camera.unproject(x as f64, y as f64, z);
        let mut places: Vec<Point3<f64>> = depths.iter().map(place).collect();
        let middle = |axis| median(places.iter().map(|p| p[axis])).unwrap_or(0.0);
        let middle = Point3::new(middle(0), middle(1), middle(2));
        let is_near = |p: &Point3<f64>| (p - middle).norm() <= REACH * radius;
        let colored = observation.has_colors();
        let color =
            |&(x, y, _): &(usize, usize, f64)| observation.color.get(x, y).filter(|_| colored);
        let colors: Vec<_> =
            depths.iter().zip(&places).filter(|(_, p)| is_near(p)).map(|(d, _)| color(d)).collect();
        places.retain(is_near);
        let tree = KdTree::new(&places).map_err(|_| RefineError::NoDepth)?;
        let normals = estimate_normals(&tree, NEIGHBORS, &Point3::origin());
        let seen = places.into_iter().zip(normals).zip(colors);
        let point = |((position, normal), color)| SensedPoint {
            position,
            normal,
            color,
            force: None,
            is_contact: false,
        };
        let felt = frame.hand().map_or(Ok(Vec::new()), touched)?;
        Ok(Self { seen: seen.map(point).collect(), felt })
    }
}

/// Touched places of the skin.
fn touched(reading: &HandMeasurement) -> Result<Vec<SensedPoint>, RefineError> {
    let hand = &reading.hand;
    let posed = hand.posed(&reading.t_cam_hand, &reading.joints)?;
    let links = posed.t_world_links();
    let contact = |link: usize, position: &Point3<f64>, normal: Vector3<f64>, force| SensedPoint {
        position: links[link] * position,
        normal: -(links[link] * normal),
        color: None,
        force,
        is_contact: true,
    };
    let mut felt = Vec::new();
    if !reading.forces.is_empty() {
        hand.check_forces(&reading.forces)?;
    }
    for (taxel, force) in hand.taxels.iter().zip(&reading.forces) {
        // Of an unknown one this is false.
        if force.norm() > CONTACT {
            let link = hand.link_of(taxel)?;
            let force = Some(links[link] * force);
            felt.push(contact(link, &taxel.position, taxel.normal, force));
        }
    }
    for touch in &reading.touch {
        match touch {
            TouchReading::Binary(contacts) => {
                let touching = contacts.iter().filter(|c| c.touched);
                felt.extend(touching.map(|c| contact(c.link, &c.position, Vector3::zeros(), None)));
            }
            TouchReading::Patch(patch) => {
                let points = patch.points.iter().zip(&patch.normals);
                felt.extend(points.map(|(p, n)| contact(patch.link, p, *n, None)));
            }
            TouchReading::Proximity(_) => {}
        }
    }
    Ok(felt)
}

/// The network's coordinates: origin in the middle of the points that were seen, z along the line of sight to it, lengths in radii of the object.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewFrame {
    /// Network axes → camera frame \[m\], at the scale of the camera.
    pub t_cam_view: Isometry3<f64>,
    /// Radius of the object \[m\].
    pub radius: f64,
    /// Root mean square of the colors.
    brightness: f32,
}

impl ViewFrame {
    /// Coordinates for `seen`, turned by `roll` \[rad\] about the line of sight.
    pub fn new(seen: &[SensedPoint], radius: f64, roll: f64) -> Self {
        let sum = seen.iter().fold(Vector3::zeros(), |sum, p| sum + p.position.coords);
        let middle = sum / seen.len().max(1) as f64;
        let sight = UnitQuaternion::rotation_between(&Vector3::z(), &middle);
        let roll = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll);
        let rotation = sight.unwrap_or_else(UnitQuaternion::identity) * roll;
        let colors = seen.iter().filter_map(|p| p.color).flatten();
        let (squares, count) = colors.fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0_f32));
        Self {
            t_cam_view: Isometry3::from_parts(middle.into(), rotation),
            radius,
            brightness: (squares / count.max(1.0)).sqrt().max(0.02),
        }
    }

    /// Numbers of `point` for the network.
    pub fn features(&self, point: &SensedPoint) -> [f32; CHANNELS] {
        let turn = |v: &Vector3<f64>| self.t_cam_view.rotation.inverse_transform_vector(v);
        let position = self.t_cam_view.inverse_transform_point(&point.position) / self.radius;
        let mut all = [0.0; CHANNELS];
        let mut put = |at: usize, v: &Vector3<f64>| (0..3).for_each(|k| all[at + k] = v[k] as f32);
        put(0, &position.coords);
        put(3, &turn(&point.normal));
        if let Some(force) = &point.force {
            put(10, &(turn(force) / (force.norm() + FORCE)));
        }
        if let Some(color) = point.color {
            (0..3).for_each(|k| all[6 + k] = (color[k] / self.brightness).min(3.0) - 0.5);
            all[9] = 1.0;
        }
        all[13] = f32::from(u8::from(point.is_contact));
        all[14] = f32::from(u8::from(point.force.is_some()));
        all
    }

    /// The pose \[m\], object → camera, of an object whose `center` \[m\] is at `position` (network coordinates) and that is turned by `rotation`, object →
    /// network axes.
    pub fn pose(
        &self,
        center: &Point3<f64>,
        position: &Vector3<f64>,
        rotation: &UnitQuaternion<f64>,
    ) -> Isometry3<f64> {
        let rotation = self.t_cam_view.rotation * rotation;
        let there = self.t_cam_view * Point3::from(position * self.radius);
        Isometry3::from_parts((there - rotation * center).into(), rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn points_lie_on_the_object_and_their_normals_point_out_of_it() {
        let scene = default_scene(1).unwrap();
        let frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
        let points = SensedPoints::new(&frame, scene.object.radius).unwrap();
        assert!(points.seen.len() > 300 && points.felt.len() > 3);
        let right = |p: &&SensedPoint| {
            let place = scene.truth.inverse_transform_point(&p.position);
            scene.object.surface.signed_distance(&place).0.abs() < 6e-3
        };
        for list in [&points.seen, &points.felt] {
            let near = list.iter().filter(right).count();
            assert!(near * 10 > list.len() * 8, "{near} of {}", list.len());
        }
    }

    #[test]
    fn coordinates_turn_with_the_view_and_poses_come_back() {
        let scene = default_scene(1).unwrap();
        let frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
        let (object, truth) = (&scene.object, &scene.truth);
        let points = SensedPoints::new(&frame, object.radius).unwrap();
        let views = [0.0, 1.0].map(|roll| ViewFrame::new(&points.seen, object.radius, roll));
        for view in &views {
            let t_view_object = view.t_cam_view.inverse() * truth;
            let position = (t_view_object * object.center).coords / object.radius;
            let back = view.pose(&object.center, &position, &t_view_object.rotation);
            assert!((back.to_homogeneous() - truth.to_homogeneous()).amax() < 1e-12);
        }
        let [a, b] = views.map(|view| view.features(&points.seen[0]));
        let roll = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -1.0);
        let (a0, b0) = (Vector3::new(a[0], a[1], a[2]), Vector3::new(b[0], b[1], b[2]));
        assert!((roll.cast::<f32>() * a0 - b0).norm() < 1e-5);
        assert_eq!(a[6..], b[6..]);
    }
}
