//! The whole system on the built-in scene.

use std::sync::LazyLock;

use nalgebra::Vector6;
use prehend::autodiff::lie::perturb_about;
use prehend::refine::baselines::{GradientKind, Heuristic};
use prehend::refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend::refine::scene::{Scene, default_scene};
use prehend::refine::strategy::Fused;
use prehend::refine::{Estimate, PreparedFrame, RefineError, Strategy, refine};

static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).expect("the built-in scene"));

fn frame() -> PreparedFrame<'static> {
    PreparedFrame::new(&SCENE.frame, &SCENE.object).expect("the frame fits")
}

fn run(strategy: &dyn Strategy) -> Result<Estimate, RefineError> {
    refine(&frame(), &SCENE.initial, strategy)
}

#[test]
fn the_pose_is_found() {
    let (fused, combined) = (Fused::default(), Heuristic::combined());
    let strategies: [&dyn Strategy; 2] = [&fused, &combined];
    for (name, strategy) in ["fused", "combined"].iter().zip(strategies) {
        let pose = *run(strategy).unwrap().t_cam_object();
        let (pe, oe) = (pe_cm(&pose, &SCENE.truth), oe_deg(&pose, &SCENE.truth));
        assert!(pe < 0.1 && oe < 1.5, "{name}: {pe} cm, {oe}°");
    }
}

#[test]
fn every_gradient_lowers_its_own_cost() {
    // Some millimeters and degrees off: far inside the hand, contact alone knows no way out.
    let delta = Vector6::new(3e-3, -2e-3, 4e-3, 0.04, -0.03, 0.05);
    let start = perturb_about(&SCENE.truth, &(SCENE.truth * SCENE.object.center).coords, &delta);
    for kind in GradientKind::ALL {
        let alone = Heuristic { iterations: 40, ..Heuristic::of(&[kind]) };
        let trace = refine(&frame(), &start, &alone).unwrap().trace;
        let value = |i: usize| trace.iterations[i].values[0];
        let last = trace.iterations.len() - 1;
        println!("{kind}: {} to {}", value(0), value(last));
        assert!(value(last) < 0.9 * value(0), "{kind}: {} to {}", value(0), value(last));
    }
}

#[test]
fn the_checkpoint_is_the_pose_of_lowest_rendering_cost() {
    let refined = run(&Heuristic::combined()).unwrap();
    let rendering = refined.trace.terms.iter().position(|t| t == "rendering").unwrap();
    let value = |i: &prehend::refine::strategy::Iteration| i.values[rendering];
    let lowest = refined.trace.iterations.iter().map(value).fold(f64::INFINITY, f64::min);
    assert_eq!(value(&refined.trace.iterations[refined.iteration]), lowest);
}

#[test]
fn poses_are_the_same_for_any_number_of_threads() {
    let short = Heuristic { iterations: 12, ..Heuristic::combined() };
    let poses = [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let pose = *pool.install(|| run(&short)).unwrap().t_cam_object();
        (pose.translation.vector, *pose.rotation.quaternion())
    });
    assert_eq!(poses[0], poses[1]);
    assert_eq!(poses[0], poses[2]);
}

#[test]
fn without_a_hand_vision_alone_still_works() {
    let mut observation = SCENE.frame.clone();
    (observation.hand, observation.gravity) = (None, None);
    let frame = PreparedFrame::new(&observation, &SCENE.object).unwrap();
    let vision = Heuristic::of(&[GradientKind::Rendering, GradientKind::Depth]);
    let strategies: [&dyn Strategy; 2] = [&vision, &Fused::default()];
    for strategy in strategies {
        let refined = refine(&frame, &SCENE.initial, strategy).unwrap();
        assert!(pe_cm(refined.t_cam_object(), &SCENE.truth) < 0.5);
    }
    let all = refine(&frame, &SCENE.initial, &Heuristic::combined());
    assert!(matches!(all, Err(RefineError::Missing { .. })));
}

#[test]
fn unusable_poses_are_refused() {
    let refuse = |initial| refine(&frame(), &initial, &Fused::default()).unwrap_err();
    let mut behind = SCENE.initial;
    behind.translation.z = -0.4;
    assert!(matches!(refuse(behind), RefineError::BehindCamera { .. }));
    let mut broken = SCENE.initial;
    broken.translation.x = f64::NAN;
    assert!(matches!(refuse(broken), RefineError::NotFinite));
}
