//! Anisotropic friction: along a direction of the surface otherwise than across it.

use nalgebra::{Unit, Vector3};
use prehend_autodiff::Scalar;

use super::{FrictionCoefficient, FrictionLaw, regularized_speed};
use crate::contact::error::LawError;
use crate::contact::parameters::{LawParameter, Parameters, Tabulated, entry};
use crate::contact::point::ContactKinematics;
use crate::contact::range::ParameterRange;

/// Friction with the coefficient μ of `along` along the unit direction a, and r·μ across it. The direction is fixed to the
/// body with the field: it is along the axes of that body and turns with it.
///
/// Under symmetric contact ([`Model::add_symmetric_contact`](crate::Model::add_symmetric_contact)), a is along the axes of
/// each direction's own field.
///
/// f_t = −f_n·P M u/√(|u|² + v_s²) with the friction tensor M = μ·(a aᵀ + r (I − a aᵀ)) and P the projection
/// across the normal: linear anisotropic friction (A. Zmitrowicz, "A theoretical model of anisotropic dry
/// friction", Wear 73, 1981), regularized as in [`regularized_coulomb`](super::regularized_coulomb). M is positive, so
/// every slip is braked. On a surface that holds a, the force stays inside the elliptic cone (f_a/μ)² + (f_b/rμ)² ≤ f_n²
/// and reaches it in fast slip. On a tilted one the tensor turns smoothly into the coefficient r·μ of every direction,
/// where a is the normal. Where the coefficient depends on speed, both directions do.
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_sim::contact::AnisotropicFriction;
/// use prehend_sim::{ContactLaw, Coulomb, KelvinVoigt, Law};
///
/// // Slides three times as easily along x as along y.
/// let along = Coulomb { friction: 0.2, slip_scale: 1e-3 };
/// let friction = AnisotropicFriction { along, across_ratio: 3.0, direction: Vector3::x_axis() };
/// let law = Law::new(KelvinVoigt { stiffness: 2e7, damping: 1e4 }, friction)?;
/// assert_eq!(law.params(), [2e7, 1e4, 0.2, 3.0]);
/// # Ok::<(), prehend_sim::contact::LawError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnisotropicFriction<F> {
    /// Friction along the direction.
    pub along: F,
    /// Friction across the direction over that along it, r ≥ 0.
    pub across_ratio: f64,
    /// The direction a, along the axes of the body with the field.
    pub direction: Unit<Vector3<f64>>,
}

const ACROSS_RATIO: LawParameter =
    entry!(across_ratio "" NotNegative "friction across the direction over that along it");

const DIRECTION: [LawParameter; 3] = [
    entry!(direction_x "" Finite "direction in the frame of the body with the field, any length"),
    entry!(direction_y "" Finite "its y"),
    entry!(direction_z "" Finite "its z"),
];

impl<F: FrictionCoefficient> Parameters for AnisotropicFriction<F> {
    type Params<T: Copy> = (F::Params<T>, [T; 1]);

    fn values(&self) -> Self::Params<f64> {
        (self.along.values(), [self.across_ratio])
    }

    fn names(&self) -> Vec<&'static str> {
        [self.along.names(), vec![ACROSS_RATIO.name]].concat()
    }

    fn check(&self, (along, [ratio]): &Self::Params<f64>) -> Result<(), LawError> {
        self.along.check(along)?;
        ACROSS_RATIO.check(*ratio)?;
        // One made of zeros or of anything that is not finite is NaN.
        ParameterRange::Positive.check("direction", self.direction.norm())
    }
}

impl<F: FrictionCoefficient + Tabulated> Tabulated for AnisotropicFriction<F> {
    type Constants<T: Copy> = (F::Constants<T>, [T; 3]);

    const SUMMARY: &'static str = "friction in an elliptic cone";

    const PARAMETERS: Self::Params<LawParameter> = (F::PARAMETERS, [ACROSS_RATIO]);

    const CONSTANTS: Self::Constants<LawParameter> = (F::CONSTANTS, DIRECTION);

    fn from_values(
        (along, [across_ratio]): Self::Params<f64>,
        (constants, direction): Self::Constants<f64>,
    ) -> Self {
        let direction = Unit::new_normalize(direction.into());
        Self { along: F::from_values(along, constants), across_ratio, direction }
    }
}

impl<F: FrictionCoefficient> FrictionLaw for AnisotropicFriction<F> {
    #[inline]
    fn force<S: Scalar>(
        &self,
        (along, [across]): Self::Params<S>,
        normal_force: S,
        contact: &ContactKinematics<S>,
    ) -> Vector3<S> {
        let speed = regularized_speed(&contact.slip, self.along.slip_scale());
        let scale = -(self.along.coefficient(along, speed) * normal_force) / speed;
        let (a, n, u) = (&self.direction, &contact.normal, &contact.slip);
        let slip_along = u.x.times(a.x) + u.y.times(a.y) + u.z.times(a.z);
        let along = (S::one() - across) * slip_along;
        let pull = Vector3::from_fn(|i, _| across * u[i] + along.times(a[i]));
        let lift = n.x * pull.x + n.y * pull.y + n.z * pull.z;
        Vector3::from_fn(|i, _| scale * (pull[i] - lift * n[i]))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Matrix3, Point3};

    use super::*;
    use crate::State;
    use crate::contact::Stribeck;
    use crate::contact::law_checks::{Claims, check_law};
    use crate::scenes::{floor, on_ground, penalty};
    use crate::{
        Body, BodyState, ContactLaw, Coulomb, GapSmoothing, HuntCrossley, KelvinVoigt, Law,
        RigidBody, Surface,
    };

