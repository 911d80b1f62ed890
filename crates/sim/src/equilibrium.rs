//! Quasi-static analysis: could a body rest where it is?

pub(crate) mod balance;
pub(crate) mod compliant;
pub(crate) mod pair_friction;

use nalgebra::{Point3, Unit, Vector3, Vector6};

use crate::error::SimulationError;
use crate::state::State;
use crate::surface::SurfacePoint;
use crate::world::World;
use crate::world::body_id::BodyId;
use crate::world::contact_pair::{ContactBodies, ContactPair};
use balance::{Support, WrenchBalance, friction_factor};
use pair_friction::PairFriction;

/// Whether a body could rest where it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Equilibrium {
    /// What acts on it in the simulation, by contact laws, the external wrench and gravity: force \[N\], torque about the
    /// center of mass \[N m\], world frame. Zero at rest.
    pub net: Vector6<f64>,
    /// Its points of contact.
    pub supports: Vec<Support>,
    /// Forces at these points that balance the external wrench and gravity, whatever the contact laws say.
    pub balance: WrenchBalance,
    /// The least factor on the friction coefficients with which they do; see [`friction_factor`].
    pub friction_factor: f64,
}

impl Equilibrium {
    /// Whether forces within the friction cones balance the external wrench and gravity.
    pub fn is_possible(&self) -> bool {
        self.balance.is_balanced()
    }
}

impl World {
    /// Whether forces at the contacts of `body`, within friction cones of coefficient `friction`, could hold it at
    /// `states` under its external wrench and gravity. Samples no farther than `reach` \[m\] are in contact.
    ///
    /// Friction is a number, or a function of the other body ([`PairFriction`]).
    ///
    /// Velocities matter to [`Equilibrium::net`] only.
    ///
    /// # Errors
    /// If there is no such body, it is not free, or there is not one state for each body.
    pub fn equilibrium(
        &self,
        body: BodyId,
        states: &[State],
        friction: impl PairFriction,
        reach: f64,
    ) -> Result<Equilibrium, SimulationError> {
        if states.len() != self.joint_places().end && states.len() != self.state_count() {
            return Err(self.wrong_count(states.len()));
        }
        let found = self.body(body)?;
        let Some(rigid) = found.rigid() else {
            return Err(SimulationError::NotFree { body: found.name.clone() });
        };
        let weight = self.gravity * rigid.mass();
        let weight = Vector6::new(weight.x, weight.y, weight.z, 0.0, 0.0, 0.0);
        let load = found.external_wrench + weight;
        let near = self.with_touching(states, reach);
        let supports = near.supports(body, states, &friction, reach);
        let center = Point3::from(states[body].pose.translation.vector);
        Ok(Equilibrium {
            net: self.wrenches(states, 0)[body] + weight,
            balance: WrenchBalance::find(&supports, &center, &load),
            friction_factor: friction_factor(&supports, &center, &load),
            supports,
        })
    }

    /// Where samples of `body` touch others, and theirs touch it.
    fn supports(
        &self,
        body: BodyId,
        states: &[State],
        friction: &impl PairFriction,
        reach: f64,
    ) -> Vec<Support> {
        let mut supports = Vec::new();
        for pair in &self.contacts {
            let ContactBodies { samples, field } = pair.bodies;
            let (sign, other) = match body {
                _ if samples == body => (1.0, field),
                _ if field == body => (-1.0, samples),
                _ => continue,
            };
            let friction = friction.with(other);
            for (position, outward) in self.touching(pair, states, reach) {
                if let Some(normal) = Unit::try_new(outward * sign, 0.0) {
                    supports.push(Support { position, normal, friction });
                }
            }
        }
        supports
    }

    /// Samples of `pair` within `reach` and the gradient of the field there, in the world.
    fn touching(
        &self,
        pair: &ContactPair,
        states: &[State],
        reach: f64,
    ) -> Vec<(Point3<f64>, Vector3<f64>)> {
        let ContactBodies { samples, field } = pair.bodies;
        let (body, other) = (&self.bodies[samples], &self.bodies[field]);
        let (t_world_com, t_world_field) = (states[samples].pose, states[field].pose);
        let (Some(surface), Some(field)) = (&body.surface, &other.field) else {
            return Vec::new();
        };
        let place = |position: &Point3<f64>| t_world_com * (position - body.com().coords);
        let touch = |point: &SurfacePoint| {
            let position = place(&point.position);
            let local = t_world_field.inverse_transform_point(&position) + other.com().coords;
            let outward = field.sample(&local, reach + point.radius)?.gradient;
            let outward = t_world_field.rotation * outward;
            let touches = outward.try_normalize(0.0)? * point.radius;
            Some((position - touches, outward))
        };
        surface.points().iter().filter_map(touch).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Matrix3, UnitQuaternion};

