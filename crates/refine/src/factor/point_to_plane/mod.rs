//! Depth points on the planes of the surface nearest to them.

mod scatter;
mod smooth_field;

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use nalgebra::{DMatrix, DVector, Isometry3, Point3, SVector, Vector2, Vector3};
use prehend_autodiff::lie::twist_row;
use prehend_geometry::closest::Closest;
use prehend_render::Mask;
use rayon::prelude::*;

pub(crate) use self::scatter::NoiseEstimate;
use self::smooth_field::{FieldFit, SmoothField};
use super::facing::facing;
use super::patch_sums::{PatchSums, add_to};
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Factor, NoiseModel, NormalEquations, State, SurfacePatches, Weighting};
use crate::scene::{ModelErrorSettings, Object, PreparedFrame};

settings! {
    /// Settings of [`PointToPlaneFactor`].
    pub struct PointToPlaneSettings {
        /// Number of depth points at most, spread evenly over the mask.
        pub points: usize = 1000,
        /// Noise of distances of points from the surface \[m\].
        pub noise: NoiseModel = NoiseModel::cauchy(1.5e-3, 20.0),
        /// Standard deviation of the smooth field by which neighboring points are off alike \[m\]: errors of the depth camera and, unless
        /// surface patches account for them, of the object's model; zero if there is none.
        pub gp_sigma: f64 = 0.0,
        /// Length scale of that field, a Gaussian process over space \[m\]. EXPERIMENTS: Settings of the depth field.
        pub length_scale: f64 = ModelErrorSettings::default().length_scale,
        /// Margin of the mask in which points are left out \[px\], if at least half of all is left then: there depth is of what is in front or behind, or of
        /// both. EXPERIMENTS: Mask margin.
        pub margin: usize = 2,
        /// Distance in front of the hand from which a point is of something else \[m\]: the accuracy of a hand's pose and joints.
        pub in_front: f64 = 6e-3,
        /// Sine of the inclination to the line of sight below which surface counts less, down to nothing where it looks away.
        pub grazing: f64 = 0.2,
        /// Number of inducing points of the smooth field at most (Quiñonero-Candela and Rasmussen, 2005).
        pub inducing_points: usize = 24,
        /// Distance between them, as a share of the length scale.
        pub spacing: f64 = 0.5,
        /// Number of rounds of iteratively reweighted least squares in which field and weights are found.
        pub reweightings: usize = 3,
        /// Number of patches that the mask's bounding box is cut into, about, to judge how alike the errors of neighbors are.
        pub noise_patches: f64 = 36.0,
        /// Number of points from which a patch counts there.
        pub least_points: f64 = 3.0,
    }
}

/// Distances from the masked depth points to the planes that touch the surface where it is nearest to them (Chen and
/// Medioni, 1992), where the points are as the state corrects the camera ([`CameraCalibrationError`](crate::scene::CameraCalibrationError)).
///
/// A depth point is not of a surface that looks away from the camera: it belongs to what its line of sight meets first, or else counts as it is far, and pulls
/// nothing. What the points' errors have in common, a smooth field, is eliminated.
pub struct PointToPlaneFactor {
    object: Arc<Object>,
    points: Vec<MeasuredPoint>,
    field: Option<SmoothField>,
    /// Where the object may be off from its model.
    patches: Option<Arc<SurfacePatches>>,
    settings: PointToPlaneSettings,
}

/// A depth point.
struct MeasuredPoint {
    /// Its column and row.
    pixel: (usize, usize),
    /// Its direction, (x/z, y/z).
    ray: Vector2<f64>,
    /// Its depth as measured \[m\].
    depth: f64,
    /// The face that was nearest last: where a search begins changes how long it takes, not what it finds.
    face: AtomicU32,
}

/// Parameters of the object's pose and the camera together.
const N: usize = 12;

/// Distance from the surface within which a line of sight meets it \[m\], and steps to there at most: those of a line at 5° to the surface.
const MET: f64 = 1e-5;
const STEPS: usize = 96;

