//! Residuals of matches, and their derivatives by a left twist of the source.

use nalgebra::{Point3, Vector3};
use prehend_autodiff::Quadratic;
use prehend_autodiff::lie::twist_row;

use super::Match;
use crate::robust::RobustKernel;

/// Which distance of a match counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Metric {
    /// Between the two points (Besl and McKay, "A method for registration of 3-D shapes", 1992).
    PointToPoint,
    /// From the source point to the plane through the target point (Chen and Medioni, "Object modeling by
    /// registration of multiple range images", 1992): surfaces may slide, which converges far faster.
    #[default]
    PointToPlane,
}

/// A sum of robust losses of matches, with its derivatives by a left twist about a center, translation first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalEquations {
    /// Σ ρ(r²) \[m²\] and its derivatives.
    pub quadratic: Quadratic<6>,
    /// Σ w.
    pub weight: f64,
    /// Σ r² over the inliers \[m²\].
    pub squares: f64,
    /// Matches of positive weight.
    pub inliers: usize,
}

impl NormalEquations {
    /// Of no matches.
    pub fn new() -> Self {
        Self { quadratic: Quadratic::zeros(), weight: 0.0, squares: 0.0, inliers: 0 }
    }

    /// Adds the match `target` of the source point `point` \[m\], the source being turned about `center` \[m\], all
    /// three in the target's frame. A match without normal has no plane and adds nothing to that metric.
    #[inline]
    pub fn add(
        &mut self,
        metric: Metric,
        kernel: RobustKernel,
        point: &Point3<f64>,
        target: &Match,
        center: &Point3<f64>,
    ) {
        let (residual, arm) = (point - target.point, point - center);
        match metric {
            Metric::PointToPlane => {
                let n = &target.normal;
                if *n == Vector3::zeros() {
                    return;
                }
                let r = residual.dot(n);
                if let Some((loss, weight)) = self.weigh(kernel, r * r) {
                    self.quadratic.add_robust_row(&twist_row(&arm, n), r, loss, weight);
                }
            }
            Metric::PointToPoint => {
                let Some((loss, w)) = self.weigh(kernel, residual.norm_squared()) else { return };
                self.quadratic.value += loss;
                self.quadratic.gradient += twist_row(&arm, &residual) * w;
                // JᵀJ of J = (1, −[a]×), whose blocks are 1, −[a]× and a² − aaᵀ.
                let a = arm * w;
                let m = &mut self.quadratic.hessian;
                for i in 0..3 {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    m[(i, i)] += w;
                    m[(i, 3 + j)] += a[k];
                    m[(i, 3 + k)] -= a[j];
                    m[(3 + j, i)] += a[k];
                    m[(3 + k, i)] -= a[j];
                    m[(3 + i, 3 + i)] += a[j] * arm[j] + a[k] * arm[k];
                    m[(3 + i, 3 + j)] -= a[i] * arm[j];
                    m[(3 + j, 3 + i)] -= a[i] * arm[j];
                }
            }
        }
    }

    /// Counts a match and returns its loss and weight, or adds the loss alone and returns `None` where the weight is zero.
    #[inline]
    fn weigh(&mut self, kernel: RobustKernel, r2: f64) -> Option<(f64, f64)> {
        let (loss, weight) = (kernel.loss(r2), kernel.weight(r2));
        if weight <= 0.0 {
            self.quadratic.value += loss;
            return None;
        }
        self.weight += weight;
        self.squares += r2;
        self.inliers += 1;
        Some((loss, weight))
    }

    /// Adds the sums of other matches about the same center.
    pub fn merge(&mut self, other: &Self) {
        self.quadratic += &other.quadratic;
        self.weight += other.weight;
        self.squares += other.squares;
        self.inliers += other.inliers;
    }

    /// Root mean square residual of the inliers \[m\]; zero without any.
    pub fn rms(&self) -> f64 {
        (self.squares / self.inliers.max(1) as f64).sqrt()
    }
}

