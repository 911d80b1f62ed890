//! Initial poses: true poses with the errors of a vision system.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;
use strum::{Display, EnumString, IntoStaticStr, VariantNames};

use crate::scene::Target;

/// Noise level of initial poses. Errors are added to the pose's own translation and rotation, as PE and OE measure them, so
/// that the stated means hold for any choice of the model's origin.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, Display, EnumString, IntoStaticStr, VariantNames,
)]
#[strum(serialize_all = "kebab-case", parse_err_ty = String, parse_err_fn = unknown)]
pub enum NoiseLevel {
    /// The paper's lower level: mean PE 0.65 cm, mean OE 6.98°, the same in all directions.
    Low,
    /// The paper's higher level: mean PE 2.21 cm, mean OE 15.25°, the same in all directions.
    High,
    /// As estimators from color images err: 17 to 40 mm, of which more than 95 % along the view ray, and 2.5° to
    /// 6.6°; the ranges of MegaPose's errors on a scene of YCB-V.
    Ray,
}

/// Mean length of a vector of three independent standard normal numbers: √(8/π).
const MEAN_LENGTH: f64 = 1.595_769_121_605_731;
/// Smallest component of the error along the view ray, as a fraction of its length.
const RAY_SHARE: f64 = 0.95;

impl NoiseLevel {
    /// The name used on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// `truth` with an error drawn from `random`.
    pub(crate) fn perturb(self, truth: &Isometry3<f64>, random: &mut SplitMix64) -> Isometry3<f64> {
        let (offset, turn) = match self {
            Self::Low => isotropic(0.65e-2, 6.98_f64.to_radians(), random),
            Self::High => isotropic(2.21e-2, 15.25_f64.to_radians(), random),
            Self::Ray => along_ray(&truth.translation.vector, random),
        };
        Isometry3::from_parts(
            Translation3::from(truth.translation.vector + offset),
            UnitQuaternion::from_scaled_axis(turn) * truth.rotation,
        )
    }

    /// `truth` (object → camera \[m\]) with a random error that depends on `seed` and the target alone, so that the poses of a
    /// part of a dataset are those of the whole.
    ///
    /// At the paper's levels, of which it gives the means alone, translation and rotation vector are normally
    /// distributed, each component with the same variance. At the other, length, share and angle are uniform.
    pub fn perturb_target(
        self,
        truth: &Isometry3<f64>,
        seed: u64,
        target: &Target,
    ) -> Isometry3<f64> {
        let Target { scene_id, im_id, obj_id, instance } = *target;
        let ids = [scene_id.into(), im_id.into(), obj_id.into(), instance as u64];
        let mix =
            |state: u64, id: u64| (state ^ id).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
        self.perturb(truth, &mut SplitMix64::new(ids.into_iter().fold(seed, mix)))
    }
}

fn unknown(text: &str) -> String {
    format!("unknown noise level {text:?}: one of {}", NoiseLevel::VARIANTS.join(", "))
}

/// Offset \[m\] and rotation vector \[rad\] with these mean lengths.
fn isotropic(length: f64, angle: f64, random: &mut SplitMix64) -> (Vector3<f64>, Vector3<f64>) {
    let mut normal = || Vector3::from_fn(|_, _| random.normal()) / MEAN_LENGTH;
    (normal() * length, normal() * angle)
}

fn along_ray(place: &Vector3<f64>, random: &mut SplitMix64) -> (Vector3<f64>, Vector3<f64>) {
    let ray = place.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
    let length = between(17e-3, 40e-3);
    let share = between(RAY_SHARE, 1.0);
    let side = if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
    let angle = between(2.5, 6.6).to_radians();
    let across = random_direction(random);
    let across =
        (across - ray * ray.dot(&across)).try_normalize(1e-9).unwrap_or_else(Vector3::zeros);
    let offset = ray * (side * share) + across * (1.0 - share * share).sqrt();
    (offset * length, random_direction(random) * angle)
}

/// A direction, uniform on the unit sphere.
pub(crate) fn random_direction(random: &mut SplitMix64) -> Vector3<f64> {
    let normal = Vector3::from_fn(|_, _| random.normal());
    normal.try_normalize(0.0).unwrap_or_else(Vector3::x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::metrics::{oe_deg, pe_cm};

    fn truth() -> Isometry3<f64> {
        Isometry3::new(Vector3::new(0.1, -0.05, 0.6), Vector3::new(0.4, -1.0, 2.0))
    }

    #[test]
    fn means_are_the_papers_and_targets_have_errors_of_their_own() {
        let n = 20_000;
        for (level, pe, oe) in [(NoiseLevel::Low, 0.65, 6.98), (NoiseLevel::High, 2.21, 15.25)] {
            let of = |seed, im_id| {
                let target = Target { scene_id: 1, im_id, obj_id: 5, instance: 0 };
                level.perturb_target(&truth(), seed, &target)
            };
            assert_eq!(of(1, 0), of(1, 0));
            assert!(pe_cm(&of(1, 0), &of(1, 1)) > 1e-3 && pe_cm(&of(1, 0), &of(2, 0)) > 1e-3);
            let (mut sums, mut mean) = ([0.0; 2], Vector3::zeros());
            for pose in (0..n).map(|im_id| of(3, im_id)) {
                sums[0] += pe_cm(&pose, &truth()) / f64::from(n);
                sums[1] += oe_deg(&pose, &truth()) / f64::from(n);
                mean += (pose.translation.vector - truth().translation.vector) / f64::from(n);
            }
            // The standard deviation of a length is 0.42 of its mean: 0.3 % of the mean of 20 000.
            let near = (sums[0] / pe - 1.0).abs() < 0.01 && (sums[1] / oe - 1.0).abs() < 0.01;
            assert!(near, "{sums:?}");
            assert!(mean.norm() < 0.02 * pe * 1e-2, "{mean}");
        }
    }

    #[test]
    fn the_ray_level_errs_along_the_ray() {
        let mut random = SplitMix64::new(4);
        let ray = truth().translation.vector.normalize();
        let mut towards = 0;
        for _ in 0..2000 {
            let pose = NoiseLevel::Ray.perturb(&truth(), &mut random);
            let offset = pose.translation.vector - truth().translation.vector;
            let along = offset.dot(&ray);
            assert!(along.abs() >= 0.95 * offset.norm());
            assert!((0.017..0.040).contains(&offset.norm()));
            assert!((2.4999..6.6001).contains(&oe_deg(&pose, &truth())));
            towards += usize::from(along < 0.0);
        }
        assert!((900..1100).contains(&towards), "{towards}");
    }

    #[test]
    fn names_are_read_back() {
        for name in NoiseLevel::VARIANTS {
            assert_eq!(name.parse::<NoiseLevel>().unwrap().name(), *name);
        }
        assert!("loud".parse::<NoiseLevel>().is_err());
    }
}
