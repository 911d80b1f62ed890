//! The test of fit: whether model and data are what they are taken for, or something else.

use std::f64::consts::TAU;

use prehend_render::Camera;

use crate::defaults::settings;
use crate::factor::{NoiseEstimate, ScaleSettings, Scales};
use crate::problem::{Contribution, Linearization};
use crate::scene::IntrinsicsMistake;

settings! {
    /// Settings of the test of fit.
    #[derive(Copy)]
    pub struct FitSettings {
        // One in two hundred, of any size within a factor of ten.
        /// Prior probability that a kind of evidence is of something else: of another object, another frame, a hand that is elsewhere; that intrinsics are wrong;
        /// and that an image is cropped.
        pub fault: f64 = 0.005,
        /// Standard deviation of the logarithm of the scale of its residuals then.
        pub fault_scale: f64 = std::f64::consts::LN_10,
        /// Standard deviation of the principal point from the image's middle, as a part of the width: lenses are off by a few percent.
        pub principal_point: f64 = 0.04,
    }
}

/// How the residuals of one kind of evidence, or the errors of a group of calibrations, compare with their nominal size.
#[derive(Clone, Debug, PartialEq)]
pub struct Consistency {
    /// The factor's name, `depth-noise`, or the name of a group of errors.
    pub name: &'static str,
    /// Logarithm of their scale: ½ ln(χ²/n) of n effective degrees of freedom.
    pub log_scale: f64,
    /// Its standard deviation where nothing is wrong.
    pub sigma: f64,
    /// Probability that the evidence is of something else.
    pub fault: f64,
}

/// The test of fit of a pose.
///
/// Where nothing is wrong, the logarithm u of a scale is normal about zero, with the deviation of the prior of scales and that of an estimate by n degrees of
/// freedom, τ² + 1/2n. Where the evidence is of something else, u > 0 is anything: a broad normal density. What fits better than usual is no fault. Kinds of
/// evidence fail independently.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Probability that model and data are what they are taken for.
    pub probability: f64,
    /// Consistency of each kind of evidence.
    pub consistency: Vec<Consistency>,
    /// Probability that the intrinsics are not those of the images.
    pub camera: f64,
}

impl Fit {
    /// Test of the solution `point` before `camera` with these scales; `noise` is that of depth with the nominal deviation of a point.
    pub(super) fn new(
        camera: &Camera,
        point: &Linearization,
        scales: &Scales,
        noise: Option<(NoiseEstimate, f64)>,
        prior: &ScaleSettings,
        settings: &FitSettings,
    ) -> Self {
        let mut logs = of_factors(point, prior);
        if let Some((noise, nominal)) = noise {
            let sigma = prior.noise.hypot((0.5 / noise.effective_samples).sqrt());
            logs.push(("depth-noise", (noise.sigma / nominal).ln(), sigma));
        }
        let common = scales.common(prior);
        let groups = scales.iter();
        logs.extend(groups.map(|(group, log, _)| (group.name(), log - common, prior.own)));
        logs.push(("calibration", common, prior.common));
        Self::of_logs(camera, &logs, settings)
    }

    /// Test of a solution whose calibrations deviate from their nominal values by a χ² with that number of degrees of freedom.
    pub(crate) fn of_tracked(
        camera: &Camera,
        point: &Linearization,
        (name, chi_square, degrees): (&'static str, f64, f64),
        prior: &ScaleSettings,
        settings: &FitSettings,
    ) -> Self {
        let mut logs = of_factors(point, prior);
        if degrees > 0.0 && chi_square > 0.0 {
            // Their scale is not learnt: what they have in common counts, too.
            let sigma = prior.own.hypot((0.5 / degrees).sqrt());
            logs.push((name, 0.5 * (chi_square / degrees).ln(), sigma));
        }
        Self::of_logs(camera, &logs, settings)
    }

    /// Test of a camera and of logarithms of scales, with their names and their standard deviations where nothing is wrong.
    fn of_logs(camera: &Camera, logs: &[(&'static str, f64, f64)], settings: &FitSettings) -> Self {
        let of = |&(name, log_scale, sigma): &(&'static str, f64, f64)| {
            let fault = settings.probability_of_fault(log_scale, sigma);
            Consistency { name, log_scale, sigma, fault }
        };
        let consistency: Vec<_> = logs.iter().map(of).collect();
        let sound: f64 = consistency.iter().map(|of| 1.0 - of.fault).product();
        let camera = settings.probability_of_mistake(camera);
        Self { probability: sound * (1.0 - camera), consistency, camera }
    }

    /// Evidence that is more probably of something else than not, and how probably, the most probable first.
    pub fn misfits(&self) -> Vec<(&'static str, f64)> {
        let of_camera = ("camera", self.camera);
        let consistency = self.consistency.iter().map(|of| (of.name, of.fault));
        let mut misfits: Vec<_> = consistency.chain([of_camera]).collect();
        misfits.retain(|(_, fault)| *fault > 0.5);
        misfits.sort_by(|a, b| b.1.total_cmp(&a.1));
        misfits
    }
}

/// The logarithm of the scale of each factor's residuals with its standard deviation; none of factors that amount to less than one measurement.
fn of_factors(point: &Linearization, prior: &ScaleSettings) -> Vec<(&'static str, f64, f64)> {
    let of = |part: &Contribution| {
        let (chi_square, degrees) = (part.chi_square(), part.equations.degrees());
        let sigma = prior.noise.hypot((0.5 / degrees).sqrt());
        let log = 0.5 * (chi_square / degrees).ln();
        (degrees >= 1.0 && chi_square > 0.0).then_some((part.name, log, sigma))
    };
    point.factors.iter().filter_map(of).collect()
}

impl FitSettings {
    /// The mistake that intrinsics more probably have than not.
    pub(crate) fn likely_mistake(&self, camera: &Camera) -> Option<IntrinsicsMistake> {
        IntrinsicsMistake::likely(camera, self.principal_point, self.fault)
    }

    /// The probability that intrinsics are wrong.
    fn probability_of_mistake(&self, camera: &Camera) -> f64 {
        let all = IntrinsicsMistake::probabilities(camera, self.principal_point, self.fault);
        all.iter().map(|(_, probability)| probability).sum()
    }

    /// The probability that evidence of this logarithm of a scale, of standard deviation `sigma` where nothing is wrong, is of something else.
    fn probability_of_fault(&self, log_scale: f64, sigma: f64) -> f64 {
        let density =
            |sigma: f64| (-0.5 * (log_scale.max(0.0) / sigma).powi(2)).exp() / (sigma * TAU.sqrt());
        let (fault, sound) =
            (self.fault * 2.0 * density(self.fault_scale), (1.0 - self.fault) * density(sigma));
        fault / (fault + sound)
    }
}
