//! Randomized smoothing: values and gradients of a function averaged over Gaussian perturbations.

use nalgebra::SVector;
use prehend_geometry::SplitMix64;
use rayon::prelude::*;
use thiserror::Error;

/// Errors of a [`Smoothing`].
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub(crate) enum SmoothingError {
    /// A variance needs two pairs of samples.
    #[error("at least two pairs of perturbations are needed, {0} asked for")]
    Pairs(usize),
    /// A standard deviation is negative or not finite.
    #[error("standard deviation {index} must be finite and zero or positive, is {value}")]
    Deviation {
        /// Which direction.
        index: usize,
        /// The deviation.
        value: f64,
    },
    /// No direction is perturbed.
    #[error("at least one standard deviation must be positive")]
    Still,
}

/// Gaussian perturbations of `N` numbers, a pose twist's six for instance, over which a function f is averaged:
/// F(x) = E f(x + δ), δ ~ N(0, diag σ²).
///
/// F is smooth whatever f is, and contacts not yet made are felt in its gradient as far as δ reaches. Two estimators of
/// ∇F are offered (J. Duchi, P. Bartlett and M. Wainwright, "Randomized smoothing for stochastic optimization", SIAM J.
/// Optimization 22, 2012; H. Suh et al., "Do differentiable simulators give better policy gradients?", ICML 2022):
/// [`zeroth_order`](Self::zeroth_order) needs values only and is right for any f;
/// [`first_order`](Self::first_order) averages gradients, varies far less, and is right where f is continuous:
/// a jump, such as that of a clamped damper at first touch, is invisible to it.
///
/// Perturbations come in antithetic pairs ±δ and are the same at every call (common random numbers), so that
/// differences of estimates are differences of f. Results are the same to the last bit on any number of threads.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Smoothing<const N: usize> {
    deviations: SVector<f64, N>,
    /// One of each pair.
    perturbations: Vec<SVector<f64, N>>,
}

/// A smoothed value and gradient, with what is left to chance in them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SmoothedGradient<const N: usize> {
    /// Estimate of F.
    pub(crate) value: f64,
    /// Variance of `value`.
    pub(crate) value_variance: f64,
    /// Estimate of ∇F.
    pub(crate) gradient: SVector<f64, N>,
    /// Variance of each component of `gradient`: the square of its standard error.
    pub(crate) variance: SVector<f64, N>,
}

impl<const N: usize> Smoothing<N> {
    /// `pairs` antithetic pairs of perturbations with standard `deviations` (in the units of x; zero leaves a
    /// direction as it is), the same for the same `seed`.
    ///
    /// # Errors
    /// For fewer than two pairs, or deviations that are negative, not finite or all zero.
    pub(crate) fn new(
        deviations: SVector<f64, N>,
        pairs: usize,
        seed: u64,
    ) -> Result<Self, SmoothingError> {
        if pairs < 2 {
            return Err(SmoothingError::Pairs(pairs));
        }
        if let Some(index) = deviations.iter().position(|d| !(d.is_finite() && *d >= 0.0)) {
            return Err(SmoothingError::Deviation { index, value: deviations[index] });
        }
        if deviations.iter().all(|d| *d == 0.0) {
            return Err(SmoothingError::Still);
        }
        let mut random = SplitMix64::new(seed);
        let perturbation = |_| deviations.map(|deviation| deviation * random.normal());
        Ok(Self { deviations, perturbations: (0..pairs).map(perturbation).collect() })
    }

    /// Smooths `f` at `x` from its values: the mean of (f(x + δ) − f(x − δ))/2 · δ/σ² estimates the gradient. In
    /// directions of zero deviation it is zero.
    ///
    /// # Errors
    /// The first error of `f`, in the order of the perturbations.
    pub(crate) fn zeroth_order<E: Send>(
        &self,
        x: &SVector<f64, N>,
        f: impl Fn(&SVector<f64, N>) -> Result<f64, E> + Sync,
    ) -> Result<SmoothedGradient<N>, E> {
        self.average(|delta| {
            let (ahead, behind) = (f(&(x + delta))?, f(&(x - delta))?);
            let slope = delta.zip_map(&self.deviations, |d, deviation| {
                if deviation > 0.0 {
                    // In this order nothing overflows where a deviation is tiny.
                    0.5 * (ahead - behind) * (d / deviation) / deviation
                } else {
                    0.0
                }
            });
            Ok((0.5 * (ahead + behind), slope))
        })
    }

    /// Smooths `f` at `x`, a function that returns its value and its gradient by x, from its gradients.
    ///
    /// For a function of a pose, x is the twist by which the pose is moved; if the gradient is known by a further
    /// left twist of the moved pose, its product with the transposed left Jacobian
    /// ([`se3_left_jacobian`](prehend_autodiff::lie::se3_left_jacobian)) at x is the gradient by x.
    ///
    /// # Errors
    /// The first error of `f`, in the order of the perturbations.
    pub(crate) fn first_order<E: Send>(
        &self,
        x: &SVector<f64, N>,
        f: impl Fn(&SVector<f64, N>) -> Result<(f64, SVector<f64, N>), E> + Sync,
    ) -> Result<SmoothedGradient<N>, E> {
        self.average(|delta| {
            let ((a, slope_ahead), (b, slope_behind)) = (f(&(x + delta))?, f(&(x - delta))?);
            Ok((0.5 * (a + b), (slope_ahead + slope_behind) * 0.5))
        })
    }