    use super::*;
    use crate::scenes::{floor, on_ground, penalty};
    use crate::{Body, DynContactLaw, GapSmoothing, RigidBody, Surface};

    /// A box of 0.5 kg, 6 cm wide and 4 cm high, on an incline; the center of mass is in its middle.
    fn incline(angle: f64) -> (World, Vec<State>) {
        let corners: Vec<Point3<f64>> = (0..8)
            .map(|i| {
                let sign = |bit: usize| if i & bit == 0 { -1.0 } else { 1.0 };
                Point3::new(0.03 * sign(1), 0.03 * sign(2), 0.02 * sign(4))
            })
            .collect();
        let rigid = RigidBody::new(0.5, Matrix3::identity() * 1e-4, Point3::origin()).unwrap();
        let law = Arc::new(penalty(1e6, 1e3, 0.5, 1e-3));
        let block =
            Body::free("block", rigid).with_surface(Surface::uniform(&corners, 1e-2).unwrap());
        let world = on_ground(Vector3::z() * -9.81, floor(), block, law, GapSmoothing::Hard);
        let tilt = Isometry3::rotation(Vector3::new(0.0, angle, 0.0));
        let states = [Isometry3::identity(), Isometry3::translation(0.0, 0.0, 0.02)]
            .map(|pose| State::at_rest(tilt * pose));
        (world, states.to_vec())
    }

    #[test]
    fn a_block_holds_below_the_friction_angle() {
        let friction = 0.5_f64;
        for fraction in [0.0, 0.5, 0.99, 1.01, 1.5] {
            let slope = fraction * friction;
            let (world, states) = incline(slope.atan());
            let found = world.equilibrium(BodyId(1), &states, friction, 1e-9).unwrap();
            assert_eq!(found.supports.len(), 4);
            assert_eq!(found.is_possible(), fraction < 1.0, "{fraction}: {:?}", found.balance);
            assert!((found.friction_factor - fraction).abs() < 1e-4, "{}", found.friction_factor);
            if fraction < 1.0 {
                let sum: Vector3<f64> = found.balance.forces.iter().sum();
                assert!((sum + world.gravity * 0.5).norm() < 1e-5);
            } else {
                // What slides is left: m g (sin θ − μ cos θ), but that the balance trades against the pressure.
                let slides = 9.81 * 0.5 * (slope - friction) * slope.atan().cos();
                let left = found.balance.residual.fixed_rows::<3>(0).norm();
                assert!((left - slides * friction.atan().cos()).abs() < 1e-6, "{left} {slides}");
            }
        }
    }

    #[test]
    fn a_steep_block_tips_whatever_the_friction() {
        // Wider by half than high: it tips at tan θ = 3/2.
        let factor = |slope: f64| {
            let (world, states) = incline(slope.atan());
            world.equilibrium(BodyId(1), &states, 1.0, 1e-9).unwrap().friction_factor
        };
        assert!((factor(1.45) - 1.45).abs() < 1e-3);
        assert_eq!(factor(1.55), f64::INFINITY);
    }

