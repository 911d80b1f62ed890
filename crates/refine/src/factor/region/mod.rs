//! Regions: colors within and around the object's outline, and the mask.

mod line;

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix6, Point3, Vector3, Vector6};
use prehend_autodiff::lie::twist_row;
use prehend_render::{Camera, DepthImage, OutlinePoint, outline_points};

use self::line::{Border, Misfit, REACH};
use super::patch_sums::PatchSums;
use super::rendering::{reprojected, seen_by_state};
use crate::defaults::settings;
use crate::error::RefineError;
use crate::problem::{Factor, NormalEquations, State};
use crate::scene::{ForegroundSettings, Object, PreparedFrame, RegionEvidence};

settings! {
    /// Settings of [`RegionFactor`].
    #[derive(Copy)]
    pub struct RegionSettings {
        /// Factor by which the image is made smaller.
        pub downsample: usize = 1,
        /// True if colors count beside the mask.
        pub color: bool = true,
        /// Standard deviation of the outline beside what the pixels tell \[px of the reduced image\].
        pub sigma: f64 = 0.5,
        /// Standard deviation of the object's surface about its model \[m\].
        pub surface: f64 = 0.0,
        /// Half-width of the Cauchy distribution of the outline's common offset from the border that pixels tell: colors mix at borders, surfaces that turn
        /// away are darker, masks are drawn too small or too large \[px of the reduced image\]. EXPERIMENTS: Offset of the outline.
        pub offset: f64 = 0.7,
        /// Effective sample size of the outline.
        pub effective_samples: f64 = 40.0,
        /// Cost of a part of the outline that nothing is seen of where it should be: something hides it \[nat\].
        pub hidden: f64 = 2.0,
        /// Cost of a part of the outline beyond which the object goes on \[nat\].
        pub exceeded: f64 = 8.0,
        /// Evidence of masks and colors that pixels are the object's.
        pub foreground: ForegroundSettings = ForegroundSettings::default(),
    }
}

impl RegionSettings {
    fn check(&self) -> Result<(), RefineError> {
        RefineError::require_positive(&[
            ("region.sigma", self.sigma),
            ("region.offset", self.offset),
            ("region.effective_samples", self.effective_samples),
            ("region.hidden", self.hidden),
            ("region.exceeded", self.exceeded),
            ("region.downsample", self.downsample as f64),
        ])
    }
}

/// Likelihood of the outline along lines across it, given the log-likelihood ratios of object and others of their pixels (Prisacariu and Reid, 2012;
/// Tjaden and others, 2018; Stoiber and others, 2022). Where nothing of a line is the object's, something hides it.
pub struct RegionFactor {
    object: Arc<Object>,
    camera: Camera,
    evidence: RegionEvidence,
    hand: Arc<DepthImage>,
    settings: RegionSettings,
}

/// Newton's steps to the common offset of the outline at most, and the last of them \[px\].
const OFFSET_STEPS: usize = 20;
const OFFSET_RESOLUTION: f64 = 1e-6;

/// A line across the outline.
struct Line {
    point: OutlinePoint,
    border: Border,
    /// Independent measurements that it amounts to.
    weight: f64,
}

impl RegionFactor {
    /// Factor of the image and the mask of `frame`.
    ///
    /// # Errors
    /// [`RefineError::EmptyMask`], [`RefineError::Setting`] for a setting that is not positive.
    pub fn new(frame: &PreparedFrame<'_>, settings: &RegionSettings) -> Result<Self, RefineError> {
        settings.check()?;
        let observation = frame.observation();
        let factor = settings.downsample;
        let color = settings.color && observation.has_colors();
        let evidence = frame.regions(color, &settings.foreground)?.reduced(factor);
        Ok(Self {
            object: Arc::clone(frame.object()),
            camera: observation.camera.scaled(1.0 / factor as f64),
            evidence,
            hand: Arc::clone(frame.hand_depth()),
            settings: *settings,
        })
    }