    /// Mean and variance of what `pair` says of each pair, in a fixed order.
    fn average<E: Send>(
        &self,
        pair: impl Fn(&SVector<f64, N>) -> Result<(f64, SVector<f64, N>), E> + Sync,
    ) -> Result<SmoothedGradient<N>, E> {
        let results: Vec<Result<_, E>> = self.perturbations.par_iter().map(&pair).collect();
        let samples: Vec<(f64, SVector<f64, N>)> = results.into_iter().collect::<Result<_, E>>()?;
        let count = samples.len() as f64;
        let (mut value, mut gradient) = (0.0, SVector::zeros());
        for (v, g) in &samples {
            value += v / count;
            gradient += g / count;
        }
        let (mut value_variance, mut variance) = (0.0, SVector::zeros());
        let scale = 1.0 / (count * (count - 1.0));
        for (v, g) in &samples {
            value_variance += scale * (v - value) * (v - value);
            variance += (g - gradient).map(|d| scale * d * d);
        }
        Ok(SmoothedGradient { value, value_variance, gradient, variance })
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use nalgebra::{Matrix6, Point3, Vector1, Vector3, Vector6};
    use prehend_autodiff::lie::{se3_exp, se3_left_jacobian};

    use super::*;

    /// Half xᵀAx + bᵀx with its gradient.
    fn quadratic(x: &Vector6<f64>) -> Result<(f64, Vector6<f64>), Infallible> {
        let a = Matrix6::from_fn(|i, j| if i == j { 3.0 } else { 1.0 / (1 + i + j) as f64 });
        let b = Vector6::from_fn(|i, _| i as f64 - 2.0);
        Ok((0.5 * x.dot(&(a * x)) + b.dot(x), a * x + b))
    }

    #[test]
    fn a_quadratic_keeps_its_gradient_and_gains_half_its_curvature() {
        let deviations = Vector6::new(0.1, 0.2, 0.1, 0.3, 0.1, 0.2);
        let smoothing = Smoothing::new(deviations, 4000, 3).unwrap();
        let x = Vector6::new(1.0, -0.5, 0.3, 0.2, -0.7, 0.4);
        let (value, exact) = quadratic(&x).unwrap();
        let raised = value + 1.5 * deviations.norm_squared();
        let first = smoothing.first_order(&x, quadratic).unwrap();
        // Antithetic pairs leave nothing of a linear gradient to chance.
        assert!((first.gradient - exact).norm() < 1e-12 && first.variance.norm() < 1e-24);
        let zeroth = smoothing.zeroth_order(&x, |x| quadratic(x).map(|(v, _)| v)).unwrap();
        for i in 0..6 {
            let error = (zeroth.gradient[i] - exact[i]).abs();
            assert!(error < 4.0 * zeroth.variance[i].sqrt() && zeroth.variance[i].sqrt() < 0.2);
        }
        for estimate in [first, zeroth] {
            assert!((estimate.value - raised).abs() < 4.0 * estimate.value_variance.sqrt());
            assert!(estimate.value_variance.sqrt() < 0.02);
        }
    }

    #[test]
    fn variances_are_those_of_a_mean() {
        // Of two values a and b, (a − b)²/4.
        let smoothing = Smoothing::new(Vector1::new(0.5), 2, 3).unwrap();
        let square =
            |x: &Vector1<f64>| Ok::<_, Infallible>((x.x.powi(2), Vector1::new(3.0 * x.x.powi(2))));
        let [a, b] = [0, 1].map(|k| smoothing.perturbations[k].x.powi(2));
        let found = smoothing.first_order(&Vector1::zeros(), square).unwrap();
        let expected = 0.25 * (a - b).powi(2);
        assert!((found.value - 0.5 * (a + b)).abs() < 1e-15);
        assert!((found.value_variance / expected - 1.0).abs() < 1e-12);
        assert!((found.variance.x / (9.0 * expected) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_kink_has_the_slope_of_the_normal_distribution() {
        // E max(x + δ, 0) has slope Φ(x/σ) and value x Φ(x/σ) + σ φ(x/σ).
        let smoothing = Smoothing::new(Vector1::new(0.5), 20_000, 11).unwrap();
        for (x, slope) in [(0.0_f64, 0.5), (0.5, 0.841_344_746), (-1.0, 0.022_750_132)] {
            let density = (-2.0 * x * x).exp() / std::f64::consts::TAU.sqrt();
            let at = Vector1::new(x);
            let ramp = |y: &Vector1<f64>| Ok::<_, Infallible>(y.x.max(0.0));
            let zeroth = smoothing.zeroth_order(&at, ramp).unwrap();
            let slope_of = |y: &Vector1<f64>| Vector1::new(if y.x > 0.0 { 1.0 } else { 0.0 });
            let first = smoothing.first_order(&at, |y| ramp(y).map(|v| (v, slope_of(y)))).unwrap();
            for estimate in [zeroth, first] {
                let error = (estimate.gradient.x - slope).abs();
                let (chance, value) = (estimate.variance.x.sqrt(), x * slope + 0.5 * density);
                assert!(error <= 4.0 * chance + 1e-9 && chance < 0.02, "{x}: {estimate:?}");
                let wrong = (estimate.value - value).abs();
                assert!(wrong <= 4.0 * estimate.value_variance.sqrt(), "{x}: {estimate:?}");
            }
        }
    }

    #[test]
    fn both_orders_agree_on_a_function_of_a_pose() {
        // Squared distance of a moved point from another, and its gradient by a further left twist.
        let (point, target) = (Point3::new(0.1, 0.4, -0.3), Vector3::new(1.0, 0.2, 0.3));
        let by_twist = |x: &Vector6<f64>| {
            let moved = se3_exp(x) * point;
            let off = moved.coords - target;
            let (by_shift, by_turn) = (off * 2.0, moved.coords.cross(&off) * 2.0);
            let mut slope = Vector6::zeros();
            slope.fixed_rows_mut::<3>(0).copy_from(&by_shift);
            slope.fixed_rows_mut::<3>(3).copy_from(&by_turn);
            Ok::<_, Infallible>((off.norm_squared(), se3_left_jacobian(x).tr_mul(&slope)))
        };
        let smoothing = Smoothing::new(Vector6::repeat(0.3), 20_000, 2).unwrap();
        let x = Vector6::new(0.1, -0.2, 0.3, 0.5, -0.4, 0.6);
        let first = smoothing.first_order(&x, by_twist).unwrap();
        let zeroth = smoothing.zeroth_order(&x, |x| by_twist(x).map(|(v, _)| v)).unwrap();
        for i in 0..6 {
            let chance = (first.variance[i] + zeroth.variance[i]).sqrt();
            assert!((first.gradient[i] - zeroth.gradient[i]).abs() < 4.0 * chance);
            assert!(chance < 0.05, "{chance}");
        }
        assert!((first.value - zeroth.value).abs() < 1e-12);
    }

    #[test]
    fn a_jump_is_felt_by_values_only() {
        let smoothing = Smoothing::new(Vector1::new(0.5), 20_000, 5).unwrap();
        let step = |y: &Vector1<f64>| Ok::<_, Infallible>(if y.x > 0.0 { 1.0 } else { 0.0 });
        let at = Vector1::new(0.0);
        let zeroth = smoothing.zeroth_order(&at, step).unwrap();
        let density = 2.0 / std::f64::consts::TAU.sqrt();
        assert!((zeroth.gradient.x - density).abs() < 4.0 * zeroth.variance.x.sqrt());
        let first =
            smoothing.first_order(&at, |y| step(y).map(|v| (v, Vector1::new(0.0)))).unwrap();
        assert_eq!(first.gradient.x, 0.0);
    }

    #[test]
    fn results_are_identical_on_any_number_of_threads_and_at_every_call() {
        let smoothing = Smoothing::new(Vector6::repeat(0.1), 501, 9).unwrap();
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let f = |x: &Vector6<f64>| Ok::<_, Infallible>(x.iter().map(|v| v.sin()).sum());
            pool.install(|| smoothing.zeroth_order(&Vector6::repeat(0.3), f)).unwrap()
        };
        assert_eq!(run(1), run(3));
        assert_eq!(smoothing, Smoothing::new(Vector6::repeat(0.1), 501, 9).unwrap());
        assert_ne!(smoothing, Smoothing::new(Vector6::repeat(0.1), 501, 10).unwrap());
    }

    #[test]
    fn bad_input_and_failing_functions_are_told() {
        let new = |deviation, pairs| Smoothing::new(Vector1::new(deviation), pairs, 0);
        assert_eq!(new(1.0, 1).unwrap_err(), SmoothingError::Pairs(1));
        assert_eq!(new(-1.0, 9).unwrap_err(), SmoothingError::Deviation { index: 0, value: -1.0 });
        assert!(matches!(new(f64::NAN, 9), Err(SmoothingError::Deviation { .. })));
        assert_eq!(new(0.0, 9).unwrap_err(), SmoothingError::Still);
        let fails = |x: &Vector1<f64>| if x.x > 0.5 { Err(x.x.to_bits()) } else { Ok(0.0) };
        let smoothing = new(1.0, 100).unwrap();
        let error = smoothing.zeroth_order(&Vector1::new(0.0), fails).unwrap_err();
        assert_eq!(smoothing.zeroth_order(&Vector1::new(0.0), fails).unwrap_err(), error);
    }
}
