//! The entry: one observation, one object, one initial pose in; a refined pose out.

use std::sync::Arc;

use nalgebra::{Isometry3, UnitQuaternion};
use prehend_render::{DepthImage, Light, depth_map};

use crate::strategy::Heuristic;
use crate::term::{DepthTerm, PhysicsTerm, RenderingTerm, TactileTerm, Term};
use crate::trace::Trace;
use crate::{Config, Object, Observation, RefineError, Robot, State, TermKind};

/// The outcome of a refinement.
#[derive(Clone, Debug)]
pub struct RefinedPose {
    /// Object coordinates → camera coordinates \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// The iteration that the pose comes from.
    pub iteration: usize,
    /// What happened on the way.
    pub trace: Trace,
}

/// Progress of a refinement under way.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Iterations done.
    pub iteration: usize,
    /// Iterations at most.
    pub iterations: usize,
}

/// Refines `initial` (object → camera \[m\]) by the terms of `config`.
///
/// `robot` may be absent if the terms do not need it; without it, or without its state in the
/// observation, nothing is known to hide the object.
///
/// # Errors
/// If the observation lacks what a term needs, or the initial pose cannot be seen.
pub fn refine(
    observation: &Observation,
    object: &Arc<Object>,
    robot: Option<&Robot>,
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
    robot: Option<&Robot>,
    initial: &Isometry3<f64>,
    config: &Config,
    mut observe: impl FnMut(Progress) -> bool,
) -> Result<RefinedPose, RefineError> {
    let state = initial_state(observation, object, initial)?;
    let hand = Arc::new(hand_depth(observation, robot));
    let rendering = || {
        let settings = config.rendering.clone();
        RenderingTerm::new(observation, Arc::clone(object), &hand, settings)
    };
    let terms = config
        .terms
        .iter()
        .map(|kind| -> Result<Box<dyn Term>, RefineError> {
            let missing = || RefineError::Missing { what: "hand", term: kind.name() };
            let robot = || robot.ok_or_else(missing);
            Ok(match kind {
                TermKind::Physics => Box::new(PhysicsTerm::new(
                    observation,
                    object,
                    robot()?,
                    &state,
                    config.physics.clone(),
                )?),
                TermKind::Rendering => Box::new(rendering()?),
                TermKind::Depth => Box::new(DepthTerm::new(
                    observation,
                    Arc::clone(object),
                    Arc::clone(&hand),
                    config.depth.clone(),
                )?),
                TermKind::Tactile => Box::new(TactileTerm::new(
                    observation,
                    Arc::clone(object),
                    robot()?,
                    config.tactile.clone(),
                )?),
            })
        })
        .collect::<Result<Vec<_>, _>>()?;
    if terms.is_empty() {
        return Err(RefineError::NoTerms);
    }

    // The judge of checkpoints: the rendering term among the terms, or one of its own.
    let judge_index = config.terms.iter().position(|&k| k == TermKind::Rendering);
    let judge = (config.checkpoint && judge_index.is_none()).then(rendering).transpose()?;
    let mut best = (f64::INFINITY, 0, state.t_cam_object);
    let heuristic = Heuristic { settings: config.heuristic.clone() };
    let trace = heuristic.run(&terms, state, object.radius, |state, iteration| {
        let score = match (&judge, judge_index) {
            _ if !config.checkpoint => f64::NEG_INFINITY,
            (Some(judge), _) => {
                let mut lit = state.clone();
                judge.refresh(&mut lit);
                judge.value(&lit)
            }
            (None, Some(index)) => iteration.values[index],
            (None, None) => f64::NEG_INFINITY,
        };
        if score < best.0 || score == f64::NEG_INFINITY {
            best = (score, iteration.index, state.t_cam_object);
        }
        observe(Progress { iteration: iteration.index, iterations: config.heuristic.iterations })
    });
    Ok(RefinedPose { t_cam_object: best.2, iteration: best.1, trace })
}

pub(crate) fn initial_state(
    observation: &Observation,
    object: &Object,
    initial: &Isometry3<f64>,
) -> Result<State, RefineError> {
    let rotation = initial.rotation.coords.iter().copied();
    if !rotation.chain(initial.translation.vector.iter().copied()).all(f64::is_finite) {
        return Err(RefineError::NotFinite);
    }
    if observation.mask.count() == 0 {
        return Err(RefineError::EmptyMask);
    }
    let hand = observation.hand.as_ref();
    let state = State {
        t_cam_object: Isometry3::from_parts(
            initial.translation,
            UnitQuaternion::new_normalize(*initial.rotation.quaternion()),
        ),
        object_centre: object.centre,
        t_cam_hand: hand.map_or_else(Isometry3::identity, |h| h.t_cam_hand),
        light: Light::ambient(1.0),
    };
    let depth = state.centre().z;
    if depth <= 0.0 {
        return Err(RefineError::BehindCamera { depth });
    }
    Ok(state)
}

/// Depth image of the hand alone \[m\], 0 where it is not.
pub(crate) fn hand_depth(observation: &Observation, robot: Option<&Robot>) -> DepthImage {
    let camera = &observation.camera;
    match (robot, &observation.hand) {
        (Some(robot), Some(hand)) => {
            depth_map(camera, &robot.render_bodies(&hand.t_cam_hand, &hand.joints))
        }
        _ => DepthImage::filled(camera.width, camera.height, 0.0),
    }
}
