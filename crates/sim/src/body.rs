//! A rigid body: mass, inertia, center of mass.

pub(crate) mod error;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_autodiff::rigid::conjugated;

use crate::body_state::BodyState;
use error::{BodyError, check_lengths};

/// Mass, inertia and center of mass of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBody<S: Scalar = f64> {
    mass: S,
    inertia: Matrix3<S>,
    inverse_inertia: Matrix3<S>,
    com: Point3<S>,
}

impl<S: Scalar> RigidBody<S> {
    /// A body of `mass` \[kg\], `inertia` about its center of mass along the axes of the body frame \[kg m²\] and
    /// center of mass `com` in its body frame \[m\].
    ///
    /// # Errors
    /// Unless the mass is positive, the inertia symmetric positive definite and that of a body, and everything finite.
    pub fn new(mass: S, inertia: Matrix3<S>, com: Point3<S>) -> Result<Self, BodyError> {
        let value = mass.value();
        if !(value > 0.0 && value.is_finite()) {
            return Err(BodyError::Mass(value));
        }
        if !com.iter().all(|c| c.value().is_finite()) {
            return Err(BodyError::CenterOfMass);
        }
        let values = inertia.map(S::value);
        let asymmetry = (values - values.transpose()).norm();
        if !values.iter().all(|x| x.is_finite()) || asymmetry > 1e-6 * values.norm() {
            return Err(BodyError::Inertia);
        }
        let mut moments: [f64; 3] = values.symmetric_eigenvalues().into();
        moments.sort_by(f64::total_cmp);
        // Nothing is as thin as a sheet: some room for what was measured or written with few digits.
        if moments[0] > 0.0 && moments[2] > (1.0 + 1e-3) * (moments[0] + moments[1]) {
            return Err(BodyError::Moments { moments });
        }
        let inertia = (inertia + inertia.transpose()) * S::constant(0.5);
        let inverse_inertia = inertia.cholesky().ok_or(BodyError::Inertia)?.inverse();
        // Of what is next to nothing it overflows.
        if !inverse_inertia.iter().all(|x| x.value().is_finite()) {
            return Err(BodyError::Inertia);
        }
        Ok(Self { mass, inertia, inverse_inertia, com })
    }

    /// A solid, uniform box of `mass` \[kg\] around the origin of its body frame with edges along the axes, `half_extents` \[m\]
    /// from it.
    ///
    /// # Errors
    /// Unless the mass and all lengths are positive and finite.
    pub fn cuboid(mass: S, half_extents: [f64; 3]) -> Result<Self, BodyError> {
        check_lengths(&half_extents)?;
        let [x, y, z] = half_extents.map(|half| half * half / 3.0);
        let moments = Vector3::new(y + z, z + x, x + y).map(|square| mass.times(square));
        Self::new(mass, Matrix3::from_diagonal(&moments), Point3::origin())
    }

    /// A solid, uniform ball of `mass` \[kg\] and `radius` \[m\] around the origin of its body frame.
    ///
    /// # Errors
    /// Unless both are positive and finite.
    pub fn ball(mass: S, radius: f64) -> Result<Self, BodyError> {
        check_lengths(&[radius])?;
        let moment = mass.times(0.4 * radius * radius);
        Self::new(mass, Matrix3::from_diagonal_element(moment), Point3::origin())
    }

    /// Body moved in its body frame: what was at the origin is at `motion`.
    #[must_use]
    pub fn moved(&self, motion: &Isometry3<f64>) -> Self {
        let rotation = motion.rotation.to_rotation_matrix().into_inner().map(S::constant);
        let about = |matrix: &Matrix3<S>| rotation * matrix * rotation.transpose();
        let place = motion.translation.vector.map(S::constant);
        Self {
            mass: self.mass,
            inertia: about(&self.inertia),
            inverse_inertia: about(&self.inverse_inertia),
            com: (place + rotation * self.com.coords).into(),
        }
    }

    /// Body of another density, so that it has `mass` \[kg\]: the inertia is scaled as well.
    ///
    /// # Errors
    /// Unless the mass is positive and finite.
    pub fn with_mass(&self, mass: S) -> Result<Self, BodyError> {
        Self::new(mass, self.inertia * (mass / self.mass), self.com)
    }

    /// Mass \[kg\].
    #[inline]
    pub fn mass(&self) -> S {
        self.mass
    }

    /// Inertia about the center of mass, along the axes of the body frame \[kg m²\].
    #[inline]
    pub fn inertia(&self) -> &Matrix3<S> {
        &self.inertia
    }

    /// Center of mass in the body frame \[m\].
    #[inline]
    pub fn com(&self) -> &Point3<S> {
        &self.com
    }

    /// A zero that carries the derivatives of the center of mass, in the body frame \[m\]; none if it is a constant.
    #[inline]
    pub(crate) fn com_change(&self) -> Option<Vector3<S>> {
        let change = self.com.coords.map(|x| x.plus(-x.value()));
        (!change.iter().all(|x| x.is_constant_zero())).then_some(change)
    }

