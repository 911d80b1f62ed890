//! Steps of many bodies: those that cannot touch each other for a while move on by themselves.

use std::collections::HashMap;

use prehend_autodiff::Scalar;
use rayon::prelude::*;

use super::Adaptive;
use super::error_norm::ErrorNorm;
use super::islands::{Island, Links};
use super::schedule::{Schedule, Substeps};
use super::sensitivity::{self, Tangent};
use super::substep_controller::SHORTEST;
use crate::body_state::{BodyState, Rows};
use crate::error::Result;
use crate::handle::BodyId;
use crate::integrator::model_template::ModelTemplate;
use crate::integrator::step_checkpointed::{OneStep, with_moved};
use crate::model::Model;
use crate::model::broad_phase::{BroadPhase, CandidateContact};
use crate::model::contact_pair::ContactPair;
use crate::time::Step;

/// Distance that the fastest body goes in a window, in fractions of its size.
const TRAVEL: f64 = 0.35;
/// Deviation from free motion within which a body is first looked for, in fractions of its size: where that is too little
/// it is seen, and costs less than an island that is too large.
const SLACK: f64 = 1e-3;
/// Factor on the deviation found, within which a body is looked for next.
const MARGIN: f64 = 1.25;

/// The states after `whole`.
///
/// A step is divided into windows. Within one, no body comes farther from uniform motion than contacts were looked for, so that
/// bodies which no contact links are islands, each with substeps of its own. Without groups of contacts the whole step is one window.
pub(super) fn step<S: Scalar>(
    settings: &Adaptive,
    model: &Model<S>,
    states: &Rows<S>,
    whole: Step,
) -> Result<Vec<BodyState<S>>> {
    let plain = model.to_f64();
    let driving = plain.cast::<Tangent>();
    let search = BroadPhase::new(&plain);
    let mut states = states.to_vec();
    let values: Vec<BodyState> = states.iter().map(BodyState::value).collect();
    let mut tangents =
        sensitivity::seeded(&values, ErrorNorm::new(settings, &plain, &values).units());
    driving.forward_kinematics(&mut tangents);
    let mut next_substeps = vec![None; model.bodies.len()];
    let mut window = whole;
    for windows in 0.. {
        let left = whole.end() - window.start;
        let length = length(&search, &tangents);
        window.dt = if length < left { length } else { left };
        let values = || tangents.iter().map(BodyState::value).collect::<Vec<_>>();
        if window.dt <= SHORTEST * whole.dt.max(window.start.abs()) && window.dt < left {
            return Err(plain.stalled(&values(), window.start, window.dt));
        }
        if windows > settings.max_substeps {
            return Err(plain.too_many_substeps(&values(), window.start, settings.max_substeps));
        }
        let ContactWindow { candidates, islands } =
            ContactWindow::find(settings, &search, &tangents, window, &next_substeps)?;
        let after = match S::ORDER {
            0 => Vec::new(),
            _ => followed(model, &model.contacts_with(&candidates), &states, &islands, window)?,
        };
        for (i, (island, schedule)) in islands.iter().enumerate() {
            for (k, (place, tangent)) in island.places().zip(&schedule.states).enumerate() {
                states[place] = match after.get(i) {
                    Some(after) => after[k],
                    None => tangent.value().cast(),
                };
                tangents[place] = *tangent;
            }
            island
                .bodies
                .iter()
                .for_each(|id| next_substeps[id.index()] = Some(schedule.next_substep));
        }
        if window.dt == left {
            break;
        }
        let start = window.end();
        driving.place_bodies(&mut tangents, start);
        model.place_bodies(&mut states, start);
        window = Step { index: window.index.max(1), start, dt: left - window.dt };
    }
    Ok(states)
}

