//! Ambient light, lamps and two materials.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::{Shader, SurfacePoint};

/// A source of light, camera frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lamp {
    /// Parallel rays.
    Directional {
        /// Where the light comes from; its length does not matter.
        towards: Vector3<f64>,
        /// Strength per channel on a surface that faces it.
        strength: [f64; 3],
    },
    /// Light that spreads from a point.
    Point {
        /// Position \[m\].
        position: Vector3<f64>,
        /// Strength per channel on a surface that faces it, with fall-off at a distance of 1 m.
        strength: [f64; 3],
        /// Whether the strength falls with the square of the distance, as that of a small lamp does.
        falls_off: bool,
    },
}

/// How a surface reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// Equally in all directions.
    Lambert,
    /// With a highlight of the lamp's color (J. F. Blinn, "Models of light reflection for computer synthesized
    /// pictures", 1977).
    BlinnPhong {
        /// Strength of the highlight.
        specular: f64,
        /// Exponent, above zero: the higher, the smaller the highlight.
        shininess: f64,
    },
}

/// Ambient light and any number of lamps on one material.
///
/// With albedo a, unit normal n, unit direction to the eye v, and for lamp l the unit direction to it s and the strength
/// e (divided by the squared distance in meters where it falls off), the color of each channel is
/// `a ambient + Σ_l e max(0, n·s) (a + specular max(0, n·h)^shininess)`, h = (s + v)/|s + v|. The highlight is part of the
/// reflectance (T. Akenine-Möller and others, "Real-Time Rendering", 3rd edition, 2008, section 7.5.2), so that it fades
/// where the light grazes instead of ending there. There are no shadows.
#[derive(Clone, Debug, PartialEq)]
pub struct Lighting {
    /// Light from everywhere, per channel.
    pub ambient: [f64; 3],
    /// The lamps.
    pub lamps: Vec<Lamp>,
    /// The material.
    pub material: Material,
}

impl Lighting {
    /// With the parameters (as of [`Shader::parameters`]) in the place of its own numbers.
    ///
    /// # Panics
    /// If there are not as many.
    pub fn with_parameters(&self, parameters: &[f64]) -> Self {
        assert_eq!(parameters.len(), 3 + 6 * self.lamps.len() + self.highlight().len());
        let mut out = self.clone();
        let triple = |i: usize| -> [f64; 3] { [0, 1, 2].map(|k| parameters[i + k]) };
        out.ambient = triple(0);
        for (i, lamp) in out.lamps.iter_mut().enumerate() {
            let first = 3 + 6 * i;
            match lamp {
                Lamp::Directional { towards: place, strength }
                | Lamp::Point { position: place, strength, .. } => {
                    (*place, *strength) = (triple(first).into(), triple(first + 3));
                }
            }
        }
        if let Material::BlinnPhong { specular, shininess } = &mut out.material {
            let first = 3 + 6 * self.lamps.len();
            (*specular, *shininess) = (parameters[first], parameters[first + 1]);
        }
        out
    }

    fn highlight(&self) -> Vec<f64> {
        match self.material {
            Material::Lambert => Vec::new(),
            Material::BlinnPhong { specular, shininess } => vec![specular, shininess],
        }
    }
}

/// A unit vector, or zero (without derivatives) of what has no direction.
#[inline]
fn unit<S: Scalar>(v: &Vector3<S>) -> Vector3<S> {
    let squared = v.norm_squared();
    if squared.value() > 1e-24 { v / squared.sqrt() } else { Vector3::zeros() }
}

impl Shader for Lighting {
    /// Ambient; for each lamp its direction or position and its strength; specular and shininess.
    fn parameters(&self) -> Vec<f64> {
        let lamp = |lamp: &Lamp| match lamp {
            Lamp::Directional { towards: place, strength }
            | Lamp::Point { position: place, strength, .. } => {
                [[place.x, place.y, place.z], *strength].concat()
            }
        };
        let mut out = self.ambient.to_vec();
        out.extend(self.lamps.iter().flat_map(lamp));
        out.extend(self.highlight());
        out
    }

