//! Anisotropic friction: a grain along which bodies slide otherwise than across it.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::error::LawError;
use super::friction::regularized_speed;
use super::law::{Contact, ContactLaw, Isotropic, IsotropicLaw, Response};

/// `law` with the friction of a grained surface: its own coefficient μ along the unit direction a of the
/// grain and r·μ across it. The grain is fixed to the surface it lies on: a is along the axes of the body with
/// the field and turns with that body.
///
/// Between bodies that touch both ways
/// ([`World::touch_both_ways`](crate::World::touch_both_ways)), a is along the axes of each direction's own
/// field: a body on each side of the contact carries the grain.
///
/// f_t = −f_n·P M u/√(|u|² + v_s²) with the friction tensor M = μ·(a aᵀ + r (I − a aᵀ)) and P the projection
/// across the normal: linear anisotropic friction (A. Zmitrowicz, "A theoretical model of anisotropic dry
/// friction", Wear 73, 1981), regularized as in
/// [`regularized_coulomb`](super::friction::regularized_coulomb). M is positive, so every slip is braked. On
/// a surface that holds a, the force stays inside the elliptic cone (f_a/μ)² + (f_b/rμ)² ≤ f_n² and reaches
/// it in fast slip. On a tilted one the tensor turns smoothly into the coefficient r·μ of every direction,
/// where a is the normal. Where the coefficient depends on speed, both directions do.
///
/// ```
/// use nalgebra::Vector3;
/// use prehend_sim::{ContactLaw, Penalty};
///
/// // Slides three times as easily along x as along y.
/// let law = Penalty::new(2e7, 1e4, 0.2, 1e-3)?.with_grain(Vector3::x(), 3.0)?;
/// assert_eq!(law.params(), [2e7, 1e4, 0.2, 3.0]);
/// # Ok::<(), prehend_sim::LawError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Grained<L> {
    law: L,
    /// The parameters of `law`, then r.
    params: Vec<f64>,
    direction: Vector3<f64>,
}

impl<L: IsotropicLaw> Isotropic<L> {
    /// This law with its own friction coefficient along `direction` (along the axes of the body
    /// with the field, of any length but zero) and `across_ratio` ≥ 0 times as much across. See [`Grained`].
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn with_grain(
        self,
        direction: Vector3<f64>,
        across_ratio: f64,
    ) -> Result<Grained<L>, LawError> {
        let Isotropic(law) = self;
        LawError::check_not_negative("across_ratio", across_ratio)?;
        LawError::check_positive("direction", direction.norm())?;
        let params = [law.params(), &[across_ratio]].concat();
        Ok(Grained { law, params, direction: direction.normalize() })
    }
}

impl<L: IsotropicLaw> ContactLaw for Grained<L> {
    #[inline]
    fn params(&self) -> &[f64] {
        &self.params
    }

    #[inline]
    fn law<S: Scalar>(&self, p: &[S], contact: &Contact<S>) -> Response<S> {
        let &[ref inner @ .., across] = p else { return Response::zero() };
        let normal = self.law.normal_force(inner, contact);
        let speed = regularized_speed(&contact.slip, self.law.slip_scale());
        let scale = -(self.law.friction_coefficient(inner, speed) * normal) / speed;
        let (a, n, u) = (&self.direction, &contact.normal, &contact.slip);
        let slip_along = u.x.times(a.x) + u.y.times(a.y) + u.z.times(a.z);
        let along = (S::one() - across) * slip_along;
        let pull = Vector3::from_fn(|i, _| across * u[i] + along.times(a[i]));
        let lift = n.x * pull.x + n.y * pull.y + n.z * pull.z;
        let tangential = Vector3::from_fn(|i, _| scale * (pull[i] - lift * n[i]));
        Response { normal, tangential }
    }

    #[inline]
    fn reach(&self) -> f64 {
        self.law.reach()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Matrix3, Point3};

