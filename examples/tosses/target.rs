//! The rows of a toss that are to be explained.

use std::ops::Range;

use nalgebra::{DVector, Dyn, OMatrix, SMatrix, SVector, U22};
use prehend::autodiff::{Fwd, Scalar};
use prehend::sim::RungeKutta4;

use super::cube::{self, Path, Steps};
use super::flight::{self, NOISE};
use super::parameters::{self, COUNT, DEPTH, EXACT, HALF_WIDTH, LANES};
use super::recording::{Start, Toss};
use super::slide;

/// Width of the cube, by which positions are measured \[m\].
const WIDTH: f64 = 0.1048;
/// Change of the last coordinate for central differences.
const NUDGE: f64 = 0.05;
/// Percent of the width and degrees by which a slide may be off.
const SLIDE: f64 = 2.0;
/// Noise of the height at rest, where faces are not quite alike \[m\].
const REST_NOISE: f64 = 3e-4;

/// Rows to be explained.
#[derive(Clone)]
pub(crate) struct Target<'a> {
    pub(crate) toss: &'a Toss,
    pub(crate) start: Start,
    /// The first row, and how many.
    first: usize,
    rows: usize,
    /// Off by one in position \[m\] and attitude \[rad\].
    unit: [f64; 2],
    steps: Steps<RungeKutta4>,
    /// Height at rest, if it is to be explained \[m\].
    rest: Option<f64>,
}

impl<'a> Target<'a> {
    /// The flight of a toss, if it is long enough, and where the toss comes to rest.
    pub(crate) fn flight(toss: &'a Toss) -> Option<Self> {
        let (rows, start) = (flight::rows(toss), toss.rows[0].start(flight::GRAVITY));
        let rest = flight::rest(toss);
        (rows >= flight::SHORTEST).then_some(Self {
            toss,
            start,
            first: 0,
            rows,
            unit: NOISE,
            rest,
            steps: flight::STEPS,
        })
    }

    /// The rows up to some after the first touch, which may be off by percents of the width and degrees.
    pub(crate) fn contacts(toss: &'a Toss, start: Start, rows: usize, percent: f64) -> Self {
        let steps = Steps { integrator: RungeKutta4, per_row: 16, board: true };
        let rows = flight::rows(toss).saturating_add(rows).min(toss.rows.len());
        let unit = off(percent);
        Self { toss, start, first: 0, rows, unit, steps, rest: None }
    }

    /// The last slide of a toss, if it is long enough.
    pub(crate) fn slide(toss: &'a Toss) -> Option<Self> {
        let steps = Steps { integrator: RungeKutta4, per_row: 8, board: true };
        let (first, start) = slide::begin(toss)?;
        let rows = toss.rows.len() - first;
        Some(Self { toss, start, first, rows, unit: off(SLIDE), steps, rest: None })
    }

    /// Differences in position and attitude, so that the sum of their squares is the mean over the rows.
    fn residuals<S: Scalar>(&self, path: &Path<S>) -> Vec<S> {
        let mean = (self.rows as f64).sqrt().recip();
        let scales = self.unit.map(|unit| mean / unit);
        let rows = &self.toss.rows[self.first..];
        path.iter().zip(rows).flat_map(|(pose, row)| row.to(pose, scales)).collect()
    }

    /// The start with its derivatives by the coordinates `free`, if the rows tell it.
    pub(crate) fn start_by(
        &self,
        x: &[f64; COUNT],
        free: &Range<usize>,
    ) -> Option<Start<Fwd<LANES>>> {
        match self.first {
            0 => flight::begin(self.toss, &parameters::seeded(x, free)),
            _ => Some(self.start.cast()),
        }
    }

    /// The residuals and their derivatives by the coordinates `free`, from a start that may depend on them.
    pub(crate) fn linearized(
        &self,
        x: &[f64; COUNT],
        free: &Range<usize>,
        start: &Start<Fwd<LANES>>,
    ) -> Option<Linearized> {
        let values = parameters::seeded(x, free);
        // On a face.
        let stands = values[HALF_WIDTH] - values[DEPTH];
        let mut start = *start;
        if self.first > 0 {
            start.pose.translation.z = stands;
        }
        let path = cube::path(&self.steps, &values, &start, self.rows).ok()?;
        let mut exact = self.residuals(&path);
        exact.extend(self.rest.map(|height| stands.plus(-height).times(1.0 / REST_NOISE)));
        let mut slopes = Slopes::zeros(exact.len());
        for (mut row, residual) in slopes.row_iter_mut().zip(&exact) {
            for (slope, lane) in
                row.columns_range_mut(free.clone()).iter_mut().zip(residual.derivative)
            {
                *slope = lane;
            }
        }
        if free.contains(&EXACT) {
            let nudged = |change: f64| {
                let mut x = *x;
                x[EXACT] += change;
                let path =
                    cube::path(&self.steps, &parameters::values(&x), &start.value(), self.rows);
                Some(self.residuals(&path.ok()?))
            };
            for ((slope, more), less) in
                slopes.column_mut(EXACT).iter_mut().zip(nudged(NUDGE)?).zip(nudged(-NUDGE)?)
            {
                *slope = (more - less) / (2.0 * NUDGE);
            }
        }
        Some(Linearized {
            residuals: DVector::from_iterator(exact.len(), exact.iter().map(|r| r.value)),
            slopes,
        })
    }
}

/// Percent of the width, and as many degrees \[m, rad\].
fn off(percent: f64) -> [f64; 2] {
    [percent / 100.0 * WIDTH, percent.to_radians()]
}

type Slopes = OMatrix<f64, Dyn, U22>;

/// Residuals of a toss and their derivatives.
pub(crate) struct Linearized {
    residuals: DVector<f64>,
    slopes: Slopes,
}

/// One toss in the normal equations.
pub(crate) struct Part {
    pub(crate) value: f64,
    pub(crate) gradient: SVector<f64, COUNT>,
    pub(crate) matrix: SMatrix<f64, COUNT, COUNT>,
}

impl Linearized {
    pub(crate) fn slopes(&self) -> &Slopes {
        &self.slopes
    }

    /// Derivative of ½ ln(1 + |r|²) by ½ |r|²: a toss that tumbles another way counts little.
    pub(crate) fn weight(&self) -> f64 {
        (1.0 + self.residuals.norm_squared()).recip()
    }

    pub(crate) fn part(&self) -> Part {
        let weight = self.weight();
        Part {
            value: 0.5 * self.residuals.norm_squared().ln_1p(),
            gradient: self.slopes.tr_mul(&self.residuals) * weight,
            matrix: self.slopes.tr_mul(&self.slopes) * weight,
        }
    }
}
