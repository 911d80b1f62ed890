//! Against each other, and against differences.

use nalgebra::{DVector, Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use prehend_autodiff::{Fwd, Scalar};
use prehend_geometry::SplitMix64;

use super::*;

/// A nut on a thread, about x and along a line that is askew.
#[derive(Debug)]
struct Thread;

impl JointModel for Thread {
    fn nv(&self) -> usize {
        1
    }
    fn placement<S: Scalar>(&self, q: &[S]) -> Isometry3<S> {
        let rise = Vector3::new(q[0].times(0.2), q[0].sin().times(0.1), S::zero());
        let turn = Vector3::new(q[0], S::zero(), S::zero());
        Isometry3::from_parts(rise.into(), prehend_autodiff::lie::so3_exp(&turn))
    }
}

/// Two axes that cross, with an arm between them.
#[derive(Debug)]
struct Universal;

impl JointModel for Universal {
    fn nv(&self) -> usize {
        2
    }
    fn placement<S: Scalar>(&self, q: &[S]) -> Isometry3<S> {
        let zero = S::zero();
        let about = |x, y, z| prehend_autodiff::lie::so3_exp(&Vector3::new(x, y, z));
        let first = about(q[0], zero, zero);
        let arm = first * Vector3::new(zero, S::constant(0.1), zero);
        Isometry3::from_parts(arm.into(), first * about(zero, q[1], zero))
    }
}

/// A tree of `count` links with all kinds of joints, each under one of those before it.
pub(super) fn random_tree(seed: u64, count: usize) -> Articulation {
    let mut random = SplitMix64::new(seed);
    let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * random.normal());
    let links = (0..count).map(|index| {
        let place = Translation3::from(vector(0.3));
        let turn = UnitQuaternion::from_scaled_axis(vector(1.0));
        let axis = Unit::new_normalize(vector(1.0));
        let root = Matrix3::from_columns(&[vector(0.1), vector(0.1), vector(0.1)]);
        let choice = vector(1.0);
        let joint = match (choice.x.abs() * 1e6) as usize % 8 {
            _ if index == 0 && seed.is_multiple_of(2) => Joint::Floating,
            0 => Joint::Spherical,
            1 => Joint::Fixed,
            2 => Joint::Prismatic(axis),
            3 if seed.is_multiple_of(3) => Joint::Floating,
            4 if seed % 3 != 1 => Joint::custom(Thread),
            5 if seed % 3 == 2 => Joint::custom(Universal),
            _ => Joint::Revolute(axis),
        };
        let back = 1 + (choice.y.abs() * 1e6) as usize % 2;
        Link {
            name: format!("link {index}"),
            parent: index.checked_sub(back.min(index)).filter(|_| index > 0),
            t_parent_joint: Isometry3::from_parts(place, turn),
            joint,
            mass: 0.5 + choice.z.abs(),
            com: vector(0.1).into(),
            inertia: root * root.transpose() + Matrix3::identity() * 0.01,
            armature: 0.01 * (index % 3) as f64,
        }
    });
    Articulation::new(links.collect(), Vector3::new(0.3, -0.2, -9.81)).unwrap()
}

/// Coordinates, velocities and one more vector of that size.
pub(super) fn random_state(tree: &Articulation, seed: u64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let mut random = SplitMix64::new(seed);
    let mut vector = |n: usize| (0..n).map(|_| random.normal()).collect::<Vec<f64>>();
    let n = tree.nv();
    let q = tree.moved(&tree.neutral(), &vector(n));
    (q, vector(n), vector(n))
}

fn assert_near(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len());
    let size = expected.iter().fold(1.0f64, |a, b| a.max(b.abs()));
    for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
        let error = (found - expected).abs() / size;
        assert!(error < tolerance, "{what} {k}: {found}, not {expected} (of {size})");
    }
}

#[test]
fn forward_inverse_and_mass_matrix_agree() {
    for seed in 0..40 {
        let tree = random_tree(seed, 1 + seed as usize % 12);
        let (q, v, a) = random_state(&tree, 100 + seed);
        let at = tree.kinematics(&q, &v);
        let tau = at.inverse_dynamics(&a);
        assert_near(at.forward_dynamics(tau.as_slice()).as_slice(), &a, 1e-9, "acceleration");
        let bias = at.inverse_dynamics(&vec![0.0; a.len()]);
        let sum = at.mass_matrix() * DVector::from_column_slice(&a) + bias;
        assert_near(tau.as_slice(), sum.as_slice(), 1e-12, "effort");
    }
}

