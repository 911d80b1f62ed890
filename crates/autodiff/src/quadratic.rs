//! The quadratic model of a sum of squares.

use nalgebra::{SMatrix, SVector};

/// Value, gradient and Gauss–Newton Hessian of ½‖r‖² for residuals r with Jacobian J: ½‖r‖², Jᵀr and JᵀJ.
///
/// With weights W, or a robust kernel ρ whose weights they are: ½ rᵀWr or Σ ρ(r), JᵀWr and JᵀWJ. The Gauss–Newton step is
/// −`hessian`⁻¹ `gradient`.
///
/// ```
/// use nalgebra::Vector2;
/// use prehend_autodiff::Quadratic;
///
/// let mut sum = Quadratic::<2>::zeros();
/// sum.add_row(&Vector2::new(1.0, 2.0), 3.0, 0.5);
/// assert_eq!((sum.value, sum.gradient), (2.25, Vector2::new(1.5, 3.0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quadratic<const N: usize> {
    /// ½ rᵀWr, or the sum of robust losses.
    pub value: f64,
    /// JᵀWr.
    pub gradient: SVector<f64, N>,
    /// JᵀWJ.
    pub hessian: SMatrix<f64, N, N>,
}

impl<const N: usize> Quadratic<N> {
    /// Zero, the sum over no residuals.
    pub fn zeros() -> Self {
        Self { value: 0.0, gradient: SVector::zeros(), hessian: SMatrix::zeros() }
    }

    /// Adds the residual `residual` with derivatives `row` and weight `weight`.
    #[inline]
    pub fn add_row(&mut self, row: &SVector<f64, N>, residual: f64, weight: f64) {
        self.add_robust_row(row, residual, 0.5 * weight * residual * residual, weight);
    }

    /// [`add_row`](Self::add_row) for a residual whose value is `loss`, not half its weighted square.
    #[inline]
    pub fn add_robust_row(&mut self, row: &SVector<f64, N>, residual: f64, loss: f64, weight: f64) {
        self.value += loss;
        self.gradient += row * (weight * residual);
        // Column by column: nalgebra would hand a product of this size to its routine for large matrices.
        for (i, mut column) in self.hessian.column_iter_mut().enumerate() {
            column += row * (weight * row[i]);
        }
    }

    /// By parameters in other units: one of the new ones is `units` old ones. Zero holds a parameter.
    pub fn in_units(&self, units: &SVector<f64, N>) -> Self {
        Self {
            value: self.value,
            gradient: self.gradient.component_mul(units),
            hessian: SMatrix::from_fn(|r, c| units[r] * self.hessian[(r, c)] * units[c]),
        }
    }

    /// The damped Gauss–Newton step −(H + μ1)⁻¹g, μ being the part `damping` of the mean diagonal of H: directions that the
    /// residuals leave open must not become long steps. Zero where H is not positive semidefinite, or a number not finite.
    pub fn damped_step(&self, damping: f64) -> SVector<f64, N> {
        let damping = damping * self.hessian.trace() / N as f64 + f64::MIN_POSITIVE;
        let factor = (self.hessian + SMatrix::identity() * damping).cholesky();
        let step = factor.map(|factor| -factor.solve(&self.gradient));
        let step = step.filter(|step| step.iter().all(|x| x.is_finite()));
        step.unwrap_or_else(SVector::zeros)
    }
}

impl<const N: usize> std::ops::AddAssign<&Self> for Quadratic<N> {
    /// Adds the sums of other residuals by the same parameters.
    fn add_assign(&mut self, other: &Self) {
        self.value += other.value;
        self.gradient += other.gradient;
        self.hessian += other.hessian;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;

    #[test]
    fn damped_steps() {
        let mut sum = Quadratic::<3>::zeros();
        sum.add_row(&Vector3::new(2.0, 0.0, 0.0), 1.0, 1.0);
        sum.add_row(&Vector3::new(0.0, 0.5, 0.1), -3.0, 2.0);
        // Of the direction that is open, nothing; the others end as without damping.
        let step = sum.damped_step(1e-9);
        let open = Vector3::new(0.0, 0.1, -0.5);
        assert!(step.dot(&open).abs() < 1e-5 && (step.x + 0.5).abs() < 1e-7, "{step}");
        let left = sum.gradient + sum.hessian * step;
        assert!(left.norm() < 1e-6, "{left}");
        // A held parameter stays; the units of another change nothing without damping.
        let units = Vector3::new(7.0, 3.0, 0.0);
        let held = sum.in_units(&units).damped_step(1e-9).component_mul(&units);
        assert!((held - Vector3::new(-0.5, 6.0, 0.0)).norm() < 1e-6, "{held}");
        sum.hessian = -Matrix3::identity();
        assert_eq!(sum.damped_step(0.1), Vector3::zeros());
    }
}
