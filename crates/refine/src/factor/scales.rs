//! Scales of errors: by which factors they are larger or smaller than their nominal sizes.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use crate::defaults::settings;
use crate::problem::Block;

/// A group of errors that share a scale.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, IntoStaticStr, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum ErrorGroup {
    /// The hand's pose in the camera frame.
    Hand,
    /// The hand's joint positions.
    Joints,
    /// Intrinsics and depth calibration of the camera.
    Camera,
    /// Other cameras: where they are, and their calibration.
    Views,
    /// The object's surface, and what neighboring depth points have in common.
    Surface,
}

impl ErrorGroup {
    /// The name used in reports.
    pub fn name(self) -> &'static str {
        self.into()
    }

    pub(crate) fn of(block: Block) -> Option<Self> {
        match block {
            Block::ObjectPose => None,
            Block::HandPose => Some(Self::Hand),
            Block::Joints(_) => Some(Self::Joints),
            Block::Camera => Some(Self::Camera),
            Block::View(_) => Some(Self::Views),
        }
    }
}

settings! {
    /// Prior of the scales s of all groups: ln s = c + d, normal with mean zero, c common to all groups and d of each by itself.
    #[derive(Copy)]
    pub struct ScaleSettings {
        // Errors within a factor of 2.5 of what is usual, groups alike within a factor of 1.6.
        /// Standard deviation of the common logarithm c: whoever calibrates one thing with care does so with others. Zero, with `own`, for sizes that are
        /// known. EXPERIMENTS: Prior of scales.
        pub common: f64 = 0.9,
        /// Standard deviation of each group's own logarithm d. EXPERIMENTS: Prior of scales.
        pub own: f64 = 0.3,
        /// Standard deviation of the logarithm of the scale of a factor's noise, each by itself.
        pub noise: f64 = 0.35,
    }
}

/// Logarithms of scales, by the groups that a frame tells of: posterior mean and covariance (Laplace). The default is nominal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scales {
    pub(crate) groups: Vec<ErrorGroup>,
    pub(crate) log: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
}

impl Scales {
    /// The scale of `group`: 1 if nothing tells of it.
    pub fn get(&self, group: ErrorGroup) -> f64 {
        let at = self.groups.iter().position(|known| *known == group);
        at.map_or(1.0, |k| self.log[k].exp())
    }

    /// The common part c of the logarithms: its posterior mean given them.
    pub(crate) fn common(&self, settings: &ScaleSettings) -> f64 {
        let (common, own) = (settings.common.powi(2), settings.own.powi(2));
        let count = self.log.len() as f64;
        if count == 0.0 || common == 0.0 {
            return 0.0;
        }
        self.log.sum() / (count + own / common)
    }

    /// Each group's logarithm of the scale with its standard deviation.
    pub fn iter(&self) -> impl Iterator<Item = (ErrorGroup, f64, f64)> {
        let of = |(k, group): (usize, &ErrorGroup)| {
            (*group, self.log[k], self.covariance[(k, k)].max(0.0).sqrt())
        };
        self.groups.iter().enumerate().map(of)
    }
}
