//! Steps of many bodies: those that cannot touch each other for a while move on by themselves.

use std::collections::HashMap;

use prehend_autodiff::Scalar;
use rayon::prelude::*;

use super::Adaptive;
use super::course::{Course, Parts};
use super::error_norm::ErrorNorm;
use super::islands::{Island, Links};
use super::planner::SHORTEST;
use super::probe::{self, Probe};
use crate::adjoint::{OneStep, Scene, with_moved};
use crate::error::SimulationError;
use crate::state::State;
use crate::time::Step;
use crate::world::World;
use crate::world::body_id::BodyId;
use crate::world::contact_pair::ContactPair;
use crate::world::neighbors::{NeighborSearch, Neighbors};

/// How far the fastest body goes in a window, in parts of its size.
const TRAVEL: f64 = 0.35;
/// How far a body is first looked for from where it would be if nothing pushed it, in parts of its size: where that is too little
/// it is seen, and costs less than an island that is too large.
const SLACK: f64 = 1e-3;
/// How much farther than it came a body is looked for.
const MARGIN: f64 = 1.25;

/// The states after `whole`.
///
/// A step is divided into windows. Within one, no body comes farther from uniform motion than contacts were looked for, so that
/// bodies which no contact links are islands, each with parts of its own. Without groups of contacts the whole step is one window.
pub(super) fn step<S: Scalar>(
    settings: &Adaptive,
    world: &World<S>,
    states: &[State<S>],
    whole: Step,
) -> Result<Vec<State<S>>, SimulationError> {
    let plain = world.plain();
    let driving = plain.cast::<Probe>();
    let search = NeighborSearch::new(&plain);
    let mut states = states.to_vec();
    let values: Vec<State> = states.iter().map(State::value).collect();
    let mut probes = probe::seeded(&values, ErrorNorm::new(settings, &plain, &values).units());
    driving.forward_kinematics(&mut probes);
    let mut next_parts = vec![None; world.bodies.len()];
    let mut window = whole;
    for windows in 0.. {
        let left = whole.end() - window.start;
        let length = length(&search, &probes);
        window.dt = if length < left { length } else { left };
        let values = || probes.iter().map(State::value).collect::<Vec<_>>();
        if window.dt <= SHORTEST * whole.dt.max(window.start.abs()) && window.dt < left {
            return Err(plain.stalled(&values(), window.start, window.dt));
        }
        if windows > settings.max_substeps {
            return Err(plain.too_many_substeps(&values(), window.start, settings.max_substeps));
        }
        let Window { neighbors, islands } =
            Window::find(settings, &search, &probes, window, &next_parts)?;
        let after = match S::ORDER {
            0 => Vec::new(),
            _ => followed(world, &world.contacts_with(&neighbors), &states, &islands, window)?,
        };
        for (i, (island, course)) in islands.iter().enumerate() {
            for (k, (place, probe)) in island.places().zip(&course.states).enumerate() {
                states[place] = match after.get(i) {
                    Some(after) => after[k],
                    None => probe.value().cast(),
                };
                probes[place] = *probe;
            }
            island.bodies.iter().for_each(|id| next_parts[id.index()] = Some(course.next_part));
        }
        if window.dt == left {
            break;
        }
        let start = window.end();
        driving.update_kinematics(&mut probes, start);
        world.update_kinematics(&mut states, start);
        window = Step { index: window.index.max(1), start, dt: left - window.dt };
    }
    Ok(states)
}