    /// Radius of gyration about the center of mass, of all axes together: √(tr I / 2m) \[m\].
    #[inline]
    pub(crate) fn gyration_radius(&self) -> f64 {
        (self.inertia.trace().value() / (2.0 * self.mass.value())).sqrt()
    }

    /// Inertia about the center of mass, along the world's axes \[kg m²\].
    #[inline]
    pub fn world_inertia(&self, rotation: &UnitQuaternion<S>) -> Matrix3<S> {
        let r = rotation.to_rotation_matrix();
        r.matrix() * self.inertia * r.matrix().transpose()
    }

    /// Inverse of [`Self::world_inertia`].
    #[inline]
    pub fn inverse_world_inertia(&self, rotation: &UnitQuaternion<S>) -> Matrix3<S> {
        let r = rotation.to_rotation_matrix();
        r.matrix() * self.inverse_inertia * r.matrix().transpose()
    }

    /// Angular momentum \[kg m²/s\] of the body that turns with `angular` \[rad/s\], world frame.
    #[inline]
    pub(crate) fn momentum(
        &self,
        rotation: &UnitQuaternion<S>,
        angular: &Vector3<S>,
    ) -> Vector3<S> {
        conjugate(&self.inertia, rotation, angular)
    }

    /// Angular velocity \[rad/s\] of the body with angular `momentum` \[kg m²/s\], world frame.
    #[inline]
    pub(crate) fn angular(
        &self,
        rotation: &UnitQuaternion<S>,
        momentum: &Vector3<S>,
    ) -> Vector3<S> {
        conjugate(&self.inverse_inertia, rotation, momentum)
    }

    /// Velocity of the center of mass \[m/s\] and angular momentum \[kg m²/s\] of the body at `state` after `wrench` (about the
    /// center of mass) and `gravity` \[m/s²\] have acted on it for `dt` \[s\], world frame.
    #[inline]
    pub(crate) fn apply_impulse(
        &self,
        state: &BodyState<S>,
        wrench: &Vector6<S>,
        gravity: &Vector3<S>,
        dt: S,
    ) -> (Vector3<S>, Vector3<S>) {
        let (force, torque) = (wrench.fixed_rows::<3>(0), wrench.fixed_rows::<3>(3));
        let linear = state.linear + (gravity + force / self.mass) * dt;
        (linear, self.momentum(&state.pose.rotation, &state.angular) + torque * dt)
    }

    /// `t_world_com` of a body whose body frame is at `t_world_body`.
    #[inline]
    pub fn com_pose(&self, t_world_body: &Isometry3<S>) -> Isometry3<S> {
        t_world_body * Translation3::from(self.com.coords)
    }

    /// `t_world_body` of a body whose center-of-mass frame is at `t_world_com`.
    #[inline]
    pub fn body_pose(&self, t_world_com: &Isometry3<S>) -> Isometry3<S> {
        t_world_com * Translation3::from(-self.com.coords)
    }

    /// Body, each number through `f`.
    pub(crate) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> RigidBody<T> {
        RigidBody {
            mass: f(self.mass),
            inertia: self.inertia.map(&f),
            inverse_inertia: self.inverse_inertia.map(&f),
            com: self.com.map(&f),
        }
    }

    /// The body at rest with its body frame at `t_world_body`. Derivatives by the center of mass are in the state, too.
    pub fn at_rest(&self, t_world_body: &Isometry3<S>) -> BodyState<S> {
        BodyState::at_rest(self.com_pose(t_world_body))
    }
}

impl RigidBody {
    /// Body in constants of another scalar.
    pub fn cast<S: Scalar>(&self) -> RigidBody<S> {
        self.map(S::constant)
    }
}