/// Lagrange's equations know nothing of spatial vectors: d/dt ∂L/∂v, by differences of momentum and energy along the motion, in one coordinate
/// of each revolute or prismatic joint.
#[test]
fn inverse_dynamics_are_lagranges() {
    for seed in [1, 3, 5, 7] {
        let mut tree = random_tree(seed, 6);
        let links: Vec<Link> = tree
            .links()
            .iter()
            .map(|link| match link.joint {
                Joint::Spherical | Joint::Floating => {
                    Link { joint: Joint::Revolute(Vector3::y_axis()), ..link.clone() }
                }
                _ => link.clone(),
            })
            .collect();
        tree = Articulation::new(links, *tree.gravity()).unwrap();
        let (q, v, a) = random_state(&tree, seed);
        let n = v.len();
        let lagrangian = |q: &[f64], v: &[f64]| {
            let Energy { kinetic, potential } = tree.kinematics(q, v).energy(v);
            kinetic - potential
        };
        let momentum = |t: f64| {
            let q: Vec<f64> = (0..n).map(|k| q[k] + v[k] * t + 0.5 * a[k] * t * t).collect();
            let v = DVector::from_fn(n, |k, _| v[k] + a[k] * t);
            tree.kinematics(&q, v.as_slice()).mass_matrix() * v
        };
        let step = 1e-5;
        let rate = (momentum(step) - momentum(-step)) / (2.0 * step);
        let tau = tree.kinematics(&q, &v).inverse_dynamics(&a);
        let expected: Vec<f64> = (0..n)
            .map(|k| {
                let at = |sign: f64| {
                    let mut moved = q.clone();
                    moved[k] += sign * step;
                    lagrangian(&moved, &v)
                };
                rate[k] - (at(1.0) - at(-1.0)) / (2.0 * step)
            })
            .collect();
        assert_near(tau.as_slice(), &expected, 1e-7, "effort");
    }
}

/// Derivatives in closed form against forward mode.
#[test]
fn derivatives_are_those_of_forward_mode() {
    for seed in 0..40 {
        let tree = random_tree(seed, 1 + seed as usize % 10);
        let (q, v, a) = random_state(&tree, 200 + seed);
        let n = v.len();
        let at = tree.kinematics(&q, &v);
        let tau = at.inverse_dynamics(&a);
        let inverse = at.inverse_dynamics_derivatives(&a);
        assert_near(inverse.by_acceleration.as_slice(), at.mass_matrix().as_slice(), 1e-13, "mass");
        let forward = at.forward_dynamics_derivatives(&DVector::from_column_slice(&a)).unwrap();
        let lifted = tree.cast::<Fwd<1>>();
        let constants = |x: &[f64]| x.iter().map(|x| Fwd::<1>::constant(*x)).collect::<Vec<_>>();
        for k in 0..n {
            let along = |x: &[f64]| {
                let mut x = constants(x);
                x[k] = Fwd::variable(x[k].value(), 0);
                x
            };
            let moved = lifted.moved(&constants(&q), &along(&vec![0.0; n]));
            let pushed = along(&v);
            let rate = |x: DVector<Fwd<1>>| x.iter().map(|x| x.derivative[0]).collect::<Vec<f64>>();
            let (tau, a) = (constants(tau.as_slice()), constants(&a));
            for (q, v, of_inverse, of_forward) in [
                (&moved, &constants(&v), &inverse.by_position, &forward.by_position),
                (&constants(&q), &pushed, &inverse.by_velocity, &forward.by_velocity),
            ] {
                let at = lifted.kinematics(q, v);
                let expected = rate(at.inverse_dynamics(&a));
                assert_near(of_inverse.column(k).as_slice(), &expected, 1e-10, "by inverse");
                let expected = rate(at.forward_dynamics(&tau));
                assert_near(of_forward.column(k).as_slice(), &expected, 1e-9, "by forward");
            }
        }
    }
}

#[test]
fn jacobians_are_velocities_of_points() {
    for seed in 0..6 {
        let tree = random_tree(seed, 7);
        let (q, v, _) = random_state(&tree, seed);
        let (link, point) = (6, Point3::new(0.1, 0.2, -0.3));
        let at = tree.kinematics(&q, &v);
        let [velocity, spin] = at.velocity(link, &point);
        let all = at.jacobian(link, &point) * DVector::from_column_slice(&v);
        assert_near(&all.as_slice()[..3], velocity.as_slice(), 1e-12, "velocity");
        assert_near(&all.as_slice()[3..], spin.as_slice(), 1e-12, "angular velocity");
        let place = |t: f64| {
            let step: Vec<f64> = v.iter().map(|v| v * t).collect();
            tree.kinematics(&tree.moved(&q, &step), &v).pose(link) * point
        };
        let difference = (place(1e-6) - place(-1e-6)) / 2e-6;
        assert_near(velocity.as_slice(), difference.as_slice(), 1e-7, "difference");
    }
}

#[test]
#[should_panic(expected = "one number a coordinate")]
fn too_few_coordinates_are_refused() {
    let tree = random_tree(1, 3);
    tree.check(&vec![0.0; tree.nq() - 1], &vec![0.0; tree.nv()]);
}

#[test]
#[should_panic(expected = "one number a degree of freedom")]
fn too_many_velocities_are_refused() {
    let tree = random_tree(1, 3);
    tree.check(&vec![0.0; tree.nq()], &vec![0.0; tree.nv() + 1]);
}
