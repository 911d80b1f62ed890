//! A pose that is moved to where mask and depth have the object: poses to start from are off, and that is nothing to correct.

use std::borrow::Cow;

use nalgebra::{Isometry3, Point3, SVector, Vector2, Vector3, Vector6};
use prehend_autodiff::Quadratic;
use prehend_autodiff::lie::{perturb_about, twist_row};
use prehend_geometry::RobustKernel;
use prehend_render::{DepthImage, OutlinePoint, outline_points};

use super::evidence::{FrameImages, centroid};
use super::inputs::CheckInputs;
use crate::scene::median;

/// Pose, logarithm of the scale of depth, logarithm of the focal length.
pub(super) const UNKNOWNS: usize = 8;

/// Damping of a step, as a part of the mean curvature.
const DAMPING: f64 = 1e-3;

/// Pixels beyond a mask's border at which depth tells what the border is of \[px\].
const BEYOND: f64 = 3.0;

/// Sum of squares by the unknowns.
pub(super) type Sum = Quadratic<UNKNOWNS>;

/// A fit of inputs to what a frame shows.
pub(super) struct Fitted {
    /// Agreement with the frame times the plausibility of the move, 0 to 1.
    pub(super) agreement: f64,
    /// With the object where mask and depth have it.
    pub(super) inputs: CheckInputs,
    /// Sum of squares of outline, depth and pose there.
    pub(super) sum: Sum,
}

/// Images of a frame with the hand before a camera.
struct PoseFit<'a> {
    evidence: &'a FrameImages<'a>,
    hand: Option<Cow<'a, DepthImage>>,
}

impl FrameImages<'_> {
    /// `start` with the object moved to where mask and depth have it, and, if `sized`, with depth scaled; none where the object is not in view.
    pub(super) fn fit(&self, start: &CheckInputs, sized: bool) -> Option<Fitted> {
        let fit = PoseFit { evidence: self, hand: self.hand_drawn(start) };
        let (inputs, sum) = fit.align(start, sized)?;
        let plausible = fit.plausibility(start, &inputs.t_cam_object);
        let agreement = plausible * self.agreement(&inputs, fit.hand.as_deref());
        Some(Fitted { agreement, inputs, sum })
    }
}

