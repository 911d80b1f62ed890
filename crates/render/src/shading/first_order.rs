//! First-order light as a shader.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::{Shader, SurfacePoint};
use crate::light::Light;

impl Light {
    /// The color of a visible point, whose normal is in the camera frame: albedo times irradiance, which is zero where the surface faces
    /// away, and the offset; not clamped.
    #[inline]
    pub fn color(&self, point: &SurfacePoint<f32>) -> [f32; 3] {
        let normal = point.normal.cast::<f64>();
        [0, 1, 2].map(|k| point.albedo[k] * self.factor(k, &normal) as f32 + self.offset[k] as f32)
    }
}

impl Shader for Light {
    /// For each channel the ambient factor, the directional vector and the offset.
    fn parameters(&self) -> Vec<f64> {
        let channel = |k: usize| {
            let d = self.directional[k];
            [self.ambient[k], d.x, d.y, d.z, self.offset[k]]
        };
        [0, 1, 2].map(channel).concat()
    }

    #[inline]
    fn shade<S: Scalar>(&self, parameters: &[S], point: &SurfacePoint<S>) -> [S; 3] {
        [0, 1, 2].map(|k| {
            let p = &parameters[5 * k..5 * k + 5];
            let factor = p[0] + Vector3::new(p[1], p[2], p[3]).dot(&point.normal);
            (point.albedo[k] * factor).select(factor.value() > 0.0, S::zero()) + p[4]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shader_is_the_lights_own_factor() {
        let mut light = Light::headlight(0.3, 0.6);
        light.directional[1] = Vector3::new(0.2, -0.5, 0.1);
        light.offset = [0.0, 0.1, -0.02];
        let parameters = light.parameters();
        for normal in [Vector3::new(0.6, 0.0, -0.8), Vector3::new(0.0, 1.0, 0.0), Vector3::z()] {
            let point = SurfacePoint { position: Vector3::z(), normal, albedo: [0.5, 0.6, 0.7] };
            let color = light.shade(&parameters, &point);
            let single = light.color(&SurfacePoint {
                position: point.position.cast(),
                normal: normal.cast(),
                albedo: point.albedo.map(|a| a as f32),
            });
            assert!(single.iter().zip(color).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6));
            for (k, value) in color.iter().enumerate() {
                let expected = point.albedo[k] * light.factor(k, &normal) + light.offset[k];
                assert!((value - expected).abs() < 1e-15);
            }
        }
    }
}