impl Default for NormalEquations {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robust::tests::kernels;
    use nalgebra::{Isometry3, Matrix6, Vector6};
    use prehend_autodiff::check::{finite_difference_gradient, finite_difference_jacobian};
    use prehend_autodiff::lie::perturb_about;
    use proptest::prelude::*;

    fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = Vector3<f64>> {
        [range.clone(), range.clone(), range].prop_map(Vector3::from)
    }

    fn moved(point: &Point3<f64>, center: &Point3<f64>, twist: &[f64]) -> Point3<f64> {
        let delta = Vector6::from_column_slice(twist);
        perturb_about(&Isometry3::identity(), &center.coords, &delta) * point
    }

    proptest! {
        #[test]
        fn gradient_and_matrix_match_differences(
            pairs in prop::collection::vec((vector(-1.0..1.0), vector(-1.0..1.0), vector(-1.0..1.0)), 1..6),
            center in vector(-1.0..1.0),
        ) {
            let center = Point3::from(center);
            let matches: Vec<_> = pairs
                .iter()
                .filter(|(_, _, n)| n.norm() > 0.1)
                .map(|(p, q, n)| (Point3::from(*p), Match { point: Point3::from(*q), normal: n.normalize() }))
                .collect();
            for metric in [Metric::PointToPoint, Metric::PointToPlane] {
                let residuals = |twist: &[f64]| -> Vec<f64> {
                    matches.iter().flat_map(|(p, m)| {
                        let r = moved(p, &center, twist) - m.point;
                        match metric {
                            Metric::PointToPoint => vec![r.x, r.y, r.z],
                            Metric::PointToPlane => vec![r.dot(&m.normal)],
                        }
                    }).collect()
                };
                for kernel in kernels(0.7) {
                    let sums = |twist: &[f64]| {
                        let mut sums = NormalEquations::new();
                        for (p, m) in &matches {
                            sums.add(metric, kernel, &moved(p, &center, twist), m, &center);
                        }
                        sums
                    };
                    let at = sums(&[0.0; 6]);
                    // Where Huber's pieces are joined the slope's own slope jumps by at most |∂r|² < 25 a match, and
                    // the difference is off by a quarter of that times the step.
                    let reference = finite_difference_gradient(|x| sums(x).quadratic.value, &[0.0; 6], 1e-7);
                    for (g, r) in at.quadratic.gradient.iter().zip(&reference) {
                        prop_assert!((g - r).abs() < 1e-5, "{:?} {:?}: {} {}", metric, kernel, g, r);
                    }
                    if kernel == RobustKernel::Squared && !matches.is_empty() {
                        let rows = finite_difference_jacobian(residuals, &[0.0; 6], 1e-3);
                        let matrix = Matrix6::from_fn(|i, j| rows.iter().map(|r| r[i] * r[j]).sum());
                        prop_assert!((matrix - at.quadratic.hessian).norm() < 1e-8, "{:?}", metric);
                        prop_assert_eq!(at.inliers, matches.len());
                    }
                }
            }
        }
    }

    #[test]
    fn a_match_without_normal_or_weight_adds_no_row() {
        let (origin, far) = (Point3::origin(), Point3::new(0.0, 0.0, 1.0));
        let target = Match { point: far, normal: Vector3::zeros() };
        let mut sums = NormalEquations::new();
        sums.add(Metric::PointToPlane, RobustKernel::Squared, &origin, &target, &origin);
        assert_eq!(sums, NormalEquations::default());
        sums.add(
            Metric::PointToPoint,
            RobustKernel::Tukey { scale: 0.5 },
            &origin,
            &target,
            &origin,
        );
        assert_eq!((sums.inliers, sums.weight, sums.rms()), (0, 0.0, 0.0));
        assert!((sums.quadratic.value - 0.25 / 6.0).abs() < 1e-16);
    }
}