    /// Misfit of a common offset of the outline \[px\], which has a Cauchy distribution.
    fn offset_prior(&self, offset: f64) -> Misfit {
        let variance = self.settings.offset.powi(2);
        let information = 2.0 / (variance + offset * offset);
        let cost = (offset * offset / variance).ln_1p();
        Misfit { cost, slope: information * offset, information }
    }

    /// The lines at `seen` \[m\] that nothing known hides.
    fn lines(&self, seen: &Isometry3<f64>) -> Vec<Line> {
        let points = outline_points(&self.camera, &self.object.model, seen);
        let length: f64 = points.iter().map(|point| point.length).sum();
        let line = |point: OutlinePoint| {
            let OutlinePoint { pixel, outward, .. } = point;
            let place = |k: usize| pixel + (k as f64 - f64::from(REACH)) * outward;
            let evidence = std::array::from_fn(|k| self.evidence.at(&place(k)));
            let edges = std::array::from_fn(|k| self.evidence.edge_at(&(place(k) - 0.5 * outward)));
            let RegionSettings { sigma, surface, hidden, exceeded, .. } = self.settings;
            let sigma = sigma.hypot(surface * self.camera.fx / point.point.z);
            let border = Border::new(&evidence, &edges, sigma, [hidden, exceeded]);
            let weight = self.settings.effective_samples * point.length / length;
            Line { point, border, weight }
        };
        points.into_iter().filter(|point| !self.is_behind_hand(point)).map(line).collect()
    }

    fn is_behind_hand(&self, point: &OutlinePoint) -> bool {
        let factor = self.settings.downsample as f64;
        let [x, y] = [point.pixel.x, point.pixel.y].map(|v| ((v + 0.5) * factor).max(0.0) as usize);
        let hand = self.hand.get(x, y).unwrap_or_default();
        hand > 0.0 && f64::from(hand) < point.point.z
    }

    fn correspondences(&self, state: &State) -> Correspondences<'_> {
        let seen = reprojected(state);
        Correspondences { factor: self, lines: self.lines(&seen), to_object: seen.inverse() }
    }
}

impl Factor for RegionFactor {
    fn name(&self) -> &'static str {
        "region"
    }

    fn cost(&self, state: &State) -> f64 {
        self.correspondences(state).cost(state)
    }

    fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
        self.correspondences(state).linearize(state, equations)
    }

    fn conditional_at(&self, state: &State) -> Option<Box<dyn Factor + '_>> {
        Some(Box::new(self.correspondences(state)))
    }
}

/// The factor with lines and borders as they are at one pose.
struct Correspondences<'a> {
    factor: &'a RegionFactor,
    lines: Vec<Line>,
    /// Camera frame where the lines were found → object coordinates \[m\].
    to_object: Isometry3<f64>,
}

impl Correspondences<'_> {
    /// Each line with its point as it is at `seen` \[m\], and how far outward that is from the middle of the line \[px\].
    fn moved(&self, seen: &Isometry3<f64>) -> impl Iterator<Item = (&Line, Point3<f64>, f64)> {
        let motion = seen * self.to_object;
        self.lines.iter().filter_map(move |line| {
            let OutlinePoint { pixel, outward, point, .. } = line.point;
            let point = motion * point;
            let shown = self.factor.camera.project(&point)?;
            Some((line, point, outward.dot(&(shown - pixel))))
        })
    }

    /// Offset of the outline that fits best with the object at `seen` \[px\], and the information about it \[nat/px²\].
    fn offset(&self, seen: &Isometry3<f64>) -> (f64, f64) {
        let places: Vec<(&Line, f64)> =
            self.moved(seen).map(|(line, _, place)| (line, place)).collect();
        let misfit = |offset: f64| {
            let mut sum = self.factor.offset_prior(offset);
            for (Line { border, weight, .. }, place) in &places {
                let line = border.misfit(place - offset);
                sum.cost += weight * line.cost;
                sum.slope -= weight * line.slope;
                sum.information += weight * line.information;
            }
            sum
        };
        let (mut offset, mut at) = (0.0, misfit(0.0));
        let mut step = -at.slope / at.information;
        for _ in 0..OFFSET_STEPS {
            if step.abs() < OFFSET_RESOLUTION {
                break;
            }
            let next = misfit(offset + step);
            if next.cost <= at.cost {
                (offset, at) = (offset + step, next);
                step = -at.slope / at.information;
            } else {
                step *= 0.5;
            }
        }
        (offset, at.information)
    }
}

