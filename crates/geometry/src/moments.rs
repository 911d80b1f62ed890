//! Volume, center and second moments of solids, over plain numbers or numbers that carry derivatives.

mod polyhedron;
mod revolution;

use std::iter::Sum;
use std::ops::Add;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_autodiff::Scalar;

/// Volume of a solid and the first two moments about the origin of its frame: V \[m³\], ∫x dV \[m⁴\] and ∫x xᵀ dV \[m⁵\].
///
/// Solids that do not overlap add up.
///
/// ```
/// use prehend_autodiff::{Fwd, Scalar};
/// use prehend_geometry::Moments;
///
/// // Inertia of a cylinder about its axis, m r²/2 = π r⁴ h ρ at 1000 kg/m³ with the half height h, by its radius.
/// let [radius] = Fwd::<1>::variables([0.03]);
/// let cylinder = Moments::cylinder(Fwd::constant(0.05), radius);
/// let (_, _, inertia) = cylinder.of_density(Fwd::constant(1e3));
/// let expected = 4.0 * std::f64::consts::PI * 0.03_f64.powi(3) * 0.05 * 1e3;
/// assert!((inertia[(1, 1)].derivative[0] / expected - 1.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments<S: Scalar = f64> {
    /// V \[m³\].
    pub volume: S,
    /// ∫x dV \[m⁴\].
    pub first: Vector3<S>,
    /// ∫x xᵀ dV \[m⁵\].
    pub second: Matrix3<S>,
}

impl<S: Scalar> Moments<S> {
    /// Those of nothing.
    pub fn zero() -> Self {
        Self { volume: S::zero(), first: Vector3::zeros(), second: Matrix3::zeros() }
    }

    /// A ball of `radius` \[m\] around the origin.
    pub fn ball(radius: S) -> Self {
        let square = radius * radius;
        let volume = (square * radius).times(4.0 / 3.0 * std::f64::consts::PI);
        Self::centered(volume, Vector3::repeat((volume * square).times(0.2)))
    }

    /// A box around the origin, along the axes.
    pub fn cuboid(half_extents: &Vector3<S>) -> Self {
        let volume = (half_extents.x * half_extents.y * half_extents.z).times(8.0);
        Self::centered(volume, half_extents.map(|half| (volume * half * half).times(1.0 / 3.0)))
    }

    /// A solid with its center at the origin and these ∫xᵢ² dV \[m⁵\].
    fn centered(volume: S, squares: Vector3<S>) -> Self {
        Self { volume, first: Vector3::zeros(), second: Matrix3::from_diagonal(&squares) }
    }

    /// Those of the solid after a motion.
    #[must_use]
    pub fn moved(&self, motion: &Isometry3<S>) -> Self {
        let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
        let turned = rotation * self.first;
        let mixed = turned * shift.transpose();
        Self {
            volume: self.volume,
            first: turned + shift * self.volume,
            second: rotation.matrix() * self.second * rotation.matrix().transpose()
                + mixed
                + mixed.transpose()
                + shift * shift.transpose() * self.volume,
        }
    }

    /// Mass \[kg\], center of mass \[m\] and inertia about it \[kg m²\] at a uniform `density` \[kg/m³\].
    /// The center of what has no volume is the origin.
    pub fn of_density(&self, density: S) -> (S, Point3<S>, Matrix3<S>) {
        let center = match self.volume.value() {
            0.0 => Vector3::zeros(),
            _ => self.first / self.volume,
        };
        let central = (self.second - center * center.transpose() * self.volume) * density;
        let inertia = Matrix3::from_diagonal_element(central.trace()) - central;
        (self.volume * density, center.into(), inertia)
    }
}

impl<S: Scalar> Add for Moments<S> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            volume: self.volume + other.volume,
            first: self.first + other.first,
            second: self.second + other.second,
        }
    }
}

impl<S: Scalar> Sum for Moments<S> {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::zero(), Add::add)
    }
}

#[cfg(test)]
mod tests;
