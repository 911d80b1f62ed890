//! Scales of errors, learnt from each frame (empirical Bayes).

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

use crate::factor::{ErrorGroup, ScaleSettings, Scales};
use crate::problem::{Block, Linearization, NoiseScale, RIDGE, ScaledCholesky};

/// Steps at most, and the change that ends them.
const STEPS: usize = 12;
const CONVERGED: f64 = 1e-2;

/// The scale exp(u) of a factor's noise whose posterior density is the largest: its residuals have this `chi_square` by so many `degrees` of freedom at a
/// scale of one, and −ln p(u | χ²) = n u + ½ χ² exp(−2u) + ½ u²/τ². Not below one: residuals that are smaller than usual are no more independent.
pub(super) fn noise_scale(chi_square: f64, degrees: f64, settings: &ScaleSettings) -> NoiseScale {
    if settings.noise == 0.0 {
        return NoiseScale::ONE;
    }
    let precision = settings.noise.powi(-2);
    let mut log = 0.0;
    for _ in 0..STEPS {
        let expected = chi_square * f64::exp(-2.0 * log);
        let gradient = expected - degrees - precision * log;
        let step: f64 = gradient / (2.0 * expected + precision);
        log += step.clamp(-1.0, 1.0);
    }
    let log = log.max(0.0);
    NoiseScale { scale: log.exp(), cost: degrees * log + 0.5 * precision * log * log }
}

/// The evidence of scales: the quadratic model of a frame's factors about a solution, with its priors apart.
///
/// With data of gradient g and Hessian H about the solution, whose calibrations deviate by e from their nominal values, and a prior of precision Λ(s),
/// the marginal likelihood of the scales (MacKay, 1992) is p(D|s) ∝ |Λ|^½ |H + Λ|^−½ exp(−E), where E is the least value of
/// gᵀδ + ½ δᵀHδ + ½ (e + δ)ᵀΛ(e + δ).
pub(super) struct ScaleEvidence {
    /// Data alone.
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
    /// Precision at scales of one, and deviation from nominal values.
    precision: DMatrix<f64>,
    deviation: DVector<f64>,
    /// Where the object's pose begins.
    pose: usize,
    /// The group of each parameter, as its place in `groups`.
    of_parameters: Vec<Option<usize>>,
    groups: Vec<ErrorGroup>,
    /// Precision of the logarithms' prior.
    hyperprior: DMatrix<f64>,
}

impl ScaleEvidence {
    /// Evidence of scales about the solution `point`, found with the scales `now`; `None` without a prior, or if the scales are known.
    pub(super) fn new(
        point: &Linearization,
        now: &Scales,
        settings: &ScaleSettings,
    ) -> Option<Self> {
        let prior = &point.prior.as_ref()?.equations;
        let pose = point.equations.offset(Block::ObjectPose)?;
        let mut of_parameters = Vec::new();
        let mut groups: Vec<ErrorGroup> = Vec::new();
        for block in point.equations.blocks() {
            let group = ErrorGroup::of(*block).filter(|_| block.dimension() > 0);
            let at = group.map(|group| {
                groups.iter().position(|known| *known == group).unwrap_or_else(|| {
                    groups.push(group);
                    groups.len() - 1
                })
            });
            of_parameters.extend(std::iter::repeat_n(at, block.dimension()));
        }
        // What a wrong surface does, a warp of depth does, too: its scale follows from the others' alone.
        groups.push(ErrorGroup::Surface);
        let n = groups.len();
        let common = settings.common.powi(2);
        let own = settings.own.powi(2);
        let covariance = DMatrix::from_fn(n, n, |r, c| common + if r == c { own } else { 0.0 });
        let hyperprior = covariance.cholesky().filter(|_| n > 0)?.inverse();
        let scale = DVector::from_iterator(
            of_parameters.len(),
            of_parameters.iter().map(|at| at.map_or(1.0, |k| now.get(groups[k]))),
        );
        let current = prior.hessian();
        let factor = ScaledCholesky::new(current, RIDGE)?;
        let deviation = factor.inverse() * prior.gradient();
        let precision = DMatrix::from_fn(current.nrows(), current.ncols(), |r, c| {
            current[(r, c)] * scale[r] * scale[c]
        });
        Some(Self {
            // The solution is stationary but for what the solver leaves, which would be blown up where a prior is wide.
            gradient: -prior.gradient(),
            hessian: point.equations.hessian() - current,
            precision,
            deviation,
            pose,
            of_parameters,
            groups,
            hyperprior,
        })
    }

