//! Settings of a calibration.

use std::f64::consts::PI;

use nalgebra::DVector;

use crate::defaults::settings;
use crate::factor::PriorSettings;
use crate::problem::{Block, ImageWarp, RADIAL};
use crate::rig::Play;
use crate::strategy::FusedSettings;

settings! {
    /// Settings of a [`Calibrator`](super::Calibrator): how frames are refined, and standard deviations of what is wrong with a rig. The defaults are of
    /// a robot and a depth camera of common accuracy.
    pub struct CalibratorSettings {
        /// Estimator that refines frames, and accuracy of models.
        #[serde(skip)]
        pub fused: FusedSettings = FusedSettings::default(),
        /// Prior of hand, joints and camera. The hand's is of its place and rotation both in its own axes and in those of the camera.
        pub prior: PriorSettings = PriorSettings {
            hand_translation: 3e-3,
            hand_rotation: 10e-3,
            ..PriorSettings::default()
        },
        /// Standard deviation of the coefficients k1 and k2 of radial distortion, beside what is said of the lens.
        pub distortion: f64 = 0.02,
        /// Standard deviation of the coefficients of the smooth field that depth is off by \[m\].
        pub depth_offset: f64 = 3e-3,
        /// Play: standard deviations of what changes from frame to frame, as they are expected until frames tell.
        pub play: Play = Play { hand_translation: 4e-4, hand_rotation: 1.5e-3, joints: 4e-3 },
        /// Number of frames that would outweigh that.
        pub play_weight: f64 = 5.0,
        /// Number of cells of the field that depth is off by, along the width of images.
        pub depth_cells: usize = 4,
        /// Change of a parameter, in its standard deviations, from which the rig is still on its way; below, it is the mean of solutions.
        pub moving: f64 = 2.0,
        /// Disagreement with the rig, as a multiple of what is usual, from which a frame is left out.
        pub outlier_ratio: f64 = 3.5,
        /// Turn of an object in the camera below which it shows the same surface \[rad\]: what is wrong there is so in both frames.
        pub same_view_angle: f64 = 20.0 * PI / 180.0,
        /// Motion of an object in the camera below which it is in the same part of the image \[m\].
        pub same_view_distance: f64 = 0.05,
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
