//! Motion of an object since a keyframe, by direct alignment of images.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix6, Point3, SMatrix, SVector, Vector3, Vector6};
use prehend_autodiff::lie::{perturb_about, so3_log, twist_row};
use prehend_render::{DepthImage, draw_depth};

use super::Tracker;
use super::memory::{Prediction, TrackState};
use super::pyramid::{LEVELS, PyramidLevel, pyramid};
use super::sight::Sight;
use crate::defaults::settings;
use crate::scene::{Object, median};

settings! {
    /// Settings of the alignment of images to a keyframe.
    #[derive(Copy)]
    pub struct KeyframeSettings {
        /// Number of points at most; zero for no alignment.
        pub points: usize = 300,
        /// Effective sample size of their intensities at most: shading and interpolation err alike in neighbors. EXPERIMENTS: Image alignment also in a known
        /// hand.
        pub effective_samples: f64 = 12.0,
        /// Share of the points that must be seen as in the keyframe, or this frame is the next one.
        pub least_inliers: f64 = 0.5,
        /// Share of the variance of intensities that must be explained, likewise.
        pub least_explained: f64 = 0.8,
        /// Drift of an object that seems to stand still, a random walk \[m/√s\]: errors that frames share are not averaged away.
        pub drift: f64 = 8e-4,
        /// Degrees of freedom of the residuals' Student's t distribution (Lange, Little and Taylor, 1989).
        pub degrees: f64 = 4.0,
        /// Intensity that is resolved: the smallest standard deviation of residuals, and contrast of a point that is of use. About one of 256 levels.
        pub resolution: f64 = 4e-3,
        /// Margin about a point in which the object must be seen, too \[px\].
        pub margin: usize = 2,
        /// Distance from the surface from which depth is of another thing \[m\].
        pub off_surface: f64 = 10e-3,
    }
}

/// Gauss–Newton steps in a level at most, and the displacement that ends them \[px\].
const STEPS: usize = 6;
const STEP: f64 = 0.02;

/// Points of an object's surface with their intensities in an image.
#[derive(Clone, Debug)]
pub(super) struct Keyframe {
    /// In the object's frame \[m\].
    points: Arc<[Point3<f64>]>,
    /// At each resolution, in the order of the points.
    intensities: [Arc<[f32]>; LEVELS],
    /// Object → camera in the last frame, by alignment with the keyframe alone.
    aligned: Isometry3<f64>,
    settings: KeyframeSettings,
}

/// Object → camera by alignment.
struct Alignment {
    pose: Isometry3<f64>,
    /// Covariance of a left twist about the object's center \[m², m rad, rad²\].
    covariance: Matrix6<f64>,
}

impl Keyframe {
    /// Points on `object` at `pose` that differ from their neighbors, spread over what is seen of it; none if these are too few.
    fn new(
        sight: &Sight,
        object: &Object,
        pose: &Isometry3<f64>,
        settings: &KeyframeSettings,
    ) -> Option<Self> {
        let center = pose * object.center;
        let levels = pyramid(sight, &center, object.radius)?;
        let PyramidLevel { camera, pixels } = &levels[0];
        let mut drawn = DepthImage::default();
        draw_depth(&mut drawn, camera, &[(&object.model, *pose)]);
        let full = &sight.frame.camera;
        let (left, top) = ((full.cx - camera.cx) as usize, (full.cy - camera.cy) as usize);
        let depth = drawn.pixels();
        let shows = |x: usize, y: usize| {
            let z = depth[y * camera.width + x];
            let at = (top + y) * full.width + left + x;
            let [hand, sensed] = [&sight.hand_depth, &sight.depth].map(|image| image.pixels()[at]);
            let off = f64::from((sensed - z).abs());
            z > 0.0
                && sight.frame.mask.pixels()[at]
                && !(hand > 0.0 && hand < z)
                && !(sensed > 0.0 && off > settings.off_surface)
        };
        let area = depth.iter().filter(|z| **z > 0.0).count();
        let cell = ((area as f64 / settings.points as f64).sqrt().ceil() as usize).max(1);
        let contrast = |x: usize, y: usize| {
            let at = y * camera.width + x;
            let across = (pixels[at + 1] - pixels[at - 1]).abs();
            across.max((pixels[at + camera.width] - pixels[at - camera.width]).abs())
        };
        let margin = settings.margin.max(1);
        let strongest = |(column, row): (usize, usize)| {
            let within = |from: usize, size: usize| {
                (from * cell).max(margin)..((from + 1) * cell).min(size - margin)
            };
            let places = within(row, camera.height)
                .flat_map(|y| within(column, camera.width).map(move |x| (x, y)));
            let best = places
                .filter(|&(x, y)| depth[y * camera.width + x] > 0.0)
                .max_by(|a, b| contrast(a.0, a.1).total_cmp(&contrast(b.0, b.1)))?;
            let (x, y) = best;
            let around =
                [(x, y), (x - margin, y), (x + margin, y), (x, y - margin), (x, y + margin)];
            let seen = around.into_iter().all(|(x, y)| shows(x, y));
            (seen && contrast(x, y) > settings.resolution as f32).then_some(best)
        };
        let to_object = pose.inverse();
        let cells = (0..camera.height.div_ceil(cell))
            .flat_map(|row| (0..camera.width.div_ceil(cell)).map(move |column| (column, row)));
        let points: Arc<[Point3<f64>]> = cells
            .filter_map(strongest)
            .map(|(x, y)| {
                let z = f64::from(depth[y * camera.width + x]);
                to_object * camera.unproject(x as f64, y as f64, z)
            })
            .collect();
        if (points.len() as f64) < settings.effective_samples {
            return None;
        }
        let intensities = levels.each_ref().map(|level| {
            let at = |point: &Point3<f64>| {
                let place = level.camera.project(&(pose * point))?;
                level.sample(place.x, place.y).map(|(value, _)| value as f32)
            };
            points.iter().map(|point| at(point).unwrap_or(f32::NAN)).collect()
        });
        Some(Self { points, intensities, aligned: *pose, settings: *settings })
    }

