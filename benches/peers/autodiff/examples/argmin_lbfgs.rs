//! Throws a ball through the air at a target: by L-BFGS from the `argmin` crate, and by our own methods.
//!
//! Any optimizer that takes a function and its gradient can drive a simulation written over `Scalar`.

use argmin::core::{CostFunction, Error, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use nalgebra::Vector3;
use prehend_autodiff::optimize::{Adam, LevenbergMarquardt, NormalEquations};
use prehend_autodiff::{Scalar, gradient};

/// Where the ball, thrown from the origin, is to be after the flight \[m\].
const TARGET: [f64; 3] = [3.0, 1.0, 0.5];
/// Length of the flight \[s\].
const FLIGHT: f64 = 0.8;
/// Half the density of air times drag coefficient times cross-section over mass, for a ball as used in
/// table tennis \[1/m\].
const DRAG: f64 = 0.13;

/// How far the ball is from the target in the end, if it leaves with `velocity` \[m/s\].
fn miss<S: Scalar>(velocity: &[S]) -> Vec<S> {
    let dt = S::constant(FLIGHT / 800.0);
    let gravity = Vector3::new(0.0, 0.0, -9.81).map(S::constant);
    let (mut x, mut v) = (Vector3::zeros(), Vector3::from_column_slice(velocity));
    for _ in 0..800 {
        v += (gravity - v * (v.norm() * S::constant(DRAG))) * dt;
        x += v * dt;
    }
    (x - Vector3::from(TARGET).map(S::constant)).as_slice().to_vec()
}

/// Half the squared distance from the target \[m²\].
fn cost<S: Scalar>(velocity: &[S]) -> S {
    miss(velocity).into_iter().fold(S::zero(), |sum, r| sum + r * r) * S::constant(0.5)
}

/// The cost as `argmin` wants to see it.
struct Throw;

impl CostFunction for Throw {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, velocity: &Self::Param) -> Result<f64, Error> {
        Ok(cost(velocity))
    }
}

impl Gradient for Throw {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, velocity: &Self::Param) -> Result<Self::Gradient, Error> {
        Ok(gradient(cost, velocity).1)
    }
}

fn main() -> Result<(), Error> {
    // Straight at the target, as if there were neither gravity nor air.
    let start = TARGET.map(|x| x / FLIGHT);

    let lbfgs = LBFGS::new(MoreThuenteLineSearch::new(), 5).with_tolerance_grad(1e-8)?;
    let found = Executor::new(Throw, lbfgs)
        .configure(|state| state.param(start.to_vec()).max_iters(100))
        .run()?;
    let state = found.state();
    let by_lbfgs = state.get_best_param().cloned().ok_or_else(|| Error::msg("no step was made"))?;

    let by_lm = LevenbergMarquardt::default()
        .minimize(&start, |v| NormalEquations::forward::<3>(miss, v))?;
    let by_adam = Adam { rate: 0.1, ..Adam::default() }.minimize(&start, |v| gradient(cost, v))?;

    println!("method               iterations   miss [m]   velocity [m/s]");
    for (method, iterations, velocity) in [
        ("L-BFGS (argmin)", state.get_iter() as usize, by_lbfgs),
        ("Levenberg–Marquardt", by_lm.iterations, by_lm.parameters),
        ("Adam", by_adam.iterations, by_adam.parameters),
    ] {
        let distance = Vector3::from_vec(miss(&velocity)).norm();
        println!("{method:20} {iterations:10}   {distance:8.1e}   {velocity:.4?}");
        assert!(distance < 1e-6, "{method} misses the target");
    }
    Ok(())
}
