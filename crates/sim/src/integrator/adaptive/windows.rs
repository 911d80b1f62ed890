//! Steps of many bodies: those that cannot touch each other for a while move on by themselves.

use prehend_autodiff::Scalar;
use rayon::prelude::*;

use super::Adaptive;
use super::course::Course;
use super::error_norm::ErrorNorm;
use super::islands::Island;
use super::planner::Probe;
use super::probe;
use crate::error::SimulationError;
use crate::state::State;
use crate::time::Step;
use crate::world::World;
use crate::world::body_id::BodyId;
use crate::world::neighbors::{NeighborSearch, Neighbors};

/// How far the fastest body goes in a window, in parts of its size.
const TRAVEL: f64 = 0.25;
/// Shortest window, in parts of the step.
const SHORTEST: f64 = 1e-9;

/// The states after `whole`.
///
/// A step is divided into windows. Within one, no body comes farther than contacts were looked for at its start, so that bodies
/// which no contact links are islands, each with parts of its own. Without groups of contacts the whole step is one window.
pub(super) fn step<S: Scalar>(
    settings: &Adaptive,
    world: &World<S>,
    states: &[State<S>],
    whole: Step,
) -> Result<Vec<State<S>>, SimulationError> {
    let plain = world.plain();
    let driving = plain.lift::<Probe>();
    let search = NeighborSearch::new(&plain);
    let mut states = states.to_vec();
    let values: Vec<State> = states.iter().map(State::value).collect();
    let mut probes = probe::seeded(&values, &ErrorNorm::new(settings, &plain, &values));
    let mut next_parts = vec![None; world.bodies.len()];
    let mut window = whole;
    loop {
        let left = whole.end() - window.start;
        let length = length(&search, &probes);
        window.dt = if length < left { length } else { left };
        let Window { neighbors, islands, dt } =
            Window::find(settings, &search, &probes, window, &next_parts, whole.dt)?;
        window.dt = dt;
        let contacts = if S::ORDER == 0 { Vec::new() } else { world.contacts_with(&neighbors) };
        for (island, course) in &islands {
            let after = match S::ORDER {
                0 => course.states.iter().map(|state| state.value().lift()).collect(),
                _ => {
                    let own = island.world(world, &contacts);
                    course.follow(&own, &island.states(&states), window)
                }
            };
            for ((place, after), probe) in island.places().zip(after).zip(&course.states) {
                (states[place], probes[place]) = (after, *probe);
            }
            island.bodies.iter().for_each(|id| next_parts[id.index()] = Some(course.next_part));
        }
        if dt == left {
            return Ok(states);
        }
        let start = window.end();
        driving.drive(&mut probes, start);
        world.drive(&mut states, start);
        window = Step { index: window.index.max(1), start, dt: left - dt };
    }
}

/// In what time the fastest body of a group goes as far as contacts are looked for \[s\], infinite without any.
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
    /// Its length \[s\].
    dt: f64,
}

impl Window {
    /// The longest of the lengths of `step`, a half of it, … in which no body comes farther than contacts were looked for; an error
    /// if it would have to be next to nothing of `whole` \[s\].
    fn find(
        settings: &Adaptive,
        search: &NeighborSearch<'_, f64>,
        probes: &[State<Probe>],
        mut step: Step,
        next_parts: &[Option<f64>],
        whole: f64,
    ) -> Result<Self, SimulationError> {
        let world = search.world();
        let states: Vec<State> = probes.iter().map(State::value).collect();
        let free: Vec<BodyId> = search.free().map(|(id, _)| id).collect();
        loop {
            let travels = search.travels(&states, step);
            let neighbors = search.find(&states, &travels);
            let contacts = world.contacts_with(&neighbors);
            let islands = Island::all(world, &contacts);
            let find = |island: &Island| {
                let limit = |(own, id): (usize, &BodyId)| {
                    let limited = free.binary_search(id).is_ok();
                    limited.then_some((BodyId(own), travels[id.index()]))
                };
                let limits: Vec<_> = island.bodies.iter().enumerate().filter_map(limit).collect();
                let first = island.bodies.iter().filter_map(|id| next_parts[id.index()]);
                let first = first.min_by(f64::total_cmp);
                let own = island.world(world, &contacts);
                Course::find(settings, own, island.states(probes), step, first, &limits)
            };
            // A few are not worth the threads.
            let courses: Vec<_> = match islands.len() {
                0..4 => islands.iter().map(find).collect(),
                _ => islands.par_iter().map(find).collect(),
            };
            let courses = courses.into_iter().collect::<Result<Option<Vec<Course>>, _>>()?;
            if let Some(courses) = courses {
                let islands = islands.into_iter().zip(courses).collect();
                return Ok(Self { neighbors, islands, dt: step.dt });
            }
            if step.dt < SHORTEST * whole {
                let near = world.with_touching(&states, 0.0);
                return Err(near.stalled(&states, step.start, step.dt));
            }
            step.dt *= 0.5;
        }
    }
}