    fn shade<S: Scalar>(&self, parameters: &[S], point: &SurfacePoint<S>) -> [S; 3] {
        let (ambient, rest) = parameters.split_at(3);
        let (lamps, highlight) = rest.split_at(6 * self.lamps.len());
        let mut color = [0, 1, 2].map(|k| point.albedo[k] * ambient[k]);
        for (lamp, p) in self.lamps.iter().zip(lamps.chunks_exact(6)) {
            let place = Vector3::new(p[0], p[1], p[2]);
            let (to_lamp, fall_off) = match lamp {
                Lamp::Directional { .. } => (place, None),
                Lamp::Point { falls_off, .. } => {
                    let to_lamp = place - point.position;
                    let squared = to_lamp.norm_squared();
                    (to_lamp, (*falls_off && squared.value() > 1e-24).then(|| squared.recip()))
                }
            };
            let direction = unit(&to_lamp);
            let facing = point.normal.dot(&direction);
            if facing.value() <= 0.0 {
                continue;
            }
            let shine = match self.material {
                Material::Lambert => S::zero(),
                Material::BlinnPhong { .. } => {
                    let half = unit(&(direction - unit(&point.position)));
                    let along = point.normal.dot(&half);
                    if along.value() > 0.0 {
                        highlight[0] * (along.ln() * highlight[1]).exp()
                    } else {
                        S::zero()
                    }
                }
            };
            for k in 0..3 {
                let strength = fall_off.map_or(p[3 + k], |f| p[3 + k] * f);
                color[k] += strength * facing * (point.albedo[k] + shine);
            }
        }
        color
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shading::{Chunks, by_parameters, by_point};
    use prehend_autodiff::check::finite_difference_gradient;

    fn lighting() -> Lighting {
        let towards = Vector3::new(-0.3, -0.8, -2.0);
        let position = Vector3::new(0.3, -0.2, 0.1);
        Lighting {
            ambient: [0.2, 0.25, 0.3],
            lamps: vec![
                Lamp::Directional { towards, strength: [0.5, 0.4, 0.3] },
                Lamp::Point { position, strength: [0.1, 0.12, 0.14], falls_off: true },
                Lamp::Point { position: -position, strength: [0.3; 3], falls_off: false },
            ],
            material: Material::BlinnPhong { specular: 0.4, shininess: 12.0 },
        }
    }

    #[test]
    fn the_formula_holds_at_a_point_worked_by_hand() {
        // Eye, lamp and normal in one line: both cosines are one, and the lamp is 0.5 m away.
        let point = SurfacePoint {
            position: Vector3::new(0.0, 0.0, 0.5),
            normal: -Vector3::z(),
            albedo: [0.5, 0.2, 0.1],
        };
        let strength = [0.25, 0.5, 1.0];
        let position = Vector3::zeros();
        let light = Lighting {
            ambient: [0.1; 3],
            lamps: vec![Lamp::Point { position, strength, falls_off: true }],
            material: Material::BlinnPhong { specular: 0.3, shininess: 7.0 },
        };
        let color = light.shade(&light.parameters(), &point);
        for k in 0..3 {
            let a = point.albedo[k];
            assert!((color[k] - (0.1 * a + 4.0 * strength[k] * (a + 0.3))).abs() < 1e-14);
        }
        let away = SurfacePoint { normal: Vector3::z(), ..point };
        assert!((light.shade(&light.parameters(), &away)[0] - 0.05).abs() < 1e-15);
    }

    #[test]
    fn derivatives_match_differences() {
        let light = lighting();
        let normal = Vector3::new(0.2, -0.3, -1.0).normalize();
        let point = SurfacePoint {
            position: Vector3::new(0.05, -0.02, 0.5),
            normal,
            albedo: [0.7, 0.5, 0.3],
        };
        let adjoint = [0.3, -0.7, 1.1];
        let (p, chunks) = (light.parameters(), Chunks::new(&light.parameters()));
        assert_eq!(light.with_parameters(&p), light);
        let value = |p: &[f64], point: &SurfacePoint<f64>| -> f64 {
            let color = light.shade(p, point);
            (0..3).map(|k| adjoint[k] * color[k]).sum()
        };
        let mut by_p = vec![0.0; p.len()];
        by_parameters(&light, &chunks, &point, adjoint, &mut by_p);
        let differences = finite_difference_gradient(|p| value(p, &point), &p, 1e-6);
        for (exact, difference) in by_p.iter().zip(&differences) {
            assert!((exact - difference).abs() < 1e-7, "{by_p:?} {differences:?}");
        }
        let exact = by_point(&light, &chunks, &point, adjoint);
        let flat = |s: &SurfacePoint<f64>| [s.position.into(), s.normal.into(), s.albedo].concat();
        let at = |x: &[f64]| {
            let v = |i: usize| [x[i], x[i + 1], x[i + 2]];
            SurfacePoint { position: v(0).into(), normal: v(3).into(), albedo: v(6) }
        };
        let differences = finite_difference_gradient(|x| value(&p, &at(x)), &flat(&point), 1e-6);
        for (exact, difference) in flat(&exact).iter().zip(&differences) {
            assert!((exact - difference).abs() < 1e-7, "{exact} {difference}");
        }
    }

    #[test]
    fn singular_points_have_finite_derivatives() {
        let light = lighting();
        let chunks = Chunks::new(&light.parameters());
        let lamp = Vector3::new(0.3, -0.2, 0.1);
        for (position, normal) in
            [(lamp, -Vector3::z()), (Vector3::z(), Vector3::zeros()), (Vector3::zeros(), lamp)]
        {
            let point = SurfacePoint { position, normal, albedo: [0.0; 3] };
            let by = by_point(&light, &chunks, &point, [1.0; 3]);
            assert!(by.position.iter().chain(by.normal.iter()).all(|v| v.is_finite()));
            let mut gradient = vec![0.0; light.parameters().len()];
            by_parameters(&light, &chunks, &point, [1.0; 3], &mut gradient);
            assert!(gradient.iter().all(|v| v.is_finite()));
        }
    }
}
