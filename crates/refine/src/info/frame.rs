//! Frame files.

use std::path::Path;

use prehend_geometry::hand::load_taxels;
use serde_json::{Value, json};

use super::mesh;
use crate::data::bop::{Body, DatasetError, Tactile, TactileReading};
use crate::data::{AssetError, FrameParts, load_robot};

/// From this force on a taxel counts as touched \[N\].
const TOUCH: f64 = 0.1;

/// Images: size, focal lengths, whether they were taken through a lens, share of pixels with depth (0 to 1), pixels of the mask. The object: file, mesh, mass, initial place in the camera
/// frame \[m\]. Gravity there \[m/s²\]. The hand: name, joints, taxels, and how many of those feel more than 0.1 N, null without forces.
pub(super) fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Value, AssetError> {
    let parts = FrameParts::read(path)?;
    let mass_kg = parts.mass;
    if mass_kg.is_none() {
        warnings.push("no mass_kg: 500 kg/m³ are assumed".to_owned());
    }
    let FrameParts { frame: observation, mesh, mesh_file, bodies, tactile, .. } = &parts;
    let (camera, depth) = (&observation.camera, observation.depth.pixels());
    let (mut taxels, mut touched) = (0, None);
    if let [Tactile { taxels: Some(file), reading: TactileReading::Force(force), .. }, ..] =
        &tactile[..]
    {
        taxels = load_taxels(file).map_err(|e| DatasetError::unusable(path, e))?.len();
        let feels = force.iter().filter(|force| force.norm() > TOUCH).count();
        touched = (!force.is_empty()).then_some(feels);
    }
    let mut hand = None;
    if let Some((urdf, joints)) = bodies.iter().find_map(Body::as_hand) {
        let tree = load_robot(urdf)?;
        tree.joint_vector(joints)?;
        let joints = tree.joint_names().len();
        hand = Some(
            json!({ "name": tree.name(), "joints": joints, "taxels": taxels, "touched": touched }),
        );
    }
    Ok(json!({
        "image_size": [camera.width, camera.height],
        "focal_px": [camera.fx, camera.fy],
        "lens": parts.has_lens,
        "depth_share": depth.iter().filter(|z| **z > 0.0).count() as f64 / depth.len() as f64,
        "mask_pixels": observation.mask.count(),
        "mesh_file": mesh_file,
        "mesh": mesh::of(mesh, warnings),
        "mass_kg": mass_kg,
        "translation_m": parts.t_cam_object.translation.vector.as_slice(),
        "gravity": observation.gravity.map(<[f64; 3]>::from),
        "hand": hand,
    }))
}
