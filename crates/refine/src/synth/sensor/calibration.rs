//! Calibration errors of camera, hand pose and joints.

use nalgebra::{Isometry3, Vector6};
use prehend_autodiff::lie::se3_exp;
use prehend_geometry::SplitMix64;
use prehend_render::Camera;

use super::settings::{CalibrationSettings, PlaySettings};

impl CalibrationSettings {
    /// The errors that last; `prismatic` says of each joint whether it slides.
    pub(super) fn draw(&self, prismatic: &[bool], noise: &mut SplitMix64) -> Miscalibration {
        let focal = [0; 2].map(|_| 1.0 + self.focal * noise.normal());
        let principal = [0; 2].map(|_| self.principal_px * noise.normal() / 640.0);
        let scale = (self.hand_translation, self.hand_rotation_deg, self.joint_deg);
        Miscalibration { focal, principal, hand: HandError::draw(scale, prismatic, noise) }
    }
}

impl PlaySettings {
    /// The errors of one frame; none, and no number drawn, if all deviations are zero.
    pub(super) fn draw(&self, prismatic: &[bool], noise: &mut SplitMix64) -> Option<HandError> {
        let scale = (self.hand_translation, self.hand_rotation_deg, self.joint_deg);
        (scale != (0.0, 0.0, 0.0)).then(|| HandError::draw(scale, prismatic, noise))
    }
}

/// Error of a hand's stated pose and joints.
pub(super) struct HandError {
    /// In the hand's base frame.
    pub(super) pose: Isometry3<f64>,
    pub(super) joints: Vec<f64>,
}

impl HandError {
    /// With deviations of places \[m\], turns \[deg\] and joints \[deg, or thousandths of it in m\].
    fn draw(
        (place, turn, joint): (f64, f64, f64),
        prismatic: &[bool],
        noise: &mut SplitMix64,
    ) -> Self {
        let scale = [place, turn.to_radians()];
        let pose = se3_exp(&Vector6::from_fn(|i, _| scale[i / 3] * noise.normal()));
        let unit = |slides: &bool| if *slides { 1e-3 } else { 1f64.to_radians() };
        let joints = prismatic.iter().map(|slides| joint * unit(slides) * noise.normal()).collect();
        Self { pose, joints }
    }

    /// The pose and the joint positions that are said of a hand.
    pub(super) fn apply(
        &self,
        t_cam_hand: &Isometry3<f64>,
        joints: &[f64],
    ) -> (Isometry3<f64>, Vec<f64>) {
        let joints = joints.iter().zip(&self.joints).map(|(q, error)| q + error).collect();
        (t_cam_hand * self.pose, joints)
    }
}

/// The errors that last.
pub(super) struct Miscalibration {
    pub(super) focal: [f64; 2],
    /// In widths of the image.
    pub(super) principal: [f64; 2],
    pub(super) hand: HandError,
}

impl Miscalibration {
    /// Stated camera of a true one.
    pub(super) fn camera(&self, camera: &Camera) -> Camera {
        let width = camera.width as f64;
        Camera {
            fx: camera.fx * self.focal[0],
            fy: camera.fy * self.focal[1],
            cx: camera.cx + self.principal[0] * width,
            cy: camera.cy + self.principal[1] * width,
            ..*camera
        }
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
            let told = errors.camera(&camera);
            let (hand, joints) = errors.hand.apply(&place, &[0.3, 0.1]);
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
        let (told, (hand, joints)) = (exact.camera(&camera), exact.hand.apply(&place, &[0.7]));
        assert_eq!((told, joints), (camera, vec![0.7]));
        assert!((hand.translation.vector - place.translation.vector).norm() < 1e-15);
    }
}
