//! First-order lighting: an ambient term and one directional light a channel.

use nalgebra::{Matrix4, Vector3, Vector4};

/// First-order lighting, fixed in the camera frame.
///
/// A surface with unit normal `n` (camera frame) and albedo `a` shows color
/// `a_c * max(0, ambient_c + directional_c · n) + offset_c` in channel c: the first two bands of a spherical-harmonic
/// irradiance map (Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps",
/// 2001), which also absorbs exposure and white balance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Irradiance factor that does not depend on the normal, per channel.
    pub ambient: [f64; 3],
    /// Direction and strength of the light, per channel, pointing towards the light (camera frame).
    pub directional: [Vector3<f64>; 3],
    /// Added to the object's color whatever its albedo, per channel: haze, or the camera's black level.
    pub offset: [f64; 3],
}

/// One observation for [`Light::fit`]: a visible surface point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unlit surface color.
    pub albedo: [f32; 3],
    /// Unit normal, camera frame.
    pub normal: Vector3<f32>,
    /// Color in the image.
    pub observed: [f32; 3],
}

/// Why lighting could not be estimated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LightError {
    /// Fewer samples than unknowns.
    #[error("{found} samples given, at least {needed} needed")]
    TooFew {
        /// Samples given.
        found: usize,
        /// Samples needed.
        needed: usize,
    },
    /// The samples say nothing about a channel (all black) or are not finite.
    #[error("samples do not determine the light of channel {channel}")]
    Undetermined {
        /// 0 red, 1 green, 2 blue.
        channel: usize,
    },
}

impl Light {
    /// Uniform ambient light: colors are shown as stored times `strength`.
    pub fn ambient(strength: f64) -> Self {
        Self { ambient: [strength; 3], directional: [Vector3::zeros(); 3], offset: [0.0; 3] }
    }

    /// A light at the camera of strength `head` on surfaces that face it, over an ambient term.
    pub fn headlight(ambient: f64, head: f64) -> Self {
        Self { directional: [Vector3::new(0.0, 0.0, -head); 3], ..Self::ambient(ambient) }
    }

    /// Irradiance factor of channel `channel` (0..3) on a surface with unit normal `normal` (camera frame).
    #[inline]
    pub fn factor(&self, channel: usize, normal: &Vector3<f64>) -> f64 {
        (self.ambient[channel] + self.directional[channel].dot(normal)).max(0.0)
    }

    /// The light that best explains `samples`: linear least squares of the observed color against
    /// `albedo (1, n)`, each channel by itself, in closed form.
    ///
    /// Five rounds of iteratively reweighted least squares with Cauchy weights (scale 2.4 times the median
    /// absolute residual) set highlights and wrong pixels aside. `ridge` ≥ 0 is the strength of the pull of the
    /// directional part to zero, relative to the mean squared albedo: 1e-3 settles what normals in a narrow
    /// cone leave open.
    ///
    /// # Errors
    /// With fewer than four samples, or when a channel is undetermined.
    pub fn fit(samples: &[LightSample], ridge: f64) -> Result<Self, LightError> {
        if samples.len() < 4 {
            return Err(LightError::TooFew { found: samples.len(), needed: 4 });
        }
        let mut light = Self::ambient(0.0);
        for channel in 0..3 {
            let solution =
                fit_channel(samples, channel, ridge).ok_or(LightError::Undetermined { channel })?;
            light.ambient[channel] = solution[0];
            light.directional[channel] = Vector3::new(solution[1], solution[2], solution[3]);
        }
        Ok(light)
    }
}

/// Rounds of least squares: the first, and those that are weighted by what the one before left.
const ROUNDS: usize = 6;

