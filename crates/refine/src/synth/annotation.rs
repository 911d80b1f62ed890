//! Entries of a dataset's JSON files. Lengths in millimeters, as BOP has them.

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::TriMesh;
use prehend_render::{Camera, DepthImage, Distortion, Mask};
use serde_json::{Map, Value, json};

use super::hand_files::{TAXELS, URDF};
use crate::data::bop::{UNITS_PER_NEWTON, extent_to_bop, rotation_to_row_major, translation_to_mm};
use crate::scene::Inertial;

/// Millimeters of one unit of the depth images.
pub(super) const DEPTH_SCALE: f64 = 0.1;
/// Forces are clipped at this many units, as sensors do.
const FORCE_LIMIT: f64 = 10_000.0;

/// Entry of `scene_camera.json`, with its lens if it is no pinhole, and the pose world → camera where there is a world.
pub(super) fn camera(
    camera: &Camera,
    lens: Option<&Distortion>,
    world: Option<&Isometry3<f64>>,
) -> Value {
    let mut entry = Map::from_iter([
        ("cam_K".to_owned(), json!(camera.k())),
        ("depth_scale".to_owned(), json!(DEPTH_SCALE)),
    ]);
    if let Some(distortion) = lens {
        entry.insert("cam_dist".into(), self::lens(distortion));
    }
    if let Some(t_cam_world) = world {
        entry.extend(pose("w2c", t_cam_world));
    }
    Value::Object(entry)
}

/// A lens, as `cam_dist` of a camera has it.
pub(super) fn lens(lens: &Distortion) -> Value {
    json!({ "model": lens.name(), "coefficients": lens.coefficients() })
}

/// Entry of `scene_gt.json`.
pub(super) fn truth(obj_id: u32, t_cam_object: &Isometry3<f64>) -> Value {
    let mut object = pose("m2c", t_cam_object);
    object.insert("obj_id".into(), json!(obj_id));
    json!([object])
}

/// Entry of `scene_gt_info.json`; `whole` is the silhouette that nothing hides, `depth` what was measured.
pub(super) fn visibility(visible: &Mask, whole: &Mask, depth: &DepthImage) -> Value {
    let measured = whole.pixels().iter().zip(depth.pixels()).filter(|(m, z)| **m && **z > 0.0);
    json!([{
        "bbox_obj": bounding_box(whole),
        "bbox_visib": bounding_box(visible),
        "px_count_all": whole.count(),
        "px_count_valid": measured.count(),
        "px_count_visib": visible.count(),
        "visib_fract": visible.count() as f64 / whole.count().max(1) as f64,
    }])
}

/// Entry of `scene_bodies.json` and `scene_bodies_gt.json`.
pub(super) fn bodies(
    gravity: &Vector3<f64>,
    t_cam_hand: &Isometry3<f64>,
    names: &[String],
    joints: &[f64],
) -> Value {
    let joints: Map<String, Value> =
        names.iter().cloned().zip(joints.iter().map(|&q| json!(q))).collect();
    let mut body = pose("b2c", t_cam_hand);
    body.insert("name".into(), json!("hand"));
    body.insert("urdf".into(), json!(URDF));
    body.insert("joints".into(), Value::Object(joints));
    json!({ "gravity": gravity.as_slice(), "bodies": [body] })
}

/// Entry of `scene_tactile.json`.
pub(super) fn touch(forces: &[Vector3<f64>]) -> Value {
    // Whole units are written without a fraction.
    let units = |f: f64| {
        let units = (f * UNITS_PER_NEWTON).clamp(-FORCE_LIMIT, FORCE_LIMIT);
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