    use super::*;
    use crate::contact::law_checks::{Claims, check_law};
    use crate::scenes::floor;
    use crate::{Body, HuntCrossleyPenalty, Onset, Penalty, RigidBody, State, Surface, World};

    fn contact(slip: Vector3<f64>, normal: Vector3<f64>) -> Contact<f64> {
        Contact { gap: -1e-3, normal_speed: 0.0, slip, normal, area: 1e-4 }
    }

    #[test]
    fn keeps_what_laws_promise() {
        let direction = Vector3::new(1.0, -2.0, 0.5);
        for ratio in [0.0, 0.4, 1.0, 2.5] {
            let claims = Claims::new(0.4 * f64::max(1.0, ratio));
            let penalty = Penalty::new(3e7, 2e5, 0.4, 1e-2).unwrap();
            check_law(&penalty.with_grain(direction, ratio).unwrap(), &claims);
            let hunt = HuntCrossleyPenalty::new(4e8, 0.8, 1.5, 0.4, 1e-2).unwrap();
            let stick_slip = hunt.with_stribeck(0.3, 0.05).unwrap();
            check_law(&stick_slip.with_grain(direction, ratio).unwrap(), &claims);
        }
    }

    #[test]
    fn force_fills_its_elliptic_cone_and_stays_inside() {
        let (mu, ratio) = (0.2, 3.0);
        let law =
            Penalty::new(1e7, 0.0, mu, 1e-3).unwrap().with_grain(Vector3::x(), ratio).unwrap();
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
    fn without_anisotropy_it_is_the_isotropic_law_and_at_the_grains_end_too() {
        let isotropic = Penalty::new(1e7, 0.0, 0.2, 1e-3).unwrap();
        let slip = Vector3::new(0.3, -0.1, 0.0);
        let expected = isotropic.law(isotropic.params(), &contact(slip, Vector3::z())).tangential;
        let same = isotropic.with_grain(Vector3::x(), 1.0).unwrap();
        let force = same.law(same.params(), &contact(slip, Vector3::z())).tangential;
        assert!((force - expected).norm() < 1e-15);
        // A normal along the grain: no direction along it is left.
        let upright = isotropic.with_grain(Vector3::z(), 3.0).unwrap();
        let force = upright.law(upright.params(), &contact(slip, Vector3::z())).tangential;
        assert!((force - 3.0 * expected).norm() < 1e-15);
    }

    #[test]
    fn grain_turns_with_the_body_it_lies_on() {
        let law = Penalty::new(1e7, 0.0, 0.2, 1e-3).unwrap().with_grain(Vector3::x(), 3.0).unwrap();
        let mut world = World::new(Vector3::zeros());
        let ground = world.add(Body::held("ground").with_field(floor()));
        let rigid = RigidBody::new(0.2, Matrix3::identity(), Point3::origin()).unwrap();
        let surface = Surface::uniform(&[Point3::origin()], 1e-4).unwrap();
        let runner = world.add(Body::free("runner", rigid).with_surface(surface));
        world.touch(runner, ground, Arc::new(law), Onset::Hard).unwrap();
        let friction = |degrees: f64, slip: Vector3<f64>| {
            let turn = Isometry3::rotation(Vector3::z() * degrees.to_radians());
            let mut sliding = rigid.at_rest(&Isometry3::translation(0.0, 0.0, -1e-3));
            sliding.linear = slip;
            let wrench = world.wrenches(&[State::at_rest(turn), sliding], 0)[runner];
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
        let law = Penalty::new(1e7, 0.0, 0.2, 1e-3).unwrap();
        assert_eq!(law.with_grain(Vector3::x(), -1.0).unwrap_err().name, "across_ratio");
        assert_eq!(law.with_grain(Vector3::zeros(), 1.0).unwrap_err().name, "direction");
        assert_eq!(law.with_grain(Vector3::x() * f64::NAN, 1.0).unwrap_err().name, "direction");
    }
}