    /// Where the object is in `sight`, where it has moved by `motion` since the last frame but for an error of that covariance (a left twist about the
    /// object's center).
    fn align(
        &self,
        sight: &Sight,
        object: &Object,
        motion: &Isometry3<f64>,
        covariance: &Matrix6<f64>,
    ) -> Option<Alignment> {
        let settings = &self.settings;
        let expected = motion * self.aligned;
        let precision = covariance.try_inverse()?;
        let levels = pyramid(sight, &(expected * object.center), 2.0 * object.radius)?;
        let mut pose = expected;
        let mut found = None;
        for (level, intensities) in levels.iter().zip(&self.intensities).rev() {
            let mut brightness = [1.0, 0.0];
            let mut variance = f64::INFINITY;
            for _ in 0..STEPS {
                let system =
                    Normal::new(self, intensities, level, &pose, object, &brightness, variance);
                variance = system.variance;
                let share = (settings.effective_samples / system.samples).min(1.0);
                let off = deviation(&pose, &expected, &object.center);
                let mut hessian = system.hessian * share;
                let mut gradient = system.gradient * share;
                let mut block = hessian.fixed_view_mut::<6, 6>(0, 0);
                block += precision;
                let mut part = gradient.fixed_rows_mut::<6>(0);
                part += precision * off;
                let factor = hessian.cholesky()?;
                let step = -factor.solve(&gradient);
                let twist: Vector6<f64> = step.fixed_rows::<6>(0).into_owned();
                pose = perturb_about(&pose, &(pose * object.center).coords, &twist);
                brightness = [brightness[0] + step[6], brightness[1] + step[7]];
                let moved = twist.fixed_rows::<3>(0).norm()
                    + object.radius * twist.fixed_rows::<3>(3).norm();
                let pixel = (pose * object.center).z / level.camera.fx;
                found = Some((factor, system));
                if moved < STEP * pixel {
                    break;
                }
            }
        }
        let (factor, system) = found?;
        let covariance = factor.inverse().fixed_view::<6, 6>(0, 0).into_owned();
        let inliers = system.inliers / self.points.len() as f64;
        let is_seen =
            system.explained > settings.least_explained && inliers >= settings.least_inliers;
        is_seen.then_some(Alignment { pose, covariance })
    }
}

impl Tracker {
    /// Takes the motion since the last frame from the images, as far as they tell it.
    pub(super) fn align(&self, sight: &Sight, track: &TrackState, prediction: &mut Prediction) {
        let Some(keyframe) = &track.keyframe else { return };
        let before = track.state.t_cam_object;
        let motion = prediction.state.t_cam_object * before.inverse();
        let expected = &prediction.motion_covariance;
        let aligned = keyframe.align(sight, &self.object, &motion, expected);
        let Some(Alignment { pose, covariance }) = aligned else { return };
        let drift = self.settings.keyframe.drift.powi(2) * prediction.seconds;
        let turn = drift / self.object.radius.powi(2);
        let drift = Matrix6::from_diagonal(&[drift, drift, drift, turn, turn, turn].into());
        let measured = pose * keyframe.aligned.inverse() * before;
        prediction.measure(measured, &(covariance + drift));
        prediction.keyframe = Some(Keyframe { aligned: pose, ..keyframe.clone() });
    }

