//! The total contact wrench on a body and its derivative, gathered point by point.

use nalgebra::{Matrix3, Vector3, Vector6};
use prehend_autodiff::lie::cross_matrix;
use prehend_autodiff::{Fwd, LocalFunction, Scalar};

use super::contact_query::{ContactPoint, ContactQuery};
use super::dynamic::DynContactLaw;
use super::law::ContactLaw;
use super::moved::{LiftedContact, MovedQuery};
use super::parameters::ParamValues;
use super::point::ContactKinematics;
use crate::spatial::spatial;

/// A wrench about the center of mass with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct WrenchJacobian {
    /// Force \[N\], then torque about the center of mass \[N m\].
    pub wrench: Vector6<f64>,
    /// One row for each component of the wrench: derivatives along the directions of [`BodyState::tangent`](crate::BodyState::tangent).
    pub by_state: [[f64; 12]; 6],
    /// Derivative of the wrench by each parameter of the law; empty if not asked for.
    pub by_params: Vec<Vector6<f64>>,
}

impl WrenchJacobian {
    /// True without a wrench and derivatives by the state.
    pub(crate) fn is_zero(&self) -> bool {
        self.wrench == Vector6::zeros() && self.by_state == [[0.0; 12]; 6]
    }
}

/// Wrench as a function of the state's tangent, to first order about where it was found.
impl LocalFunction<12, 6> for WrenchJacobian {
    #[inline]
    fn evaluate<S: Scalar>(&self, tangent: [S; 12]) -> [S; 6] {
        std::array::from_fn(|row| {
            let sum = S::constant(self.wrench[row]);
            let terms = tangent.iter().zip(&self.by_state[row]);
            terms.fold(sum, |sum, (direction, slope)| sum + direction.times(*slope))
        })
    }
}

/// Wrench of `query` as a function of the tangent of its body's state, to first order.
pub(crate) struct WrenchFunction<'a> {
    pub(crate) law: &'a dyn DynContactLaw,
    pub(crate) p: &'a [f64],
    pub(crate) query: &'a ContactQuery<'a>,
}

impl LocalFunction<12, 6> for WrenchFunction<'_> {
    #[inline]
    fn evaluate<S: Scalar>(&self, tangent: [S; 12]) -> [S; 6] {
        self.law.wrench_jacobian(self.p, self.query, false).evaluate(tangent)
    }

    #[inline]
    fn derivative_along(&self, _: [f64; 12], tangent: [f64; 12]) -> Option<([f64; 6], [f64; 6])> {
        let [wrench, slope] = self.law.wrench_along(self.p, self.query, &tangent);
        Some((wrench.into(), slope.into()))
    }
}

/// Force and torque of all contacts of `query`, of each of which `force` says where it acts from the center of mass, and the force;
/// none if a field fails, which must not look like free space.
#[inline(always)]
pub(crate) fn sum_forces<T: Scalar>(
    query: &ContactQuery<'_>,
    cutoff: f64,
    pressing_only: bool,
    mut force: impl FnMut(&ContactPoint) -> (Vector3<T>, Vector3<T>),
) -> Option<Vector6<T>> {
    let (mut forces, mut torques) = (Vector3::zeros(), Vector3::zeros());
    let sound = query.for_each_contact(cutoff, pressing_only, |touch| {
        let (lever, force) = force(touch);
        forces += force;
        torques += lever.cross(&force);
    });
    sound.then(|| spatial(&forces, &torques))
}

/// The sum of all contacts of `query`.
pub(crate) fn wrench<L: ContactLaw>(law: &L, p: &[f64], query: &ContactQuery<'_>) -> Vector6<f64> {
    let cutoff = law.cutoff();
    let sum = sum_forces(query, cutoff, true, |touch| {
        (touch.lever, law.law(p, &touch.contact(cutoff)).along(&touch.normal))
    });
    sum.unwrap_or_else(|| Vector6::repeat(f64::NAN))
}

