//! Gains of taxels and masses of objects, as far as the balance of forces tells them.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix6xX, Vector3, Vector6};

use super::calibration::{FELT, GAIN_SIGMA, ObjectMass};
use super::reading::SkinReading;
use crate::problem::ScaledCholesky;

/// Standard deviations of a mass beforehand, as a share of it: if it is given, and if a density was assumed.
const MASS_SIGMA: (f64, f64) = (0.05, 0.4);

/// What is unbalanced at first, and at least, as a share of all that acts.
const UNBALANCED: (f64, f64) = (0.1, 0.01);

/// Rounds in which that is found from what is left.
const ROUNDS: usize = 15;

/// A mass is told that is known so much better than beforehand.
const TOLD: f64 = 0.8;

/// Normal equations of relative changes of what taxels feel and then of masses, so that felt forces balance the weight.
///
/// Contacts off the skin are unseen. They are where the hand has no skin, much the same in every grasp, so that their error does not average
/// out: taken for noise of single grasps, they would make gains look well known and wrong. So all grasps together count one.
#[derive(Clone, Default)]
pub(super) struct BalanceSums {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Sum of squares of what is unbalanced.
    squares: f64,
    grasps: f64,
    /// In the order in which they came: number, mass, and its standard deviation as a share.
    objects: Vec<(u32, f64, f64)>,
}

impl BalanceSums {
    /// Adds what taxels feel without their offsets: `forces`. Without gravity, or where nothing is felt, there is no balance.
    pub(super) fn add(&mut self, reading: &SkinReading, forces: &[Vector3<f64>], weight: f64) {
        let Some(gravity) = reading.gravity else { return };
        let inertial = &reading.object.inertial;
        let is_felt = |force: &Vector3<f64>| force.norm() > FELT && force.norm().is_finite();
        let felt = forces.iter().enumerate().filter(|(_, force)| is_felt(force));
        let felt: Vec<_> = felt.collect();
        if felt.is_empty() {
            return;
        }
        let load = gravity * inertial.mass;
        let size = load.norm() + felt.iter().map(|(_, force)| force.norm()).sum::<f64>();
        let mut columns: Vec<usize> = felt.iter().map(|(taxel, _)| *taxel).collect();
        columns.push(self.column_of(reading, forces.len()));
        let push = |(taxel, force): &(usize, &Vector3<f64>)| {
            // The object presses on the taxel, which presses back.
            let force = reading.t_object_links[*taxel].rotation * -**force;
            let arm = reading.place(*taxel) - inertial.center_of_mass;
            let torque = arm.cross(&force) / reading.object.radius;
            Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z) / size
        };
        let mut wrenches: Vec<_> = felt.iter().map(push).collect();
        wrenches.push(Vector6::new(load.x, load.y, load.z, 0.0, 0.0, 0.0) / size);
        let wrenches = Matrix6xX::from_columns(&wrenches);
        let unbalanced = wrenches.column_sum();
        let (hessian, gradient) = (wrenches.tr_mul(&wrenches), wrenches.tr_mul(&unbalanced));
        for (r, row) in columns.iter().enumerate() {
            self.gradient[*row] += weight * gradient[r];
            for (c, column) in columns.iter().enumerate() {
                self.hessian[(*row, *column)] += weight * hessian[(r, c)];
            }
        }
        self.squares += weight * unbalanced.norm_squared();
        self.grasps += weight;
    }

    /// The column of the mass of a reading's object, after those of so many taxels.
    fn column_of(&mut self, reading: &SkinReading, taxels: usize) -> usize {
        let known = self.objects.iter().position(|(id, ..)| *id == reading.obj_id);
        let index = known.unwrap_or_else(|| {
            let (given, assumed) = MASS_SIGMA;
            let object = &reading.object;
            let sigma = if object.inertial_assumed { assumed } else { given };
            self.objects.push((reading.obj_id, object.inertial.mass, sigma));
            let size = taxels + self.objects.len();
            self.hessian.resize_mut(size, size, 0.0);
            self.gradient.resize_vertically_mut(size, 0.0);
            self.objects.len() - 1
        });
        taxels + index
    }

    /// Gains of so many taxels with their deviations, and masses that are told.
    pub(super) fn solve(&self, taxels: usize) -> (Vec<(f64, f64)>, BTreeMap<u32, ObjectMass>) {
        let mut gains = vec![(1.0, GAIN_SIGMA); taxels];
        let mut masses = BTreeMap::new();
        let told: Vec<usize> =
            (0..self.gradient.len()).filter(|k| self.hessian[(*k, *k)] > 0.0).collect();
        let before =
            |k: usize| self.objects.get(k.wrapping_sub(taxels)).map_or(GAIN_SIGMA, |o| o.2);
        let Some((change, covariance)) = self.changes(&told, before) else {
            return (gains, masses);
        };
        for (at, k) in told.into_iter().enumerate() {
            let (share, sigma) = (1.0 + change[at], covariance[(at, at)].sqrt());
            match self.objects.get(k.wrapping_sub(taxels)) {
                // Felt forces are divided by a gain.
                None => gains[k] = (1.0 / share.max(0.2), sigma / share.max(0.2).powi(2)),
                Some((id, mass, before)) if sigma < TOLD * before && share > 0.0 => {
                    masses.insert(*id, ObjectMass { mass: mass * share, sigma: mass * sigma });
                }
                Some(_) => {}
            }
        }
        (gains, masses)
    }

    /// Relative changes of these unknowns, and their covariance.
    fn changes(
        &self,
        of: &[usize],
        before: impl Fn(usize) -> f64,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        if of.is_empty() {
            return None;
        }
        let hessian = DMatrix::from_fn(of.len(), of.len(), |r, c| self.hessian[(of[r], of[c])]);
        let gradient = DVector::from_fn(of.len(), |r, _| self.gradient[of[r]]);
        let prior = DVector::from_fn(of.len(), |r, _| before(of[r]).powi(-2));
        let (first, least) = UNBALANCED;
        let (mut variance, mut found) = (first * first, None);
        for _ in 0..ROUNDS {
            let scale = 1.0 / (self.grasps * variance);
            let information = &hessian * scale + DMatrix::from_diagonal(&prior);
            let covariance = ScaledCholesky::new(&information, 0.0)?.inverse();
            let change = &covariance * &gradient * -scale;
            let left =
                self.squares + 2.0 * change.dot(&gradient) + change.dot(&(&hessian * &change));
            variance = (left / (6.0 * self.grasps)).max(least * least);
            found = Some((change, covariance));
        }
        found
    }
}

#[cfg(test)]
mod tests;