fn fit_channel(samples: &[LightSample], channel: usize, ridge: f64) -> Option<Vector4<f64>> {
    let row = |s: &LightSample| {
        let n = s.normal.cast::<f64>();
        let a = s.albedo[channel] as f64;
        (Vector4::new(a, a * n.x, a * n.y, a * n.z), s.observed[channel] as f64)
    };
    let rows: Vec<(Vector4<f64>, f64)> = samples.iter().map(row).collect();
    let albedo_squared: f64 = samples.iter().map(|s| (s.albedo[channel] as f64).powi(2)).sum();
    let mut weights = vec![1.0; samples.len()];
    let mut magnitudes = vec![0.0; samples.len()];
    let mut solution = Vector4::zeros();
    for round in 0..ROUNDS {
        let mut normal = Matrix4::zeros();
        let mut right = Vector4::zeros();
        for ((row, observed), weight) in rows.iter().zip(&weights) {
            normal += row * row.transpose() * *weight;
            right += row * (*weight * observed);
        }
        // The ambient entry gets a pull too faint to matter, which keeps the matrix definite.
        for (i, scale) in [1e-9, ridge, ridge, ridge].into_iter().enumerate() {
            normal[(i, i)] += scale.max(1e-9) * albedo_squared;
        }
        solution = normal.cholesky()?.solve(&right);
        if round + 1 == ROUNDS {
            break;
        }
        for ((left, weight), (row, observed)) in magnitudes.iter_mut().zip(&mut weights).zip(&rows)
        {
            let residual = observed - row.dot(&solution);
            (*left, *weight) = (residual.abs(), residual);
        }
        let middle = magnitudes.len() / 2;
        let (_, median, _) = magnitudes.select_nth_unstable_by(middle, f64::total_cmp);
        let scale = (2.4 * *median).max(1e-4);
        // These hold residuals so far.
        weights.iter_mut().for_each(|w| *w = 1.0 / (1.0 + (*w / scale).powi(2)));
    }
    solution.iter().all(|v| v.is_finite()).then_some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(light: &Light, outliers: usize) -> Vec<LightSample> {
        (0..400)
            .map(|i| {
                let a = i as f64 * 0.7;
                let normal =
                    Vector3::new(a.cos(), a.sin(), -0.3 - 0.005 * (i * 7 % 400) as f64).normalize();
                let albedo = [0, 1, 2].map(|c| 0.3 + 0.6 * ((i * (c + 3)) % 17) as f64 / 17.0);
                let mut observed = [0, 1, 2].map(|c| albedo[c] * light.factor(c, &normal));
                if outliers > 0 && i % (400 / outliers.max(1)) == 0 {
                    observed = [1.0; 3];
                }
                LightSample {
                    albedo: albedo.map(|v| v as f32),
                    normal: normal.cast(),
                    observed: observed.map(|v| v as f32),
                }
            })
            .collect()
    }

    #[test]
    fn fitting_recovers_the_light_despite_outliers() {
        let mut light = Light::headlight(0.5, 0.3);
        light.directional[1] = Vector3::new(0.1, -0.2, -0.25);
        light.ambient[2] = 0.8;
        for outliers in [0, 80] {
            let fitted = Light::fit(&samples(&light, outliers), 0.0).unwrap();
            for c in 0..3 {
                assert!((fitted.ambient[c] - light.ambient[c]).abs() < 2e-3, "{fitted:?}");
                assert!((fitted.directional[c] - light.directional[c]).norm() < 2e-3, "{fitted:?}");
            }
        }
    }

    #[test]
    fn the_ridge_settles_a_single_normal() {
        let light = Light::headlight(0.4, 0.4);
        let mut flat = samples(&light, 0);
        flat.iter_mut().for_each(|s| {
            s.normal = Vector3::new(0.0, 0.0, -1.0);
            s.observed = s.albedo.map(|a| 0.8 * a);
        });
        let fitted = Light::fit(&flat, 1e-3).unwrap();
        let factor = fitted.factor(0, &Vector3::new(0.0, 0.0, -1.0));
        assert!((factor - 0.8).abs() < 1e-3);
    }

    #[test]
    fn what_cannot_be_fitted_is_an_error() {
        let mut all = samples(&Light::ambient(1.0), 0);
        assert_eq!(Light::fit(&all[..3], 1e-3), Err(LightError::TooFew { found: 3, needed: 4 }));
        all.iter_mut().for_each(|s| s.albedo[1] = 0.0);
        assert_eq!(Light::fit(&all, 1e-3), Err(LightError::Undetermined { channel: 1 }));
        all.iter_mut().for_each(|s| s.albedo[0] = f32::NAN);
        assert_eq!(Light::fit(&all, 1e-3), Err(LightError::Undetermined { channel: 0 }));
    }

    #[test]
    fn surfaces_facing_away_are_black_not_negative() {
        let light = Light::headlight(0.1, 1.0);
        assert_eq!(light.factor(0, &Vector3::new(0.0, 0.0, 1.0)), 0.0);
        assert_eq!(light.factor(0, &Vector3::new(0.0, 0.0, -1.0)), 1.1);
    }
}