/// [`wrench`] with its derivative.
///
/// Each point differentiates its force by its own position and velocity in forward mode (the normal
/// turns with the position: hence the field's Hessian); the rest is the rigid body's kinematics.
pub(crate) fn wrench_jacobian<L: ContactLaw>(
    law: &L,
    p: &[f64],
    query: &ContactQuery<'_>,
    by_params: bool,
) -> WrenchJacobian {
    let cutoff = law.cutoff();
    let params: ParamValues<Fwd<6>> = p.iter().map(|&p| Fwd::constant(p)).collect();
    let spin = query.state.angular;
    let mut wrench = Vector6::zeros();
    // Force and torque by position, turn, velocity and spin of the body.
    let mut by = [[Matrix3::<f64>::zeros(); 4]; 2];
    let mut param_slopes = vec![Vector6::zeros(); if by_params { p.len() } else { 0 }];
    let sound = query.for_each_contact(cutoff, false, |touch| {
        let contact = touch.lifted(cutoff);
        let response = law.law(&params, &contact);
        let force: Vector3<Fwd<6>> =
            Vector3::from_fn(|i, _| contact.normal[i] * response.normal + response.tangential[i]);
        let f = force.map(|x| x.value);
        let mut by_position = Matrix3::from_fn(|i, j| force[i].derivative[j]);
        let by_velocity = Matrix3::from_fn(|i, j| force[i].derivative[3 + j]);

        // Sample position x: δx = δt + δθ×r, for the arm r; velocity where it touches: δv + δω×l + ω×δl, for the lever
        // l, which turns with the arm and, if the sample is round, with the normal: δl = δθ×r + L δx, L = −ρ ∂n/∂x.
        let (arm, lever) = (&touch.arm, &touch.lever);
        if touch.radius > 0.0 {
            roll(touch, &contact, &f, &spin, &by_velocity, &mut by_position, &mut by[1]);
        }
        let by_turn = times_cross(&-(by_position + times_cross(&by_velocity, &spin)), arm);
        let slopes = [by_position, by_turn, by_velocity, times_cross(&-by_velocity, lever)];
        for (column, slope) in slopes.iter().enumerate() {
            by[0][column] += slope;
            by[1][column] += cross_times(lever, slope);
        }
        // Torque l×f: δ(l×f) = δl×f + l×δf.
        by[1][1] += cross_times(&f, &cross_matrix(arm));
        wrench += spatial(&f, &lever.cross(&f));
        add_param_slopes(law, p, touch, cutoff, &mut param_slopes);
    });
    if !sound {
        wrench = Vector6::repeat(f64::NAN);
    }
    let by_state = std::array::from_fn(|row| {
        std::array::from_fn(|column| by[row / 3][column / 3][(row % 3, column % 3)])
    });
    WrenchJacobian { wrench, by_state, by_params: param_slopes }
}

/// [`wrench`] with its derivative along `tangent`.
pub(crate) fn wrench_along<L: ContactLaw>(
    law: &L,
    p: &[f64],
    query: &ContactQuery<'_>,
    tangent: &[f64; 12],
) -> [Vector6<f64>; 2] {
    let cutoff = law.cutoff();
    let params: ParamValues<Fwd<1>> = p.iter().map(|&p| Fwd::constant(p)).collect();
    let moved = MovedQuery::new(query, &tangent.map(|x| Fwd { value: 0.0, derivative: [x] }));
    let sum = sum_forces(query, cutoff, false, |touch| {
        let LiftedContact { contact, lever } = moved.lift(touch, cutoff);
        (lever, law.law(&params, &contact).along(&contact.normal))
    });
    let all = sum.unwrap_or_else(|| Vector6::repeat(Fwd::constant(f64::NAN)));
    [all.map(|x| x.value), all.map(|x| x.derivative[0])]
}

/// Term of round samples, whose lever turns with the normal. Never inlined: it is rare, and the rest then fits the
/// registers.
#[cold]
#[inline(never)]
fn roll(
    touch: &ContactPoint,
    contact: &ContactKinematics<Fwd<6>>,
    force: &Vector3<f64>,
    spin: &Vector3<f64>,
    by_velocity: &Matrix3<f64>,
    by_position: &mut Matrix3<f64>,
    torque_by: &mut [Matrix3<f64>; 4],
) {
    let by_place = |i: usize, j: usize| -touch.radius * contact.normal[i].derivative[j];
    let lever_slope = Matrix3::from_fn(by_place);
    *by_position += times_cross(by_velocity, spin) * lever_slope;
    let moved = -cross_times(force, &lever_slope);
    torque_by[0] += moved;
    torque_by[1] -= times_cross(&moved, &touch.arm);
}

/// Adds the derivatives of one contact's wrench by the parameters, six at a time.
///
/// The seeds are made for each contact: made once, outside of the loop, they slow down gradients by the state alone by 8 %.
#[inline(always)]
fn add_param_slopes<L: ContactLaw>(
    law: &L,
    p: &[f64],
    touch: &ContactPoint,
    cutoff: f64,
    slopes: &mut [Vector6<f64>],
) {
    for (chunk, slopes) in slopes.chunks_mut(6).enumerate() {
        let seeded = |(i, &p): (usize, &f64)| match i.checked_sub(6 * chunk) {
            Some(lane) if lane < 6 => Fwd::variable(p, lane),
            _ => Fwd::constant(p),
        };
        let params: ParamValues<Fwd<6>> = p.iter().enumerate().map(seeded).collect();
        let ContactKinematics { gap, normal_speed, slip, normal, area } = touch.contact(cutoff);
        let response = law.law(
            &params,
            &ContactKinematics {
                gap: Fwd::constant(gap),
                normal_speed: Fwd::constant(normal_speed),
                slip: slip.map(Fwd::constant),
                normal: normal.map(Fwd::constant),
                area: Fwd::constant(area),
            },
        );
        for (lane, slope) in slopes.iter_mut().enumerate() {
            let f = touch.normal * response.normal.derivative[lane]
                + response.tangential.map(|x| x.derivative[lane]);
            *slope += spatial(&f, &touch.lever.cross(&f));
        }
    }
}

