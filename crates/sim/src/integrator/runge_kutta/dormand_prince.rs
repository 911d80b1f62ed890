//! Dormand and Prince's pair of orders 5 and 4.

use nalgebra::Vector6;
use prehend_autodiff::Scalar;

use super::{Change, Stages};
use crate::body_state::{BodyState, Rows};
use crate::model::Model;
use crate::time::Step;

/// Fractions of the step and weights of the slopes before, of the second stage to the last, which is the end of the step
/// (J. R. Dormand and P. J. Prince, "A family of embedded Runge–Kutta formulae", J. Comput. Appl. Math. 6, 1980).
const STAGES: [(f64, &[f64]); 6] = [
    (1.0 / 5.0, &[1.0 / 5.0]),
    (3.0 / 10.0, &[3.0 / 40.0, 9.0 / 40.0]),
    (4.0 / 5.0, &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0]),
    (8.0 / 9.0, &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0]),
    (1.0, &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0]),
    (1.0, &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0]),
];

/// Weights of the slopes in the fifth order less those in the fourth.
const ERROR: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Third divided differences of the slopes: of the stages at 0, 3/10, 4/5 and 1, at 3/10, 4/5, 8/9 and 1, and at 0, 3/10, 4/5 and
/// 8/9. Of a slope that jumps between 3/10 and 4/5 the first and the last are a quarter of the jump, as large as the error may
/// be; the largest weight of the other is a quarter.
const THIRD: [[f64; 7]; 3] = [
    [-7.0 / 36.0, 0.0, 4.0 / 9.0, -7.0 / 12.0, 0.0, 0.0, 1.0 / 3.0],
    [0.0, 0.0, -4.0 / 567.0, 53.0 / 324.0, -1.0 / 4.0, 0.0, 53.0 / 567.0],
    [-53.0 / 300.0, 0.0, 32.0 / 75.0, -53.0 / 50.0, 81.0 / 100.0, 0.0, 0.0],
];
/// Differences of lower order: the second one of the slopes at 0, 3/10 and 1, and the first one from 0 to 1, so small that
/// together they are below the third ones wherever the slope jumps.
const LOWER: [[f64; 7]; 2] = [
    [7.0 / 45.0, 0.0, -2.0 / 9.0, 0.0, 0.0, 0.0, 1.0 / 15.0],
    [-1.0 / 20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0 / 20.0],
];

/// States that a step leads to.
pub(in crate::integrator) struct Trial<S: Scalar> {
    /// The states at its stages, the last of which is its end.
    pub(in crate::integrator) stages: Vec<Vec<BodyState<S>>>,
    /// The wrenches there: those that the next step starts with.
    pub(in crate::integrator) wrenches: Vec<Vector6<S>>,
}

/// Estimated errors of a step.
pub(in crate::integrator) struct Estimate<S: Scalar> {
    /// For each free body and contact with bristles, by how much the solutions of fifth and fourth order differ.
    orders: Vec<Change<S>>,
    /// Divided differences of its slopes.
    third: [Vec<Change<S>>; 3],
    lower: [Vec<Change<S>>; 2],
}

/// A step from `states` with `wrenches` on them.
pub(in crate::integrator) fn step<S: Scalar>(
    model: &Model<S>,
    states: &Rows<S>,
    wrenches: &[Vector6<S>],
    step: Step,
) -> Trial<S> {
    visit(&mut Stages::new(model, states, wrenches, step, 1 + STAGES.len()))
}

/// [`step`], and how far off it may be.
pub(in crate::integrator) fn estimated<S: Scalar>(
    model: &Model<S>,
    states: &Rows<S>,
    wrenches: &[Vector6<S>],
    step: Step,
) -> (Trial<S>, Estimate<S>) {
    let mut stages = Stages::new(model, states, wrenches, step, 1 + STAGES.len());
    let trial = visit(&mut stages);
    let estimate = Estimate {
        orders: stages.combined(&ERROR),
        third: THIRD.map(|weights| stages.combined(&weights)),
        lower: LOWER.map(|weights| stages.combined(&weights)),
    };
    (trial, estimate)
}

