//! Loads of the crates.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use nalgebra::{Isometry3, Vector3};
use prehend_autodiff::{Scalar, gradient};
use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::scene::default_sequence;
use prehend_refine::tracker::{Tracker, TrackerSettings};
use prehend_sim::{BodyState, SemiImplicitEuler, State, TimeSteps};

use super::memory::Memory;
use super::{LoadContext, NOISE, Outcome};
use crate::scene::body_over_floor;

/// Where a body of `points` contact points is after `steps` steps, thrown onto a floor with a velocity of `push`.
fn slid<S: Scalar>(points: usize, steps: usize, push: [S; 3]) -> Result<Vector3<S>> {
    // A body of n segments has n²/2 vertices, about.
    let model = body_over_floor((2 * points).isqrt() + 1)?;
    let mut start: BodyState<S> =
        BodyState::at_rest(Isometry3::translation(0.0, 0.0, 0.051)).cast();
    start.linear = Vector3::from(push);
    let still = BodyState::at_rest(Isometry3::identity()).cast();
    let time_steps = TimeSteps { dt: 5e-5, steps };
    let euler = SemiImplicitEuler;
    let end = model.cast().simulate_with(&euler, &State::new([still, start]), time_steps)?;
    Ok(end.states[1].pose.translation.vector)
}

/// Many points of a body touch a floor for many steps.
pub(super) fn contacts(context: &LoadContext<'_>) -> Result<Outcome> {
    let (points, steps) = (10_000, context.scaled(10_000));
    let push = [0.3, 0.1, 0.0];
    let work = || {
        let end = slid(points, steps, push)?;
        let mut recorded = Ok(());
        let (value, by) = gradient(
            |x| {
                let end = slid(points, steps, [x[0], x[1], x[2]]);
                end.map_or_else(
                    |error| {
                        recorded = Err(error);
                        0.0.into()
                    },
                    |end| end.x,
                )
            },
            &push,
        );
        recorded?;
        ensure!(value == end.x, "{value} m recorded, {} m run", end.x);
        // What is pushed farther goes farther.
        ensure!(by[0].is_finite() && by[0] > 0.0, "the gradient is {by:?}");
        let h = 1e-6;
        let beside = |h: f64| slid(points, steps, [push[0] + h, push[1], push[2]]);
        let difference = (beside(h)?.x - beside(-h)?.x) / (2.0 * h);
        let off = (by[0] / difference - 1.0).abs();
        ensure!(off < 1e-3, "{} m/(m/s), by differences {difference}", by[0]);
        Ok(format!("slid {:.1} mm, gradient {off:.0e} off differences", 1e3 * end.x))
    };
    let (note, memory) = Memory::of(std::process::id(), work)?;
    Ok(Outcome { memory, growth: None, note })
}

/// Frames of the film that is played forth and back.
const FILM: usize = 90;

/// A film of an hour, whose object is never at rest.
pub(super) fn tracker(context: &LoadContext<'_>) -> Result<Outcome> {
    let count = context.scaled(30 * 3600);
    let film = default_sequence(1, FILM)?;
    let mut tracker = Tracker::new(Arc::clone(&film.object), TrackerSettings::default())?;
    tracker.start_from(&film.initial);
    let mut errors = Vec::with_capacity(count);
    let work = || {
        for number in 0..count {
            let phase = number % (2 * FILM - 2);
            let frame = &film.frames[phase.min(2 * FILM - 2 - phase)];
            let mut observation = frame.frame.clone();
            if number > 0 {
                observation.mask.pixels_mut().fill(false);
            }
            let time = Duration::from_secs_f64(number as f64 / 30.0);
            let pose = tracker.push(observation, time)?.t_cam_object;
            errors.push((pe_cm(&pose, &frame.truth), oe_deg(&pose, &frame.truth)));
        }
        Ok(())
    };
    let ((), memory) = Memory::of(std::process::id(), work)?;
    let near = errors.iter().filter(|(pe, oe)| *pe < 0.5 && *oe < 5.0).count();
    let share = near as f64 / count as f64;
    let last = errors.last().context("no frame")?;
    ensure!(share >= 0.99 && last.0 < 0.5, "{near} of {count} within 5 mm and 5°");
    Ok(Outcome {
        memory,
        growth: Some(NOISE),
        note: format!("{near} of {count} within 5 mm and 5°"),
    })
}
