//! Balance of a load by supports that yield.

use nalgebra::{Matrix6, Point3, Unit, Vector3, Vector6};
use prehend_geometry::SplitMix64;
use prehend_sim::{CompliantBalance, CompliantSupport, Support, WrenchBalance};

const LENGTH: f64 = 0.7;

/// Supports about the origin and a load, at random.
fn problem(random: &mut SplitMix64, compliance: f64) -> (Vec<CompliantSupport>, Vector6<f64>) {
    let mut unit = || 2.0 * random.uniform() - 1.0;
    let count = 2 + (4.0 * (1.0 + unit())) as usize;
    let supports = (0..count).map(|_| {
        let normal = Unit::new_normalize(Vector3::new(unit(), unit(), 0.7 + unit()));
        let position = Point3::new(unit(), unit(), unit());
        let support = Support { position, normal, friction: 0.5 + 0.4 * unit() };
        CompliantSupport { support, compliance: compliance * (1.5 + unit()) }
    });
    let supports = supports.collect();
    (supports, Vector6::from_fn(|i, _| if i == 2 { -2.0 } else { 0.5 * unit() }))
}

fn solve(supports: &[CompliantSupport], load: &Vector6<f64>) -> CompliantBalance {
    CompliantBalance::find(supports, &Point3::origin(), LENGTH, load)
}

#[test]
fn a_yielding_support_bears_its_share() {
    let support = Support { position: Point3::origin(), normal: Vector3::z_axis(), friction: 0.5 };
    let load = Vector6::new(0.0, 0.0, -3.0, 0.0, 0.0, 0.0);
    let found = solve(&[CompliantSupport { support, compliance: 0.5 }], &load);
    assert!((found.forces[0] - Vector3::new(0.0, 0.0, 2.0)).norm() < 1e-12);
    assert!((found.residual[2] + 1.0).abs() < 1e-12 && (found.value - 1.5).abs() < 1e-12);
    // It cannot pull, and least of all without friction.
    for friction in [0.5, 0.0] {
        let support = Support { friction, ..support };
        let pulled = solve(&[CompliantSupport { support, compliance: 0.5 }], &-load);
        assert_eq!((pulled.forces[0], pulled.value), (Vector3::zeros(), 4.5));
    }
}

/// `force` with no more friction than the support can give, and no pull.
fn within_cone(force: &Vector3<f64>, support: &Support) -> Vector3<f64> {
    let push = support.normal.dot(force).max(0.0);
    let sideways = force - support.normal.into_inner() * support.normal.dot(force);
    let most = (support.friction * push / sideways.norm()).min(1.0);
    support.normal.into_inner() * push + sideways * most
}

#[test]
fn no_other_forces_cost_less() {
    let mut random = SplitMix64::new(5);
    for _ in 0..100 {
        let (supports, load) = problem(&mut random, 0.1);
        let found = solve(&supports, &load);
        let cost = |forces: &[Vector3<f64>]| {
            let mut left = load;
            let mut cost = 0.0;
            for (s, f) in supports.iter().zip(forces) {
                let torque = s.support.position.coords.cross(f) / LENGTH;
                left += Vector6::new(f.x, f.y, f.z, torque.x, torque.y, torque.z);
                cost += s.compliance * f.norm_squared();
            }
            (0.5 * (left.norm_squared() + cost), left)
        };
        let (value, left) = cost(&found.forces);
        assert!((value - found.value).abs() < 1e-9 && (left - found.residual).norm() < 1e-9);
        for _ in 0..50 {
            let nudged = |(s, f): (&CompliantSupport, &Vector3<f64>)| {
                let nudge = Vector3::from_fn(|_, _| 0.2 * (random.uniform() - 0.5));
                within_cone(&(f + nudge), &s.support)
            };
            let other: Vec<_> = supports.iter().zip(&found.forces).map(nudged).collect();
            assert!(cost(&other).0 >= found.value - 1e-12);
        }
    }
}

#[test]
fn derivatives_by_the_load_match_differences() {
    let mut random = SplitMix64::new(6);
    for _ in 0..50 {
        let (supports, load) = problem(&mut random, 0.1);
        let found = solve(&supports, &load);
        let step = 1e-6;
        for k in 0..6 {
            let at = |sign: f64| solve(&supports, &(load + Vector6::ith(k, sign * step)));
            let (plus, minus) = (at(1.0), at(-1.0));
            let slope = (plus.value - minus.value) / (2.0 * step);
            assert!((slope - found.residual[k]).abs() < 1e-6);
            let bend = (plus.residual - minus.residual) / (2.0 * step);
            assert!((bend - found.residual_jacobian.column(k)).norm() < 1e-4, "{bend}");
        }
    }
}

#[test]
fn with_little_compliance_it_is_nearly_the_balance() {
    let mut random = SplitMix64::new(7);
    let mut open = 0;
    for _ in 0..200 {
        let (supports, load) = problem(&mut random, 1e-4);
        let hard: Vec<Support> = supports.iter().map(|s| s.support).collect();
        let mut scaled = load;
        scaled.fixed_rows_mut::<3>(3).scale_mut(LENGTH);
        let balance = WrenchBalance::find(&hard, &Point3::origin(), &scaled);
        let soft = solve(&supports, &load);
        let cost = |forces: &[Vector3<f64>]| {
            let costs = supports.iter().zip(forces);
            0.5 * costs.map(|(s, f)| s.compliance * f.norm_squared()).sum::<f64>()
        };
        open += i32::from(!balance.is_balanced());
        // What balances best and costs something is one of the choices, in a norm of torques of its own.
        if balance.is_balanced() {
            assert!(soft.value <= cost(&balance.forces) * (1.0 + 1e-9) + 1e-12);
        } else {
            assert!(soft.residual.norm() > 1e-6);
        }
    }
    assert!((20..180).contains(&open), "{open}");
}

#[test]
fn nothing_holds_without_supports() {
    let load = Vector6::new(0.0, 0.0, -2.0, 0.1, 0.0, 0.0);
    let found = solve(&[], &load);
    assert_eq!((found.residual, found.residual_jacobian), (load, Matrix6::identity()));
}
