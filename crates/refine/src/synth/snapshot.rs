//! The true state of a grasp at one moment, before any sensor has measured it.

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::SplitMix64;
use prehend_geometry::hand::{JOINT_NAMES, default_grasp};

use crate::data::AssetError;
use crate::scene::{Hand, Object, feel};

/// One moment of an object held in a hand.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspSnapshot {
    /// Object coordinates → hand base coordinates \[m\].
    pub t_hand_object: Isometry3<f64>,
    /// Joint positions in the order of the robot's joint names \[rad; m\].
    pub joints: Vec<f64>,
    /// Gravity in hand base coordinates \[m/s²\].
    pub gravity: Vector3<f64>,
    /// Force of the object on each taxel, in the frame of the taxel's link \[N\].
    pub taxel_forces: Vec<Vector3<f64>>,
}

/// `count` moments of `object` where the built-in bottle lies in the built-in hand ([`default_grasp`]), while gravity turns
/// about the hand; taxels measure what is near them.
///
/// For trying out sensors: nothing here moves by forces, and only the bottle fits.
///
/// # Errors
/// If `robot` is not the built-in hand.
pub fn ready_made_moments(
    object: &Object,
    robot: &Hand,
    seed: u64,
    count: usize,
) -> Result<Vec<GraspSnapshot>, AssetError> {
    let grasp = default_grasp();
    let joints = JOINT_NAMES.iter().map(|n| (*n).to_owned()).zip(grasp.joints).collect();
    let joints = robot.tree.joint_vector(&joints)?;
    let forces = feel(object, robot, &grasp.t_base_object, &Isometry3::identity(), &joints);
    let mut noise = SplitMix64::new(seed);
    let mut down = Vector3::from_fn(|_, _| noise.normal());
    let moment = |_| {
        down = down.normalize() + Vector3::from_fn(|_, _| 0.1 * noise.normal());
        GraspSnapshot {
            t_hand_object: grasp.t_base_object,
            joints: joints.clone(),
            gravity: down.normalize() * 9.81,
            taxel_forces: forces.clone(),
        }
    };
    Ok((0..count).map(moment).collect())
}
