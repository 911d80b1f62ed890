//! Checks of every contact law, for its tests.

use nalgebra::Vector3;
use prehend_autodiff::check::finite_difference_jacobian;
use prehend_autodiff::{Fwd, Scalar};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use super::calibration::ContactCalibration;
use super::composite::Law;
use super::error::LawError;
use super::friction::coulomb::Coulomb;
use super::law::ContactLaw;
use super::normal::NormalLaw;
use super::point::ContactKinematics;

/// Gap, normal speed, slip and normal.
const INPUTS: usize = 8;
/// Room for the inputs and the parameters of any law here.
const DIRECTIONS: usize = 16;

/// Sizes on which inputs vary: differences are taken in these units.
const SCALES: [f64; INPUTS] = [1e-3, 0.1, 0.1, 0.1, 0.1, 1.0, 1.0, 1.0];

/// 300 g that sink in by half a millimeter.
pub(crate) const TARGET: ContactCalibration =
    ContactCalibration { mass: 0.3, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };

/// `normal` without friction.
pub(crate) fn frictionless<N: NormalLaw>(normal: Result<N, LawError>) -> Law<N, Coulomb> {
    Law::new(normal.unwrap(), Coulomb { friction: 0.0, slip_scale: 1e-3 }).unwrap()
}

/// Claims of a law.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Claims {
    /// Friction is at most this times the normal force.
    pub(crate) friction: f64,
    /// The force has a derivative where the normal speed is zero.
    pub(crate) smooth_at_rest: bool,
}

impl Claims {
    pub(crate) fn new(friction: f64) -> Self {
        Self { friction, smooth_at_rest: true }
    }
}

/// Normal force \[N\] of a still contact of `area` \[m²\] at `depth` \[m\].
pub(crate) fn load(law: &impl ContactLaw, area: f64, depth: f64) -> f64 {
    let (slip, normal) = (Vector3::zeros(), Vector3::z());
    law.law(law.params(), &ContactKinematics { gap: -depth, normal_speed: 0.0, slip, normal, area })
        .normal
}

/// Coefficient of restitution of the body of `target` that hits its contact at `speed` \[m/s\], without gravity,
/// by integration.
pub(crate) fn bounce(law: &impl ContactLaw, target: &ContactCalibration, speed: f64) -> f64 {
    let (slip, normal, area) = (Vector3::zeros(), Vector3::z(), target.contact_area);
    let acceleration = |[gap, normal_speed]: [f64; 2]| {
        let contact = ContactKinematics { gap, normal_speed, slip, normal, area };
        law.law(law.params(), &contact).normal / target.mass
    };
    let rate = |x: [f64; 2]| [x[1], acceleration(x)];
    let along = |x: [f64; 2], k: [f64; 2], h: f64| [x[0] + h * k[0], x[1] + h * k[1]];
    let dt = 1e-4 * (target.penetration / target.gravity).sqrt();
    let mut x = [0.0, -speed];
    for _ in 0..1_000_000 {
        let k1 = rate(x);
        let k2 = rate(along(x, k1, 0.5 * dt));
        let k3 = rate(along(x, k2, 0.5 * dt));
        let k4 = rate(along(x, k3, dt));
        let mean = [0, 1].map(|i| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0);
        x = along(x, mean, dt);
        if x[1] > 0.0 && (x[0] >= 0.0 || acceleration(x) <= 0.0) {
            break;
        }
    }
    x[1] / speed
}

/// Everything of this module, at random contacts and at the singular ones.
pub(crate) fn check_law(law: &impl ContactLaw, claims: &Claims) {
    let span = |limit: f64| -limit..limit;
    let contacts = (
        -2e-3..-1e-6,
        span(0.5),
        prop::array::uniform3(span(0.3)),
        prop::array::uniform3(span(1.0)),
    );
    TestRunner::deterministic()
        .run(&contacts, |(depth, speed, slip, normal)| {
            let normal = Vector3::from(normal);
            prop_assume!(normal.norm() > 0.1);
            let (normal, slip) = (normal.normalize(), Vector3::from(slip));
            let slip = slip - normal * normal.dot(&slip);
            let x = pack(law.cutoff() + depth, speed, &slip, &normal);
            assert_partials(law, x);
            assert_physical(law, x, claims);
            let fast = pack(law.cutoff() + depth, 1e3 * speed, &(slip * 1e6), &normal);
            assert_physical(law, fast, claims);
            Ok(())
        })
        .unwrap();
    assert_singular_points(law, claims);
    assert_nothing_beyond_reach(law);
}

fn pack(gap: f64, speed: f64, slip: &Vector3<f64>, normal: &Vector3<f64>) -> [f64; INPUTS] {
    [gap, speed, slip.x, slip.y, slip.z, normal.x, normal.y, normal.z]
}

fn unpack<S: Scalar>(x: &[S]) -> ContactKinematics<S> {
    let (slip, normal) = (Vector3::new(x[2], x[3], x[4]), Vector3::new(x[5], x[6], x[7]));
    ContactKinematics { gap: x[0], normal_speed: x[1], slip, normal, area: S::constant(2e-5) }
}

