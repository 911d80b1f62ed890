use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::super::test_problems::{meyer, powell, rosenbrock};
use super::super::{Criteria, Stop};
use super::*;
use crate::lie::{so3_exp, so3_log};
use crate::{Fwd, Scalar};

fn gauss_newton() -> LevenbergMarquardt {
    LevenbergMarquardt { damping: 0.0, ..Default::default() }
}

fn both() -> [LevenbergMarquardt; 2] {
    [LevenbergMarquardt::default(), gauss_newton()]
}

#[test]
fn rosenbrock_is_solved_to_rounding() {
    for method in both() {
        let found = method
            .minimize(&[-1.2, 1.0], |x| NormalEquations::forward::<2>(rosenbrock, x))
            .unwrap();
        assert_eq!(found.stop, Stop::Gradient);
        assert!(found.iterations < 40, "{found:?}");
        assert!(found.parameters.iter().all(|x| (x - 1.0).abs() < 1e-9), "{found:?}");
    }
}

#[test]
fn linear_residuals_take_one_step_without_damping() {
    fn plane<S: Scalar>(x: &[S]) -> Vec<S> {
        vec![x[0] + x[1] * S::constant(2.0) - S::constant(3.0), x[0] - x[1], x[0]]
    }
    let [damped, undamped] = both().map(|method| {
        method.minimize(&[5.0, -7.0], |x| NormalEquations::forward::<2>(plane, x)).unwrap()
    });
    assert_eq!((undamped.iterations, undamped.stop), (1, Stop::Gradient));
    assert!(damped.iterations > 1, "{damped:?}");
}

#[test]
fn powell_singular_is_reached_though_its_jacobian_loses_rank_there() {
    for method in both() {
        let found = method
            .minimize(&[3.0, -1.0, 0.0, 1.0], |x| NormalEquations::forward::<3>(powell, x))
            .unwrap();
        assert_eq!(found.stop, Stop::Gradient);
        assert!(found.iterations < 40, "{found:?}");
        assert!(found.parameters.iter().all(|x| x.abs() < 1e-3), "{found:?}");
    }
}

#[test]
fn a_badly_scaled_fit_with_residuals_left_reaches_the_published_value() {
    for method in both() {
        let found = method
            .minimize(&[0.02, 4000.0, 250.0], |x| NormalEquations::forward::<3>(meyer, x))
            .unwrap();
        assert!((2.0 * found.value - 87.9458).abs() < 1e-4, "{found:?}");
        assert_ne!(found.stop, Stop::Iterations);
    }
}

#[test]
fn units_of_the_parameters_do_not_change_the_path() {
    let path = |unit: f64| {
        let scaled = |x: &[Fwd<2>]| rosenbrock(&[x[0], x[1] * Fwd::constant(unit)]);
        let mut values = Vec::new();
        LevenbergMarquardt::default()
            .minimize_observed(
                &[-1.2, 1.0 / unit],
                |x| NormalEquations::forward(scaled, x),
                |iteration| {
                    values.push(iteration.value);
                    ControlFlow::Continue(())
                },
            )
            .unwrap();
        values
    };
    // A power of two, so that rounding is the same as well.
    let (meters, other) = (path(1.0), path(1.0 / 1024.0));
    assert!(meters.len() > 10);
    assert_eq!(meters[..10], other[..10]);
}

const POINTS: [[f64; 3]; 4] =
    [[0.3, -0.2, 0.9], [1.0, 0.1, -0.4], [-0.5, 0.8, 0.2], [0.1, 0.9, 0.7]];

fn rotation(x: &[f64]) -> UnitQuaternion<f64> {
    so3_exp(&Vector3::from_column_slice(x))
}

/// The rotation that turns `POINTS` onto `seen`.
fn fit_rotation(method: LevenbergMarquardt, seen: &[Vector3<f64>]) -> UnitQuaternion<f64> {
    let residuals = |x: &[Fwd<3>]| {
        let turn = so3_exp(&Vector3::from_column_slice(x));
        POINTS
            .iter()
            .zip(seen)
            .flat_map(|(&point, seen)| {
                let miss = turn * Vector3::from(point).map(Fwd::constant) - seen.map(Fwd::constant);
                [miss.x, miss.y, miss.z]
            })
            .collect()
    };
    let found = method.minimize(&[0.0; 3], |x| NormalEquations::forward(residuals, x)).unwrap();
    assert_ne!(found.stop, Stop::Iterations);
    rotation(&found.parameters)
}

#[test]
fn a_rotation_is_found_from_points_seen_turned() {
    for omega in [[0.0, 0.0, 0.0], [0.4, -0.9, 0.2], [-1.5, 2.0, 1.2]] {
        let truth = rotation(&omega);
        let seen = POINTS.map(|p| truth * Vector3::from(p));
        for method in both() {
            let error = so3_log(&(truth.inverse() * fit_rotation(method, &seen))).norm();
            assert!(error < 1e-10, "{omega:?}: {error:e}");
        }
    }
}