/// The states of each island after its schedule, with derivatives; `contacts` are those that they were found by.
///
/// One node is recorded for all islands, which the sweep goes through side by side: it keeps the states that a window begins
/// with, and the substeps.
fn followed<S: Scalar>(
    model: &Model<S>,
    contacts: &[ContactPair<S>],
    states: &Rows<S>,
    islands: &[(Island, Schedule)],
    window: Step,
) -> Result<Vec<Vec<BodyState<S>>>> {
    let island = |(island, schedule): &(Island, Schedule)| {
        (island.model(model, contacts), island.states(states), schedule.substeps.clone())
    };
    let parts: Vec<_> = islands.iter().map(island).collect();
    let follow = |(own, states, substeps): &(Model<S>, Vec<BodyState<S>>, Substeps)| {
        substeps.follow(own, states, window)
    };
    if !S::RECORDED {
        return Ok(parts.par_iter().map(follow).collect());
    }
    // Of a single window the caller knows better what to keep; trajectories with derivatives are no numbers that a node could keep.
    if model.contact_groups.is_empty() || model.check_trajectories().is_err() {
        return Ok(parts.iter().map(follow).collect());
    }
    let node = |(own, states, substeps): &(Model<S>, Vec<BodyState<S>>, Substeps)| {
        let template = ModelTemplate::new(substeps.clone(), own)?;
        Ok(OneStep::new(&template, own, states, window))
    };
    let nodes = parts.iter().map(node).collect::<Result<Vec<_>>>()?;
    let after = parts.iter().zip(S::recompute_each(nodes));
    after.map(|((own, states, _), moved)| Ok(with_moved(own, states, &moved?))).collect()
}

/// In what time the fastest body of a group goes as far as in a window \[s\], infinite without any.
fn length(search: &BroadPhase<'_, f64>, states: &Rows<Tangent>) -> f64 {
    let gravity = search.model().gravity.norm();
    let time = |(id, size): (BodyId, f64)| {
        TRAVEL * size / (states[id].value().linear.norm() + (gravity * size).sqrt())
    };
    search.free().map(time).fold(f64::INFINITY, f64::min)
}

/// Contacts and islands of a window.
struct ContactWindow {
    /// The contacts of groups that may touch.
    candidates: Vec<CandidateContact>,
    islands: Vec<(Island, Schedule)>,
}

impl ContactWindow {
    /// Window of `step`. Contacts are searched again where a body deviates farther from uniform motion than the search assumed;
    /// schedules of islands that stay the same are kept.
    fn find(
        settings: &Adaptive,
        search: &BroadPhase<'_, f64>,
        tangents: &Rows<Tangent>,
        step: Step,
        next_substeps: &[Option<f64>],
    ) -> Result<Self> {
        let model = search.model();
        let states: Vec<BodyState> = tangents.iter().map(BodyState::value).collect();
        let free: Vec<BodyId> = search.free().map(|(id, _)| id).collect();
        let mut deviations = search.deviations(step, SLACK);
        let mut known: HashMap<Links, Schedule> = HashMap::new();
        loop {
            let candidates = search.find(&states, &deviations, step.dt);
            let contacts = model.contacts_with(&candidates);
            let watched = |island: &Island| {
                let free = |id: &BodyId| free.binary_search(id).is_ok();
                let bodies = island.bodies.iter().enumerate().filter(|(_, id)| free(id));
                bodies.map(|(own, id)| (BodyId(own), *id)).collect::<Vec<_>>()
            };
            let find = |(island, known): (&Island, Option<Schedule>)| {
                if let Some(schedule) = known {
                    return Ok(schedule);
                }
                let first = island.bodies.iter().filter_map(|id| next_substeps[id.index()]);
                let first = first.min_by(f64::total_cmp);
                let own = island.model(model, &contacts);
                let watched: Vec<BodyId> = watched(island).iter().map(|(own, _)| *own).collect();
                Schedule::find(settings, own, island.states(tangents), step, first, &watched)
            };
            let islands = Island::all(model, &contacts);
            let links = |island: &Island| island.links(model.contacts.len(), &candidates);
            let known_before: Vec<_> = islands.iter().map(|i| known.remove(&links(i))).collect();
            let found = islands.iter().zip(known_before);
            // A few are not worth the threads.
            let schedules: Vec<_> = match islands.len() {
                0..4 => found.map(find).collect(),
                _ => found.collect::<Vec<_>>().into_par_iter().map(find).collect(),
            };
            let schedules = schedules.into_iter().collect::<Result<Vec<Schedule>, _>>()?;
            let mut complete = true;
            for (island, schedule) in islands.iter().zip(&schedules) {
                for ((_, id), deviation) in watched(island).into_iter().zip(&schedule.deviations) {
                    let looked_for = &mut deviations[id.index()];
                    if deviation > looked_for {
                        (*looked_for, complete) = (MARGIN * deviation, false);
                    }
                }
            }
            let islands = islands.into_iter().zip(schedules);
            if complete {
                return Ok(Self { candidates, islands: islands.collect() });
            }
            known = islands.map(|(island, schedule)| (links(&island), schedule)).collect();
        }
    }
}