/// A point seen from the surface.
struct PlaneResidual {
    /// Signed distance from the surface \[m\].
    distance: f64,
    /// Signed distance from the nearest place of the surface \[m\], whether or not the point can be of that.
    nearest: f64,
    /// Whether the point can be of the surface that is nearest: from 0, which looks away from the camera, to 1.
    facing: f64,
    /// Nearest place of the surface \[m\], and the outward direction from there to the point (camera frame). Of a point behind what its line of sight meets
    /// first: its foot on the plane there, and the normal.
    surface: Vector3<f64>,
    away: Vector3<f64>,
}

impl PointToPlaneFactor {
    /// Factor of the masked depth of `frame`, except where the mask leaks onto the hand.
    ///
    /// # Errors
    /// If no pixel of the mask, beside the hand, has a depth.
    pub fn new(
        frame: &PreparedFrame<'_>,
        settings: &PointToPlaneSettings,
    ) -> Result<Self, RefineError> {
        let (object, hand) = (Arc::clone(frame.object()), frame.hand_depth());
        let (mask, camera) = (&frame.observation().mask, &frame.observation().camera);
        let settings = settings.clone();
        let point = |(x, y, depth): (usize, usize, f64)| MeasuredPoint {
            pixel: (x, y),
            ray: camera.unproject(x as f64, y as f64, 1.0).coords.xy(),
            depth,
            face: AtomicU32::new(u32::MAX),
        };
        let of_object = |&(x, y, depth): &(usize, usize, f64)| {
            let hand = hand.get(x, y).map_or(0.0, f64::from);
            hand == 0.0 || depth < hand - settings.in_front
        };
        let mut depths = frame.masked_depths(settings.points)?;
        depths.retain(of_object);
        let inside = |&(x, y, _): &(usize, usize, f64)| within(mask, [x, y], settings.margin);
        let central: Vec<_> = depths.iter().copied().filter(inside).collect();
        // Of an object that is hardly more than border, that must do.
        let depths =
            if central.len() as f64 > 0.5 * depths.len() as f64 { central } else { depths };
        let points: Vec<MeasuredPoint> = depths.into_iter().map(point).collect();
        if points.is_empty() {
            return Err(RefineError::NoDepth);
        }
        let places: Vec<_> = points.iter().map(|p| p.ray.push(1.0) * p.depth).collect();
        let field = SmoothField::new(&places, &settings);
        Ok(Self { object, points, field, patches: None, settings })
    }

    /// This factor for an object that may deviate from its model in `patches`.
    pub(crate) fn with_patches(self, patches: Arc<SurfacePatches>) -> Self {
        Self { patches: Some(patches), ..self }
    }

    /// Residual of each point at `state`; `None` without a nearest place on the surface.
    fn residuals(&self, state: &State) -> Vec<Option<PlaneResidual>> {
        let (t_object_cam, weighting) = (state.t_cam_object.inverse(), self.weighting());
        let residual = |point: &MeasuredPoint| {
            let place = state.camera.point(&point.ray, point.depth);
            let (query, face) = (t_object_cam * place, point.face.load(Ordering::Relaxed));
            let closest = self.object.surface.closest_with_hint(&query, f64::INFINITY, face)?;
            point.face.store(closest.face, Ordering::Relaxed);
            let normal = state.t_cam_object * self.object.normals[closest.face as usize];
            let surface = (state.t_cam_object * closest.point).coords;
            let offset = place.coords - surface;
            let distance = offset.norm().copysign(normal.dot(&offset));
            let facing = self.facing(state, &closest, &surface);
            let away =
                if distance.abs() > f64::EPSILON.sqrt() { offset / distance } else { normal };
            let residual = PlaneResidual { distance, nearest: distance, facing, surface, away };
            // What is far behind is of something else.
            if facing > 0.0 || !weighting.is_inlier(distance) {
                return Some(residual);
            }
            Some(self.first_met(&place, state, &t_object_cam, distance).unwrap_or(residual))
        };
        self.points.par_iter().with_min_len(64).map(residual).collect()
    }