    const SPRING: KelvinVoigt = KelvinVoigt { stiffness: 1e7, damping: 0.0 };

    fn friction(direction: Unit<Vector3<f64>>, across_ratio: f64) -> AnisotropicFriction<Coulomb> {
        let along = Coulomb { friction: 0.2, slip_scale: 1e-3 };
        AnisotropicFriction { along, across_ratio, direction }
    }

    fn contact(slip: Vector3<f64>, normal: Vector3<f64>) -> ContactKinematics<f64> {
        ContactKinematics { gap: -1e-3, normal_speed: 0.0, slip, normal, area: 1e-4 }
    }

    #[test]
    fn keeps_what_laws_promise() {
        let direction = Unit::new_normalize(Vector3::new(1.0, -2.0, 0.5));
        for across_ratio in [0.0, 0.4, 1.0, 2.5] {
            let claims = Claims::new(0.4 * f64::max(1.0, across_ratio));
            let along = Coulomb { friction: 0.4, slip_scale: 1e-2 };
            let spring = KelvinVoigt { stiffness: 3e7, damping: 2e5 };
            let friction = AnisotropicFriction { along, across_ratio, direction };
            check_law(&Law::new(spring, friction).unwrap(), &claims);
            let (friction, kinetic_friction) = (0.4, 0.3);
            let along =
                Stribeck { friction, kinetic_friction, stribeck_speed: 0.05, slip_scale: 1e-2 };
            let hunt = HuntCrossley { stiffness: 4e8, damping: 0.8, exponent: 1.5 };
            let friction = AnisotropicFriction { along, across_ratio, direction };
            check_law(&Law::new(hunt, friction).unwrap(), &claims);
        }
    }

    #[test]
    fn force_fills_its_elliptic_cone_and_stays_inside() {
        let (mu, ratio) = (0.2, 3.0);
        let law = Law::new(SPRING, friction(Vector3::x_axis(), ratio)).unwrap();
        for k in 0..360 {
            let (sine, cosine) = f64::from(k).to_radians().sin_cos();
            for speed in [1e-9, 1e-4, 1e-2, 10.0, 1e6] {
                let slip = Vector3::new(speed * cosine, speed * sine, 0.0);
                let response = law.law(law.params(), &contact(slip, Vector3::z()));
                let f = response.tangential / response.normal;
                let level = (f.x / mu).hypot(f.y / (ratio * mu));
                assert!(level <= 1.0 + 1e-15 && f.dot(&slip) < 0.0 && f.z == 0.0);
                assert!(speed < 1.0 || level > 1.0 - 1e-8);
            }
        }
    }

    #[test]
    fn without_anisotropy_it_is_the_isotropic_law_and_where_its_direction_is_the_normal_too() {
        let isotropic = penalty(1e7, 0.0, 0.2, 1e-3);
        let slip = Vector3::new(0.3, -0.1, 0.0);
        let expected = isotropic.law(isotropic.params(), &contact(slip, Vector3::z())).tangential;
        let force = |direction, ratio| {
            let law = Law::new(SPRING, friction(direction, ratio)).unwrap();
            law.law(law.params(), &contact(slip, Vector3::z())).tangential
        };
        assert!((force(Vector3::x_axis(), 1.0) - expected).norm() < 1e-15);
        assert!((force(Vector3::z_axis(), 3.0) - 3.0 * expected).norm() < 1e-15);
    }

    #[test]
    fn the_direction_turns_with_the_body_it_lies_on() {
        let law = Law::new(SPRING, friction(Vector3::x_axis(), 3.0)).unwrap();
        let rigid = RigidBody::new(0.2, Matrix3::identity(), Point3::origin()).unwrap();
        let surface = Surface::uniform(&[Point3::origin()], 1e-4).unwrap();
        let runner = Body::dynamic("runner", rigid).with_surface(surface);
        let model = on_ground(Vector3::zeros(), floor(), runner, Arc::new(law), GapSmoothing::Hard);
        let friction = |degrees: f64, slip: Vector3<f64>| {
            let turn = Isometry3::rotation(Vector3::z() * degrees.to_radians());
            let mut sliding = rigid.at_rest(&Isometry3::translation(0.0, 0.0, -1e-3));
            sliding.linear = slip;
            let wrench = model.wrenches(&State::new([BodyState::at_rest(turn), sliding]), 0)[1];
            assert!(wrench.z > 0.5);
            wrench.fixed_rows::<3>(0) / wrench.z - Vector3::z()
        };
        let (x, y) = (Vector3::x(), Vector3::y());
        for (degrees, along, across) in [(0.0, x, y), (90.0, y, x)] {
            assert!((friction(degrees, along * 5.0) + along * 0.2).norm() < 1e-6);
            assert!((friction(degrees, across * 5.0) + across * 0.6).norm() < 1e-6);
        }
    }

    #[test]
    fn bad_parameters_are_named() {
        let refused = |direction: Vector3<f64>, ratio| {
            let friction = friction(Unit::new_normalize(direction), ratio);
            Law::new(SPRING, friction).unwrap_err().name()
        };
        assert_eq!(refused(Vector3::x(), -1.0), Some("across_ratio"));
        assert_eq!(refused(Vector3::zeros(), 1.0), Some("direction"));
        assert_eq!(refused(Vector3::x() * f64::NAN, 1.0), Some("direction"));
        let law = Law::new(SPRING, friction(Vector3::x_axis(), 1.0)).unwrap();
        assert_eq!(law.check(&[1e7, 0.0, -0.1, 1.0]).unwrap_err().name(), Some("friction"));
        assert_eq!(law.check(&[1e7, 0.0, 0.2, -1.0]).unwrap_err().name(), Some("across_ratio"));
    }
}
