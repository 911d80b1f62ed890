//! Entries of a dataset's JSON files. Lengths in millimeters, as BOP has them.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::TriMesh;
use prehend_render::{Distortion, Mask};
use serde_json::{Map, Value, json};

use super::files::Shot;
use super::hand_files::{TAXELS, URDF};
use crate::data::bop::{Tactile, extent_to_bop, rotation_to_row_major, translation_to_mm};
use crate::scene::Inertial;

/// Millimeters of one unit of the depth images.
pub(super) const DEPTH_SCALE: f64 = 0.1;
/// Forces are clipped at this many units, as sensors do.
const FORCE_LIMIT: f64 = 10_000.0;

/// Entries of one image in its scene's files, by the file's name.
pub(super) type ImageEntries = Map<String, Value>;

impl Shot {
    /// Entries of the image, which shows object `obj_id`.
    pub(super) fn entries(&self, obj_id: u32) -> ImageEntries {
        let Self { told, visible, whole, .. } = self;
        let mut entries = ImageEntries::new();
        let mut add = |name: &str, entry: Value| entries.insert(name.to_owned(), entry);
        let mut truth = pose("m2c", &self.truth);
        truth.insert("obj_id".into(), json!(obj_id));
        add("scene_gt.json", json!([truth]));
        let pixels = whole.pixels().iter().zip(told.depth.pixels());
        let measured = pixels.filter(|(in_silhouette, z)| **in_silhouette && **z > 0.0).count();
        let visibility = json!([{
            "bbox_obj": bounding_box(whole),
            "bbox_visib": bounding_box(visible),
            "px_count_all": whole.count(),
            "px_count_valid": measured,
            "px_count_visib": visible.count(),
            "visib_fract": visible.count() as f64 / whole.count().max(1) as f64,
        }]);
        add("scene_gt_info.json", visibility);
        let mut camera = self.world.as_ref().map(|world| pose("w2c", world)).unwrap_or_default();
        camera.insert("cam_K".into(), json!(told.camera.k()));
        camera.insert("depth_scale".into(), json!(DEPTH_SCALE));
        camera.extend(self.lens.as_ref().map(|model| ("cam_dist".into(), lens(model))));
        add("scene_camera.json", Value::Object(camera));
        let Some(hand) = &told.hand else { return entries };
        let bodies = |t_cam_hand: &Isometry3<f64>, joints: &[f64]| {
            let names = hand.hand.tree.joint_names();
            let joints: BTreeMap<_, _> = names.iter().zip(joints).collect();
            let mut body = pose("b2c", t_cam_hand);
            body.insert("name".into(), json!("hand"));
            body.insert("urdf".into(), json!(URDF));
            body.insert("joints".into(), json!(joints));
            json!({ "gravity": told.gravity.unwrap_or_default().as_slice(), "bodies": [body] })
        };
        add("scene_bodies.json", bodies(&hand.t_cam_hand, &hand.joints));
        if !hand.forces.is_empty() {
            add("scene_tactile.json", touch(&hand.forces));
        }
        if let Some((t_cam_hand, joints)) = &self.hand {
            add("scene_bodies_gt.json", bodies(t_cam_hand, joints));
        }
        entries
    }
}

/// A lens, as `cam_dist` of a camera has it.
pub(super) fn lens(lens: &Distortion) -> Value {
    json!({ "model": lens.name(), "coefficients": lens.coefficients() })
}

/// Entry of `scene_tactile.json`.
fn touch(forces: &[Vector3<f64>]) -> Value {
    // Whole units are written without a fraction.
    let units = |f: f64| {
        let units = (f * Tactile::UNITS_PER_NEWTON).clamp(-FORCE_LIMIT, FORCE_LIMIT);
        let whole = units.round();
        if (units - whole).abs() < 1e-9 { json!(whole as i64) } else { json!(units) }
    };
    let force: Vec<[Value; 3]> = forces.iter().map(|f| [f.x, f.y, f.z].map(units)).collect();
    json!({ "body": "hand", "taxels": TAXELS, "force": force })
}

/// Entry of `models_info.json`; `mesh` in meters.
pub(super) fn model(mesh: &TriMesh, inertial: &Inertial) -> Value {
    let mut fields = extent_to_bop(&mesh.vertices);
    let rows = inertial.inertia.row_iter().map(|r| r.iter().copied().collect());
    fields.insert("mass_kg".into(), json!(inertial.mass));
    fields.insert("com_mm".into(), json!((inertial.center_of_mass.coords * 1e3).as_slice()));
    fields.insert("inertia_kg_m2".into(), json!(rows.collect::<Vec<Vec<f64>>>()));
    Value::Object(fields)
}

/// `cam_R_…` and `cam_t_…` of a pose into the camera frame.
fn pose(suffix: &str, pose: &Isometry3<f64>) -> Map<String, Value> {
    Map::from_iter([
        (format!("cam_R_{suffix}"), json!(rotation_to_row_major(&pose.rotation))),
        (format!("cam_t_{suffix}"), json!(translation_to_mm(&pose.translation))),
    ])
}

/// Left, top, width and height of what is set, BOP's all −1 if nothing is.
fn bounding_box(mask: &Mask) -> [i64; 4] {
    mask.bounds().map_or([-1; 4], |bounds| bounds.map(|v| v as i64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_left_top_width_height() {
        let mut mask = Mask::filled(5, 4, false);
        assert_eq!(bounding_box(&mask), [-1; 4]);
        for (x, y) in [(1, 3), (3, 2)] {
            mask.pixels_mut()[y * 5 + x] = true;
        }
        assert_eq!(bounding_box(&mask), [1, 2, 3, 2]);
    }
}
