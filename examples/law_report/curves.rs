//! Forces as functions of depth and slip.

use prehend::nalgebra::Vector3;

use super::point_contact::{DEPTH, PointContact};

/// Something to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curve {
    /// Title of the plot.
    pub(crate) name: String,
    /// Names of the axes, with units.
    pub(crate) axes: [&'static str; 2],
    /// The points.
    pub(crate) points: Vec<[f64; 2]>,
}

/// Points of a curve.
const POINTS: usize = 200;

/// Normal force by depth at some speeds, friction by slip.
pub(crate) fn of_forces(contact_point: &PointContact<'_>) -> Vec<Curve> {
    let by_depth = |speed: f64| {
        let point = |i: usize| {
            let depth = 2.0 * DEPTH * i as f64 / POINTS as f64;
            [depth * 1e3, contact_point.force(depth, speed, Vector3::zeros()).normal]
        };
        let name = format!("normal force, {speed} m/s");
        Curve { name, axes: ["depth [mm]", "N"], points: (0..=POINTS).map(point).collect() }
    };
    let by_slip = || {
        let point = |i: usize| {
            let slip = (i as f64 / POINTS as f64 - 0.5) * 0.2;
            [slip, contact_point.force(DEPTH, 0.0, Vector3::x() * slip).tangential.x]
        };
        let name = "friction 0.5 mm deep".to_owned();
        Curve { name, axes: ["slip [m/s]", "N"], points: (0..=POINTS).map(point).collect() }
    };
    let mut curves: Vec<Curve> = [-0.5, 0.0, 0.5].map(by_depth).into();
    curves.push(by_slip());
    curves
}