impl Factor for Correspondences<'_> {
    fn name(&self) -> &'static str {
        self.factor.name()
    }

    fn cost(&self, state: &State) -> f64 {
        let seen = reprojected(state);
        let (offset, _) = self.offset(&seen);
        let cost = |(line, _, place): (&Line, _, f64)| {
            line.weight * line.border.misfit(place - offset).cost
        };
        self.factor.offset_prior(offset).cost + self.moved(&seen).map(cost).sum::<f64>()
    }

    fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
        let seen = reprojected(state);
        let center = seen * self.factor.object.center;
        let Camera { fx, fy, .. } = self.factor.camera;
        let (mut gradient, mut hessian) = (Vector6::zeros(), Matrix6::zeros());
        let (offset, of_offset) = self.offset(&seen);
        let mut cost = self.factor.offset_prior(offset).cost;
        // Mixed derivative by pose and offset, which is eliminated (Schur's complement).
        let mut mixed = Vector6::zeros();
        let mut degrees = 0.0;
        for (line, point, place) in self.moved(&seen) {
            let Line { point: OutlinePoint { outward, .. }, border, weight } = line;
            let Misfit { cost: own, slope, information } = border.misfit(place - offset);
            cost += weight * own;
            degrees += weight;
            let [x, y] = [outward.x * fx, outward.y * fy].map(|n| n / point.z);
            let along = -(x * point.x + y * point.y) / point.z;
            let row: Vector6<f64> = twist_row(&(point - center), &Vector3::new(x, y, along));
            gradient += row * (weight * slope);
            hessian += row * row.transpose() * (weight * information);
            mixed += row * (weight * information);
        }
        hessian -= mixed * mixed.transpose() / of_offset;
        let chain = seen_by_state(state);
        let mut sums = PatchSums::<12>::new(0);
        sums.add(None, &chain.tr_mul(&gradient), &(chain.tr_mul(&hessian) * chain));
        let center = state.center();
        sums.add_to(&(center.xy() / center.z), equations);
        equations.add_degrees(degrees);
        cost
    }
}

#[cfg(test)]
mod tests {
    use super::super::gradient_check::{assert_gradient, fixture, scene};
    use super::*;
    use crate::problem::Block;

    #[test]
    fn gradient_matches_differences() {
        for seed in 0..3 {
            let (frame, mut state) = fixture(seed);
            let factor = RegionFactor::new(&frame, &RegionSettings::default()).unwrap();
            let near = factor.correspondences(&state);
            assert_gradient(&near, &state, Block::ObjectPose, 1e-6, 1e-4);
            state.camera = state.camera.changed(&[0.0, 0.0, 1e-3, -1e-3, 3e-3, 1e-3]);
            assert_gradient(&near, &state, Block::Camera, 1e-6, 1e-3);
        }
    }

    #[test]
    fn settings_that_are_not_positive_are_named() {
        let (frame, _) = fixture(0);
        let settings = RegionSettings { offset: 0.0, ..RegionSettings::default() };
        let refused = RegionFactor::new(&frame, &settings).err().unwrap();
        assert!(refused.to_string().contains("region.offset is 0"), "{refused}");
    }

    #[test]
    fn truth_fits_best() {
        let (frame, state) = fixture(0);
        let factor = RegionFactor::new(&frame, &RegionSettings::default()).unwrap();
        let truth = State { t_cam_object: scene().truth, ..state.clone() };
        assert!(factor.cost(&truth) < 0.3 * factor.cost(&state));
    }
}
