//! Settings of a calibration.

use nalgebra::DVector;

use crate::factor::PriorSettings;
use crate::problem::{Block, ImageWarp, RADIAL};
use crate::rig::Play;
use crate::strategy::Fused;

/// Settings of a [`Calibrator`](super::Calibrator): how frames are refined, and standard deviations of what is wrong with a rig.
#[derive(Clone, Debug)]
pub struct CalibratorSettings {
    /// How frames are refined, and how good models are.
    pub fused: Fused,
    /// Hand, joints and camera. The hand's are of its place and rotation both in its own axes and in those of the camera.
    pub prior: PriorSettings,
    /// Coefficients k1 and k2 of radial distortion, beside what is said of the lens.
    pub distortion: f64,
    /// The coefficients of the smooth field that depth is off by \[m\].
    pub depth_offset: f64,
    /// Play, as it is expected until frames say how much there is.
    pub play: Play,
    /// So many frames would outweigh that.
    pub play_weight: f64,
    /// Cells of the field that depth is off by, along the width of images.
    pub depth_cells: usize,
}

impl Default for CalibratorSettings {
    /// A robot and a depth camera of common accuracy, as in a single frame; a hand that may be off in both ways.
    fn default() -> Self {
        Self {
            fused: Fused::default(),
            prior: PriorSettings {
                hand_translation: 3e-3,
                hand_rotation: 10e-3,
                ..PriorSettings::default()
            },
            distortion: 0.02,
            depth_offset: 3e-3,
            play: Play { hand_translation: 4e-4, hand_rotation: 1.5e-3, joints: 4e-3 },
            play_weight: 5.0,
            depth_cells: 4,
        }
    }
}

impl CalibratorSettings {
    /// Standard deviations of the parameters of a rig.
    pub(super) fn sigmas(&self, joints: usize, warp: &ImageWarp) -> DVector<f64> {
        let blocks = [Block::HandPose, Block::HandPose, Block::Joints(joints), Block::Camera];
        let mut sigmas = blocks.map(|block| self.prior.sigmas(block)).concat();
        sigmas.resize(sigmas.len() + RADIAL, self.distortion);
        sigmas.resize(sigmas.len() + warp.depth.len(), self.depth_offset);
        DVector::from_vec(sigmas)
    }
}