#[test]
fn a_rotation_fitted_to_noisy_points_is_that_of_kabsch() {
    let truth = rotation(&[0.4, -0.9, 0.2]);
    let mut noise = [0.07, -0.07, 0.03, -0.05].iter();
    let seen = POINTS
        .map(|p| truth * Vector3::from(p) + Vector3::new(1.0, -1.0, 0.5) * *noise.next().unwrap());
    let correlation: Matrix3<f64> =
        POINTS.iter().zip(&seen).map(|(&p, seen)| seen * Vector3::from(p).transpose()).sum();
    let svd = correlation.svd(true, true);
    let best = svd.u.unwrap() * svd.v_t.unwrap();
    assert!(best.determinant() > 0.0);
    for method in both() {
        let fitted = fit_rotation(method, &seen).to_rotation_matrix();
        let difference = (fitted.matrix() - best).norm();
        assert!(difference < 1e-8, "{difference:e}");
    }
}

#[test]
fn what_the_residuals_do_not_determine_stays() {
    // Only the sum of the first two counts, and the third not at all.
    fn residuals<S: Scalar>(x: &[S]) -> Vec<S> {
        let sum = x[0] + x[1];
        vec![sum - S::constant(4.0), (sum - S::constant(4.0)) * S::constant(3.0)]
    }
    for method in both() {
        let found = method
            .minimize(&[1.0, 2.0, 7.0], |x| NormalEquations::forward::<3>(residuals, x))
            .unwrap();
        assert_eq!(found.stop, Stop::Gradient);
        for (x, expected) in found.parameters.iter().zip([1.5, 2.5, 7.0]) {
            assert!((x - expected).abs() < 1e-6, "{found:?}");
        }
    }
}

#[test]
fn pivots_of_mere_rounding_make_no_huge_steps() {
    // One weighted sum seen twice: JᵀJ has rank 1, but the factorization may not notice.
    for case in 1..200 {
        let weights = [1.0, 2.0, 3.0].map(|i| 2.0 + (f64::from(case) * i).sin());
        let residuals = |x: &[Fwd<3>]| {
            let sum = (0..3).fold(Fwd::constant(-4.0), |s, i| s + x[i] * Fwd::constant(weights[i]));
            vec![sum, sum * Fwd::constant(0.3)]
        };
        let found =
            gauss_newton().minimize(&[0.0; 3], |x| NormalEquations::forward(residuals, x)).unwrap();
        // Each parameter takes its third of the sum.
        for (x, weight) in found.parameters.iter().zip(weights) {
            assert!((x * weight - 4.0 / 3.0).abs() < 1e-5, "{weights:?}: {found:?}");
        }
    }
}

#[test]
fn the_value_never_rises_and_refused_steps_change_nothing() {
    for method in both() {
        let (mut last, mut refused) = ((f64::INFINITY, vec![-1.2, 1.0]), 0);
        method
            .minimize_observed(
                &[-1.2, 1.0],
                |x| NormalEquations::forward::<2>(rosenbrock, x),
                |iteration| {
                    if iteration.taken {
                        assert!(iteration.value < last.0);
                    } else {
                        refused += 1;
                        assert_eq!(*iteration.parameters, last.1);
                    }
                    last = (iteration.value, iteration.parameters.to_vec());
                    ControlFlow::Continue(())
                },
            )
            .unwrap();
        assert!(refused > 0, "no step was refused, so nothing was tested");
    }
}

#[test]
fn steps_to_where_residuals_are_not_finite_are_shortened() {
    // √x has no value left of zero, which is where the first step of Gauss–Newton from 9 leads.
    fn residuals<S: Scalar>(x: &[S]) -> Vec<S> {
        vec![x[0].sqrt() - S::constant(0.1)]
    }
    for method in both() {
        let mut bad = 0;
        let found = method
            .minimize(&[9.0], |x| {
                bad += usize::from(x[0] < 0.0);
                NormalEquations::forward::<1>(residuals, x)
            })
            .unwrap();
        assert!(bad > 0, "every step was finite, so nothing was tested");
        assert!((found.parameters[0] - 0.01).abs() < 1e-9, "{found:?}");
        assert!(found.iterations < 20, "{found:?}");
    }
}

#[test]
fn a_minimum_that_leaves_residuals_settles() {
    let criteria = Criteria { gradient: 0.0, ..Criteria::default() };
    for method in both() {
        let method = LevenbergMarquardt { criteria, ..method };
        let line = |x: &[Fwd<1>]| {
            [1.0, 2.0, 6.0].map(|y| (x[0] - Fwd::constant(y)) * Fwd::constant(0.1)).to_vec()
        };
        let found = method.minimize(&[100.0], |x| NormalEquations::forward(line, x)).unwrap();
        assert!((found.parameters[0] - 3.0).abs() < 1e-6, "{found:?}");
        assert!(found.iterations < 20 && found.stop != Stop::Iterations, "{found:?}");
    }
}