    /// Visibility from 0 to 1 of the surface at `closest`, which is at `place` (camera frame \[m\]), by normals that are smooth over the surface: the cost must
    /// not jump as points pass from face to face.
    fn facing(&self, state: &State, closest: &Closest, place: &Vector3<f64>) -> f64 {
        let corners = &self.object.corner_normals[closest.face as usize];
        let smooth: Vector3<f64> =
            corners.iter().zip(closest.barycentric).map(|(normal, b)| normal * b).sum();
        facing(&(state.t_cam_object * smooth), place, self.settings.grazing)
    }

    /// Residual of the point at `place` (camera frame \[m\]), `nearest` to the surface by that distance, from the plane that its line of sight meets first,
    /// before that point: sphere tracing (Hart, 1996). At an edge that plane is another one at once, and the cost jumps by that one point's.
    fn first_met(
        &self,
        place: &Point3<f64>,
        state: &State,
        t_object_cam: &Isometry3<f64>,
        nearest: f64,
    ) -> Option<PlaneResidual> {
        let Object { surface, center, radius, .. } = &*self.object;
        let (eye, direction) = (t_object_cam * Point3::origin(), t_object_cam * place.coords);
        let length = direction.norm();
        let direction = direction / length;
        let mut along = ((center - eye).dot(&direction) - radius).max(0.0);
        let mut face = u32::MAX;
        for _ in 0..STEPS {
            let closest =
                surface.closest_with_hint(&(eye + direction * along), f64::INFINITY, face)?;
            (along, face) = (along + closest.distance, closest.face);
            if along >= length {
                return None;
            }
            if closest.distance < MET {
                let away = state.t_cam_object * self.object.normals[face as usize];
                let met = (state.t_cam_object * closest.point).coords;
                let facing = self.facing(state, &closest, &met);
                let distance = away.dot(&(place.coords - met));
                let surface = place.coords - away * distance;
                let residual = PlaneResidual { distance, nearest, facing, surface, away };
                return Some(residual).filter(|_| facing > 0.0);
            }
        }
        None
    }

    /// The field that the distances are best seen with, and what it leaves of them.
    fn fit(&self, residuals: &[Option<PlaneResidual>]) -> FieldFit {
        let distance = |r: &Option<PlaneResidual>| r.as_ref().map_or(0.0, |r| r.distance);
        let distances: Vec<f64> = residuals.iter().map(distance).collect();
        let weighting = self.weighting();
        let facing = |i: usize| residuals[i].as_ref().map_or(0.0, |r| r.facing);
        let weight = |i: usize, left: f64| facing(i) * weighting.weight(left);
        let fitted = self.field.as_ref().and_then(|field| field.fit(&distances, weight));
        fitted.unwrap_or_else(|| FieldFit::without_field(&distances, weight))
    }

    /// Nats at the fitted field.
    fn cost_of(&self, residuals: &[Option<PlaneResidual>], fit: &FieldFit) -> f64 {
        let weighting = self.weighting();
        let cost = |(left, residual): (&f64, &Option<PlaneResidual>)| {
            let Some(PlaneResidual { nearest, facing, .. }) = residual else { return 0.0 };
            facing * weighting.cost(*left) + (1.0 - facing) * weighting.cost(*nearest)
        };
        fit.left.iter().zip(residuals).map(cost).sum::<f64>() + fit.cost
    }

    fn weighting(&self) -> Weighting {
        self.settings.noise.weighting(self.points.len())
    }
}

/// Whether the pixels at this distance around (x, y), in eight directions, are in the mask or outside the image.
fn within(mask: &Mask, [x, y]: [usize; 2], distance: usize) -> bool {
    let at = |center: usize, step: usize| (center + step * distance).checked_sub(distance);
    let steps = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
    steps.into_iter().all(|(i, j)| match (at(x, i), at(y, j)) {
        (Some(x), Some(y)) => mask.get(x, y).unwrap_or(true),
        _ => true,
    })
}