/// R A Rᵀ `vector` for A = `matrix`: one node of a tape unless that carries derivatives.
#[inline]
fn conjugate<S: Scalar>(
    matrix: &Matrix3<S>,
    rotation: &UnitQuaternion<S>,
    vector: &Vector3<S>,
) -> Vector3<S> {
    if S::RECORDED && matrix.iter().all(|x| x.is_constant()) {
        return conjugated(rotation, &matrix.map(S::value), vector);
    }
    let r = rotation.to_rotation_matrix();
    r * (matrix * r.inverse_transform_vector(vector))
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::Fwd;

    use super::*;

    #[test]
    fn bad_bodies_are_refused() {
        let (i, o) = (Matrix3::identity(), Point3::origin());
        assert_eq!(RigidBody::new(0.0, i, o), Err(BodyError::Mass(0.0)));
        assert!(RigidBody::new(f64::NAN, i, o).is_err());
        assert_eq!(RigidBody::new(1.0, -i, o), Err(BodyError::Inertia));
        assert_eq!(RigidBody::new(1.0, i * f64::NAN, o), Err(BodyError::Inertia));
        let impossible = Matrix3::from_diagonal(&Vector3::new(1.0, 3.0, 1.0));
        let moments = [1.0, 1.0, 3.0];
        assert_eq!(RigidBody::new(1.0, impossible, o), Err(BodyError::Moments { moments }));
        let nowhere = Point3::new(f64::NAN, 0.0, 0.0);
        assert_eq!(RigidBody::new(1.0, i, nowhere), Err(BodyError::CenterOfMass));
    }

    #[test]
    fn the_radius_of_gyration_is_of_all_axes_together() {
        let ball = RigidBody::ball(2.0, 0.1).unwrap();
        // Of ∫ r² dm = 3/5 m R².
        assert!((ball.gyration_radius() - 0.6_f64.sqrt() * 0.1).abs() < 1e-15);
    }

    #[test]
    fn model_and_com_poses_are_inverse() {
        let com = Point3::new(0.1, -0.2, 0.3);
        let body = RigidBody::new(2.0, Matrix3::identity(), com).unwrap();
        let pose = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, 0.2, -0.5));
        let at_com = body.com_pose(&pose);
        assert!((at_com.translation.vector - (pose * com).coords).norm() < 1e-15);
        assert!((body.body_pose(&at_com).to_homogeneous() - pose.to_homogeneous()).norm() < 1e-15);
    }

    #[test]
    fn a_heavier_body_turns_as_slowly() {
        let body = RigidBody::new(2.0, Matrix3::identity() * 0.4, Point3::origin()).unwrap();
        let [mass] = Fwd::<1>::variables([3.0]);
        let heavier = body.cast().with_mass(mass).unwrap();
        assert!((heavier.inertia()[(0, 0)].value - 0.6).abs() < 1e-15);
        assert!((heavier.inertia()[(0, 0)].derivative[0] - 0.2).abs() < 1e-15);
        assert_eq!(body.with_mass(0.0), Err(BodyError::Mass(0.0)));
    }

    #[test]
    fn solids_have_the_moments_of_their_matter() {
        let half = [0.03, 0.02, 0.05];
        let mass = 0.3;
        let cuboid = RigidBody::cuboid(mass, half).unwrap();
        let ball = RigidBody::ball(mass, 0.05).unwrap();
        // Sums over small cells: ∫(r² − x²) dm along each axis.
        let cells = 40;
        let place = |i: i32, half: f64| half * (f64::from(2 * i + 1) / f64::from(cells) - 1.0);
        let moments = |half: [f64; 3], inside: fn(&Vector3<f64>) -> bool| {
            let grid = (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j)));
            let points = grid.flat_map(|(i, j)| {
                let x =
                    move |k| Vector3::new(place(i, half[0]), place(j, half[1]), place(k, half[2]));
                (0..cells).map(x)
            });
            let points: Vec<_> = points.filter(inside).collect();
            let sum: Vector3<f64> = points
                .iter()
                .map(|p| (p.component_mul(p) * -1.0).add_scalar(p.norm_squared()))
                .sum();
            sum * (mass / points.len() as f64)
        };
        let close = |body: &RigidBody, expected: Vector3<f64>| {
            let off = body.inertia() - Matrix3::from_diagonal(&expected);
            assert!(off.norm() < 3e-3 * expected.norm(), "{off}");
        };
        close(&cuboid, moments(half, |_| true));
        close(&ball, moments([0.05; 3], |p| p.norm() < 0.05));
        let [mass] = Fwd::<1>::variables([0.3]);
        let by_mass = RigidBody::cuboid(mass, half).unwrap().inertia()[(2, 2)].derivative[0];
        assert!((by_mass - cuboid.inertia()[(2, 2)] / 0.3).abs() < 1e-18);
        assert_eq!(RigidBody::cuboid(1.0, [1.0, 0.0, 1.0]), Err(BodyError::Length(0.0)));
        assert_eq!(RigidBody::ball(1.0, -1.0), Err(BodyError::Length(-1.0)));
        assert_eq!(RigidBody::ball(0.0, 1.0), Err(BodyError::Mass(0.0)));
    }

    #[test]
    fn inertia_carries_its_derivative_into_its_inverse() {
        let [a, b] = Fwd::<2>::variables([1.5, 0.3]);
        let mut inertia = Matrix3::<Fwd<2>>::identity();
        (inertia[(0, 0)], inertia[(0, 1)], inertia[(1, 0)]) = (a, b, b);
        let body = RigidBody::new(Fwd::constant(1.0), inertia, Point3::origin()).unwrap();
        // (1.5·1 − b²)⁻¹ at the corner: ∂/∂a of the inverse's first entry is −(that entry)².
        let inverse = body.inverse_world_inertia(&UnitQuaternion::identity());
        let first = inverse[(0, 0)];
        assert!((first.value - 1.0 / (1.5 - 0.09)).abs() < 1e-14);
        assert!((first.derivative[0] + first.value * first.value).abs() < 1e-14);
    }
}
