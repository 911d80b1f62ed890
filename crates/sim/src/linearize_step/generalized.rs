//! Forces along all coordinates, their derivatives, and the accelerations of joints that follow.

use nalgebra::{DMatrix, SMatrix, Vector6};
use prehend_autodiff::Fwd;

use super::motions::{BodyMotion, of_free_body, of_link};
use crate::articulated::Kinematics;
use crate::articulated::tree_factor::TreeFactor;
use crate::body_state::Rows;
use crate::model::Model;
use crate::model::articulated_body::ArticulatedBody;
use crate::model::joint_force::ForceAxes;
use crate::spatial::{angular, cross_motion, linear};

/// Forces on free bodies and accelerations of joints, with derivatives by all coordinates.
pub(super) struct Generalized {
    /// Number of coordinates, and the first of those of joints.
    pub(super) count: usize,
    pub(super) joints: usize,
    /// As [`Model::wrenches`] has them.
    pub(super) wrenches: Vec<Vector6<f64>>,
    /// Derivatives of wrenches on free bodies and accelerations of joints, by displacements and by velocities.
    pub(super) by_position: DMatrix<f64>,
    pub(super) by_velocity: DMatrix<f64>,
    /// Derivatives of accelerations of joints by efforts.
    pub(super) by_effort: DMatrix<f64>,
}

impl Generalized {
    /// At `states`, whose links are moved to where their joints put them.
    pub(super) fn new(model: &Model, states: &mut Rows, step: usize) -> Self {
        let trees = trees(model, states);
        for PosedTree { own, at, .. } in &trees {
            let bodies = own.bodies().iter();
            bodies.zip(at.link_states()).for_each(|(body, state)| states[*body] = state);
        }
        let mut all = Self::empty(model, &trees);
        let rates = all.add_forces(model, states, &trees, step);
        let efforts = all.add_joint_forces(model, states, &trees);
        for (tree, efforts) in trees.iter().zip(&efforts) {
            let accelerations = all.accelerate(tree, efforts);
            for (index, link) in tree.own.tree.links().iter().enumerate() {
                let [_, dofs] = tree.own.tree.range(index);
                all.wrenches.push(link.joint.rate_of_velocities(&accelerations[dofs]));
            }
        }
        all.wrenches.extend(rates);
        all
    }

    /// Without any but by efforts.
    pub(super) fn without_forces(model: &Model, states: &Rows) -> Self {
        let trees = trees(model, states);
        let mut all = Self::empty(model, &trees);
        for PosedTree { at, first, .. } in &trees {
            let inverse = at.inverse_mass_matrix();
            let (from, n) = (first - all.joints, inverse.nrows());
            all.by_effort.view_mut((from, from), (n, n)).copy_from(&inverse);
        }
        all
    }

