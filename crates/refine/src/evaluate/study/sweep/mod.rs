//! Faults of an observation by kind and amount, for the robustness study.

mod hand;
mod image;
mod occlusion;

use clap::ValueEnum;
use prehend_geometry::SplitMix64;
use serde::{Deserialize, Serialize};
use strum::Display;

use crate::data::bop::ResultRow;
use crate::scene::Frame;

/// A kind of fault that is swept from none to much; the documentation of the variants is the command's help.
///
/// Faults come on top of what is already wrong with an observation. A frame's fault is the same for every method, and of a
/// greater amount it is the same one, only more of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Display, ValueEnum)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Sweep {
    /// Depth noise, as a multiple of a realistic sensor's
    DepthNoise,
    /// Color noise, as a multiple of a realistic sensor's
    ColorNoise,
    /// Visible share of the object beside a block in front of it, in %
    Visibility,
    /// Position error of the hand, in mm
    HandPosition,
    /// Rotation error of the hand about its base, in °
    HandRotation,
    /// Error of every joint, either way, in °
    Joints,
    /// Share of taxels that report no force, in %
    DeadTaxels,
    /// Share of taxels that report random forces, in %
    FalseTaxels,
    /// Share of the image without depth, in patches, in %
    MissingDepth,
    /// Share of the image that is gray, in patches, in %
    MissingColor,
    /// Missing touch: 100 %, or 0
    MissingTouch,
    /// Missing hand, touch included: 100 %, or 0
    MissingHand,
}

impl Sweep {
    /// The amounts that the study compares; the first one means no fault.
    pub(super) fn amounts(self) -> &'static [u32] {
        match self {
            Self::DepthNoise | Self::ColorNoise => &[1, 2, 4, 8],
            Self::Visibility => &[100, 75, 50, 25, 10],
            Self::HandPosition => &[0, 2, 5, 10],
            Self::HandRotation | Self::Joints => &[0, 1, 2, 5],
            Self::DeadTaxels | Self::FalseTaxels | Self::MissingDepth => &[0, 25, 50, 75, 100],
            Self::MissingColor => &[0, 50, 100],
            Self::MissingTouch | Self::MissingHand => &[0, 100],
        }
    }

    /// Adds `amount` of the fault, in the unit that the variant names; `seed` seeds its random numbers.
    pub(super) fn perturb(self, observation: &mut Frame, amount: u32, seed: u64) {
        if amount == self.amounts()[0] {
            return;
        }
        let amount = f64::from(amount);
        let mut random = SplitMix64::new(seed);
        let (random, share) = (&mut random, 1e-2 * amount);
        let Frame { color, depth, .. } = observation;
        let width = depth.width();
        match (self, &mut observation.hand) {
            (Self::DepthNoise, _) => image::add_depth_noise(depth, amount, random),
            (Self::ColorNoise, _) => image::add_color_noise(color, amount, random),
            (Self::Visibility, _) => occlusion::block(observation, share, random),
            (Self::MissingDepth, _) => image::lose(depth.pixels_mut(), width, 0.0, share, random),
            // Gray.
            (Self::MissingColor, _) => {
                image::lose(color.pixels_mut(), width, [0.5; 3], share, random);
            }
            (_, None) => {}
            (Self::HandPosition, Some(hand)) => hand::shift(hand, 1e-3 * amount, random),
            (Self::HandRotation, Some(hand)) => hand::turn(hand, amount.to_radians(), random),
            (Self::Joints, Some(hand)) => hand::bend(hand, amount.to_radians(), random),
            (Self::DeadTaxels, Some(hand)) => hand::silence(hand, share, random),
            (Self::FalseTaxels, Some(hand)) => hand::invent(hand, share, random),
            (Self::MissingTouch, Some(hand)) => hand.forces.clear(),
            (Self::MissingHand, Some(_)) => observation.hand = None,
        }
    }

    /// A seed for this fault on the frame of `row`.
    pub(super) fn seed(self, row: &ResultRow) -> u64 {
        let words = [self as u64, row.scene_id.into(), row.im_id.into(), row.obj_id.into()];
        // A number of one sequence seeds the next, so that near words give unrelated seeds.
        words.into_iter().fold(0, |state, word| {
            (SplitMix64::new(state ^ word).uniform() * (1_u64 << 53) as f64) as u64
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::sync::Arc;

    use crate::scene::Hand;
    use nalgebra::{Isometry3, Vector3};
    use prehend_geometry::robot::KinematicTree;
    use prehend_render::{Camera, DepthImage, Mask, RgbImage};

    /// A square object half a meter away in the middle of a small picture, before a wall.
    pub(in super::super) fn square() -> Frame {
        let (width, height) = (80, 60);
        let inside = |k: usize| (30..50).contains(&(k % width)) && (20..40).contains(&(k / width));
        let count = width * height;
        let depth = (0..count).map(|k| if inside(k) { 0.5 } else { 1.0 }).collect();
        let hand = Arc::new(Hand::new(KinematicTree::rigid("palm", vec![]), vec![]).unwrap());
        Frame {
            camera: Camera { fx: 80.0, fy: 80.0, cx: 39.5, cy: 29.5, width, height },
            color: RgbImage::filled(width, height, [0.6, 0.3, 0.2]),
            depth: DepthImage::new(width, height, depth).unwrap(),
            mask: Mask::new(width, height, (0..count).map(inside).collect()).unwrap(),
            gravity: None,
            hand: Some(
                hand.measured(Isometry3::translation(0.0, 0.1, 0.5), vec![0.2; 16])
                    .with_forces((0..100).map(|k| Vector3::z() * f64::from(k % 2)).collect()),
            ),
            views: Vec::new(),
        }
    }

    fn same(a: &Frame, b: &Frame) -> bool {
        format!("{a:?}") == format!("{b:?}")
    }

    #[test]
    fn the_first_amount_is_nothing_and_every_other_is_something_that_repeats() {
        for &sweep in Sweep::value_variants() {
            for (k, &amount) in sweep.amounts().iter().enumerate() {
                let [mut once, mut again, mut other] = [square(), square(), square()];
                sweep.perturb(&mut once, amount, 5);
                sweep.perturb(&mut again, amount, 5);
                sweep.perturb(&mut other, amount, 6);
                assert!(same(&once, &again), "{sweep} {amount}");
                assert_eq!(same(&once, &square()), k == 0, "{sweep} {amount}");
                let all = [Sweep::DeadTaxels, Sweep::MissingDepth, Sweep::MissingColor];
                let whole = amount == 100 && all.contains(&sweep);
                let decided =
                    k == 0 || whole || [Sweep::MissingTouch, Sweep::MissingHand].contains(&sweep);
                assert_eq!(same(&once, &other), decided, "{sweep} {amount}");
                assert!(once.check_sizes().is_ok());
            }
        }
    }

    #[test]
    fn names_are_read_back_and_seeds_differ() {
        for &sweep in Sweep::value_variants() {
            assert_eq!(Sweep::from_str(&sweep.to_string(), false), Ok(sweep));
            let json = serde_json::to_string(&sweep).unwrap();
            assert_eq!(json, format!("\"{sweep}\""));
        }
        let mut seeds = std::collections::BTreeSet::new();
        for &sweep in Sweep::value_variants() {
            for (scene_id, im_id, obj_id) in [(0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)] {
                let t_cam_model = Isometry3::identity();
                let row = ResultRow { scene_id, im_id, obj_id, score: 0.0, t_cam_model, time: 0.0 };
                assert!(seeds.insert(sweep.seed(&row)));
            }
        }
    }
}
