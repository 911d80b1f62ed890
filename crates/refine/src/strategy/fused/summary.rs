//! Summary of a posterior.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::Posterior;
use crate::MM_PER_M;

/// Summary of a [`Posterior`] for reports and files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PosteriorSummary {
    /// Probability that model, data and pose are right, the last within 5 mm and 5° of the true one.
    pub probability: f64,
    /// Probability that model and data are right, where that was asked.
    pub fit: Option<f64>,
    /// Evidence that agrees less with its model than usual, and how probable a fault of it is.
    pub misfits: Vec<(String, f64)>,
    /// Standard deviations of the place of the object's center in the camera frame \[mm\].
    pub deviation_mm: [f64; 3],
    /// Standard deviations of the rotation about the axes of the camera frame \[°\].
    pub deviation_deg: [f64; 3],
    /// Covariance of a left twist about the object's center in the camera frame, translation first \[m², m rad, rad²\].
    pub covariance: [[f64; 6]; 6],
    /// The center of the object, about which that twist turns (camera frame) \[m\].
    pub center_m: [f64; 3],
    /// Standard deviations of surface motion along unobservable directions \[mm\].
    pub unobservable_mm: Vec<f64>,
    /// Inconsistent factors, with their distances \[standard deviations\].
    pub inconsistencies: Vec<(String, f64)>,
    /// Scales of errors: factors by which they are larger than their nominal sizes.
    #[serde(default)]
    pub scales: Vec<(String, f64)>,
    /// Size of the object by that of its model, and its standard deviation, where that is estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_scale: Option<[f64; 2]>,
    /// Shares of the posterior that the poses found have, the best first.
    pub weights: Vec<f64>,
    /// The poses that have them: object → camera, homogeneous, row by row \[m\].
    #[serde(default)]
    pub modes: Vec<[[f64; 4]; 4]>,
    /// Reason for which the solver stopped.
    pub termination: String,
}

impl From<&Posterior> for PosteriorSummary {
    fn from(posterior: &Posterior) -> Self {
        let covariance = posterior.covariance();
        let deviation =
            |first: usize| Vector3::from_fn(|k, _| covariance[(first + k, first + k)].sqrt());
        let inconsistencies = posterior.inconsistencies.iter();
        let fit = posterior.fit.as_ref();
        let misfits = fit.iter().flat_map(|fit| fit.misfits());
        Self {
            probability: posterior.probability(),
            fit: fit.map(|fit| fit.probability),
            misfits: misfits.map(|(what, p)| (what.to_owned(), p)).collect(),
            deviation_mm: (deviation(0) * MM_PER_M).into(),
            deviation_deg: deviation(3).map(f64::to_degrees).into(),
            covariance: std::array::from_fn(|r| std::array::from_fn(|c| covariance[(r, c)])),
            center_m: posterior.center().into(),
            unobservable_mm: posterior
                .unobservable
                .iter()
                .map(|u| u.deviation * MM_PER_M)
                .collect(),
            inconsistencies: inconsistencies.map(|d| (d.factor.to_owned(), d.distance)).collect(),
            scales: posterior
                .scales
                .iter()
                .map(|(g, ln, _)| (g.name().to_owned(), ln.exp()))
                .collect(),
            model_scale: posterior.model_scale.map(|found| [found.scale, found.sigma]),
            weights: posterior.modes.iter().map(|h| h.weight).collect(),
            modes: posterior
                .modes
                .iter()
                .map(|h| h.t_cam_object.to_homogeneous().transpose().into())
                .collect(),
            termination: posterior.termination.name().to_owned(),
        }
    }
}