    fn empty(model: &Model, trees: &[PosedTree<'_>]) -> Self {
        let joints = 6 * model.free_bodies().len();
        let count = joints + trees.iter().map(|tree| tree.dofs).sum::<usize>();
        let [by_position, by_velocity] = [(); 2].map(|()| DMatrix::zeros(count, count));
        let by_effort = DMatrix::zeros(count - joints, count - joints);
        let wrenches = model.bodies.iter().map(|body| body.external_wrench).collect();
        Self { count, joints, wrenches, by_position, by_velocity, by_effort }
    }

    /// Adds contacts and bushings: their wrenches on bodies, and what follows along the coordinates. Returns the rates of deflections.
    fn add_forces(
        &mut self,
        model: &Model,
        states: &Rows,
        trees: &[PosedTree<'_>],
        step: usize,
    ) -> Vec<Vector6<f64>> {
        let mut rates = Vec::new();
        let mut motions: Vec<Option<Vec<BodyMotion>>> = Vec::new();
        motions.resize_with(model.bodies.len(), || None);
        let mut own = Vec::new();
        if !(model.contacts.is_empty() && model.bushings.is_empty()) {
            own = places(model, trees);
        }
        for between in model.pair_jacobians(states, step) {
            rates.extend(between.rate);
            for body in between.bodies {
                motions[body].get_or_insert_with(|| match own[body.index()] {
                    Dofs::Free(first) => of_free_body(first),
                    Dofs::Link(tree, link) => of_link(&trees[tree].at, link, trees[tree].first),
                    Dofs::Fixed => Vec::new(),
                });
            }
            let ends = between.bodies.map(|body| motions[body].as_deref().unwrap_or(&[]));
            for end in 0..2 {
                let wrench = &between.on[end];
                self.wrenches[between.bodies[end]] += wrench;
                for (by, moving) in ends.iter().enumerate() {
                    self.add_slopes(&between.by[end][by], ends[end], moving);
                }
                if matches!(own[between.bodies[end].index()], Dofs::Link(..)) {
                    self.add_turns(wrench, ends[end]);
                }
            }
        }
        rates
    }

    /// Adds, along the motions of one body, the change of a wrench with those of another.
    fn add_slopes(&mut self, by: &SMatrix<f64, 6, 12>, of: &[BodyMotion], moving: &[BodyMotion]) {
        for BodyMotion { dof: column, displaced, unit } in moving {
            let by_displacement = by * displaced;
            let by_velocity = by.fixed_columns::<6>(6) * unit;
            for BodyMotion { dof: row, unit, .. } in of {
                self.by_position[(*row, *column)] += unit.dot(&by_displacement);
                self.by_velocity[(*row, *column)] += unit.dot(&by_velocity);
            }
        }
    }

    /// Adds the change of the coordinates' share in a wrench on a link as its point moves; that by the turn of axes follows for the sum.
    fn add_turns(&mut self, wrench: &Vector6<f64>, motions: &[BodyMotion]) {
        let force = linear(wrench);
        for BodyMotion { dof: column, unit: moved, .. } in motions {
            let change = linear(moved).cross(&force);
            for BodyMotion { dof: row, unit, .. } in motions {
                self.by_position[(*row, *column)] += angular(unit).dot(&change);
            }
        }
    }

    /// Adds the slopes of forces along joints, and returns the efforts of each tree.
    fn add_joint_forces(
        &mut self,
        model: &Model,
        states: &Rows,
        trees: &[PosedTree<'_>],
    ) -> Vec<Vec<f64>> {
        let mut efforts: Vec<Vec<f64>> = trees.iter().map(|tree| vec![0.0; tree.dofs]).collect();
        for force in &model.joint_forces {
            let Some(ForceAxes { articulation, dofs, position, velocity }) =
                model.along(force, states)
            else {
                continue;
            };
            let Fwd { value, derivative: [by_position, by_velocity] } =
                force.law().effort_by_motion(force.params(), position, velocity);
            let first = trees[articulation].first;
            for (row, share) in &dofs {
                efforts[articulation][*row] += value * share;
                for (column, factor) in &dofs {
                    let at = (first + row, first + column);
                    self.by_velocity[at] += by_velocity * share * factor;
                    self.by_position[at] += by_position * share * factor;
                }
            }
        }
        efforts
    }

    /// Makes accelerations of the efforts of a tree, and of their derivatives.
    fn accelerate(&mut self, tree: &PosedTree<'_>, efforts: &[f64]) -> Vec<f64> {
        let PosedTree { own, at, first, .. } = tree;
        let (first, n) = (*first, efforts.len());
        let wrenches: Vec<Vector6<f64>> =
            own.bodies().iter().map(|body| self.wrenches[*body]).collect();
        let accelerations = at.forward_dynamics_under(efforts, &wrenches);
        self.add_axes_turns(tree, &wrenches);
        let bias = at.inverse_dynamics_derivatives(accelerations.as_slice());
        let Some(factor) = TreeFactor::new(&bias.by_acceleration, own.tree.carriers()) else {
            self.by_position.rows_mut(first, n).fill(f64::NAN);
            return accelerations.as_slice().to_vec();
        };
        let mut view = self.by_position.view_mut((first, first), (n, n));
        view -= &bias.by_position;
        let mut view = self.by_velocity.view_mut((first, first), (n, n));
        view -= &bias.by_velocity;
        let columns = self.count;
        let mut all = DMatrix::zeros(2 * columns + n, n);
        for row in 0..n {
            for k in 0..columns {
                all[(k, row)] = self.by_position[(first + row, k)];
                all[(columns + k, row)] = self.by_velocity[(first + row, k)];
            }
            all[(2 * columns + row, row)] = 1.0;
        }
        factor.solve_transposed(&mut all);
        for row in 0..n {
            for k in 0..columns {
                self.by_position[(first + row, k)] = all[(k, row)];
                self.by_velocity[(first + row, k)] = all[(columns + k, row)];
            }
            for k in 0..n {
                let at = (first - self.joints + row, first - self.joints + k);
                self.by_effort[at] = all[(2 * columns + k, row)];
            }
        }
        accelerations.as_slice().to_vec()
    }

    /// Adds the change of the coordinates' share in all wrenches on links as axes turn with those that carry them.
    fn add_axes_turns(&mut self, tree: &PosedTree<'_>, wrenches: &[Vector6<f64>]) {
        let PosedTree { own, at, first, .. } = tree;
        let links = own.tree.links();
        let mut sums: Vec<Vector6<f64>> = Vec::with_capacity(links.len());
        sums.extend(wrenches.iter().enumerate().map(|(link, w)| at.about_origin(link, w)));
        for (index, link) in links.iter().enumerate().rev() {
            let sum = sums[index];
            if sum == Vector6::zeros() {
                continue;
            }
            let [_, dofs] = own.tree.range(index);
            for row in dofs {
                for column in own.tree.dofs_of(index) {
                    let turned = cross_motion(&at.axes[column], &at.axes[row]);
                    self.by_position[(first + row, first + column)] += turned.dot(&sum);
                }
            }
            if let Some(parent) = link.parent {
                sums[parent] += sum;
            }
        }
    }
}

/// An articulation where it is.
struct PosedTree<'a> {
    own: &'a ArticulatedBody,
    at: Kinematics<'a>,
    /// The first of its coordinates.
    first: usize,
    /// Number of them.
    dofs: usize,
}

fn trees<'a>(model: &'a Model, states: &Rows) -> Vec<PosedTree<'a>> {
    let mut first = 6 * model.free_bodies().len();
    let mut trees = Vec::with_capacity(model.articulations.len());
    for (index, own) in model.articulations.iter().enumerate() {
        let dofs = own.tree.nv();
        let [q, v] = own.coordinates(&states[model.joint_range(index)]);
        let at = own.tree.kinematics(&q, &v).under(model.gravity);
        trees.push(PosedTree { own, at, first, dofs });
        first += dofs;
    }
    trees
}

/// Coordinates that move a body.
#[derive(Clone, Copy)]
enum Dofs {
    Fixed,
    /// Its own coordinates, from here on.
    Free(usize),
    /// The tree and the link in it.
    Link(usize, usize),
}

fn places(model: &Model, trees: &[PosedTree<'_>]) -> Vec<Dofs> {
    let mut places = vec![Dofs::Fixed; model.bodies.len()];
    for (slot, body) in model.free_bodies().into_iter().enumerate() {
        places[body] = Dofs::Free(6 * slot);
    }
    for (index, tree) in trees.iter().enumerate() {
        for (link, body) in tree.own.bodies().iter().enumerate() {
            places[*body] = Dofs::Link(index, link);
        }
    }
    places
}
