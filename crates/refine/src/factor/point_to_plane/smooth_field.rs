//! A smooth field by which measurements at places are off.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};

use super::PointToPlaneSettings;
use crate::problem::RIDGE;
use crate::scene::{InducingPoints, farthest_points};

/// A Gaussian process over space, with covariance τ² exp(−d²/2ℓ²) at distance d, through a few places that describe all others
/// (Quiñonero-Candela and Rasmussen, 2005).
///
/// It is what the errors of a depth camera have in common, and of an object's model where nothing else accounts for that: neighbors are off
/// alike.
pub(super) struct SmoothField {
    /// A column for each place \[m\]: the field there is its product with coefficients, which are independent and of unit variance.
    features: DMatrix<f64>,
    /// Times that weights are found: they depend on what the field leaves.
    reweightings: usize,
}

/// The field that fits residuals best, or none.
pub(super) struct FieldFit {
    /// Residuals without it \[m\].
    pub(super) left: Vec<f64>,
    /// Their weights, with which it was found \[1/m²\].
    pub(super) weights: Vec<f64>,
    /// Cost of its coefficients c, ½‖c‖² \[nat\].
    pub(super) cost: f64,
    /// Factor of the coefficients' information matrix.
    information: Option<Cholesky<f64, Dyn>>,
}

impl FieldFit {
    /// Without a field; `weight` is that of [`SmoothField::fit`].
    pub(super) fn without_field(residuals: &[f64], weight: impl Fn(usize, f64) -> f64) -> Self {
        let weights = residuals.iter().enumerate().map(|(i, r)| weight(i, *r)).collect();
        Self { left: residuals.to_vec(), weights, cost: 0.0, information: None }
    }
}

impl SmoothField {
    /// At `places` \[m\]; `None` if there is none.
    pub(super) fn new(places: &[Vector3<f64>], settings: &PointToPlaneSettings) -> Option<Self> {
        let &PointToPlaneSettings { gp_sigma, length_scale, spacing, .. } = settings;
        let chosen = farthest_points(places, spacing * length_scale, settings.inducing_points);
        let process = InducingPoints::new(chosen, gp_sigma, length_scale, RIDGE)?;
        Some(Self { features: process.features(places), reweightings: settings.reweightings })
    }

    /// The field that is most likely where `residuals` are seen, of which `weight` says from index and residual how much
    /// information is in one \[1/m²\].
    ///
    /// With it at its best, derivatives by anything else are those at a fixed field (Golub and Pereyra, 1973).
    pub(super) fn fit(
        &self,
        residuals: &[f64],
        weight: impl Fn(usize, f64) -> f64,
    ) -> Option<FieldFit> {
        let count = self.features.nrows();
        let round = |left: &[f64]| {
            let weights: Vec<f64> = left.iter().enumerate().map(|(i, r)| weight(i, *r)).collect();
            let mut information = DMatrix::identity(count, count);
            let mut right = DVector::zeros(count);
            for (i, feature) in self.features.column_iter().enumerate() {
                right.axpy(weights[i] * residuals[i], &feature, 1.0);
                information.syger(weights[i], &feature, &feature, 1.0);
            }
            let information = Cholesky::new(information)?;
            let coefficients = information.solve(&right);
            let field = self.features.tr_mul(&coefficients);
            let left = residuals.iter().zip(field.iter()).map(|(r, field)| r - field).collect();
            let (cost, information) = (0.5 * coefficients.norm_squared(), Some(information));
            Some(FieldFit { left, weights, cost, information })
        };
        let mut fit = round(residuals)?;
        for _ in 1..self.reweightings {
            fit = round(&fit.left)?;
        }
        Some(fit)
    }

    /// The information about `size` parameters that residuals lose because they may also be the field; `derivatives` are those of a
    /// residual that are not zero. With the weights of the fit it is never more than there is.
    pub(super) fn lost<I: Iterator<Item = (usize, f64)>>(
        &self,
        fit: &FieldFit,
        size: usize,
        derivatives: impl Fn(usize) -> I,
    ) -> DMatrix<f64> {
        let Some(information) = &fit.information else { return DMatrix::zeros(size, size) };
        let mut shared = DMatrix::zeros(self.features.nrows(), size);
        for (i, (feature, weight)) in self.features.column_iter().zip(&fit.weights).enumerate() {
            for (parameter, derivative) in derivatives(i) {
                shared.column_mut(parameter).axpy(weight * derivative, &feature, 1.0);
            }
        }
        shared.tr_mul(&information.solve(&shared))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_geometry::SplitMix64;

    #[test]
    fn eliminating_is_integrating_out_if_weights_are_fixed() {
        let mut random = SplitMix64::new(3);
        let place = |i: usize| Vector3::new(0.003 * i as f64, 0.01 * (i as f64).sin(), 0.5);
        let places: Vec<_> = (0..40).map(place).collect();
        let settings = |gp_sigma| PointToPlaneSettings { gp_sigma, ..Default::default() };
        let field = SmoothField::new(&places, &settings(1e-3)).unwrap();
        let residuals: Vec<f64> = (0..40).map(|_| 1e-3 * random.normal()).collect();
        let rows: Vec<[f64; 2]> = (0..40).map(|_| [random.normal(), random.normal()]).collect();
        let weight = 1.0 / 0.5e-3f64.powi(2);
        let fit = field.fit(&residuals, |_, _| weight).unwrap();
        let lost = field.lost(&fit, 2, |i| rows[i].into_iter().enumerate());
        // The same with the covariance of all residuals.
        let covariance =
            field.features.tr_mul(&field.features) + DMatrix::identity(40, 40) / weight;
        let inverse = covariance.clone().cholesky().unwrap().inverse();
        let r = DVector::from_vec(residuals);
        let value = 0.5 * weight * fit.left.iter().map(|r| r * r).sum::<f64>() + fit.cost;
        let expected = 0.5 * r.dot(&(&inverse * &r));
        assert!((value / expected - 1.0).abs() < 1e-9, "{value} {expected}");
        let j = DMatrix::from_fn(40, 2, |r, c| rows[r][c]);
        let kept = j.tr_mul(&j) * weight - lost;
        let expected = j.tr_mul(&(inverse * &j));
        assert!((kept - &expected).amax() < 1e-9 * expected.amax());
        // Neighbors are off nearly alike, those far apart are not.
        let alike = |i: usize, j: usize| covariance[(i, j)] / 1e-6;
        assert!(
            (alike(10, 11) - (-0.5f64 * (places[10] - places[11]).norm_squared() / 4e-4).exp())
                .abs()
                < 0.02
        );
        assert!(alike(0, 39) < 1e-3);
        assert!(SmoothField::new(&places, &settings(0.0)).is_none());
    }
}