fn visit<S: Scalar>(stages: &mut Stages<'_, S>) -> Trial<S> {
    let (mut visited, mut wrenches) = (Vec::with_capacity(STAGES.len()), Vec::new());
    for (fraction, weights) in STAGES {
        let (states, acting) = stages.stage(fraction, weights);
        visited.push(states);
        wrenches = acting;
    }
    Trial { stages: visited, wrenches }
}

impl<S: Scalar> Trial<S> {
    /// The states at its end.
    pub(in crate::integrator) fn end(&self) -> &Rows<S> {
        self.stages.last().map_or(&[], Vec::as_slice)
    }
}

impl<S: Scalar> Estimate<S> {
    /// Estimated error of `part` of the numbers of free body or contact `i`, at kinks too.
    ///
    /// The two orders differ as those of a smooth motion do. Their weights nearly cancel on either side of the gap between the
    /// stages at 3/10 and 4/5: of a slope that jumps in there they see eighty times less than what is wrong. There, divided
    /// differences of third order are as large as those of lower order; of a smooth slope they are smaller, the more so the
    /// shorter the step. So they count by that ratio, which makes them of at least fifth order where the motion is smooth, and
    /// of first order, as the error is, at a kink.
    pub(in crate::integrator) fn across_kinks(&self, i: usize, part: fn(S) -> f64) -> [f64; 4] {
        let orders = norms(&self.orders[i], part);
        let (third, lower) = (together(&self.third, i, part), together(&self.lower, i, part));
        std::array::from_fn(|k| {
            let ratio = if third[k] < lower[k] { third[k] / lower[k] } else { 1.0 };
            orders[k] + third[k] * ratio
        })
    }
}

fn norms<S: Scalar>(change: &Change<S>, part: fn(S) -> f64) -> [f64; 4] {
    change.each_ref().map(|vector| vector.map(part).norm())
}

/// Roots of sums of squares over `differences` of entry `i`.
fn together<S: Scalar>(differences: &[Vec<Change<S>>], i: usize, part: fn(S) -> f64) -> [f64; 4] {
    let norms = differences.iter().map(|difference| norms(&difference[i], part));
    norms.fold([0.0; 4], |sum, norms| {
        std::array::from_fn(|k| (norms[k] * norms[k] + sum[k] * sum[k]).sqrt())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Σ w cᵏ over the stages.
    fn moment(weights: &[f64], power: i32) -> f64 {
        let nodes = [0.0].into_iter().chain(STAGES.map(|(fraction, _)| fraction));
        nodes.zip(weights).map(|(c, w)| w * c.powi(power)).sum()
    }

    #[test]
    fn weights_have_their_orders() {
        for (fraction, weights) in STAGES {
            assert!((moment(weights, 0) - fraction).abs() < 1e-14);
        }
        let (_, fifth) = STAGES[5];
        for power in 0..5 {
            assert!((moment(fifth, power) - 1.0 / f64::from(power + 1)).abs() < 1e-15);
        }
        for power in 0..4 {
            assert!(moment(&ERROR, power).abs() < 1e-15);
        }
        assert!(moment(&ERROR, 4).abs() > 1e-4);
        let orders = THIRD.iter().map(|weights| (weights, 3));
        let orders = orders.chain(LOWER.iter().zip([2, 1]));
        for (weights, order) in orders {
            for power in 0..order {
                assert!(moment(weights, power).abs() < 1e-15);
            }
            assert!(moment(weights, order).abs() > 1e-3);
        }
    }

    #[test]
    fn a_jump_between_stages_is_seen() {
        let step = |weights: &[f64; 7]| weights[3..].iter().sum::<f64>();
        let size = |all: &[[f64; 7]]| all.iter().map(|w| step(w).powi(2)).sum::<f64>().sqrt();
        // A slope that is 0 up to 3/10 of the step and 1 from 4/5 on.
        assert!(step(&ERROR).abs() < 5e-3);
        assert!(size(&THIRD) > 0.3 && size(&LOWER) < size(&THIRD));
    }
}