    /// A keyframe of an object that is in no hand: a hand that is known says better how what it holds has moved, than images that show half of it.
    pub(super) fn keyframe(&self, sight: &Sight, pose: &Isometry3<f64>) -> Option<Keyframe> {
        let in_hand = self.hand.is_some() && sight.frame.hand.is_some();
        let settings = &self.settings.keyframe;
        (!in_hand).then(|| Keyframe::new(sight, &self.object, pose, settings)).flatten()
    }
}

/// Twist about the object's `center` that takes `from` to `pose`.
pub(super) fn deviation(
    pose: &Isometry3<f64>,
    from: &Isometry3<f64>,
    center: &Point3<f64>,
) -> Vector6<f64> {
    let off = pose * center - from * center;
    let turn = so3_log(&(pose.rotation * from.rotation.inverse()));
    Vector6::new(off.x, off.y, off.z, turn.x, turn.y, turn.z)
}

/// Normal equations of an alignment: of a twist, and of gain and offset of the brightness.
struct Normal {
    hessian: SMatrix<f64, 8, 8>,
    gradient: SVector<f64, 8>,
    /// Points within the image.
    samples: f64,
    /// Variance of residuals.
    variance: f64,
    inliers: f64,
    /// Share of the variance of intensities.
    explained: f64,
}

impl Normal {
    fn new(
        keyframe: &Keyframe,
        intensities: &[f32],
        level: &PyramidLevel,
        pose: &Isometry3<f64>,
        object: &Object,
        [gain, offset]: &[f64; 2],
        before: f64,
    ) -> Self {
        let camera = &level.camera;
        let center = (pose * object.center).coords;
        let mut rows: Vec<(f64, SVector<f64, 8>, f64)> = Vec::with_capacity(intensities.len());
        for (point, &intensity) in keyframe.points.iter().zip(intensities) {
            let place = pose * point;
            let Some(at) = camera.project(&place) else { continue };
            let Some((value, [across, down])) = level.sample(at.x, at.y) else { continue };
            if intensity.is_nan() {
                continue;
            }
            let intensity = f64::from(intensity);
            let (x, y) = (across * camera.fx / place.z, down * camera.fy / place.z);
            let direction = Vector3::new(x, y, -(x * place.x + y * place.y) / place.z);
            let row = twist_row(&(place.coords - center), &direction);
            let row = SVector::from_fn(|k, _| match k {
                6 => -intensity,
                7 => -1.0,
                _ => row[k],
            });
            rows.push((value - gain * intensity - offset, row, value));
        }
        let samples = rows.len().max(1) as f64;
        // About that of a normal distribution, by the median; then the maximum likelihood by fixed point iterations.
        let mut variance = before;
        if before.is_infinite() {
            let size = median(rows.iter().map(|row| row.0.abs()));
            variance = size.map_or(1.0, |size| (2.0 * size).powi(2));
        }
        let KeyframeSettings { degrees, resolution, .. } = keyframe.settings;
        let least = f64::from(resolution as f32).powi(2);
        let weight = |residual: f64, variance: f64| {
            (degrees + 1.0) / (degrees + residual * residual / variance)
        };
        for _ in 0..3 {
            variance = variance.max(least);
            let sum: f64 = rows.iter().map(|(r, ..)| weight(*r, variance) * r * r).sum();
            variance = (sum / samples).max(least);
        }
        let mut hessian = SMatrix::<f64, 8, 8>::zeros();
        let mut gradient = SVector::<f64, 8>::zeros();
        let (mut inliers, mut weights, mut sum, mut squares, mut left) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (residual, row, value) in &rows {
            let w = weight(*residual, variance);
            hessian.ger(w / variance, row, row, 1.0);
            gradient.axpy(w * residual / variance, row, 1.0);
            inliers += f64::from(u8::from(residual * residual < 2.0 * degrees * variance));
            weights += w;
            sum += w * value;
            squares += w * value * value;
            left += w * residual * residual;
        }
        // Something is known of the brightness where no point is.
        hessian[(6, 6)] += 1.0;
        hessian[(7, 7)] += 1.0;
        let spread = squares - sum * sum / weights.max(f64::EPSILON);
        let explained = if spread > 0.0 { 1.0 - left / spread } else { 0.0 };
        Self { hessian, gradient, samples, variance, inliers, explained }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Sequence, default_sequence};
    use crate::tracker::sight::Images;