/// \[a\]× `m`, column by column.
#[inline(always)]
fn cross_times(a: &Vector3<f64>, m: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_columns(&[a.cross(&m.column(0)), a.cross(&m.column(1)), a.cross(&m.column(2))])
}

/// `m` \[a\]×, row by row.
#[inline(always)]
fn times_cross(m: &Matrix3<f64>, a: &Vector3<f64>) -> Matrix3<f64> {
    -cross_times(a, &m.transpose()).transpose()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Point3, Vector3, Vector6};
    use prehend_autodiff::Fwd;
    use prehend_autodiff::check::{compare_gradients, finite_difference_jacobian};
    use prehend_geometry::{DistanceField, FieldSample};

    use crate::contact::LeakSteps;
    use crate::contact::contact_query::ContactQuery;
    use crate::contact::dynamic::DynContactLaw;
    use crate::contact::wrench::WrenchJacobian;
    use crate::scenes::{bowl, egg_on, floor, penalty};
    use crate::{BodyState, ContactLaw, GapSmoothing, Model, State, Surface};

    /// A single sample, with the state of the egg but at `height` above the floor.
    fn sample_at<R>(
        height: f64,
        field: &dyn DistanceField,
        smoothing: GapSmoothing,
        f: impl Fn(&ContactQuery<'_>) -> R,
    ) -> R {
        let surface = Surface::new(&[Point3::origin()], &[1e-4]).unwrap();
        let (_, states) = egg_on(floor(), smoothing);
        let state = BodyState { pose: Isometry3::translation(0.0, 0.0, height), ..states[1] };
        f(&ContactQuery { surface: &surface, com: Point3::origin(), state, field, smoothing })
    }

    fn is_finite(jacobian: &WrenchJacobian) -> bool {
        jacobian.wrench.iter().chain(jacobian.by_state.as_flattened()).all(|x| x.is_finite())
    }

    /// The wrench on body 1 presses it up, the same with derivatives as without, and those match differences.
    fn assert_derivatives(model: &Model, states: &State, what: &str) {
        let wrench = |state: BodyState| model.wrenches(&State::new([states[0], state]), 0)[1];
        let mut lifted: State<Fwd<12>> = states.cast();
        lifted[1] = states[1].variables();
        let exact = model.cast().wrenches(&lifted, 0)[1];
        let value = wrench(states[1]);
        assert!((value - exact.map(|w| w.value)).norm() <= 1e-12 * value.norm());
        assert!(value.z > 0.0);
        let differences = finite_difference_jacobian(
            |x| {
                let moved = states[1].retract(&std::array::from_fn::<f64, 12, _>(|i| x[i]));
                wrench(moved).iter().copied().collect()
            },
            &[0.0; 12],
            1e-7,
        );
        for (row, reference) in differences.iter().enumerate() {
            let error = compare_gradients(&exact[row].derivative, reference);
            assert!(error.relative < 1e-6, "{what} row {row}: {error:?}");
        }
    }

    #[test]
    fn derivatives_match_differences() {
        for field in [floor(), bowl()] {
            for smoothing in [GapSmoothing::Hard, GapSmoothing::Softplus { width: 5e-4 }] {
                let (model, mut states) = egg_on(Arc::clone(&field), smoothing);
                states[1].pose.translation.z -= 1e-3;
                assert_derivatives(&model, &states, &format!("{smoothing:?}"));
            }
        }
    }

    #[test]
    fn derivatives_of_rounded_samples_match_differences() {
        for field in [floor(), bowl()] {
            let (mut model, mut states) = egg_on(field, GapSmoothing::Softplus { width: 5e-4 });
            states[1].pose.translation.z += 3e-3;
            let surface = model.bodies[1].surface.take().unwrap();
            let rounded = Surface::clone(&surface).rounded(4e-3).unwrap();
            model.bodies[1].surface = Some(Arc::new(rounded));
            assert_derivatives(&model, &states, "rounded");
        }
    }

    #[test]
    fn a_leak_adds_stiffness_and_no_force() {
        let law = penalty(2e7, 1e4, 0.5, 1e-2);
        let jacobian = |smoothing| {
            sample_at(1e-3, floor().as_ref(), smoothing, |query| {
                law.wrench_jacobian(law.params(), query, true)
            })
        };
        let leaky = jacobian(GapSmoothing::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::All });
        assert_eq!(leaky.wrench, Vector6::zeros());
        assert!((leaky.by_state[2][2] + 0.1 * 2e7 * 1e-4).abs() < 1e-9);
        assert!(leaky.by_state.iter().all(|row| row[6..].iter().all(|slope| *slope == 0.0)));
        let hard = jacobian(GapSmoothing::Hard);
        let zero = WrenchJacobian {
            wrench: Vector6::zeros(),
            by_state: [[0.0; 12]; 6],
            by_params: vec![Vector6::zeros(); 3],
        };
        assert_eq!(hard, zero);
    }

    #[test]
    fn a_field_that_fails_does_not_look_like_free_space() {
        struct Broken;
        impl DistanceField for Broken {
            fn sample(&self, _: &Point3<f64>, _: f64) -> Option<FieldSample> {
                let (gradient, hessian) = (Vector3::z(), nalgebra::Matrix3::zeros());
                Some(FieldSample { distance: f64::NAN, gradient, hessian })
            }
        }
        let law = penalty(2e7, 1e4, 0.5, 1e-2);
        sample_at(0.0, &Broken, GapSmoothing::Hard, |query| {
            assert!(law.wrench(law.params(), query).iter().all(|w| w.is_nan()));
            let jacobian = law.wrench_jacobian(law.params(), query, false);
            assert!(jacobian.wrench.iter().all(|w| w.is_nan()));
        });
    }

    #[test]
    fn a_height_above_terrain_may_be_steep_if_it_says_so() {
        /// z − 2x, which rises by √5.
        struct Slope;
        impl DistanceField for Slope {
            fn sample(&self, p: &Point3<f64>, reach: f64) -> Option<FieldSample> {
                let (distance, gradient) = (p.z - 2.0 * p.x, Vector3::new(-2.0, 0.0, 1.0));
                let hessian = nalgebra::Matrix3::zeros();
                (distance <= reach).then_some(FieldSample { distance, gradient, hessian })
            }
            fn lipschitz_bound(&self) -> f64 {
                2.3
            }
        }
        let law = penalty(2e7, 1e4, 0.5, 1e-2);
        let row: Vec<Point3<f64>> =
            (0..16).map(|i| Point3::new(0.02 * f64::from(i), 0.0, 0.55)).collect();
        let whole = Surface::uniform(&row, 16e-4).unwrap();
        let state = BodyState::at_rest(Isometry3::identity());
        let (com, smoothing) = (Point3::origin(), GapSmoothing::Hard);
        let wrench = |surface: &Surface| {
            let query = ContactQuery { surface, com, state, field: &Slope, smoothing };
            law.wrench(law.params(), &query)
        };
        let singly = row.iter().map(|p| wrench(&Surface::new(&[*p], &[1e-4]).unwrap()));
        let singly = singly.fold(Vector6::zeros(), |sum: Vector6<f64>, w| sum + w);
        assert!(singly.norm() > 1.0 && (wrench(&whole) - singly).norm() < 1e-9 * singly.norm());
    }

    #[test]
    fn singular_points_give_finite_numbers() {
        struct FlatField;
        impl DistanceField for FlatField {
            fn sample(&self, _: &Point3<f64>, _: f64) -> Option<FieldSample> {
                let (gradient, hessian) = (Vector3::zeros(), nalgebra::Matrix3::zeros());
                Some(FieldSample { distance: -1e-3, gradient, hessian })
            }
        }
        let law = penalty(2e7, 1e4, 0.5, 1e-2);
        let leaky = GapSmoothing::Leaky { alpha: 0.1, band: 2e-3, steps: LeakSteps::All };
        for smoothing in [GapSmoothing::Hard, GapSmoothing::Softplus { width: 1e-4 }, leaky] {
            let jacobian =
                |query: &ContactQuery<'_>| law.wrench_jacobian(law.params(), query, true);
            // ∇φ = 0 gives no contact; φ = 0 without slip, finite ones.
            assert_eq!(sample_at(0.0, &FlatField, smoothing, jacobian).wrench, Vector6::zeros());
            let rest = |query: &ContactQuery<'_>| {
                let state = BodyState::at_rest(Isometry3::identity());
                jacobian(&ContactQuery { state, ..*query })
            };
            assert!(is_finite(&sample_at(0.0, floor().as_ref(), smoothing, rest)));
        }
    }
}
