//! Friction that holds.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::{FrictionCoefficient, FrictionLaw};
use crate::contact::bristles::Bristles;
use crate::contact::error::LawError;
use crate::contact::parameters::{LawParameter, Parameters, Tabulated, entry};
use crate::contact::point::ContactKinematics;

/// Friction with tangential springs: what it holds does not creep, see [`Bristles`]. What only slides is five to ten times cheaper, with
/// derivatives, under the friction within alone: [`Coulomb`](super::coulomb::Coulomb) says how to choose its slip scale.
///
/// The deflection should be about the depth to which contacts press, so that they are as stiff across the normal as along it:
/// often 0.1 mm. The slip scale of the friction within no longer sets a creep, and may be as large as 2 cm/s; the full
/// deflection counts as five times that slip, which is 98 % of full friction.
///
/// ```
/// use prehend_sim::{BristleFriction, Coulomb, HuntCrossley, Law};
///
/// let friction = BristleFriction { friction: Coulomb { friction: 0.5, slip_scale: 1e-2 }, deflection: 1e-4 };
/// let law = Law::new(HuntCrossley { stiffness: 1e9, damping: 1.0, exponent: 1.5 }, friction)?;
/// # Ok::<(), prehend_sim::contact::LawError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BristleFriction<F> {
    /// Friction of what slides.
    pub friction: F,
    /// Deflection of full friction \[m\], positive.
    pub deflection: f64,
}

/// Slip that the full deflection counts as, in multiples of the slip scale.
const FULL: f64 = 5.0;

const DEFLECTION: LawParameter = entry!(deflection "m" Positive "deflection of full friction");

impl<F: FrictionCoefficient> Parameters for BristleFriction<F> {
    type Params<T: Copy> = F::Params<T>;

    fn values(&self) -> Self::Params<f64> {
        self.friction.values()
    }

    fn names(&self) -> Vec<&'static str> {
        self.friction.names()
    }

    fn check(&self, values: &Self::Params<f64>) -> Result<(), LawError> {
        self.friction.check(values)?;
        DEFLECTION.check(self.deflection)
    }
}

impl<F: FrictionCoefficient + Tabulated> Tabulated for BristleFriction<F> {
    type Constants<T: Copy> = (F::Constants<T>, [T; 1]);

    const SUMMARY: &'static str = "friction that holds";

    const PARAMETERS: Self::Params<LawParameter> = F::PARAMETERS;

    const CONSTANTS: Self::Constants<LawParameter> = (F::CONSTANTS, [DEFLECTION]);

    fn from_values(
        params: Self::Params<f64>,
        (constants, [deflection]): Self::Constants<f64>,
    ) -> Self {
        Self { friction: F::from_values(params, constants), deflection }
    }
}

impl<F: FrictionCoefficient> FrictionLaw for BristleFriction<F> {
    #[inline]
    fn force<S: Scalar>(
        &self,
        p: Self::Params<S>,
        normal_force: S,
        contact: &ContactKinematics<S>,
    ) -> Vector3<S> {
        self.friction.isotropic_force(p, normal_force, &contact.slip)
    }

    fn bristles(&self) -> Option<Bristles> {
        let slip_speed = FULL * self.friction.slip_scale();
        Some(Bristles { deflection: self.deflection, slip_speed })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Matrix3, Point3};

    use super::*;
    use crate::contact::law_checks::{Claims, check_law};
    use crate::scenes::{floor, on_ground, sticking};
    use crate::{
        Body, BodyState, Coulomb, GapSmoothing, HuntCrossley, KelvinVoigt, Law, Model, RigidBody,
        State, Surface, TimeSteps,
    };

    const FRICTION: BristleFriction<Coulomb> =
        BristleFriction { friction: Coulomb { friction: 0.5, slip_scale: 1e-2 }, deflection: 1e-4 };