/// Rosenbrock's valley as a problem of plain vectors; not a number beyond x = 5. It forgets answers once it was asked often.
struct Valley(std::cell::RefCell<Vec<usize>>);

impl LeastSquares for Valley {
    type Point = Vec<f64>;
    type Linearization = NormalEquations;

    fn linearize(&self, at: &Vec<f64>) -> NormalEquations {
        let mut all = NormalEquations::forward::<2>(rosenbrock, at);
        all.value = if at[0] > 5.0 { f64::NAN } else { all.value };
        all
    }

    fn linearize_all(&self, points: &[Vec<f64>]) -> Vec<NormalEquations> {
        self.0.borrow_mut().push(points.len());
        let answered = if self.0.borrow().len() > 900 { 0 } else { points.len() };
        points[..answered].iter().map(|at| self.linearize(at)).collect()
    }

    fn retract(&self, at: &Vec<f64>, step: &[f64]) -> Vec<f64> {
        at.iter().zip(step).map(|(x, h)| x + h).collect()
    }
}

#[test]
fn a_missing_answer_is_an_error() {
    let problem = Valley(vec![0; 900].into());
    let start = vec![-1.2, 1.0];
    let linearized = problem.linearize(&start);
    let go_on = |_: &Iteration<Vec<f64>>| ControlFlow::Continue(());
    let found = LevenbergMarquardt::default().minimize_on(&problem, start, linearized, go_on);
    let error = OptimizeError::Answers { expected: 1, found: 0 };
    assert_eq!(found.map(|found| found.0), Err(error));
}

#[test]
fn steps_on_a_manifold_are_measured_by_themselves() {
    let problem = Valley(Vec::new().into());
    let start = vec![-1.2, 1.0];
    let linearized = problem.linearize(&start);
    let criteria = Criteria { gradient: 0.0, decrease: 0.0, step: 1e-3, ..Criteria::default() };
    let method = LevenbergMarquardt { criteria, ..LevenbergMarquardt::default() };
    let mut steps = Vec::new();
    let (found, _) = method
        .minimize_on(&problem, start, linearized, |iteration| {
            steps.push(iteration.step);
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(found.stop, Stop::Step);
    let (last, before) = steps.split_last().unwrap();
    assert!(*last < 1e-3 && before.iter().all(|step| *step >= 1e-3), "{steps:?}");
}

#[test]
fn walks_side_by_side_go_as_they_go_alone() {
    let starts = [[-1.2, 1.0], [2.0, -1.0], [6.0, 0.0], [1.0, 1.0], [0.3, 0.3]];
    let problem = Valley(Vec::new().into());
    for method in both() {
        let begin = |start: &[f64; 2]| (start.to_vec(), problem.linearize(&start.to_vec()));
        let go_on = |_: &Iteration<Vec<f64>>| ControlFlow::Continue(());
        let alone: Vec<_> = starts
            .iter()
            .map(|start| {
                let (x, linearized) = begin(start);
                method.minimize_on(&problem, x, linearized, go_on).map(|found| found.0)
            })
            .collect();
        problem.0.borrow_mut().clear();
        let mut heard = [0; 5];
        let together = method
            .minimize_all_on(&problem, starts.iter().map(begin).collect(), |number, _| {
                heard[number] += 1;
                ControlFlow::Continue(())
            })
            .unwrap();
        let together: Vec<_> =
            together.into_iter().map(|found| found.map(|found| found.0)).collect();
        assert_eq!(together, alone);
        assert_eq!(together[2], Err(OptimizeError::ObjectiveNotFinite));
        let iterations = |found: &Result<Outcome<_>, _>| found.as_ref().map_or(0, |o| o.iterations);
        assert_eq!(together.iter().map(iterations).collect::<Vec<_>>(), heard);
        // All that were not over were asked for at once.
        let asked = problem.0.borrow();
        assert_eq!(asked.len(), *heard.iter().max().unwrap());
        assert_eq!(asked[0], 3);
        assert!(asked.is_sorted_by(|a, b| a >= b));
    }
}

#[test]
fn bad_damping_and_matrices_are_refused() {
    let method = LevenbergMarquardt { damping: -1.0, ..Default::default() };
    let refused = method.minimize(&[1.0], |x| NormalEquations::forward::<2>(rosenbrock, x));
    assert!(matches!(refused, Err(OptimizeError::Setting { name: "damping", .. })));
    let with_matrix = |matrix: DMatrix<f64>| {
        LevenbergMarquardt::default().minimize(&[1.0], |_| NormalEquations {
            value: 1.0,
            gradient: DVector::repeat(1, 1.0),
            matrix: matrix.clone(),
        })
    };
    assert_eq!(
        with_matrix(DMatrix::identity(2, 2)),
        Err(OptimizeError::MatrixShape { expected: 1, rows: 2, columns: 2 })
    );
    let infinite = DMatrix::repeat(1, 1, f64::INFINITY);
    assert_eq!(with_matrix(infinite), Err(OptimizeError::ObjectiveNotFinite));
}