/// The states of each island after its course, with derivatives; `contacts` are those that they were found by.
///
/// What is recorded is one node for all islands, which the sweep goes through side by side: it keeps the states that a window begins
/// with, and the parts.
fn followed<S: Scalar>(
    world: &World<S>,
    contacts: &[ContactPair<S>],
    states: &[State<S>],
    islands: &[(Island, Course)],
    window: Step,
) -> Result<Vec<Vec<State<S>>>, SimulationError> {
    let island = |(island, course): &(Island, Course)| {
        (island.world(world, contacts), island.states(states), course.parts.clone())
    };
    let worlds: Vec<_> = islands.iter().map(island).collect();
    let follow =
        |(own, states, parts): &(World<S>, Vec<State<S>>, Parts)| parts.follow(own, states, window);
    if !S::RECORDED {
        return Ok(worlds.par_iter().map(follow).collect());
    }
    // Of a single window the caller knows better what to keep; trajectories with derivatives are no numbers that a node could keep.
    if world.contact_groups.is_empty() || world.check_trajectories().is_err() {
        return Ok(worlds.iter().map(follow).collect());
    }
    let node = |(own, states, parts): &(World<S>, Vec<State<S>>, Parts)| {
        let scene = Scene::new(parts.clone(), own)?;
        Ok(OneStep::new(&scene, own, states, window))
    };
    let nodes = worlds.iter().map(node).collect::<Result<Vec<_>, SimulationError>>()?;
    let after = worlds.iter().zip(S::recompute_each(nodes));
    after.map(|((own, states, _), moved)| Ok(with_moved(own, states, &moved?))).collect()
}

/// In what time the fastest body of a group goes as far as in a window \[s\], infinite without any.
fn length(search: &NeighborSearch<'_, f64>, states: &[State<Probe>]) -> f64 {
    let gravity = search.world().gravity.norm();
    let time = |(id, size): (BodyId, f64)| {
        TRAVEL * size / (states[id].value().linear.norm() + (gravity * size).sqrt())
    };
    search.free().map(time).fold(f64::INFINITY, f64::min)
}

/// What happens in a window.
struct Window {
    /// The contacts of groups that may touch.
    neighbors: Vec<Neighbors>,
    islands: Vec<(Island, Course)>,
}

impl Window {
    /// Of `step`. Where a body comes farther from uniform motion than contacts were looked for, they are looked for again; courses of
    /// islands which that leaves alone are kept.
    fn find(
        settings: &Adaptive,
        search: &NeighborSearch<'_, f64>,
        probes: &[State<Probe>],
        step: Step,
        next_parts: &[Option<f64>],
    ) -> Result<Self, SimulationError> {
        let world = search.world();
        let states: Vec<State> = probes.iter().map(State::value).collect();
        let free: Vec<BodyId> = search.free().map(|(id, _)| id).collect();
        let mut deviations = search.deviations(step, SLACK);
        let mut known: HashMap<Links, Course> = HashMap::new();
        loop {
            let neighbors = search.find(&states, &deviations, step.dt);
            let contacts = world.contacts_with(&neighbors);
            let watched = |island: &Island| {
                let free = |id: &BodyId| free.binary_search(id).is_ok();
                let bodies = island.bodies.iter().enumerate().filter(|(_, id)| free(id));
                bodies.map(|(own, id)| (BodyId(own), *id)).collect::<Vec<_>>()
            };
            let find = |(island, known): (&Island, Option<Course>)| {
                if let Some(course) = known {
                    return Ok(course);
                }
                let first = island.bodies.iter().filter_map(|id| next_parts[id.index()]);
                let first = first.min_by(f64::total_cmp);
                let own = island.world(world, &contacts);
                let watched: Vec<BodyId> = watched(island).iter().map(|(own, _)| *own).collect();
                Course::find(settings, own, island.states(probes), step, first, &watched)
            };
            let islands = Island::all(world, &contacts);
            let links = |island: &Island| island.links(world.contacts.len(), &neighbors);
            let known_before: Vec<_> = islands.iter().map(|i| known.remove(&links(i))).collect();
            let found = islands.iter().zip(known_before);
            // A few are not worth the threads.
            let courses: Vec<_> = match islands.len() {
                0..4 => found.map(find).collect(),
                _ => found.collect::<Vec<_>>().into_par_iter().map(find).collect(),
            };
            let courses = courses.into_iter().collect::<Result<Vec<Course>, _>>()?;
            let mut complete = true;
            for (island, course) in islands.iter().zip(&courses) {
                for ((_, id), deviation) in watched(island).into_iter().zip(&course.deviations) {
                    let looked_for = &mut deviations[id.index()];
                    if deviation > looked_for {
                        (*looked_for, complete) = (MARGIN * deviation, false);
                    }
                }
            }
            let islands = islands.into_iter().zip(courses);
            if complete {
                return Ok(Self { neighbors, islands: islands.collect() });
            }
            known = islands.map(|(island, course)| (links(&island), course)).collect();
        }
    }
}
