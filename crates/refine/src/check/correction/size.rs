//! The scale of models and the focal length, by the size of the point cloud and of the mask.

use nalgebra::{Matrix2, Vector2};

use super::finding::{Finding, groups};
use super::kind::Correction;
use super::settings::CorrectionSettings;
use super::trial::{CorrectionTrial, Size};
use crate::scene::{Target, median};

/// Standard deviations of a normal distribution in the median of absolute deviations.
const TO_SIGMA: f64 = 1.4826;

/// The model scales or focal lengths that frames that are not `explained` otherwise contradict.
///
/// A wrong focal length is the same for all objects, shrinks them across the line of sight alone, and the hand, too; a wrong model is wrong in depth as
/// well. Where frames do not tell which, both are named.
pub(super) fn find_sizes(
    trials: &[(Target, CorrectionTrial)],
    explained: &[bool],
    settings: &CorrectionSettings,
) -> Vec<Finding> {
    let sizes_of = |group: &[usize]| -> Vec<(usize, Size)> {
        let open = group.iter().filter(|&&k| !explained[k]);
        open.filter_map(|&k| Some((k, trials[k].1.size?))).collect()
    };
    let objects = groups(trials, |_, target| target.obj_id);
    let objects: Vec<_> = objects.iter().map(|group| sizes_of(group)).collect();
    let all: Vec<usize> = (0..trials.len()).collect();
    let together = estimate(&sizes_of(&all), settings, true);
    let alike = |scale: f64| {
        let medians = || objects.iter().filter_map(|sizes| median(sizes.iter().map(|s| s.1.scale)));
        let near = medians().filter(|other| (other - scale).abs() < settings.size);
        medians().count() > 1 && near.count() * 4 >= medians().count() * 3
    };
    match together.filter(|found| alike(found.factor.ln())) {
        Some(found) => vec![found],
        None => objects.iter().filter_map(|sizes| estimate(sizes, settings, false)).collect(),
    }
}

/// The size that frames have in common, if it is not as it is said to be; of objects that differ if there are `several`.
fn estimate(
    sizes: &[(usize, Size)],
    settings: &CorrectionSettings,
    several: bool,
) -> Option<Finding> {
    // The model's scale alone: robust, whatever a frame or two say.
    let scale = median(sizes.iter().map(|(_, size)| size.scale))?;
    let deviations = sizes.iter().map(|(_, size)| (size.scale - scale).abs());
    let information: Matrix2<f64> = sizes.iter().map(|(_, size)| size.information).sum();
    let vector: Vector2<f64> = sizes.iter().map(|(_, size)| size.vector).sum();
    let stated = information[(0, 0)].max(f64::MIN_POSITIVE).sqrt().recip();
    let scattered = TO_SIGMA * median(deviations)? / (sizes.len() as f64).sqrt();
    let sigma = stated.max(scattered);
    if scale.abs() < settings.size || scale.abs() < settings.sure * sigma {
        return None;
    }
    // Cost of either alone, in nats; the hand, where it is known, tells it better.
    let alone = |k: usize| -0.5 * vector[k] * vector[k] / information[(k, k)];
    let clear = 0.5 * settings.sure * settings.sure;
    let gains: Vec<f64> = sizes.iter().filter_map(|(_, size)| size.hand_gain).collect();
    let gain = gains.iter().sum::<f64>() / gains.len().max(1) as f64;
    let of_hand = settings.hand_gain / (gains.len().max(1) as f64).sqrt();
    let model = (Correction::ModelScale, scale.exp());
    let focal = (Correction::FocalLength, (vector.y / information[(1, 1)]).exp());
    let ((correction, factor), alternative) = match alone(1) - alone(0) {
        _ if gain > of_hand => (focal, None),
        _ if gain < -of_hand => (model, None),
        difference if difference < -clear => (focal, None),
        difference if difference > clear => (model, None),
        // Several objects that are wrong alike have the camera in common.
        _ if several => (focal, Some(model)),
        _ => (model, Some(focal)),
    };
    Some(Finding {
        correction,
        factor,
        alternative,
        frames: sizes.iter().map(|(k, _)| *k).collect(),
        agreement: None,
        sigma: Some(sigma),
    })
}