impl PoseFit<'_> {
    /// The inputs of a fit, and their sum of squares.
    fn align(&self, start: &CheckInputs, sized: bool) -> Option<(CheckInputs, Sum)> {
        let start = self.placed(start)?;
        let radius = self.evidence.object.radius;
        let size = if sized && self.evidence.has_depth { 1.0 } else { 0.0 };
        // Steps in units of the radius.
        let units = SVector::from([radius, radius, radius, 1.0, 1.0, 1.0, size, 0.0]);
        let mut inputs = start;
        let settings = self.evidence.settings;
        for step in 0..settings.steps {
            // From far to near: at first all counts that is within reach.
            let width = 1.0 + 4.0 * (1.0 - step as f64 / settings.steps as f64);
            let sum = self.sum(&inputs, &start, width)?;
            let step = sum.in_units(&units).damped_step(DAMPING).component_mul(&units);
            let center = self.evidence.center(&inputs).coords;
            let twist = step.fixed_rows::<6>(0).into_owned();
            inputs.t_cam_object = perturb_about(&inputs.t_cam_object, &center, &twist);
            inputs.t_cam_object.rotation.renormalize();
            // What is measured stays what it is: the model is scaled.
            inputs.depth_scale *= step[6].exp();
            inputs.meters /= step[6].exp();
            let limit = settings.largest_size;
            let ratio = inputs.depth_scale / start.depth_scale;
            if !(limit.recip()..=limit).contains(&ratio) {
                return None;
            }
        }
        Some((inputs, self.sum(&inputs, &start, 1.0)?))
    }

    /// With the object moved to where the mask is, and where depth has it.
    fn placed(&self, start: &CheckInputs) -> Option<CheckInputs> {
        let mut inputs = *start;
        let camera = inputs.camera;
        let is_masked = |index: &usize| self.evidence.is_masked(&inputs, *index);
        let pixels = 0..self.evidence.frame.mask.pixels().len();
        let masked = centroid(camera.width, pixels.filter(is_masked))?;
        let measured = median(self.evidence.masked_points(&inputs).map(|(_, depth)| depth));
        // That the object is in view where it is sought, it is put before the mask.
        let mut center = self.evidence.center(&inputs);
        if center.z.is_nan() || center.z <= 0.0 && inputs.is_placed {
            return None;
        }
        if !inputs.is_placed {
            let z = measured.unwrap_or(center.z.abs().max(2.0 * self.evidence.object.radius));
            let sought = camera.unproject(masked.x, masked.y, z);
            inputs.t_cam_object.translation.vector += sought - center;
            center = sought;
        }
        for _ in 0..3 {
            let drawn = self.evidence.drawn(&inputs);
            let seen = || drawn.pixels().iter().enumerate().filter(|(_, z)| **z > 0.0);
            let surface = median(seen().map(|(_, z)| f64::from(*z)));
            let z = match (measured, surface) {
                (Some(measured), Some(surface)) => center.z + measured - surface,
                _ => center.z,
            };
            let at = centroid(camera.width, seen().map(|(index, _)| index));
            let at = at.or_else(|| camera.project(&center))?;
            if z <= 0.0 {
                return None;
            }
            let shift = camera.unproject(masked.x, masked.y, z) - camera.unproject(at.x, at.y, z);
            let to = Point3::new(center.x * z / center.z, center.y * z / center.z, z) + shift;
            inputs.t_cam_object.translation.vector += to - center;
            center = to;
        }
        inputs.t_cam_object.translation.vector.iter().all(|v| v.is_finite()).then_some(inputs)
    }

    /// Sum of squares at `inputs`, kernels so many times as wide as errors are.
    fn sum(&self, inputs: &CheckInputs, start: &CheckInputs, width: f64) -> Option<Sum> {
        let mut sum = Quadratic::zeros();
        self.add_depth(inputs, width, &mut sum);
        self.add_outline(inputs, width, &mut sum)?;
        self.add_prior(inputs, start, &mut sum);
        Some(sum)
    }

    fn add_depth(&self, inputs: &CheckInputs, width: f64, sum: &mut Sum) {
        let FrameImages { settings, .. } = self.evidence;
        let (object, center) = (&self.evidence.object, self.evidence.center(inputs));
        let inverse = inputs.t_cam_object.inverse();
        let sigma = settings.depth * object.radius;
        let kernel = RobustKernel::Cauchy { scale: width };
        let points: Vec<(Vector2<f64>, f64)> = self.evidence.masked_points(inputs).collect();
        let share = settings.measurements / points.len().max(1) as f64;
        for (pixel, depth) in &points {
            let point = inputs.camera.unproject(pixel.x, pixel.y, *depth);
            let Some(closest) = object.surface.closest(&(inverse * point), 2.0 * object.radius)
            else {
                continue;
            };
            let normal = inputs.t_cam_object.rotation * object.normals[closest.face as usize];
            let to = point - inputs.t_cam_object * closest.point;
            let residual = normal.dot(&to) / sigma;
            let twist = twist_row(&(point - center), &-normal);
            let by_focal = -(normal.x * point.x + normal.y * point.y);
            let row = joined(&twist, normal.dot(&point.coords), by_focal) / sigma;
            sum.add_row(&row, residual, share * kernel.weight(residual * residual));
        }
    }

    /// None of an object that is not in view.
    fn add_outline(&self, inputs: &CheckInputs, width: f64, sum: &mut Sum) -> Option<()> {
        let FrameImages { settings, .. } = self.evidence;
        let (object, camera) = (&self.evidence.object, &inputs.camera);
        let center = self.evidence.center(inputs);
        let outline = outline_points(camera, &object.model, &inputs.t_cam_object);
        if outline.is_empty() {
            return None;
        }
        let kernel = RobustKernel::Cauchy { scale: width };
        let reach = settings.reach * object.radius * camera.fx / center.z * width / 5.0;
        let reach = reach.clamp(6.0, camera.width as f64 / 4.0);
        let length: f64 = outline.iter().map(|point| point.length).sum();
        for at in &outline {
            let Some(border) = self.border(inputs, at, reach) else { continue };
            let OutlinePoint { outward, point, .. } = at;
            let (x, y, z) = (point.x, point.y, point.z);
            let gradient = Vector3::new(
                camera.fx * outward.x / z,
                camera.fy * outward.y / z,
                -(camera.fx * outward.x * x + camera.fy * outward.y * y) / (z * z),
            );
            let by_focal = -outward.dot(&(at.pixel - Vector2::new(camera.cx, camera.cy)));
            let twist = -twist_row(&(point - center), &gradient);
            let row = joined(&twist, 0.0, by_focal) / settings.outline;
            let residual = border / settings.outline;
            let weight = settings.measurements * at.length / length;
            sum.add_row(&row, residual, weight * kernel.weight(residual * residual));
        }
        Some(())
    }

    /// Distance of the mask's border outward of a point of the outline \[px\]; none where there is none within `reach`, or it is that of
    /// something in front.
    fn border(&self, inputs: &CheckInputs, at: &OutlinePoint, reach: f64) -> Option<f64> {
        let (width, height) = (inputs.camera.width, inputs.camera.height);
        let index = |along: f64| {
            let pixel = at.pixel + at.outward * along;
            let (x, y) = (pixel.x.round(), pixel.y.round());
            let inside = x >= 1.0 && y >= 1.0 && x < width as f64 - 1.0 && y < height as f64 - 1.0;
            inside.then(|| y as usize * width + x as usize)
        };
        let masked = |along: f64| index(along).map(|index| self.evidence.is_masked(inputs, index));
        // From the outline to whichever side the border is on.
        let inner = masked(0.0)?;
        let side = if inner { 1.0 } else { -1.0 };
        let mut along = 0.0;
        while masked(along)? == inner {
            along += side;
            if along.abs() > reach {
                return None;
            }
        }
        let border = along - 0.5 * side;
        let beyond = index(border + BEYOND)?;
        let tolerance = self.evidence.tolerance();
        let hides = |depth: f64| depth > 0.0 && depth < at.point.z - tolerance;
        let hand = self.hand.as_ref().map_or(0.0, |hand| f64::from(hand.pixels()[beyond]));
        (!hides(self.evidence.sensor(inputs, beyond)) && !hides(hand / inputs.meters))
            .then_some(border)
    }

    /// Adds the prior of poses: they are about where they are stated.
    fn add_prior(&self, inputs: &CheckInputs, start: &CheckInputs, sum: &mut Sum) {
        let turn = self.evidence.settings.turn;
        let off =
            (inputs.t_cam_object.rotation * start.t_cam_object.rotation.inverse()).scaled_axis();
        let shift = self.shift_sigma(start);
        let moved = self.evidence.center(inputs) - self.evidence.center(start);
        for axis in 0..3 {
            for (k, residual, sigma) in [(axis, moved[axis], shift), (axis + 3, off[axis], turn)] {
                let mut row = SVector::zeros();
                row[k] = sigma.recip();
                sum.add_row(&row, residual / sigma, 1.0);
            }
        }
    }

    /// Standard deviation of the translation.
    fn shift_sigma(&self, inputs: &CheckInputs) -> f64 {
        let [of_distance, of_radius] = self.evidence.settings.shift;
        of_distance * self.evidence.center(inputs).z.abs() + of_radius * self.evidence.object.radius
    }

    /// Plausibility that `start` is in truth at `to`, 0 to 1.
    fn plausibility(&self, start: &CheckInputs, to: &Isometry3<f64>) -> f64 {
        let turned = start.t_cam_object.rotation.angle_to(&to.rotation);
        let turned = turned / self.evidence.settings.turn;
        let moved = match start.is_placed {
            true => {
                let moved = to * self.evidence.object.center - self.evidence.center(start);
                moved.norm() / self.shift_sigma(start)
            }
            false => 0.0,
        };
        // An error in three directions, each as large as is expected, is nothing special.
        let excess = |squares: f64| (squares - 3.0).max(0.0);
        (-0.5 * (excess(turned * turned) + excess(moved * moved))).exp()
    }
}

/// Row of derivatives by the unknowns.
fn joined(twist: &Vector6<f64>, by_depth: f64, by_focal: f64) -> SVector<f64, UNKNOWNS> {
    let mut row = SVector::<f64, UNKNOWNS>::zeros();
    row.fixed_rows_mut::<6>(0).copy_from(twist);
    row[6] = by_depth;
    row[7] = by_focal;
    row
}
