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
    /// Of no residuals.
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
}

impl<const N: usize> std::ops::AddAssign<&Self> for Quadratic<N> {
    /// Adds the sums of other residuals by the same parameters.
    fn add_assign(&mut self, other: &Self) {
        self.value += other.value;
        self.gradient += other.gradient;
        self.hessian += other.hessian;
    }
}