/// Force components for the inputs of a contact, followed by the law's parameters.
fn respond<S: Scalar>(law: &impl ContactLaw, x: &[S]) -> [S; 4] {
    let response = law.law(&x[INPUTS..], &unpack(x));
    let t = response.tangential;
    [response.normal, t.x, t.y, t.z]
}

/// Forward mode along the contact's inputs and all parameters.
fn forward(law: &impl ContactLaw, x: &[f64]) -> [Fwd<DIRECTIONS>; 4] {
    let x: Vec<_> = x.iter().enumerate().map(|(i, &v)| Fwd::variable(v, i)).collect();
    respond(law, &x)
}

fn with_params(law: &impl ContactLaw, x: [f64; INPUTS]) -> Vec<f64> {
    [&x[..], law.params()].concat()
}

/// Derivatives by the contact and by all parameters against central differences.
fn assert_partials(law: &impl ContactLaw, x: [f64; INPUTS]) {
    let x = with_params(law, x);
    let scale = |i: usize| SCALES.get(i).copied().unwrap_or(x[i].abs().max(1e-3));
    let exact = forward(law, &x);
    let differences = finite_difference_jacobian(
        |y| {
            let moved: Vec<f64> = (0..x.len()).map(|i| x[i] + scale(i) * y[i]).collect();
            respond(law, &moved).to_vec()
        },
        &vec![0.0; x.len()],
        1e-5,
    );
    // One measure for all: friction's components may each be zero.
    let size = |v: f64| v.abs();
    let force = exact.iter().map(|f| size(f.value)).fold(1e-6, f64::max);
    for (row, (exact, reference)) in exact.iter().zip(&differences).enumerate() {
        let largest = reference.iter().copied().map(size).fold(force, f64::max);
        for (i, reference) in reference.iter().enumerate() {
            let error = exact.derivative[i] * scale(i) - reference;
            assert!(error.abs() <= 1e-6 * largest, "row {row}, input {i} at {x:?}: {error:e}");
        }
    }
}

/// Never pulling, damping that opposes the approach, friction in its cone and against the slip.
fn assert_physical(law: &impl ContactLaw, x: [f64; INPUTS], claims: &Claims) {
    let x = with_params(law, x);
    let (contact, response) = (unpack(&x), law.law(law.params(), &unpack(&x)));
    let normal = response.normal;
    let still = law.law(law.params(), &ContactKinematics { normal_speed: 0.0, ..contact }).normal;
    assert!(normal >= 0.0 && normal.is_finite(), "pulls with {normal} at {x:?}");
    let power = (normal - still) * contact.normal_speed;
    assert!(power <= 0.0, "damping does work {power} at {x:?}");
    let (friction, slip) = (response.tangential, contact.slip);
    let bound = claims.friction * normal * (1.0 + 1e-12);
    assert!(friction.norm() <= bound, "{} leaves the cone {bound} at {x:?}", friction.norm());
    assert!(friction.dot(&slip) <= 1e-15 * bound * slip.norm(), "friction pushes at {x:?}");
    assert!(friction.dot(&contact.normal).abs() <= 1e-12 * bound, "friction lifts at {x:?}");
}

/// No slip, no normal speed, the gap at the reach: finite everywhere, and exact where there is a derivative.
fn assert_singular_points(law: &impl ContactLaw, claims: &Claims) {
    let (none, slip, normal) = (Vector3::zeros(), Vector3::new(0.1, -0.2, 0.0), Vector3::z());
    let inside = law.cutoff() - 1e-3;
    assert_partials(law, pack(inside, -0.1, &none, &normal));
    if claims.smooth_at_rest {
        assert_partials(law, pack(inside, 0.0, &slip, &normal));
        assert_partials(law, pack(inside, 0.0, &none, &normal));
    }
    for gap in [inside, law.cutoff() - 1e-300, law.cutoff() - f64::MIN_POSITIVE, law.cutoff()] {
        for speed in [0.0, -0.0, -0.1, 0.1] {
            for slip in [none, slip, slip * 1e-200, slip * 1e-8] {
                let x = pack(gap, speed, &slip, &normal);
                for row in forward(law, &with_params(law, x)) {
                    let finite =
                        row.value.is_finite() && row.derivative.iter().all(|d| d.is_finite());
                    assert!(finite, "{row:?} at {x:?}");
                    assert!(
                        gap < law.cutoff() || speed != 0.0 || row.value == 0.0,
                        "{row:?} at {x:?}"
                    );
                }
            }
        }
    }
}

fn assert_nothing_beyond_reach(law: &impl ContactLaw) {
    for beyond in [1e-12, 1e-3, 10.0] {
        for speed in [-1.0, 0.0, 1.0] {
            let slip = Vector3::new(0.1, -0.2, 0.0);
            let x = pack(law.cutoff() + beyond, speed, &slip, &Vector3::z());
            for row in forward(law, &with_params(law, x)) {
                assert_eq!((row.value, row.derivative), (0.0, [0.0; DIRECTIONS]), "at {x:?}");
            }
        }
    }
}