impl Factor for PointToPlaneFactor {
    fn name(&self) -> &'static str {
        "point-to-plane"
    }

    fn cost(&self, state: &State) -> f64 {
        let residuals = self.residuals(state);
        self.cost_of(&residuals, &self.fit(&residuals))
    }

    fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
        let residuals = self.residuals(state);
        let fit = self.fit(&residuals);
        let seen = residuals.iter().flatten().count() as f64;
        equations.add_degrees(seen * self.weighting().degrees);
        let center = state.center();
        let row = |(point, residual): (&MeasuredPoint, &Option<PlaneResidual>)| {
            let mut row = [0.0; N];
            let Some(PlaneResidual { surface, away, .. }) = residual else { return row };
            let twist = twist_row(&(surface - center), &-away);
            let camera = state.camera.point_jacobian(&point.ray, point.depth).tr_mul(away);
            row[..6].copy_from_slice(twist.as_slice());
            row[6..].copy_from_slice(camera.as_slice());
            row
        };
        let rows: Vec<[f64; N]> = self.points.iter().zip(&residuals).map(row).collect();
        let patches = self.patches.as_ref().filter(|_| equations.displacements() > 0);
        let count = patches.map_or(0, |patches| patches.count());
        let patch = |i: usize| {
            let (column, row) = self.points[i].pixel;
            patches.and_then(|patches| patches.at(column, row))
        };
        let image_warp = equations.image_warp().map(|(warp, _)| Arc::clone(warp));
        // After all patches of the equations, whether or not this factor knows of them.
        let first = N + equations.displacements();
        let derivatives = |i: usize| {
            let at = patch(i).map(PatchSums::<N>::place);
            let displaced = at.into_iter().flat_map(|at| at..at + 3).zip(rows[i]);
            let (x, y) = self.points[i].pixel;
            let (pixel, ray) = (Vector2::new(x as f64, y as f64), self.points[i].ray);
            let by_camera = &rows[i][6..];
            let off = image_warp.iter().flat_map(move |w| w.derivatives(&pixel, &ray, by_camera));
            let off = off.map(move |(k, derivative)| (first + k, derivative));
            rows[i].into_iter().enumerate().chain(displaced).chain(off)
        };
        let weighted = || fit.weights.iter().zip(&fit.left).enumerate();
        let by_patch = || {
            let mut sums = PatchSums::<N>::new(count);
            for (i, (weight, left)) in weighted() {
                sums.add_row(patch(i), &SVector::from(rows[i]), *left, *weight);
            }
            sums
        };
        if image_warp.is_none() && self.field.is_none() {
            by_patch().add_plainly_to(equations);
            return self.cost_of(&residuals, &fit);
        }
        let (gradient, mut hessian) = if let Some(warp) = &image_warp {
            let size = first + warp.len();
            let (mut gradient, mut hessian) = (DVector::zeros(size), DMatrix::zeros(size, size));
            for (i, (weight, left)) in weighted() {
                let row: Vec<(usize, f64)> = derivatives(i).collect();
                for (r, by_row) in &row {
                    gradient[*r] += weight * left * by_row;
                    row.iter().for_each(|(c, d)| hessian[(*r, *c)] += weight * by_row * d);
                }
            }
            (gradient, hessian)
        } else {
            by_patch().equations()
        };
        if let Some(field) = &self.field {
            hessian -= field.lost(&fit, hessian.nrows(), derivatives);
        }
        add_to(equations, &gradient, &hessian);
        self.cost_of(&residuals, &fit)
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{
        assert_by_patches, assert_gradient, fixture, patches, scene,
    };
    use nalgebra::Translation3;
    use prehend_geometry::shapes::cuboid;
    use prehend_render::depth_map;

    use super::*;
    use crate::problem::Block;
    use crate::scene::Frame;

    /// With a smooth field of this standard deviation \[m\].
    fn factor(frame: &PreparedFrame<'_>, gp_sigma: f64) -> PointToPlaneFactor {
        let settings = PointToPlaneSettings { gp_sigma, ..Default::default() };
        PointToPlaneFactor::new(frame, &settings).unwrap()
    }

    #[test]
    fn gradients_match_differences() {
        for seed in 0..3 {
            let (frame, mut state) = fixture(seed);
            state.camera = state.camera.changed(&[2e-3, 1e-3, 1e-3, -1e-3, 2e-3, 1e-3]);
            let check = |state: &State, gp_sigma: f64| {
                for block in [Block::ObjectPose, Block::Camera] {
                    // What the few points pull that were matched with faces that look away is left out.
                    assert_gradient(&factor(&frame, gp_sigma), state, block, 1e-8, 0.03);
                }
            };
            check(&state, 0.0);
            // Near the truth, where a field may account for what is left.
            let near = State { t_cam_object: scene().truth, ..state };
            let twist = [1e-3, -2e-3, 1e-3, 0.02, -0.01, 0.01];
            check(&near.retract(&[Block::ObjectPose], &twist), 1e-3);
        }
    }

    #[test]
    fn residuals_lead_from_the_surface_to_the_points() {
        let (frame, state) = fixture(0);
        let factor = factor(&frame, 0.0);
        for (point, residual) in factor.points.iter().zip(factor.residuals(&state)) {
            let PlaneResidual { distance, surface, away, .. } = residual.unwrap();
            let place = state.camera.point(&point.ray, point.depth).coords;
            assert!((surface + away * distance - place).norm() < 1e-12);
            assert!((away.norm() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn patches_share_what_the_object_has() {
        let (frame, state) = fixture(1);
        let patches = patches(2);
        for gp_sigma in [0.0, 1e-3] {
            let factor = factor(&frame, gp_sigma).with_patches(Arc::clone(&patches));
            assert_by_patches(&factor, &state, &patches, 1e-9);
        }
    }

    #[test]
    fn the_cost_does_not_jump_as_points_pass_from_face_to_face() {
        let (frame, state) = fixture(0);
        let factor = factor(&frame, 1e-3);
        let near = State { t_cam_object: scene().truth, ..state };
        let turned = |i: i32| {
            let twist = [8e-3, 3e-3, 0.0, 0.0, 1e-5 * f64::from(i), 0.0];
            factor.cost(&near.retract(&[Block::ObjectPose], &twist))
        };
        let costs: Vec<f64> = (0..400).map(turned).collect();
        let jump = costs.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
        assert!(jump < 0.02, "{jump} nat");
    }

    /// Points on a plate that is taken for nearer by its thickness lie on its far side.
    #[test]
    fn thin_objects_are_not_taken_for_nearer() {
        let thickness = 5e-3;
        let mesh = cuboid(Vector3::new(0.12, 0.09, thickness));
        let plate = Arc::new(Object::with_mass("plate", mesh, None, 0).unwrap());
        let truth = Isometry3::new(Vector3::new(0.01, -0.02, 0.5), Vector3::new(0.2, -0.3, 0.1));
        let all = &scene().frame;
        let depth = depth_map(&all.camera, &[(&plate.model, truth)]);
        let set = depth.pixels().iter().map(|z| *z > 0.0).collect();
        let mask = Mask::new(all.camera.width, all.camera.height, set).unwrap();
        let observation = Frame { depth, mask, hand: None, ..all.clone() };
        let frame = PreparedFrame::new(&observation, &plate).unwrap();
        let factor = factor(&frame, 0.0);
        let at = |distance: f64| {
            let moved = truth * Translation3::new(0.0, 0.0, distance);
            State::new(&frame, &moved).unwrap()
        };
        let least = factor.cost(&at(0.0));
        for share in [-1.4, -1.0, -0.7, 0.7, 1.0, 1.4] {
            let near = at(share * thickness);
            assert!(factor.cost(&near) > 5.0 + 10.0 * least, "{share}");
            for block in [Block::ObjectPose, Block::Camera] {
                assert_gradient(&factor, &near, block, 1e-8, 1e-3);
            }
        }
    }

    #[test]
    fn the_truth_is_near_the_minimum() {
        let (frame, state) = fixture(0);
        let factor = factor(&frame, 0.0);
        let truth = State { t_cam_object: scene().truth, ..state.clone() };
        assert!(factor.cost(&truth) < 0.3 * factor.cost(&state));
    }
}
