//! Errors of a network's hypotheses on views whose truth is known.

use nalgebra::Isometry3;
use prehend_refine::network::PoseNetwork;
use prehend_refine::{Object, PoseCandidate};
use rayon::prelude::*;

use crate::views::View;

/// Errors on a set of views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Median distance of the center \[cm\].
    pub position: f64,
    /// Median angle, turns of the object apart \[deg\].
    pub orientation: f64,
    /// Share of views in which the best of all hypotheses is within 15° \[0, 1\].
    pub found: f64,
}

/// Angle that counts as found \[deg\].
const FOUND: f64 = 15.0;

/// Errors of the hypotheses of `network` for `views` of `object`.
pub fn validate(network: &PoseNetwork, object: &Object, views: &[View]) -> Errors {
    let of_view = |view: &View| {
        let proposed = network.find_in(&view.points);
        errors(network, object, &proposed, &view.truth)
    };
    let all: Vec<[f64; 3]> = views.par_iter().map(of_view).collect();
    let column = |k: usize| all.iter().map(|e| e[k]).collect::<Vec<f64>>();
    let found = column(2).iter().filter(|angle| **angle <= FOUND).count();
    Errors {
        position: median(column(0)),
        orientation: median(column(1)),
        found: found as f64 / all.len().max(1) as f64,
    }
}

/// Distance \[cm\] and angle \[deg\] of the first hypothesis, and the least angle of all.
pub fn errors(
    network: &PoseNetwork,
    object: &Object,
    proposed: &[PoseCandidate],
    truth: &Isometry3<f64>,
) -> [f64; 3] {
    let angle = |p: &PoseCandidate| network.angle(&p.t_cam_object, truth).to_degrees();
    let Some(best) = proposed.first() else { return [f64::INFINITY; 3] };
    let distance = (best.t_cam_object * object.center - truth * object.center).norm();
    let least = proposed.iter().map(angle).fold(f64::INFINITY, f64::min);
    [1e2 * distance, angle(best), least]
}

/// The middle one of `values`, or the greater of the two; not a number of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
