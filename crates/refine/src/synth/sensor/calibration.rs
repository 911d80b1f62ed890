//! Calibration errors of camera, hand pose and joints.

use nalgebra::{Isometry3, Vector6};
use prehend_autodiff::lie::se3_exp;
use prehend_geometry::SplitMix64;
use prehend_render::Camera;

use super::settings::CalibrationSettings;

impl CalibrationSettings {
    /// The errors of one grasp; `prismatic` says of each joint whether it slides.
    pub(super) fn draw(&self, prismatic: &[bool], noise: &mut SplitMix64) -> Miscalibration {
        let mut normal = |scale: f64| scale * noise.normal();
        let focal = [0; 2].map(|_| 1.0 + normal(self.focal));
        let principal = [0; 2].map(|_| normal(self.principal_px) / 640.0);
        let scale = [self.hand_translation, self.hand_rotation_deg.to_radians()];
        let hand = se3_exp(&Vector6::from_fn(|i, _| normal(scale[i / 3])));
        let joint = |slides: &bool| match slides {
            true => normal(1e-3 * self.joint_deg),
            false => normal(self.joint_deg.to_radians()),
        };
        let joints = prismatic.iter().map(joint).collect();
        Miscalibration { focal, principal, hand, joints }
    }
}

/// The errors of one grasp.
pub(super) struct Miscalibration {
    focal: [f64; 2],
    /// In widths of the image.
    principal: [f64; 2],
    /// In the hand's base frame.
    hand: Isometry3<f64>,
    joints: Vec<f64>,
}

impl Miscalibration {
    /// The camera, the hand's pose and the joint positions that the estimator is told.
    pub(super) fn apply(
        &self,
        camera: &Camera,
        t_cam_hand: &Isometry3<f64>,
        joints: &[f64],
    ) -> (Camera, Isometry3<f64>, Vec<f64>) {
        let width = camera.width as f64;
        let told = Camera {
            fx: camera.fx * self.focal[0],
            fy: camera.fy * self.focal[1],
            cx: camera.cx + self.principal[0] * width,
            cy: camera.cy + self.principal[1] * width,
            ..*camera
        };
        let joints = joints.iter().zip(&self.joints).map(|(q, error)| q + error).collect();
        (told, t_cam_hand * self.hand, joints)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::sensor::settings::SensorSettings;

    #[test]
    fn errors_are_as_large_as_asked_for() {
        let (settings, mut noise) = (SensorSettings::realistic().calibration, SplitMix64::new(13));
        let camera = Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
        let place = Isometry3::translation(0.1, 0.2, 0.5);
        let count = 400.0;
        let mut squares = [0.0; 6];
        for _ in 0..count as usize {
            let errors = settings.draw(&[false, true], &mut noise);
            let (told, hand, joints) = errors.apply(&camera, &place, &[0.3, 0.1]);
            let moved = place.inverse() * hand;
            let all = [
                (told.fx / 580.0 - 1.0) / settings.focal,
                (told.cy - 239.5) / settings.principal_px,
                moved.translation.vector.norm() / 3f64.sqrt() / settings.hand_translation,
                moved.rotation.angle().to_degrees() / 3f64.sqrt() / settings.hand_rotation_deg,
                (joints[0] - 0.3).to_degrees() / settings.joint_deg,
                (joints[1] - 0.1) * 1e3 / settings.joint_deg,
            ];
            all.iter().zip(&mut squares).for_each(|(e, sum)| *sum += e * e / count);
        }
        assert!(squares.iter().all(|s| (s.sqrt() - 1.0).abs() < 0.1), "{squares:?}");
        let exact = SensorSettings::clean().calibration.draw(&[false], &mut noise);
        let (told, hand, joints) = exact.apply(&camera, &place, &[0.7]);
        assert_eq!((told, joints), (camera, vec![0.7]));
        assert!((hand.translation.vector - place.translation.vector).norm() < 1e-15);
    }
}
