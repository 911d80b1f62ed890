//! Correction of frames and objects by the calibration of a rig.

use nalgebra::Isometry3;
use prehend_render::{BrownConrady, Distortion};

use super::parameters::{Rig, of_other_joints};
use crate::error::RefineError;
use crate::scene::{Frame, Object};

/// Images of a lens that moves no pixel by more are taken as they are \[px\].
const STRAIGHT: f64 = 0.05;

impl Rig {
    /// The frame with the rig's errors corrected in its images, camera and hand.
    ///
    /// # Errors
    /// If images are of another size, or the hand has another number of joints.
    pub fn corrected(&self, observation: &Frame) -> Result<Frame, RefineError> {
        let mut corrected = observation.clone();
        let (camera, error) = (&mut corrected.camera, &self.camera);
        let (size, expected) = ([camera.width, camera.height], self.warp.depth.size());
        if size != expected {
            let problem = format!("is of images of {expected:?} pixels, not of {size:?}");
            return Err(RefineError::Setting { name: "rig", problem });
        }
        *camera = error.corrected(camera);
        for (i, z) in corrected.depth.pixels_mut().iter_mut().enumerate() {
            if *z > 0.0 {
                let (x, y) = ((i % size[0]) as f64, (i / size[0]) as f64);
                let offset = error.depth_bias + self.warp.depth.at(&self.depth_offsets, x, y);
                *z = (error.depth_scale * f64::from(*z) + offset) as f32;
            }
        }
        self.undistort(&mut corrected)?;
        if let Some(hand) = &mut corrected.hand {
            let (given, expected) = (hand.joints.len(), self.joints.len());
            if given != expected {
                return Err(of_other_joints(given, expected));
            }
            let mounted = hand.t_cam_hand * self.in_hand;
            hand.t_cam_hand = Isometry3::from_parts(
                (mounted.translation.vector + self.in_camera.translation.vector).into(),
                self.in_camera.rotation * mounted.rotation,
            );
            hand.joints.iter_mut().zip(&self.joints).for_each(|(q, error)| *q += error);
        }
        corrected.place_views();
        Ok(corrected)
    }

    /// Makes the images of a camera, corrected, those of a pinhole.
    fn undistort(&self, observation: &mut Frame) -> Result<(), RefineError> {
        let camera = observation.camera;
        // Coefficients of opposite signs may cancel at the corners and not inside; without signs they bound both.
        let bound = lens(self.distortion.map(f64::abs));
        let (right, below) = ((camera.width - 1) as f64, (camera.height - 1) as f64);
        let moved = [(0.0, 0.0), (right, 0.0), (0.0, below), (right, below)].map(|(x, y)| {
            let ray = camera.ray(x, y).xy();
            (bound.distort(ray) - ray).norm() * camera.fx.max(camera.fy)
        });
        if moved.into_iter().fold(0.0, f64::max) < STRAIGHT {
            return Ok(());
        }
        let remap = self.remaps.get(camera, Distortion::BrownConrady(lens(self.distortion)));
        observation.undistort(&remap).map_err(|error| RefineError::Setting {
            name: "rig",
            problem: format!("distortion: {error}"),
        })
    }

    /// Object `id` with its surface displaced; `None` if the rig knows nothing of it.
    ///
    /// # Errors
    /// If its mesh cannot be used any more.
    pub fn corrected_object(&self, id: u32, given: &Object) -> Result<Option<Object>, RefineError> {
        self.objects.get(&id).map(|deviation| deviation.corrected(given)).transpose()
    }
}

/// Brown–Conrady lens of radial coefficients k1 and k2.
fn lens([k1, k2]: [f64; 2]) -> BrownConrady {
    BrownConrady { radial: [k1, k2, 0.0, 0.0, 0.0, 0.0], tangential: [0.0; 2] }
}

#[cfg(test)]
mod tests {
    use prehend_render::{Mask, Remap};

    use super::*;
    use crate::calibration::{Calibrator, CalibratorSettings};
    use crate::scene::{Scene, default_scene};

    fn nominal() -> Rig {
        let objects = std::collections::BTreeMap::new();
        let settings = CalibratorSettings::default();
        Calibrator::new(16, (640, 480), objects, settings).unwrap().rig().clone()
    }

    /// The mask of a scene with a square in a corner instead, through a lens.
    fn through(scene: &Scene, distortion: [f64; 2]) -> (Mask, Frame) {
        let mut observation = scene.frame.clone();
        let mut square = Mask::filled(640, 480, false);
        for (i, set) in square.pixels_mut().iter_mut().enumerate() {
            *set = (20..60).contains(&(i % 640)) && (30..80).contains(&(i / 640));
        }
        let camera = observation.camera;
        let lens = Distortion::BrownConrady(lens(distortion));
        observation.mask = Remap::distort(camera, camera, &lens).mask(&square).unwrap();
        (square, observation)
    }

    fn different(a: &Mask, b: &Mask) -> usize {
        a.pixels().iter().zip(b.pixels()).filter(|(a, b)| a != b).count()
    }

    #[test]
    fn distortion_is_undone() {
        let scene = default_scene(1).unwrap();
        let mut rig = nominal();
        rig.distortion = [0.05, -0.02];
        let (square, seen) = through(&scene, rig.distortion);
        assert!(different(&square, &seen.mask) > 300);
        let corrected = rig.corrected(&seen).unwrap();
        // But for pixels at its border.
        assert!(different(&square, &corrected.mask) < 60);
    }

    #[test]
    fn a_lens_that_moves_no_corner_is_undone_too() {
        let scene = default_scene(1).unwrap();
        let mut rig = nominal();
        let camera = scene.frame.camera;
        let corner = camera.ray(0.0, 0.0).xy().norm_squared();
        rig.distortion = [0.1, -0.1 / corner];
        let corrected = rig.corrected(&scene.frame).unwrap();
        assert!(corrected.color.pixels() != scene.frame.color.pixels());
        rig.distortion = [0.0; 2];
        let corrected = rig.corrected(&scene.frame).unwrap();
        assert!(corrected.color.pixels() == scene.frame.color.pixels());
    }
}
