//! Visible surface discrepancy (Hodaň et al., "BOP: Benchmark for 6D Object Pose Estimation", ECCV 2018, with the
//! visibility of the challenges since 2019).

use prehend_render::{Camera, DepthImage};

/// How far the measured surface may lie before a model's and still show it \[m\].
pub(super) const VISIBILITY_TOLERANCE: f64 = 15e-3;

/// Tolerances of the misalignment, as fractions of the object's diameter.
pub(crate) const VSD_TOLERANCES: [f64; 10] =
    [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5];

/// The share of the visible surface that is out of place, in 0..=1, for each of [`VSD_TOLERANCES`].
///
/// `sensed` is the depth image of the scene, `estimate` and `truth` are those of the model alone in the estimated and
/// the true pose \[m, 0 where nothing is\], all of `camera`'s size; `diameter` is the object's \[m\]. Distances are
/// along the ray. A pixel of a model is visible where the scene is not nearer by more than
/// [`VISIBILITY_TOLERANCE`] or was not measured; the estimate is visible also where the truth is.
///
/// # Panics
/// If the images differ in size.
pub(crate) fn vsd(
    camera: &Camera,
    sensed: &DepthImage,
    estimate: &DepthImage,
    truth: &DepthImage,
    diameter: f64,
) -> [f64; VSD_TOLERANCES.len()] {
    let size = (camera.width, camera.height);
    let fits = |image: &DepthImage| (image.width(), image.height()) == size;
    assert!([sensed, estimate, truth].into_iter().all(fits), "the images differ in size");
    let (mut alone, mut off) = (0usize, [0usize; VSD_TOLERANCES.len()]);
    let mut union = 0usize;
    let pixels = sensed.pixels().iter().zip(estimate.pixels()).zip(truth.pixels());
    for (at, ((&sensed, &estimate), &truth)) in pixels.enumerate() {
        if estimate <= 0.0 && truth <= 0.0 {
            continue;
        }
        // The length of the ray to depth one.
        let ray = camera.unproject((at % size.0) as f64, (at / size.0) as f64, 1.0).coords.norm();
        let [sensed, estimate, truth] = [sensed, estimate, truth].map(|z| f64::from(z) * ray);
        let visible =
            |model: f64| model > 0.0 && (sensed <= 0.0 || model - sensed <= VISIBILITY_TOLERANCE);
        let of_truth = visible(truth);
        let of_estimate = visible(estimate) || (of_truth && estimate > 0.0);
        union += usize::from(of_truth || of_estimate);
        if of_truth && of_estimate {
            let apart = (truth - estimate).abs() / diameter;
            for (count, tolerance) in off.iter_mut().zip(VSD_TOLERANCES) {
                *count += usize::from(apart >= tolerance);
            }
        } else {
            alone += usize::from(of_truth || of_estimate);
        }
    }
    // Where neither is seen nothing is right.
    if union == 0 {
        return [1.0; VSD_TOLERANCES.len()];
    }
    off.map(|count| (count + alone) as f64 / union as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of four pixels looking straight ahead, nearly.
    fn row(depth: [f32; 4]) -> DepthImage {
        DepthImage::new(4, 1, depth.to_vec()).unwrap()
    }

    const CAMERA: Camera = Camera { fx: 1e6, fy: 1e6, cx: 1.5, cy: 0.0, width: 4, height: 1 };

    #[test]
    fn counts_what_is_missed_what_is_hidden_and_what_is_deep() {
        // Pixel 0: both, 1.2 cm apart; 1: only the truth; 2: hidden in both; 3: only the estimate, hidden.
        let truth = row([1.0, 1.0, 1.0, 0.0]);
        let estimate = row([1.012, 0.0, 1.0, 1.0]);
        let sensed = row([1.0, 1.0, 0.5, 0.5]);
        let errors = vsd(&CAMERA, &sensed, &estimate, &truth, 0.1);
        assert_eq!(errors[0], 1.0);
        assert_eq!(errors[1], 1.0);
        assert_eq!(errors[2..], [0.5; 8]);
    }

    #[test]
    fn unmeasured_pixels_count_as_visible_and_the_estimate_shows_where_the_truth_does() {
        let truth = row([1.0, 1.0, 0.0, 0.0]);
        // The second lies 5 cm behind the sensed surface, which shows the truth.
        let estimate = row([1.0, 1.052, 0.0, 0.0]);
        let sensed = row([0.0, 1.0, 0.0, 0.0]);
        let errors = vsd(&CAMERA, &sensed, &estimate, &truth, 0.2);
        assert_eq!(errors[..5], [0.5; 5]);
        assert_eq!(errors[5..], [0.0; 5]);
    }

    #[test]
    fn distances_are_along_the_ray_of_each_pixel() {
        // Two rows of two pixels: rays of length √3, √2 in the first row, √2 and 1 in the second.
        let camera = Camera { fx: 1.0, fy: 1.0, cx: 1.0, cy: 1.0, width: 2, height: 2 };
        let image = |depth: [f32; 4]| DepthImage::new(2, 2, depth.to_vec()).unwrap();
        // 10 cm in depth are 17.3, 14.1, 14.1 and 10 cm along the ray.
        let (truth, estimate) = (image([1.0; 4]), image([1.1; 4]));
        let errors = vsd(&camera, &truth, &estimate, &truth, 1.0);
        assert_eq!(errors, [1.0, 1.0, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        // 0.96 cm in depth before the model are 1.66, 1.36, 1.36 and 0.96 cm: only the first pixel is hidden.
        let sensed = image([0.9904; 4]);
        let estimate = image([0.0, 1.0, 1.0, 1.0]);
        assert_eq!(vsd(&camera, &sensed, &estimate, &truth, 1.0), [0.0; 10]);
    }

    #[test]
    fn what_only_one_pose_shows_is_wrong_whatever_the_size() {
        let (one, none) = (row([1.0, 0.0, 0.0, 0.0]), row([0.0; 4]));
        for (estimate, truth) in [(&one, &none), (&none, &one)] {
            assert_eq!(vsd(&CAMERA, &none, estimate, truth, 100.0), [1.0; 10]);
        }
    }

    #[test]
    fn a_distance_that_equals_the_tolerance_is_too_large() {
        let straight = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: 1, height: 1 };
        let image = |z| DepthImage::new(1, 1, vec![z]).unwrap();
        let (truth, estimate) = (image(1.0), image(1.25));
        let errors = vsd(&straight, &truth, &estimate, &truth, 1.0);
        assert_eq!(errors, [1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn nothing_seen_is_wrong() {
        let none = row([0.0; 4]);
        assert_eq!(vsd(&CAMERA, &none, &none, &none, 0.1), [1.0; 10]);
    }
}
