//! The object's mesh: its unit, its size against the dataset's, and what was assumed.

use nalgebra::{Point3, Vector3};
use prehend_geometry::cloud::diameter;

use super::limits;
use super::warning::{Subject, Warning, Warnings};
use crate::MM_PER_M;
use crate::scene::{Object, StatedSize};

/// Warnings of the model of `object`; none if all looks well. What was assumed of its mass and its inside matters if it is `held`.
pub(crate) fn check(object: &Object, held: bool) -> Vec<Warning> {
    let mut found = Warnings::default();
    let stated = object.stated_size.as_ref();
    if let Some(size) = stated.and_then(|stated| size(&object.mesh.vertices, stated)) {
        found.add(Subject::Model, size);
    } else if !is_plausible(object) {
        let extent = 2.0 * object.radius;
        let likely = likely_unit(extent).map_or_else(String::new, |unit| {
            format!(", {:.4} m if its vertices are multiplied by {unit}", extent * unit)
        });
        let message = format!(
            "the mesh is {extent:.4} m across{likely}: is it in the unit that it is said to be: millimeters in BOP's \
             folders, mesh_unit in a frame file?"
        );
        found.add(Subject::ModelUnit, message);
    }
    let mut warn = |message| found.add(Subject::Model, message);
    let (mass, report) = (object.inertial.mass, &object.report);
    if object.inertial_assumed && held {
        warn(format!("the object's mass is unknown: {mass:.3} kg was assumed from 500 kg/m³"));
    }
    let (inverted, of, edges) = (report.inverted_shells, report.components, report.open_edges);
    if inverted > 0 {
        warn(format!(
            "{inverted} of {of} shells of the mesh faced inward and were turned over: is the mesh mirrored?"
        ));
    }
    if !report.watertight && held {
        warn(format!("the mesh is not closed ({edges} open edges): what is inside it is a guess"));
    }
    found.0
}

/// Power of ten that makes an extent \[m\] that cannot be in meters one that can: that of millimeters and meters rather than another.
pub(crate) fn likely_unit(extent: f64) -> Option<f64> {
    let fits = |unit: &f64| limits::EXTENT.contains(&(extent * unit));
    let units = [1e-3, 1e3, 1e-2, 1e2, 1e-1, 1e1, 1e-6, 1e6];
    units.into_iter().find(fits).filter(|_| !limits::EXTENT.contains(&extent))
}

/// True of an object whose mesh can be in meters.
pub(super) fn is_plausible(object: &Object) -> bool {
    limits::EXTENT.contains(&(2.0 * object.radius))
}

/// Difference of a mesh of these `vertices` \[m\] from its `stated` size: first in scale, then in its box, then in its origin.
fn size(vertices: &[Point3<f64>], stated: &StatedSize) -> Option<String> {
    let first = vertices.first()?;
    let found = diameter(vertices);
    let ratio = found / stated.diameter;
    if (ratio - 1.0).abs() > limits::STATED_SIZE {
        let [found, said] = [found, stated.diameter].map(|d| d * MM_PER_M);
        let decade = ratio.log10().round();
        let is_unit =
            decade != 0.0 && (ratio / 10_f64.powf(decade) - 1.0).abs() < limits::UNIT_RATIO;
        let cause = match is_unit {
            true => "are both in millimeters?",
            false => "is it the model that the file describes, at that scale?",
        };
        return Some(format!(
            "the mesh is {found:.4} mm across, {ratio:.4} times the {said:.4} mm that models_info.json says: {cause}"
        ));
    }
    let (said_low, said_high) = stated.bounds?;
    let low = vertices.iter().fold(*first, |low, v| low.inf(v));
    let high = vertices.iter().fold(*first, |high, v| high.sup(v));
    let off = |found: Vector3<f64>, said: Vector3<f64>, what: &str, cause: &str| {
        let is_off = (found - said).amax() > limits::STATED_SIZE * stated.diameter;
        let [found, said] = [found, said].map(|v| {
            let [x, y, z] = (v * MM_PER_M).into();
            format!("({x:.1}, {y:.1}, {z:.1})")
        });
        is_off.then(|| {
            format!("the mesh's bounding box {what} {found} mm, but {said} mm in models_info.json: {cause}")
        })
    };
    let axes = "is it the model that the file describes, with the same axes?";
    let origin = "is its origin that of the dataset's poses?";
    off(high - low, said_high - said_low, "is", axes)
        .or_else(|| off(low.coords, said_low.coords, "begins at", origin))
}
