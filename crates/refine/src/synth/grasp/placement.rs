//! Poses of the object when the hand begins to close.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;
use prehend_geometry::robot::PosedRobot;

use super::grasper::Grasper;
use crate::scene::Object;
use crate::synth::error::SynthError;

/// Points of the object that must stay clear of the hand.
const PROBES: usize = 600;
/// From where the object approaches the palm \[m\].
const FAR: f64 = 0.6;
/// Steps of the approach at most.
const MOST_ADVANCES: usize = 200;
/// Placements that are tried.
const DRAWS: usize = 20;
/// An object farther from the middle of the palm, beyond its clearance, has been kept off by the fingers \[m\].
const NEAR_PALM: f64 = 0.03;

/// An object as it is placed.
pub(super) struct Placement {
    probes: Vec<Point3<f64>>,
    center: Point3<f64>,
    /// Axes from the longest to the shortest, in the object's frame.
    axes: UnitQuaternion<f64>,
    half_length: f64,
}

impl Placement {
    pub(super) fn new(object: &Object) -> Self {
        let every = object.samples.len().div_ceil(PROBES).max(1);
        let probes: Vec<Point3<f64>> =
            object.samples.iter().step_by(every).map(|s| s.point).collect();
        // A long body turns most easily about its long axis.
        let eigen = object.inertial.inertia.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let column = |k: usize| eigen.eigenvectors.column(order[k]).into_owned();
        let (long, middle) = (column(0), column(1));
        let along = |p: &Point3<f64>| (p - object.center).dot(&long).abs();
        Self {
            half_length: probes.iter().map(along).fold(0.0, f64::max),
            center: object.center,
            axes: UnitQuaternion::from_basis_unchecked(&[long, middle, long.cross(&middle)]),
            probes,
        }
    }

    /// Joint positions of an open hand and a random pose of the object before its palm, unless the fingers are in the way time
    /// and again.
    ///
    /// The longest axis of aligned placements lies along that about which fingers wrap, their faces towards the palm.
    pub(super) fn draw(
        &self,
        grasper: &Grasper<'_>,
        random: &mut SplitMix64,
    ) -> Result<(Vec<f64>, Isometry3<f64>), SynthError> {
        let Grasper { robot, preshape, settings, .. } = grasper;
        let palm = Point3::from(preshape.t_hand_palm.translation.vector);
        for _ in 0..DRAWS {
            let both_ways = |random: &mut SplitMix64| 2.0 * random.uniform() - 1.0;
            let open = preshape.open.iter().zip(&preshape.spread);
            let open: Vec<f64> = open.map(|(q, s)| q + s * both_ways(random)).collect();
            let joints = robot.tree.clamp_joints(&open)?;
            let aligned = random.uniform() < settings.aligned;
            let t_palm_axes = if aligned {
                let quarter = std::f64::consts::FRAC_PI_2;
                let roll = quarter * (4.0 * random.uniform()).floor();
                let flip = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
                let long = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), flip * quarter);
                let tilt = Vector3::from_fn(|_, _| settings.tilt * random.normal());
                UnitQuaternion::from_scaled_axis(tilt)
                    * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), roll)
                    * long
            } else {
                let four = nalgebra::Vector4::from_fn(|_, _| random.normal());
                UnitQuaternion::from_quaternion(nalgebra::Quaternion::from(four))
            };
            let t_palm_object = t_palm_axes * self.axes.inverse();
            // Where along a long object it is held.
            let slide = 0.6 * both_ways(random) * (self.half_length - 0.04).max(0.0);
            let long = t_palm_axes * Vector3::x();
            let across = Vector3::new(random.normal(), random.normal(), 0.0) * settings.offset;
            let clearance = settings.clearance * random.uniform().powi(2) + 1e-3;
            let at = |height: f64| {
                let middle = long * slide + across;
                let middle = Vector3::new(middle.x, middle.y, height);
                let shift = middle - t_palm_object * self.center.coords;
                preshape.t_hand_palm
                    * Isometry3::from_parts(Translation3::from(shift), t_palm_object)
            };
            let hand = robot.posed(&Isometry3::identity(), &joints)?;
            let mut height = FAR;
            // No point comes nearer by more than the object moves.
            for _ in 0..MOST_ADVANCES {
                let room = self.distance(&hand, &at(height)) - clearance;
                if room < 2e-4 || height < -FAR {
                    break;
                }
                height -= room;
            }
            let t_hand_object = at(height);
            let gap = |p: &Point3<f64>| (t_hand_object * p - palm).norm();
            let gap = self.probes.iter().map(gap).fold(f64::INFINITY, f64::min);
            if gap < settings.clearance + NEAR_PALM {
                return Ok((joints, t_hand_object));
            }
        }
        Err(SynthError::Refused("the fingers keep the object from the palm".into()))
    }

    /// Distance of the probes from the surfaces of the hand \[m\], infinite where they are far.
    fn distance(&self, hand: &PosedRobot, t_hand_object: &Isometry3<f64>) -> f64 {
        let mut nearest = f64::INFINITY;
        for probe in self.probes.iter().map(|probe| t_hand_object * probe) {
            for (link, t_hand_link) in hand.shape().links().iter().zip(hand.t_world_links()) {
                let local = t_hand_link.inverse_transform_point(&probe);
                for body in link.closest() {
                    let found = body.closest(&local, nearest.min(2.0 * FAR));
                    nearest = found.map_or(nearest, |closest| nearest.min(closest.distance));
                }
            }
        }
        nearest
    }
}
