//! Gaussian processes over space with the squared-exponential kernel exp(−d²/2ℓ²), described by inducing points (Quiñonero-Candela and Rasmussen, 2005).

use nalgebra::{Cholesky, DMatrix, Dyn, Vector3};

/// Correlation of a process of this `length_scale` between two places, all \[m\].
pub(crate) fn squared_exponential(a: &Vector3<f64>, b: &Vector3<f64>, length_scale: f64) -> f64 {
    (-0.5 * (a - b).norm_squared() / length_scale.powi(2)).exp()
}

/// A Gaussian process of standard deviation σ and length scale ℓ, through inducing points: its value at a place is the product of
/// [`features`](Self::features) with coefficients that are independent and of unit variance beforehand.
#[derive(Clone, Debug)]
pub(crate) struct InducingPoints {
    points: Vec<Vector3<f64>>,
    sigma: f64,
    length_scale: f64,
    /// Factor of the kernel matrix of the points.
    factor: Cholesky<f64, Dyn>,
}

impl InducingPoints {
    /// Standard deviation `sigma`, in the unit of the values, and `length_scale` \[m\] through `points` \[m\]; `nugget` on the diagonal of the kernel
    /// matrix makes it certainly positive definite. `None` unless sigma and length scale are positive.
    pub(crate) fn new(
        points: Vec<Vector3<f64>>,
        sigma: f64,
        length_scale: f64,
        nugget: f64,
    ) -> Option<Self> {
        if !(sigma > 0.0 && length_scale > 0.0) {
            return None;
        }
        let kernel = DMatrix::from_fn(points.len(), points.len(), |i, j| {
            let nugget = if i == j { nugget } else { 0.0 };
            squared_exponential(&points[i], &points[j], length_scale) + nugget
        });
        Some(Self { points, sigma, length_scale, factor: Cholesky::new(kernel)? })
    }

    /// Places of the points \[m\].
    pub(crate) fn points(&self) -> &[Vector3<f64>] {
        &self.points
    }

    /// Factors of the coefficients, a row a point, in the process at `places` \[m\], a column each.
    pub(crate) fn features(&self, places: &[Vector3<f64>]) -> DMatrix<f64> {
        let mut features = DMatrix::from_fn(self.points.len(), places.len(), |i, j| {
            self.sigma * squared_exponential(&self.points[i], &places[j], self.length_scale)
        });
        self.factor.l_dirty().solve_lower_triangular_mut(&mut features);
        features
    }
}

/// Farthest-point sampling: the first of `places`, and others, each farther than `distance` from all before it and the farthest of those
/// left \[m\]; `most` at most.
pub(crate) fn farthest_points(
    places: &[Vector3<f64>],
    distance: f64,
    most: usize,
) -> Vec<Vector3<f64>> {
    let mut chosen: Vec<Vector3<f64>> = places.first().copied().into_iter().collect();
    let mut nearest = vec![f64::INFINITY; places.len()];
    while let Some(last) = chosen.last().filter(|_| chosen.len() < most) {
        for (nearest, place) in nearest.iter_mut().zip(places) {
            *nearest = nearest.min((place - last).norm());
        }
        let farthest = nearest.iter().zip(places).max_by(|a, b| a.0.total_cmp(b.0));
        match farthest.filter(|(nearest, _)| **nearest > distance) {
            Some((_, place)) => chosen.push(*place),
            None => break,
        }
    }
    chosen
}
