//! The baselines: the paper's ICP and the robust one.

use std::ops::ControlFlow;

use nalgebra::Isometry3;
use prehend_refine::baselines::Icp;
use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::problem::Block;
use prehend_refine::scene::{Scene, default_scene};
use prehend_refine::{PreparedFrame, RefineError, State, Strategy};

#[test]
fn it_descends_and_its_own_optimum_is_not_the_truth() {
    let scene = default_scene(1).unwrap();
    let frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
    let start = State::new(&frame, &scene.truth).unwrap();
    let start = start.retract(&[Block::ObjectPose], &[4e-3, -3e-3, 5e-3, 0.05, 0.0, 0.04]);
    let found = Icp::default().run(&frame, &start, &mut |_| ControlFlow::Continue(())).unwrap();
    let values: Vec<f64> = found.trace.iterations.iter().map(|i| i.values[0]).collect();
    // Closest points are matched anew at each step, so the value hardly ever rises.
    assert!(values.windows(2).all(|v| v[1] <= v[0] * (1.0 + 1e-3)), "{values:?}");
    assert!(values[values.len() - 1] < 0.9 * values[0]);
    let pose = found.t_cam_object();
    let (pe, oe) = (pe_cm(pose, &scene.truth), oe_deg(pose, &scene.truth));
    // Matched with what cannot be seen, it leaves even a good pose.
    assert!(pe > 0.5 && pe < 10.0, "{pe} cm, {oe}°");
}

#[test]
fn no_depth_is_an_error() {
    let scene = default_scene(1).unwrap();
    let mut observation = scene.frame.clone();
    observation.depth.pixels_mut().fill(0.0);
    let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
    let start = State::new(&frame, &scene.truth).unwrap();
    let refused = Icp::default().run(&frame, &start, &mut |_| ControlFlow::Continue(()));
    assert!(matches!(refused, Err(RefineError::NoDepth)));
}

/// Where a strategy ends that begins `offset` from the truth, and in how many iterations.
fn found(strategy: &dyn Strategy, scene: &Scene, offset: &[f64; 6]) -> (Isometry3<f64>, usize) {
    let frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
    let truth = State::new(&frame, &scene.truth).unwrap();
    let start = truth.retract(&[Block::ObjectPose], offset);
    let found = strategy.run(&frame, &start, &mut |_| ControlFlow::Continue(())).unwrap();
    (*found.t_cam_object(), found.trace.iterations.len())
}

#[test]
fn small_offsets_are_undone() {
    let scene = default_scene(1).unwrap();
    for offset in [[5e-3, 0.0, 0.0, 0.0, 0.08, 0.0], [0.0, -6e-3, 4e-3, 0.06, 0.0, -0.05]] {
        let (found, iterations) = found(&Icp::robust(), &scene, &offset);
        let (pe, oe) = (pe_cm(&found, &scene.truth), oe_deg(&found, &scene.truth));
        assert!(pe < 0.1 && oe < 1.0, "{pe} cm, {oe}°");
        assert_eq!(iterations, 61);
    }
}

#[test]
fn it_beats_the_weak_baseline() {
    let scene = default_scene(2).unwrap();
    let offset = [5e-3, 4e-3, -4e-3, 0.05, -0.04, 0.03];
    let (weak, _) = found(&Icp::default(), &scene, &offset);
    let (strong, _) = found(&Icp::robust(), &scene, &offset);
    assert!(pe_cm(&strong, &scene.truth) < 0.3 * pe_cm(&weak, &scene.truth));
}