    /// 200 g on four feet that rest on the floor.
    fn stool(gravity: Vector3<f64>) -> (Model, State) {
        let rigid = RigidBody::new(0.2, Matrix3::identity() * 1e-4, Point3::origin()).unwrap();
        let feet = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
            .map(|(x, y)| Point3::new(0.03 * x, 0.03 * y, -0.01));
        let stool =
            Body::dynamic("stool", rigid).with_surface(Surface::uniform(&feet, 4e-4).unwrap());
        let law = Arc::new(sticking(1e7, 1e5, 0.5, 1e-2));
        let smoothing = GapSmoothing::Softplus { width: 5e-5 };
        let model = on_ground(gravity, floor(), stool, law, smoothing);
        let state = rigid.at_rest(&Isometry3::translation(0.0, 0.0, 0.0095));
        (model, State::new([BodyState::at_rest(Isometry3::identity()), state]))
    }

    #[test]
    fn laws_that_hold_keep_their_promises() {
        let claims = Claims::new(0.5);
        let (stiffness, damping) = (3e7, 2e5);
        check_law(&Law::new(KelvinVoigt { stiffness, damping }, FRICTION).unwrap(), &claims);
        let normal = HuntCrossley { stiffness: 1e9, damping: 0.5, exponent: 1.5 };
        check_law(&Law::new(normal, FRICTION).unwrap(), &claims);
        let error = Law::new(normal, BristleFriction { deflection: 0.0, ..FRICTION }).unwrap_err();
        assert_eq!(error.name(), Some("deflection"));
    }

    #[test]
    fn neither_force_nor_torque_below_friction_moves_a_body_for_long() {
        // Friction holds 0.98 N, and 0.042 of it times that as a torque.
        let (mut model, start) = stool(Vector3::new(0.0, 0.0, -9.81));
        model.bodies[1].external_wrench[0] = 0.4;
        model.bodies[1].external_wrench[5] = 0.012;
        let run = model.rollout(&start, TimeSteps { dt: 0.5, steps: 10 }).unwrap();
        let [settled, end] = [1, 10].map(|i: usize| run[i][1].pose);
        assert!((end.translation.vector - settled.translation.vector).norm() < 1e-9);
        assert!(end.rotation.angle_to(&settled.rotation) < 1e-8);
        // It gave way a little, then held.
        assert!((1e-6..1e-3).contains(&end.translation.x) && end.rotation.angle() > 1e-5);
        model.bodies[1].external_wrench[0] = 1.1;
        model.bodies[1].external_wrench[5] = 0.0;
        let moved = model.simulate(&start, 1.0).unwrap()[1].pose.translation.x;
        assert!((moved - 0.5 * (1.1 - 0.5 * 0.2 * 9.81) / 0.2).abs() < 0.03, "{moved}");
    }

    #[test]
    fn simulations_go_on_with_their_deflections() {
        let (model, start) = stool(Vector3::new(2.0, 0.0, -9.81));
        let half = model.simulate(&start, 0.5).unwrap();
        assert_eq!((start.rows().len(), half.rows().len()), (2, 3));
        let whole = model.simulate(&start, 1.0).unwrap();
        let place = |states: &State| states[1].pose.translation.x;
        assert!((place(&model.simulate(&half, 0.5).unwrap()) - place(&whole)).abs() < 1e-9);
        // Without them it starts anew, and gives way once more.
        let anew = model.simulate(&State::new(half.bodies()), 0.5).unwrap();
        assert!((place(&anew) - place(&whole)).abs() > 1e-6);
    }

    #[test]
    fn shaking_below_friction_leaves_a_body_where_it_is() {
        let (mut model, start) = stool(Vector3::new(0.0, 0.0, -9.81));
        let shake = |force: f64, periods: usize, model: &mut Model| {
            let time_steps = TimeSteps { dt: 2.5e-3, steps: 40 * periods };
            let control = |step: crate::Step, model: &mut Model, _: &mut State| {
                let phase = std::f64::consts::TAU * step.start / 0.1;
                model.bodies[1].external_wrench[0] = force * phase.sin();
            };
            let adaptive = crate::Adaptive::default();
            let end = model.simulate_controlled(&adaptive, &start, time_steps, control).unwrap();
            end.states[1].pose.translation.x
        };
        let [early, late] = [10, 40].map(|periods| shake(0.5, periods, &mut model));
        assert!((late - early).abs() < 2e-6, "{early} {late}");
    }
}