    /// The first frames of a sequence, as they are without a hand.
    fn sights(sequence: &Sequence) -> [Sight; 2] {
        [0, 2].map(|k| {
            let observation = sequence.frames[k].frame.clone();
            let mut sight = Sight::new(observation, Images::default());
            sight.frame.mask.copy_from(&sight.given);
            sight
        })
    }

    #[test]
    fn alignment_finds_the_motion_between_two_frames() {
        let sequence = default_sequence(1, 3).unwrap();
        let [first, second] = sights(&sequence);
        let [before, after] = [0, 2].map(|k| sequence.frames[k].truth);
        let (object, settings) = (&sequence.object, KeyframeSettings::default());
        let keyframe = Keyframe::new(&first, object, &before, &settings).unwrap();
        let truth = after * before.inverse();
        let errors = [2e-3, -1e-3, 2e-3, 0.02, -0.01, 0.02];
        let expected = perturb_about(&after, &(after * object.center).coords, &errors.into())
            * before.inverse();
        let covariance = Matrix6::from_diagonal(&[9e-6, 9e-6, 9e-6, 9e-4, 9e-4, 9e-4].into());
        let aligned = keyframe.align(&second, object, &expected, &covariance).unwrap();
        let off = deviation(&aligned.pose, &(truth * before), &object.center);
        let squared = off.dot(&(aligned.covariance.try_inverse().unwrap() * off));
        assert!(squared < 20.0, "χ² of six degrees of freedom: {squared}");
        for (k, error) in [(0, 3e-3), (3, 0.03)] {
            assert!(off.fixed_rows::<3>(k).norm() < 0.4 * error, "{off}");
        }
        // Another object's image is no motion.
        let mut other = second.frame.clone();
        let stripes = other.color.pixels_mut().iter_mut().enumerate();
        stripes.for_each(|(k, pixel)| *pixel = [(k % 7) as f32 / 7.0; 3]);
        let other = Sight::new(other, Images::default());
        assert!(keyframe.align(&other, object, &expected, &covariance).is_none());
    }

    #[test]
    fn the_gradient_is_the_derivative_of_the_residuals() {
        let sequence = default_sequence(1, 3).unwrap();
        let [first, _] = sights(&sequence);
        let (object, settings) = (&sequence.object, KeyframeSettings::default());
        let pose = sequence.frames[0].truth;
        let keyframe = Keyframe::new(&first, object, &pose, &settings).unwrap();
        let [_, level, _] = pyramid(&first, &(pose * object.center), object.radius).unwrap();
        let intensities = &keyframe.intensities[1];
        let residuals = |pose: &Isometry3<f64>| -> Vec<f64> {
            let residual = |(point, intensity): (&Point3<f64>, &f32)| {
                let at = level.camera.project(&(pose * point)).unwrap();
                level.sample(at.x, at.y).unwrap().0 - f64::from(*intensity)
            };
            keyframe.points.iter().zip(&intensities[..]).map(residual).collect()
        };
        let moved_by = |pose: &Isometry3<f64>, twist: &Vector6<f64>| {
            perturb_about(pose, &(pose * object.center).coords, twist)
        };
        let moved = moved_by(&pose, &[1e-3, 2e-3, -1e-3, 1e-2, 2e-2, -1e-2].into());
        let system = Normal::new(&keyframe, intensities, &level, &moved, object, &[1.0, 0.0], 1.0);
        let (step, middle) = (1e-7, residuals(&moved));
        for k in 0..6 {
            let along = |h: f64| residuals(&moved_by(&moved, &(Vector6::ith(k, h))));
            let (plus, minus) = (along(step), along(-step));
            let expected: f64 = (0..middle.len())
                .map(|i| {
                    let w = (settings.degrees + 1.0)
                        / (settings.degrees + middle[i] * middle[i] / system.variance);
                    w * middle[i] * (plus[i] - minus[i]) / (2.0 * step) / system.variance
                })
                .sum();
            let found = system.gradient[k];
            assert!(
                (found - expected).abs() < 1e-3 * expected.abs().max(1.0),
                "{k}: {found} {expected}"
            );
        }
    }
}
