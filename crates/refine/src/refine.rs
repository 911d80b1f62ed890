//! The entry: one observation, one object, one initial pose in; a refined pose out.

use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_render::{DepthImage, depth_map};

use crate::config::{Config, StrategyKind, TermKind};
use crate::error::RefineError;
use crate::factor::{DepthTerm, PhysicsTerm, RenderingTerm, TactileTerm, Term};
use crate::problem::State;
use crate::scene::{Hand, Object, Observation};
use crate::strategy::{Fused, Heuristic, Icp, Posterior, RobustIcp};
use crate::strategy::{Iteration, Trace};

/// The outcome of a refinement.
#[derive(Clone, Debug)]
pub struct RefinedPose {
    /// Object coordinates → camera coordinates \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// The iteration that the pose comes from.
    pub iteration: usize,
    /// What happened on the way.
    pub trace: Trace,
    /// How sure the pose is; only the fused estimator knows.
    pub confidence: Option<Posterior>,
}

/// Progress of a refinement under way.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Iterations done.
    pub iteration: usize,
    /// Iterations at most.
    pub iterations: usize,
    /// The pose that would be returned if the refinement ended here (object → camera \[m\]).
    pub t_cam_object: Isometry3<f64>,
}

/// Refines `initial` (object → camera \[m\]) by the strategy of `config`.
///
/// `robot` may be absent if the terms do not need it; without it, or without its state in the
/// observation, nothing is known to hide the object.
///
/// # Errors
/// If the observation lacks what the strategy or a term needs, or the initial pose cannot be seen.
pub fn refine(
    observation: &Observation,
    object: &Arc<Object>,
    robot: Option<&Arc<Hand>>,
    initial: &Isometry3<f64>,
    config: &Config,
) -> Result<RefinedPose, RefineError> {
    refine_with(observation, object, robot, initial, config, |_| true)
}

/// As [`refine`], reporting every iteration to `observe`, which ends the search by returning false.
///
/// # Errors
/// See [`refine`].
pub fn refine_with(
    observation: &Observation,
    object: &Arc<Object>,
    robot: Option<&Arc<Hand>>,
    initial: &Isometry3<f64>,
    config: &Config,
    mut observe: impl FnMut(Progress) -> bool,
) -> Result<RefinedPose, RefineError> {
    let state = State::new(observation, object, initial)?;
    let kinds = match config.strategy {
        StrategyKind::Heuristic if config.terms.is_empty() => return Err(RefineError::NoTerms),
        StrategyKind::Heuristic => config.terms.as_slice(),
        _ if !config.terms.is_empty() => {
            let problem = format!("are given, which {} does not take", config.strategy);
            return Err(RefineError::Setting { name: "terms", problem });
        }
        StrategyKind::Icp | StrategyKind::RobustIcp | StrategyKind::Fused => &[],
    };
    if let (Some(robot), Some(hand)) = (robot, &observation.hand) {
        robot.check_joints(&hand.joints)?;
    }

    // The judge of checkpoints: the rendering term among the terms, or one of its own.
    let judge_index = kinds.iter().position(|&k| k == TermKind::Rendering);
    // The fused estimator's last pose is its best, and the one that its confidence is of.
    let checkpoint = config.checkpoint && config.strategy != StrategyKind::Fused;
    let own_judge = checkpoint && judge_index.is_none();
    let judge = own_judge
        .then(|| {
            let hand = hand_depth(observation, robot.map(Arc::as_ref));
            RenderingTerm::new(observation, Arc::clone(object), &hand, config.rendering.clone())
        })
        .transpose()?;
    let mut best = (f64::INFINITY, 0, state.t_cam_object);
    let visit = |state: &State, iteration: &Iteration| {
        let score = match (&judge, judge_index) {
            (Some(judge), _) => {
                let mut lit = state.clone();
                lit.relight(judge);
                judge.value(&lit)
            }
            (None, Some(index)) => iteration.values[index],
            (None, None) => f64::INFINITY,
        };
        if !checkpoint || score < best.0 {
            best = (score, iteration.index, state.t_cam_object);
        }
        observe(Progress {
            iteration: iteration.index,
            iterations: config.iterations(),
            t_cam_object: best.2,
        })
    };
    let mut confidence = None;
    let trace = match config.strategy {
        StrategyKind::Heuristic => {
            let terms = standard_terms(observation, object, robot, &state, config)?;
            let heuristic = Heuristic { settings: config.heuristic.clone() };
            heuristic.run(&terms, state, object.radius, visit)
        }
        StrategyKind::Icp => {
            Icp { settings: config.icp.clone() }.run(observation, object, state, visit)?
        }
        StrategyKind::RobustIcp => {
            let robust = RobustIcp { settings: config.robust_icp.clone() };
            robust.run(observation, object, state, visit)?
        }
        StrategyKind::Fused => {
            let fused = Fused { settings: config.fused.clone() };
            let (trace, of_pose) = fused.run(observation, object, robot, state, visit)?;
            confidence = Some(of_pose);
            trace
        }
    };
    Ok(RefinedPose { t_cam_object: best.2, iteration: best.1, trace, confidence })
}

/// The terms that `config` asks for, in its order; add your own to them and hand all to a
/// [`Heuristic`].
///
/// # Errors
/// If the observation lacks what a term needs.
pub fn standard_terms(
    observation: &Observation,
    object: &Arc<Object>,
    robot: Option<&Arc<Hand>>,
    initial: &State,
    config: &Config,
) -> Result<Vec<Box<dyn Term>>, RefineError> {
    if let (Some(robot), Some(hand)) = (robot, &observation.hand) {
        robot.check_joints(&hand.joints)?;
    }
    let hand = Arc::new(hand_depth(observation, robot.map(Arc::as_ref)));
    let term = |kind: &TermKind| -> Result<Box<dyn Term>, RefineError> {
        let missing = || RefineError::Missing { what: "hand", term: kind.name() };
        let robot = || robot.ok_or_else(missing);
        let object = Arc::clone(object);
        Ok(match kind {
            TermKind::Physics => {
                let settings = config.physics.clone();
                Box::new(PhysicsTerm::new(observation, &object, robot()?, initial, settings)?)
            }
            TermKind::Rendering => {
                let settings = config.rendering.clone();
                Box::new(RenderingTerm::new(observation, object, &hand, settings)?)
            }
            TermKind::Depth => {
                let (hand, settings) = (Arc::clone(&hand), config.depth.clone());
                Box::new(DepthTerm::new(observation, object, hand, settings)?)
            }
            TermKind::Tactile => {
                let robot = Arc::clone(robot()?);
                Box::new(TactileTerm::new(observation, object, robot, &config.tactile)?)
            }
        })
    };
    config.terms.iter().map(term).collect()
}

/// Depth image of the hand alone \[m\], 0 where it is not. The hand's joints must have been checked.
pub(crate) fn hand_depth(observation: &Observation, robot: Option<&Hand>) -> DepthImage {
    let camera = &observation.camera;
    match (robot, &observation.hand) {
        (Some(robot), Some(hand)) => {
            depth_map(camera, &robot.render_bodies(&hand.t_cam_hand, &hand.joints))
        }
        _ => DepthImage::filled(camera.width, camera.height, 0.0),
    }
}
