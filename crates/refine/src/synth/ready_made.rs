//! Moments without physics: the ready-made grasp, with gravity turning.

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::SplitMix64;
use prehend_geometry::hand::{JOINT_NAMES, default_grasp};

use super::GraspSnapshot;
use crate::data::AssetError;
use crate::scene::feel;
use crate::scene::{Hand, Object};

/// `count` moments of `object` where the built-in bottle lies in the built-in hand ([`default_grasp`]), while gravity turns
/// about the hand; taxels feel what is near them.
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
