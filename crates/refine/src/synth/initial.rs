//! Initial poses as wrong as a vision system's.

use nalgebra::{Isometry3, Point3, Vector6};
use prehend_autodiff::lie::perturb_about;
use prehend_geometry::SplitMix64;

/// How wrong initial poses are: normally distributed, the same in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialNoise {
    /// Mean length of the translation \[m\].
    pub mean_translation: f64,
    /// Mean angle of the rotation \[rad\].
    pub mean_rotation: f64,
}

impl InitialNoise {
    /// The paper's lower level: 0.65 cm and 6.98°.
    pub const LOW: Self = Self { mean_translation: 0.0065, mean_rotation: 6.98_f64.to_radians() };
    /// The paper's higher level: 2.21 cm and 15.25°.
    pub const HIGH: Self = Self { mean_translation: 0.0221, mean_rotation: 15.25_f64.to_radians() };

    /// `truth` (object → camera) moved and turned about `centre` (camera frame).
    pub fn perturb(
        &self,
        truth: &Isometry3<f64>,
        centre: &Point3<f64>,
        noise: &mut SplitMix64,
    ) -> Isometry3<f64> {
        // The mean length of a normal vector in space is σ √(8/π).
        let length = (8.0 / std::f64::consts::PI).sqrt();
        let scale = [self.mean_translation / length, self.mean_rotation / length];
        let error = Vector6::from_fn(|i, _| scale[i / 3] * noise.normal());
        perturb_about(truth, &centre.coords, &error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_the_paper() {
        let truth = Isometry3::translation(0.1, -0.1, 0.5);
        let centre = Point3::new(0.1, -0.1, 0.5);
        let mut noise = SplitMix64::new(1);
        for (level, cm, degrees) in
            [(InitialNoise::LOW, 0.65, 6.98), (InitialNoise::HIGH, 2.21, 15.25)]
        {
            let (mut moved, mut turned) = (0.0, 0.0);
            for _ in 0..4000 {
                let pose = level.perturb(&truth, &centre, &mut noise);
                moved += (pose.translation.vector - truth.translation.vector).norm() / 40.0;
                turned += pose.rotation.angle_to(&truth.rotation).to_degrees() / 4000.0;
            }
            assert!((moved / cm - 1.0).abs() < 0.03, "{moved}");
            assert!((turned / degrees - 1.0).abs() < 0.03, "{turned}");
        }
    }
}
