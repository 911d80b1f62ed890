//! Factors, and a problem of one's own made of them.

use std::ops::ControlFlow;
use std::sync::{Arc, LazyLock};

use nalgebra::Vector6;
use prehend_autodiff::optimize::LeastSquares;
use prehend_refine::baselines::{
    ChamferDepthFactor, ChamferDepthSettings, StabilityFactor, StabilitySettings,
};
use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::factor::{
    FreeSpaceFactor, FreeSpaceSettings, GaussianPrior, HandDepthFactor, HandDepthSettings,
    PenetrationFactor, PenetrationSettings, PointToPlaneFactor, PointToPlaneSettings,
    PriorSettings, RegionFactor, RegionSettings, RenderingFactor, RenderingSettings, SupportFactor,
    SupportSettings, TactileFactor, TactileSettings, TouchModel,
};
use prehend_refine::problem::{Block, NoiseModel, NormalEquations, Problem, Solver, Termination};
use prehend_refine::scene::{Scene, default_scene};
use prehend_refine::{Factor, PreparedFrame, RefineError, State};

static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).unwrap());

fn frame() -> PreparedFrame<'static> {
    PreparedFrame::new(&SCENE.frame, &SCENE.object).unwrap()
}

/// Twists about the object's center in which a radian counts as much as a tenth of a meter.
const UNITS: [f64; 6] = [1.0, 1.0, 1.0, 10.0, 10.0, 10.0];

fn all(frame: &PreparedFrame<'_>, state: &State) -> Result<Vec<Arc<dyn Factor>>, RefineError> {
    let touch = TouchModel::Taxels(NoiseModel::cauchy(3e-3, 8.0));
    let taxels = TactileSettings { touch, ..TactileSettings::default() };
    Ok(vec![
        Arc::new(ChamferDepthFactor::new(frame, &ChamferDepthSettings::default())?),
        Arc::new(FreeSpaceFactor::new(frame, &FreeSpaceSettings::default())),
        Arc::new(HandDepthFactor::new(frame, 500, &HandDepthSettings::default())?),
        Arc::new(PenetrationFactor::new(frame, &PenetrationSettings::default())?),
        Arc::new(PointToPlaneFactor::new(frame, &PointToPlaneSettings::default())?),
        Arc::new(RegionFactor::new(frame, &RegionSettings::default())?),
        Arc::new(RenderingFactor::new(frame, &RenderingSettings::default())?),
        Arc::new(StabilityFactor::new(frame, state, StabilitySettings::default())?),
        Arc::new(SupportFactor::new(frame, &SupportSettings::default())?),
        Arc::new(TactileFactor::new(frame, &TactileSettings::default())?),
        Arc::new(TactileFactor::new(frame, &taxels)?),
        Arc::new(GaussianPrior::independent(state.clone(), &PriorSettings::default())?),
    ])
}

#[test]
fn every_factor_changes_as_its_gradient_says() {
    let frame = frame();
    let initial = State::new(&frame, &SCENE.truth).unwrap();
    let blocks = [Block::ObjectPose];
    let off = initial.retract(&blocks, &[2e-3, -1e-3, 1e-3, 0.02, 0.01, -0.03]);
    for factor in all(&frame, &initial).unwrap() {
        let mut equations = NormalEquations::new(&blocks);
        let cost = factor.linearize(&off, &mut equations);
        let name = factor.name();
        assert!((cost - factor.cost(&off)).abs() <= 1e-9 * cost.abs(), "{name}: {cost}");
        // Stability has the derivatives of smoothed contacts; free space those at fixed shares of pixels, which change at depth's
        // steps. Its own test has depth without steps.
        if ["stability", "free-space"].contains(&name) {
            continue;
        }
        let conditional = factor.conditional_at(&off);
        let factor = conditional.as_deref().unwrap_or(factor.as_ref());
        let units = Vector6::from(UNITS);
        let gradient = Vector6::from_column_slice(equations.gradient().as_slice());
        let gradient = gradient.component_mul(&units);
        // Pictures are of single precision.
        let length = if name == "rendering" { 5e-5 } else { 1e-7 };
        let differences = Vector6::from_fn(|k, _| {
            let at = |step: f64| {
                let mut twist = [0.0; 6];
                twist[k] = step * UNITS[k];
                factor.cost(&off.retract(&blocks, &twist))
            };
            (at(length) - at(-length)) / (2.0 * length)
        });
        // Point-to-plane leaves out what few points pull that were matched with faces that look away.
        let tolerance = if ["point-to-plane", "rendering"].contains(&name) { 0.05 } else { 0.01 };
        let error = (gradient - differences).norm();
        let error = error / differences.norm().max(f64::MIN_POSITIVE);
        assert!(error <= tolerance, "{name}: {error}");
    }
}

/// Depth, touch and the hand's shape, with the hand's pose not quite known: the object and the hand are found together.
#[test]
fn a_problem_of_ones_own_is_solved() {
    let frame = frame();
    let state = State::new(&frame, &SCENE.initial).unwrap();
    let blocks = vec![Block::ObjectPose, Block::HandPose];
    let factors: Vec<Arc<dyn Factor>> = vec![
        Arc::new(PointToPlaneFactor::new(&frame, &PointToPlaneSettings::default()).unwrap()),
        Arc::new(TactileFactor::new(&frame, &TactileSettings::default()).unwrap()),
        Arc::new(PenetrationFactor::new(&frame, &PenetrationSettings::default()).unwrap()),
    ];
    let prior = GaussianPrior::independent(state.clone(), &PriorSettings::default()).unwrap();
    let problem = Problem::new(factors, blocks.clone()).with_prior(Arc::new(prior));
    let start = problem.linearize(&state);
    let solver = Solver { iterations: 200, min_decrease: 1e-6 };
    let solution = problem.solve(start.clone(), &solver, |_| ControlFlow::Continue(()));
    assert_ne!(solution.termination, Termination::Iterations);
    let (before, after) = (&start.state.t_cam_object, &solution.at.state.t_cam_object);
    let error = |pose| (pe_cm(pose, &SCENE.truth), oe_deg(pose, &SCENE.truth));
    println!("{:?} → {:?} in {} steps", error(before), error(after), solution.iterations);
    assert!(error(after).0 < 0.2 && error(after).0 < 0.5 * error(before).0);
    assert!(solution.at.cost < start.cost && problem.cost(&solution.at.state) < start.cost);
    // Little is left to gain, and what each factor has to say adds up.
    let step = solution.at.gauss_newton_step().unwrap();
    let left = -0.5 * step.dot(solution.at.equations.gradient());
    assert!(left < 0.01 * (start.cost - solution.at.cost), "{left} nats");
    let parts = solution.at.prior.iter().chain(&solution.at.factors);
    let (names, costs): (Vec<_>, Vec<_>) = parts.map(|part| (part.name, part.cost)).unzip();
    assert_eq!(names, ["prior", "point-to-plane", "tactile", "penetration"]);
    assert!((costs.iter().sum::<f64>() - solution.at.cost).abs() < 1e-9 * solution.at.cost);
}
