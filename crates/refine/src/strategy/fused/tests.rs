use std::sync::{Arc, LazyLock};

use nalgebra::{Isometry3, Translation3, Vector3};

use super::*;
use crate::evaluate::metrics::{oe_deg, pe_cm};
use crate::scene::{Scene, default_scene};

static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).unwrap());

fn turned(twist: &[f64; 6]) -> State {
    let state = State::new(&SCENE.observation, &SCENE.object, &SCENE.truth).unwrap();
    state.moved(Block::ObjectPose, twist)
}

fn run(
    observation: &Observation,
    robot: Option<&Arc<Hand>>,
    start: &State,
    settings: FusedSettings,
) -> (Isometry3<f64>, Posterior) {
    let start = State::new(observation, &SCENE.object, &start.t_cam_object).unwrap();
    let mut last = start.t_cam_object;
    let fused = Fused { settings };
    let (_, confidence) = fused
        .run(observation, &SCENE.object, robot, start, |state, _| {
            last = state.t_cam_object;
            true
        })
        .unwrap();
    assert_eq!(last, confidence.hypotheses[0].t_cam_object);
    (last, confidence)
}

/// Settings with all evidence but one kind.
fn without(kind: Evidence) -> FusedSettings {
    FusedSettings {
        evidence: Evidence::ALL.into_iter().filter(|e| *e != kind).collect(),
        ..FusedSettings::default()
    }
}

const OFF: [f64; 6] = [6e-3, -5e-3, 8e-3, 0.1, -0.08, 0.12];

fn errors(pose: &Isometry3<f64>) -> (f64, f64) {
    (pe_cm(pose, &SCENE.truth), oe_deg(pose, &SCENE.truth))
}

#[test]
fn exact_calibrations_are_recognized_and_errors_are_as_large_as_promised() {
    let (pose, confidence) =
        run(&SCENE.observation, Some(&SCENE.robot), &turned(&OFF), FusedSettings::default());
    let (pe, oe) = errors(&pose);
    assert!(pe < 0.05 && oe < 0.5, "{pe} cm, {oe}°");
    let covariance = confidence.covariance();
    let deviation = covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
    // Nuisances of millimeters have not been left open.
    assert!(deviation < 5e-4, "{deviation} m");
    assert!(confidence.mahalanobis(&SCENE.truth) < 6.0);
    assert!(confidence.probability_within(5e-3, 0.09) > 0.99);
    let (near, far) =
        (confidence.probability_within(1e-5, 1.0), confidence.probability_within(1e-3, 1.0));
    assert!(near < far, "{near} {far}");
}

#[test]
fn calibrations_that_are_off_are_estimated() {
    let mut observation = SCENE.observation.clone();
    let off = Vector3::new(3e-3, -2e-3, 2e-3);
    if let Some(hand) = &mut observation.hand {
        hand.t_cam_hand = Translation3::from(off) * hand.t_cam_hand;
        hand.joints.iter_mut().enumerate().for_each(|(i, q)| *q += 0.01 * (i as f64).cos());
    }
    let start = turned(&OFF);
    let (pose, confidence) =
        run(&observation, Some(&SCENE.robot), &start, FusedSettings::default());
    let believed = FusedSettings { nuisances: Vec::new(), ..FusedSettings::default() };
    let (naive, _) = run(&observation, Some(&SCENE.robot), &start, believed);
    let ((pe, oe), (naive, _)) = (errors(&pose), errors(&naive));
    assert!(pe < 0.15 && oe < 1.5 && pe < naive, "{pe} cm, {oe}°, believing all {naive} cm");
    let deviation = confidence.covariance().fixed_view::<3, 3>(0, 0).trace().sqrt();
    assert!(deviation > 5e-4, "{deviation} m");
}

#[test]
fn every_sense_may_be_absent() {
    let start = turned(&OFF);
    let changed = |change: &dyn Fn(&mut Observation)| {
        let mut observation = SCENE.observation.clone();
        change(&mut observation);
        run(&observation, Some(&SCENE.robot), &start, FusedSettings::default()).0
    };
    let poses = [
        ("touch", changed(&|o| o.hand.as_mut().unwrap().forces.clear())),
        ("hand", changed(&|o| o.hand = None)),
        ("gravity", changed(&|o| o.gravity = None)),
        ("depth", changed(&|o| o.depth.pixels_mut().fill(0.0))),
        ("color", changed(&|o| o.color.pixels_mut().fill([0.5; 3]))),
    ];
    for (sense, pose) in poses {
        let (pe, oe) = errors(&pose);
        assert!(pe < 0.5 && oe < 4.0, "without {sense}: {pe} cm, {oe}°");
    }
    let (pose, _) = run(&SCENE.observation, Some(&SCENE.robot), &start, without(Evidence::Color));
    assert!(errors(&pose).0 < 0.3);
}

#[test]
fn exactness_is_not_believed_where_little_speaks_for_it() {
    let exact = |robot, settings| run(&SCENE.observation, robot, &turned(&OFF), settings).1.exact;
    assert!(exact(Some(&SCENE.robot), FusedSettings::default()));
    assert!(!exact(Some(&SCENE.robot), without(Evidence::HandDepth)));
    assert!(!exact(None, FusedSettings::default()));
}

#[test]
fn a_pose_that_senses_disagree_about_is_not_sure() {
    let mut observation = SCENE.observation.clone();
    if let Some(hand) = &mut observation.hand {
        hand.t_cam_hand = Translation3::new(0.0, 0.0, 0.05) * hand.t_cam_hand;
    }
    let (pose, confidence) =
        run(&observation, Some(&SCENE.robot), &turned(&OFF), FusedSettings::default());
    println!("{:?} {:?} {}", errors(&pose), confidence.disagreements, confidence.probability());
    assert!(!confidence.disagreements.is_empty());
    assert!(confidence.probability() < 0.5);
}

#[test]
fn a_solve_that_is_cut_short_is_not_sure() {
    let of = |iterations| {
        let mut settings = FusedSettings { exactness: iterations == 0, ..Default::default() };
        settings.stages.iter_mut().for_each(|stage| stage.iterations = iterations);
        run(&SCENE.observation, Some(&SCENE.robot), &turned(&OFF), settings).1
    };
    assert!(!of(0).exact);
    let (hasty, whole) = (of(1), of(10));
    println!("{} {}", hasty.mahalanobis(&SCENE.truth), whole.mahalanobis(&SCENE.truth));
    assert!(hasty.mahalanobis(&SCENE.truth) < 5.0);
    let widest = |confidence: &Posterior| confidence.widest(SCENE.object.radius);
    assert!(widest(&hasty) > widest(&whole));
}

#[test]
fn threads_make_no_difference() {
    let of = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            run(&SCENE.observation, Some(&SCENE.robot), &turned(&OFF), FusedSettings::default())
        })
    };
    assert_eq!(of(1), of(3));
}

#[test]
fn what_nothing_is_seen_of_is_said_to_be_unobserved() {
    let settings =
        FusedSettings { evidence: vec![Evidence::Silhouette], ..FusedSettings::default() };
    let (_, confidence) = run(&SCENE.observation, None, &turned(&[0.0; 6]), settings);
    // The outline of a bottle says little of how it is turned about its axis, and of its distance.
    assert!(!confidence.unobserved.is_empty());
    let (_, all) =
        run(&SCENE.observation, Some(&SCENE.robot), &turned(&OFF), FusedSettings::default());
    assert!(all.unobserved.is_empty(), "{:?}", all.unobserved);
}
