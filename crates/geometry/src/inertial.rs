//! Mass and inertia of a body, as descriptions of robots give them.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// Mass and inertia of a rigid body, in the body's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// Mass \[kg\].
    pub mass: f64,
    /// Center of mass \[m\].
    pub com: Point3<f64>,
    /// Inertia about the center of mass, along the axes of the body's frame \[kg m²\].
    pub inertia: Matrix3<f64>,
}

impl Inertial {
    /// Mass and inertia in the frame that `t_new_body` leads to, or after that motion of the body.
    #[must_use]
    pub fn moved(&self, t_new_body: &Isometry3<f64>) -> Self {
        let r = t_new_body.rotation.to_rotation_matrix();
        let inertia = r.matrix() * self.inertia * r.matrix().transpose();
        Self { mass: self.mass, com: t_new_body * self.com, inertia }
    }

    /// Bodies that are one; `None` where they weigh nothing.
    pub fn joined<'a>(parts: impl IntoIterator<Item = &'a Inertial> + Clone) -> Option<Self> {
        let mass: f64 = parts.clone().into_iter().map(|p| p.mass).sum();
        if mass <= 0.0 {
            return None;
        }
        let weighted = parts.clone().into_iter().map(|p| p.com.coords * p.mass);
        let com = Point3::from(weighted.sum::<Vector3<f64>>() / mass);
        let inertia = parts.into_iter().map(|p| p.about(&com)).sum();
        Some(Self { mass, com, inertia })
    }

    /// Inertia about `point`, along the axes of the body's frame \[kg m²\].
    pub fn about(&self, point: &Point3<f64>) -> Matrix3<f64> {
        let r = self.com - point;
        let shift = Matrix3::from_diagonal_element(r.norm_squared()) - r * r.transpose();
        self.inertia + shift * self.mass
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of unit density with this half extent along x, and with half extents of 1 along y and z.
    fn half_box(half: f64, x: f64) -> Inertial {
        let mass = 8.0 * half;
        let long = (half * half + 1.0) / 3.0;
        let inertia = Matrix3::from_diagonal(&Vector3::new(2.0 / 3.0, long, long)) * mass;
        Inertial { mass, com: Point3::new(x, 0.0, 0.0), inertia }
    }

    #[test]
    fn two_halves_make_a_whole() {
        let t = Isometry3::new(Vector3::new(0.3, -1.0, 2.0), Vector3::new(0.5, 0.1, -0.7));
        let halves = [half_box(0.5, -0.5).moved(&t), half_box(0.5, 0.5).moved(&t)];
        let (joined, whole) = (Inertial::joined(&halves).unwrap(), half_box(1.0, 0.0).moved(&t));
        assert!((joined.mass - whole.mass).abs() < 1e-14);
        assert!((joined.com - whole.com).norm() < 1e-14);
        assert!((joined.inertia - whole.inertia).norm() < 1e-13);
        assert_eq!(Inertial::joined(&[]), None);
    }
}