    /// A block between two jaws that taper by `taper` \[rad\] each upwards, out of which it is squeezed downwards.
    fn between_jaws(taper: f64) -> (World, Vec<State>) {
        let (sin, cos) = taper.sin_cos();
        let mut world = World::new(Vector3::z() * -9.81);
        let jaws = [-1.0, 1.0].map(|side: f64| {
            // A floor turned up, so that it presses inwards and down.
            let normal = Vector3::new(-side * cos, 0.0, -sin);
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &normal).unwrap();
            let place = Vector3::new(0.03 * side, 0.0, 0.0);
            let state = State::at_rest(Isometry3::from_parts(place.into(), turn));
            (world.add(Body::kinematic("jaw").with_field(floor())), state)
        });
        let on_face = |i: u32| {
            let sign = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
            let height = 0.02 * sign(1);
            Point3::new(sign(4) * (0.03 - height * sin / cos), 0.02 * sign(2), height)
        };
        let points: Vec<Point3<f64>> = (0..8).map(on_face).collect();
        let rigid = RigidBody::new(0.5, Matrix3::identity() * 1e-4, Point3::origin()).unwrap();
        let surface = Surface::uniform(&points, 1e-2).unwrap();
        let samples = world.add(Body::free("block", rigid).with_surface(surface));
        let law: Arc<dyn DynContactLaw> = Arc::new(penalty(1e6, 1e3, 0.5, 1e-3));
        for (field, _) in jaws {
            let bodies = ContactBodies { samples, field };
            world.add_contact(bodies, Arc::clone(&law), GapSmoothing::Hard).unwrap();
        }
        let block = State::at_rest(Isometry3::identity());
        (world, jaws.map(|(_, state)| state).into_iter().chain([block]).collect())
    }

    #[test]
    fn jaws_of_different_friction_hold_by_the_sum_of_their_friction_angles() {
        let (taper, left, block) = (0.15_f64, BodyId(0), BodyId(2));
        let (world, states) = between_jaws(taper);
        for first in [0.05, 0.15, 0.25] {
            for (sum, holds) in [(0.98, false), (1.02, true)] {
                // As angles: both jaws together taper by twice the one.
                let second = 2.0 * taper * sum - first;
                let [first, second] = [f64::tan(first), f64::tan(second)];
                let friction = |other: BodyId| if other == left { first } else { second };
                let found = world.equilibrium(block, &states, friction, 1e-9).unwrap();
                assert_eq!(found.supports.len(), 8);
                let of =
                    |side: f64| found.supports.iter().filter(move |s| s.position.x * side > 0.0);
                assert!(of(-1.0).all(|s| s.friction == first));
                assert!(of(1.0).all(|s| s.friction == second));
                assert_eq!(found.is_possible(), holds, "{first} {second}: {:?}", found.balance);
                // The factor with which the angles add up.
                let angles = |k: f64| (k * first).atan() + (k * second).atan();
                let factor = found.friction_factor;
                assert!((angles(factor) / (2.0 * taper) - 1.0).abs() < 1e-3, "{factor}");
                let swapped = |other: BodyId| if other == left { second } else { first };
                let mirrored = world.equilibrium(block, &states, swapped, 1e-9).unwrap();
                assert!((mirrored.friction_factor / factor - 1.0).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn a_body_in_free_space_has_nothing_but_its_weight() {
        let (world, mut states) = incline(0.1);
        states[1].pose.translation.z += 1.0;
        let found = world.equilibrium(BodyId(1), &states, 0.5, 1e-3).unwrap();
        let weight = Vector6::new(0.0, 0.0, -9.81 * 0.5, 0.0, 0.0, 0.0);
        assert_eq!((found.net, found.balance.residual), (weight, weight));
        assert!(found.supports.is_empty() && !found.is_possible());
        assert_eq!(found.friction_factor, f64::INFINITY);
    }

    #[test]
    fn the_supporting_body_feels_the_same_points_from_the_other_side() {
        let (mut world, states) = incline(0.2);
        let rigid = *world.bodies[1].rigid().unwrap();
        world.bodies[0].motion = crate::world::body::Motion::Free(rigid);
        let [below, above] =
            [0, 1].map(|b| world.equilibrium(BodyId(b), &states, 0.5, 1e-9).unwrap());
        for (a, b) in below.supports.iter().zip(&above.supports) {
            assert!((a.position - b.position).norm() < 1e-15 && a.normal == -b.normal);
        }
        assert!(!below.is_possible() && above.is_possible());
    }

    #[test]
    fn impossible_questions_are_refused() {
        let (world, states) = incline(0.1);
        let ask = |body, states: &[State]| {
            world.equilibrium(BodyId(body), states, 0.5, 1e-3).unwrap_err()
        };
        assert_eq!(ask(2, &states), SimulationError::NoBody { body: BodyId(2), bodies: 2 });
        assert_eq!(ask(0, &states), SimulationError::NotFree { body: "ground".to_owned() });
        assert_eq!(
            ask(1, &states[..1]),
            SimulationError::States { states: 1, bodies: 2, joints: 0, sticking: 0 }
        );
    }
}
