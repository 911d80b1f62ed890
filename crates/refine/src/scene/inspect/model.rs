//! The object's mesh: its unit, what the dataset says of its size, and what was assumed.

use nalgebra::{Point3, Vector3};
use prehend_geometry::cloud::diameter;

use super::warning::{Subject, Warning};
use crate::MM_PER_M;
use crate::scene::{Object, StatedSize};

/// Sizes between which an object's extent is believed to be in meters \[m\].
const PLAUSIBLE_EXTENT: std::ops::Range<f64> = 5e-3..5.0;

/// What a size may differ by from what is stated, as a share of the diameter.
const SIZE_TOLERANCE: f64 = 0.02;

/// Ratios nearer than this to a power of ten are those of units.
const UNIT_TOLERANCE: f64 = 0.1;

/// What looks wrong with the model of `object`; what was assumed of its mass and its inside matters if it is `held`.
pub(super) fn inspect(object: &Object, held: bool) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let stated = object.stated_size.as_ref();
    warnings.extend(stated.and_then(|stated| size(&object.mesh.vertices, stated)));
    if warnings.is_empty() && !is_plausible(object) {
        let extent = 2.0 * object.radius;
        let mut finding = format!("the mesh is {extent:.4} m across");
        if let Some(unit) = likely_unit(extent) {
            finding +=
                &format!(", {:.4} m if its vertices are multiplied by {unit}", extent * unit);
        }
        warnings.push(
            Warning::new(Subject::Model, extent, "m")
                .found(finding)
                .hint("is it in the unit that it is said to be: millimeters in BOP's folders, mesh_unit in a frame file?"),
        );
    }
    if object.inertial_assumed && held {
        let mass = object.inertial.mass;
        let finding =
            format!("the object's mass is unknown: {mass:.3} kg was assumed from 500 kg/m³");
        warnings.push(Warning::new(Subject::Model, mass, "kg").found(finding));
    }
    let inverted = object.report.inverted_shells;
    if inverted > 0 {
        let of = object.report.components;
        warnings.push(
            Warning::new(Subject::Model, inverted as f64, "shells")
                .found(format!(
                    "{inverted} of {of} shells of the mesh faced inward and were turned over"
                ))
                .hint("is the mesh mirrored?"),
        );
    }
    if !object.report.watertight && held {
        let edges = object.report.open_edges;
        let finding =
            format!("the mesh is not closed ({edges} open edges): what is inside it is a guess");
        warnings.push(Warning::new(Subject::Model, edges as f64, "edges").found(finding));
    }
    warnings
}

/// Power of ten that makes an extent \[m\] that cannot be in meters one that can: that of millimeters and meters rather than another.
pub(crate) fn likely_unit(extent: f64) -> Option<f64> {
    let fits = |unit: &f64| PLAUSIBLE_EXTENT.contains(&(extent * unit));
    let implausible = !PLAUSIBLE_EXTENT.contains(&extent);
    [1e-3, 1e3, 1e-2, 1e2, 1e-1, 1e1, 1e-6, 1e6].into_iter().find(fits).filter(|_| implausible)
}

/// Whether the mesh of `object` can be in meters.
pub(super) fn is_plausible(object: &Object) -> bool {
    PLAUSIBLE_EXTENT.contains(&(2.0 * object.radius))
}

/// How a mesh of these `vertices` \[m\] differs from what is `stated`: first in scale, then in its box, then in its origin.
fn size(vertices: &[Point3<f64>], stated: &StatedSize) -> Option<Warning> {
    let first = vertices.first()?;
    let found = diameter(vertices);
    let ratio = found / stated.diameter;
    if (ratio - 1.0).abs() > SIZE_TOLERANCE {
        let [found, said] = [found, stated.diameter].map(|d| d * MM_PER_M);
        let finding = format!(
            "the mesh is {found:.4} mm across, {ratio:.4} times the {said:.4} mm that models_info.json says"
        );
        let decades = ratio.log10();
        let is_unit = decades.round() != 0.0
            && (ratio / 10_f64.powf(decades.round()) - 1.0).abs() < UNIT_TOLERANCE;
        let hint = if is_unit {
            "are both in millimeters?"
        } else {
            "is it the model that the file describes, at that scale?"
        };
        return Some(Warning::new(Subject::Model, ratio, "").found(finding).hint(hint));
    }
    let (said_low, said_high) = stated.bounds?;
    let low = vertices.iter().fold(*first, |low, v| low.inf(v));
    let high = vertices.iter().fold(*first, |high, v| high.sup(v));
    let off = |found: Vector3<f64>, said: Vector3<f64>, what: &str, hint| {
        let by = (found - said).amax();
        let [found, said] = [found, said].map(|v| {
            format!("({:.1}, {:.1}, {:.1})", v.x * MM_PER_M, v.y * MM_PER_M, v.z * MM_PER_M)
        });
        (by > SIZE_TOLERANCE * stated.diameter).then(|| {
            Warning::new(Subject::Model, by * MM_PER_M, "mm")
                .found(format!("{what} {found} mm, but {said} mm in models_info.json"))
                .hint(hint)
        })
    };
    off(
        high - low,
        said_high - said_low,
        "the mesh's bounding box is",
        "is it the model that the file describes, with the same axes?",
    )
    .or_else(|| {
        off(
            low.coords,
            said_low.coords,
            "the mesh's bounding box begins at",
            "is its origin that of the dataset's poses?",
        )
    })
}
