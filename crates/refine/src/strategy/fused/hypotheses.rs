//! Where solves start, and which of their ends are the same.

use std::f64::consts::PI;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use prehend_autodiff::lie::so3_log;

use super::posterior::principal_directions;
use super::settings::HypothesisSettings;
use crate::factor::NoiseEstimate;
use crate::problem::{Block, Linearization, Solution, State};
use crate::scene::Object;
use crate::symmetry::alternatives;

/// The initial state, and those turned by `angle` \[rad\] about each axis of the camera frame, both ways; that alone if it is zero.
pub(super) fn restarts(initial: &State, angle: f64) -> Vec<State> {
    let mut starts = vec![initial.clone()];
    if angle > 0.0 {
        for axis in 0..3 {
            for turn in [angle, -angle] {
                let mut twist = [0.0; 6];
                twist[3 + axis] = turn;
                starts.push(initial.retract(&[Block::ObjectPose], &twist));
            }
        }
    }
    starts
}

/// The initial state, and the same with the object at each of the poses `others` \[m\] that differ from it and are in front of the camera.
pub(super) fn hypotheses(initial: &State, others: &[Isometry3<f64>]) -> Vec<State> {
    let at = |pose: &Isometry3<f64>| State { t_cam_object: *pose, ..initial.clone() };
    let seen = others.iter().map(at).filter(|state| state.center().z > 0.0);
    let differs = |state: &State| state.t_cam_object != initial.t_cam_object;
    std::iter::once(initial.clone()).chain(seen.filter(differs)).collect()
}

/// Other rotations that files of other conventions have in place of `rotation`: half a turn about each axis of the model, and the transpose if that is
/// `another` \[rad\].
pub(super) fn conventions(
    rotation: &UnitQuaternion<f64>,
    another: f64,
) -> Vec<UnitQuaternion<f64>> {
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let mut all = axes.map(|axis| rotation * UnitQuaternion::from_axis_angle(&axis, PI)).to_vec();
    let transposed = rotation.inverse();
    if all.iter().chain([rotation]).all(|other| transposed.angle_to(other) > another) {
        all.push(transposed);
    }
    all
}

/// `state` with the object turned to each of `rotations` about its center, where that is `another` \[rad\] than it is turned there or by those before.
pub(super) fn with_rotations(
    state: &State,
    rotations: &[UnitQuaternion<f64>],
    another: f64,
) -> Vec<State> {
    let mut states: Vec<State> = Vec::new();
    for rotation in rotations {
        let is_other = |known: &State| rotation.angle_to(&known.t_cam_object.rotation) > another;
        if states.iter().chain([state]).all(is_other) {
            states.push(State { t_cam_object: state.rotated_to(rotation), ..state.clone() });
        }
    }
    states
}

/// `states` after the `motions` in object coordinates that turn the object otherwise than all of `states` and than each other.
pub(super) fn turned(states: &[State], motions: &[Isometry3<f64>]) -> Vec<State> {
    let poses: Vec<_> = states.iter().map(|state| state.t_cam_object).collect();
    let of = |(from, t_cam_object): (usize, _)| State { t_cam_object, ..states[from].clone() };
    alternatives(&poses, motions).into_iter().map(of).collect()
}

/// The `count` of `states` with the lowest `costs`, in order of cost.
pub(super) fn lowest(states: &[State], costs: &[f64], count: usize) -> Vec<State> {
    let mut order: Vec<usize> = (0..states.len()).collect();
    order.sort_by(|&a, &b| costs[a].total_cmp(&costs[b]));
    order.into_iter().take(count).map(|k| states[k].clone()).collect()
}

/// True if `point` leaves no direction open by more than `width` \[m of surface motion\], and depth scatters by less than `scatter` \[m\] about the surface.
pub(super) fn settled(
    point: &Linearization,
    noise: impl FnOnce() -> Option<NoiseEstimate>,
    radius: f64,
    [width, scatter]: [f64; 2],
) -> bool {
    let widest = principal_directions(point, radius)[0].1;
    widest < width && noise().is_some_and(|noise| noise.sigma < scatter)
}

/// Solutions of which no two are the same pose, `same` \[m of surface motion\] apart, the one of the lowest value first.
pub(super) fn distinct(mut found: Vec<Solution>, object: &Object, same: f64) -> Vec<Solution> {
    found.sort_by(|a, b| a.at.cost.total_cmp(&b.at.cost));
    let mut kept: Vec<Solution> = Vec::new();
    for solution in found {
        let pose = &solution.at.state.t_cam_object;
        let is_same =
            |other: &Solution| object.surface_motion(pose, &other.at.state.t_cam_object) < same;
        if !kept.iter().any(is_same) {
            kept.push(solution);
        }
    }
    kept
}

/// At most `count` states along the directions in which the posterior about `point` is open so far, the widest first: at multiples of
/// [`HypothesisSettings::spacing`] from where such a direction comes nearest to `initial`.
///
/// Geometry that leaves a turn open drifts along it, tens of degrees from where the initial pose was, so that is where to look first. And some
/// deviations wide ([`HypothesisSettings::reach`]), since first solutions of hardly any difference in value lie farther apart than the curvature about the best of them has it.
pub(super) fn spread(
    point: &Linearization,
    initial: &State,
    settings: &HypothesisSettings,
    radius: f64,
    count: usize,
) -> Vec<State> {
    let &HypothesisSettings { spacing: distance, reach, .. } = settings;
    let state = &point.state;
    let moved = initial.center() - state.center();
    let turned = so3_log(&(initial.t_cam_object.rotation * state.t_cam_object.rotation.inverse()));
    let mut states = Vec::new();
    for (twist, deviation) in principal_directions(point, radius) {
        let (place, turn) = (twist.fixed_rows::<3>(0), twist.fixed_rows::<3>(3));
        // The direction is a unit vector where turns count as what they move the surface by.
        let nearest = place.dot(&moved) + radius * radius * turn.dot(&turned);
        let reach = ((reach * deviation / distance) as i32).min(reach as i32);
        if reach == 0 {
            break;
        }
        let steps = std::iter::once(0).chain((1..=reach).flat_map(|step| [step, -step]));
        for step in steps {
            let along = nearest + distance * f64::from(step);
            if along.abs() > 0.5 * distance {
                states.push(state.retract(&[Block::ObjectPose], (twist * along).as_slice()));
            }
        }
    }
    states.truncate(count);
    states
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::scene::{Frame, PreparedFrame, default_scene};

    #[test]
    fn hypotheses_are_in_front_of_the_camera_and_the_cheapest_come_first() {
        let scene = default_scene(1).unwrap();
        let bare = Frame { hand: None, ..scene.frame.clone() };
        let frame = PreparedFrame::new(&bare, &scene.object).unwrap();
        let initial = State::new(&frame, &scene.initial).unwrap();
        let behind = Isometry3::translation(0.0, 0.0, -1.0);
        let states = hypotheses(&initial, &[scene.initial, behind, scene.truth]);
        assert_eq!(states.len(), 2);
        assert_eq!(states[1].t_cam_object, scene.truth);
        let half = Isometry3::rotation(Vector3::z() * std::f64::consts::PI);
        let turned = turned(&states, &[half]);
        let poses: Vec<_> = turned.iter().map(|state| state.t_cam_object).collect();
        assert_eq!(poses, [scene.initial * half, scene.truth * half]);
        let first = lowest(&[states, turned].concat(), &[3.0, 1.0, 2.0, 4.0], 2);
        let poses: Vec<_> = first.iter().map(|state| state.t_cam_object).collect();
        assert_eq!(poses, [scene.truth, scene.initial * half]);
    }
}
