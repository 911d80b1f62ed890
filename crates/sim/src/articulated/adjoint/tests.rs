//! Reverse mode against forward mode, by every number.

use nalgebra::Vector6;
use prehend_autodiff::{Fwd, Scalar, gradient};

use super::*;
use crate::articulated::link::Articulation;
use crate::articulated::tests::{random_state, random_tree};
use crate::body_state::coordinates_of;

/// Number of inputs of [`weighed`].
fn inputs(tree: &Articulation) -> usize {
    3 + tree.nq() + 2 * tree.nv() + 6 * tree.links().len() + 18 * tree.links().len()
}

/// Accelerations and states of links, each with a weight, as a function of everything that they follow from.
fn weighed<S: Scalar>(tree: &Articulation, start: &[f64], x: &[S]) -> S {
    let mut numbers = x.iter().zip(start).map(|(x, start)| x.plus(*start));
    let mut next = || numbers.next().unwrap();
    let gravity = nalgebra::Vector3::from_fn(|_, _| next());
    let q: Vec<S> = (0..tree.nq()).map(|_| next()).collect();
    let v: Vec<S> = (0..tree.nv()).map(|_| next()).collect();
    let efforts: Vec<S> = (0..tree.nv()).map(|_| next()).collect();
    let wrenches: Vec<Vector6<S>> =
        tree.links().iter().map(|_| Vector6::from_fn(|_, _| next())).collect();
    let mut links = tree.cast::<S>().links().to_vec();
    for link in &mut links {
        let turn = nalgebra::Vector3::from_fn(|_, _| next());
        link.t_parent_joint.rotation =
            prehend_autodiff::lie::so3_exp(&turn) * link.t_parent_joint.rotation;
        link.t_parent_joint.translation.vector.iter_mut().for_each(|x| *x += next());
        link.mass += next();
        link.com.iter_mut().for_each(|x| *x += next());
        for (r, c) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
            let change = next();
            link.inertia[(r, c)] += change;
            if r != c {
                link.inertia[(c, r)] += change;
            }
        }
        link.armature += next();
        let _ = next();
    }
    let tree = Articulation::new(links, gravity).unwrap();
    let on =
        Acting { gravity, coordinates: &q, velocities: &v, efforts: &efforts, wrenches: &wrenches };
    let weights = (1..).map(|k| f64::from(k).sin());
    let accelerations = accelerations(&tree, &on);
    let states = link_states(&tree, &q, &v);
    let all = accelerations.iter().copied().chain(coordinates_of(&states));
    all.zip(weights).fold(S::zero(), |sum, (x, weight)| sum + x.times(weight))
}

#[test]
fn reverse_mode_is_forward_mode() {
    for seed in 0..60 {
        let tree = random_tree(seed, 1 + seed as usize % 7);
        let (q, v, efforts) = random_state(&tree, 300 + seed);
        let mut start = vec![0.1, 0.2, -9.0];
        start.extend(q.iter().chain(&v).chain(&efforts));
        start.extend((0..6 * tree.links().len()).map(|k| (k as f64).cos()));
        start.resize(inputs(&tree), 0.0);
        let zeros = vec![0.0; start.len()];
        let (_, slopes) = gradient(|x| weighed(&tree, &start, x), &zeros);
        let size = slopes.iter().fold(1.0, |a: f64, b| a.max(b.abs()));
        for (k, slope) in slopes.iter().enumerate() {
            let mut x = vec![Fwd::<1>::constant(0.0); start.len()];
            x[k] = Fwd::variable(0.0, 0);
            let [expected] = weighed(&tree, &start, &x).derivative;
            let off = (slope - expected).abs() / size;
            assert!(off < 1e-10, "seed {seed}, input {k}: {slope}, not {expected}");
        }
    }
}