    /// The precision of the prior with scales of these logarithms.
    fn precision_at(&self, log: &DVector<f64>) -> DMatrix<f64> {
        let scale: Vec<f64> =
            self.of_parameters.iter().map(|at| at.map_or(1.0, |k| (-log[k]).exp())).collect();
        DMatrix::from_fn(scale.len(), scale.len(), |r, c| {
            self.precision[(r, c)] * scale[r] * scale[c]
        })
    }

    /// The step to the least value, covariance of the posterior, and the precision of the prior.
    fn posterior(&self, log: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>, DMatrix<f64>)> {
        let precision = self.precision_at(log);
        let factor = ScaledCholesky::new(&(&self.hessian + &precision), RIDGE)?;
        let covariance = factor.inverse();
        let step = -(&covariance * (&self.gradient + &precision * &self.deviation));
        Some((step, covariance, precision))
    }

    /// Gradient of the logarithm of the scales' posterior density by their logarithms, and the information about these. With n errors of a group, whose
    /// posterior second moments are M, the likelihood's part of the gradient is tr(ΛM) − n over the group; that of Fisher's information about two groups is
    /// 2 tr(GG), G = 1 − ΛC over both, C being the posterior covariance.
    fn derivatives(&self, log: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let (step, covariance, precision) = self.posterior(log)?;
        let at = &self.deviation + &step;
        let n = at.len();
        let second = &precision * (&covariance + &at * at.transpose());
        let told = DMatrix::identity(n, n) - &precision * &covariance;
        let mut gradient = -(&self.hyperprior * log);
        let mut information = self.hyperprior.clone();
        let grouped = self.of_parameters.iter().enumerate();
        let grouped: Vec<_> = grouped.filter_map(|(i, group)| Some((i, (*group)?))).collect();
        for &(i, k) in &grouped {
            gradient[k] += second[(i, i)] - 1.0;
            for &(j, l) in &grouped {
                information[(k, l)] += 2.0 * told[(i, j)] * told[(j, i)];
            }
        }
        Some((gradient, information))
    }

    /// The scales of the largest posterior density, by Fisher scoring from `start`.
    pub(super) fn learn(&self, start: &Scales) -> Option<Scales> {
        let mut log = DVector::from_fn(self.groups.len(), |k, _| start.get(self.groups[k]).ln());
        let mut information = self.hyperprior.clone();
        for _ in 0..STEPS {
            let (gradient, told) = self.derivatives(&log)?;
            information = told;
            let step = information.clone().cholesky()?.solve(&gradient);
            let step = &step * step.amax().recip().min(1.0);
            log += &step;
            if step.amax() < CONVERGED {
                break;
            }
        }
        let covariance = information.cholesky()?.inverse();
        Some(Scales { groups: self.groups.clone(), log, covariance })
    }

    /// Mean (a step from the solution) and covariance of the object's pose under scales that stand for all that are probable, each with the same weight:
    /// the sigma points of the unscented transform (Julier and Uhlmann, 1997).
    pub(super) fn pose_moments(
        &self,
        scales: &Scales,
    ) -> Option<Vec<(Vector6<f64>, Matrix6<f64>)>> {
        let n = scales.log.len();
        let moments = |log: &DVector<f64>| {
            let (step, covariance, _) = self.posterior(log)?;
            let mean: Vector6<f64> = step.fixed_rows::<6>(self.pose).into_owned();
            Some((mean, covariance.fixed_view::<6, 6>(self.pose, self.pose).into_owned()))
        };
        let root = scales.covariance.clone().cholesky()?.l() * (n as f64).sqrt();
        let columns = (0..n).flat_map(|k| [root.column(k) * 1.0, root.column(k) * -1.0]);
        columns.map(|off| moments(&(&scales.log + off))).collect()
    }
}
