//! Whether a pose fits as right poses do: an absolute test of model and data.
//!
//! A posterior says which pose is likely if the model is the object's and the sensors work as they are thought to. Here is asked whether that
//! is so: how large residuals, calibrations and costs at the solution are, compared with those of right poses in frames without faults.
//! Nothing is assumed of faults.

mod pixels;
mod reference;
mod statistics;

pub(crate) use self::pixels::Pixels;
pub use self::reference::FitReference;
pub use self::statistics::FitStatistics;
pub(super) use self::statistics::Known;
use self::statistics::{STATISTICS, Suspect};
use crate::problem::Linearization;
use crate::scene::Frame;

/// How well a pose explains what was observed, beside right ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Probability that model and data are right.
    pub probability: f64,
    /// What fits worse than it does for right poses, by how many standard deviations, the worst first: `model`, `mask`, `depth`, `depth scale`,
    /// `hand`, `touch` or `color`.
    pub misfits: Vec<(&'static str, f64)>,
    /// What was compared.
    pub statistics: FitStatistics,
}

/// Standard deviations from which something counts as a misfit.
const MISFIT: f64 = 4.0;

impl Fit {
    /// Of `point` in `frame`, of which this is `known`.
    pub(super) fn new(frame: &Frame<'_>, point: &Linearization, known: &Known<'_>) -> Self {
        let statistics = FitStatistics::new(frame, point, known);
        let reference = FitReference::builtin();
        let misfits = misfits(&reference.scores(&statistics));
        Self { probability: reference.probability(&statistics), misfits, statistics }
    }
}

/// What the statistics that are off by these deviations point at.
fn misfits(scores: &[Option<f64>]) -> Vec<(&'static str, f64)> {
    let worst = |suspect: Suspect| {
        let of = STATISTICS.iter().zip(scores).filter(|(s, _)| s.suspect == suspect);
        of.filter_map(|(_, score)| *score).fold(0.0, f64::max)
    };
    let [depth, color, mask] = [Suspect::Depth, Suspect::Color, Suspect::Mask].map(worst);
    // A wrong model lies elsewhere than depth says, and looks different.
    let model = depth > MISFIT && color.max(mask) > MISFIT;
    let mut misfits = vec![
        (if model { "model" } else { "depth" }, depth),
        ("depth scale", worst(Suspect::DepthScale)),
        ("hand", worst(Suspect::Hand)),
        ("touch", worst(Suspect::Touch)),
    ];
    if !model {
        misfits.extend([("color", color), ("mask", mask)]);
    }
    misfits.retain(|(_, score)| *score > MISFIT);
    misfits.sort_by(|a, b| b.1.total_cmp(&a.1));
    misfits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine;
    use crate::scene::{Observation, default_scene};
    use crate::strategy::Fused;

    /// The fit of the built-in scene after a change of what was observed.
    fn fit(change: impl Fn(&mut Observation)) -> Fit {
        let mut scene = default_scene(3).unwrap();
        change(&mut scene.observation);
        let hand = Some(&scene.hand);
        let frame = Frame::new(&scene.observation, &scene.object, hand).unwrap();
        let found = refine(&frame, &scene.truth, &Fused::default()).unwrap();
        found.posterior.unwrap().fit.unwrap()
    }

    #[test]
    fn right_data_fit_and_wrong_data_do_not() {
        let right = fit(|_| ());
        assert!(right.probability > 0.9 && right.misfits.is_empty(), "{right:?}");
        let scaled = fit(|o| o.depth.pixels_mut().iter_mut().for_each(|z| *z *= 1.05));
        assert!(scaled.probability < 0.1, "{scaled:?}");
        let named = scaled.misfits.iter().any(|(what, _)| *what == "depth scale");
        assert!(named, "{scaled:?}");
        let displaced = fit(|o| {
            let hand = o.hand.as_mut().unwrap();
            hand.t_cam_hand.translation.x += 0.05;
        });
        assert!(displaced.probability < 0.1, "{displaced:?}");
        // A sensor less is no misfit.
        let without = fit(|o| o.hand = None);
        assert!(without.probability > 0.9, "{without:?}");
    }

    #[test]
    fn a_poses_probability_is_that_of_its_data_too() {
        let mut scene = default_scene(3).unwrap();
        scene.observation.depth.pixels_mut().iter_mut().for_each(|z| *z *= 1.05);
        let frame = Frame::new(&scene.observation, &scene.object, Some(&scene.hand)).unwrap();
        let posterior = refine(&frame, &scene.truth, &Fused::default()).unwrap().posterior.unwrap();
        let within = posterior.probability_within(5e-3, 5f64.to_radians());
        let fit = posterior.fit.as_ref().unwrap().probability;
        assert!((posterior.probability() - within * fit).abs() < 1e-12);
    }
}
