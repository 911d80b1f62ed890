//! The numbers of a rollout, a picture, a refinement and a rig are always the same: to 10⁻⁹ everywhere, and with `PREHEND_GOLDEN_BITS=1` bit by
//! bit, which holds for processors and systems like those of whoever kept them. `PREHEND_WRITE_GOLDEN=1` keeps new ones, where a change is meant.

#![allow(clippy::unwrap_used)] // a test may panic; helpers outside test functions count as code to the lint

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_autodiff::lie::lift;
use prehend_autodiff::{Scalar, Var, gradient};
use prehend_geometry::shapes;
use prehend_refine::baselines::Heuristic;
use prehend_refine::calibration::{CalibrationFrame, Calibrator, CalibratorSettings, Pass};
use prehend_refine::scene::{default_scene, default_sequence};
use prehend_refine::strategy::Fused;
use prehend_refine::{PreparedFrame, Strategy, refine};
use prehend_reliability::scene::body_over_floor;
use prehend_render::{Camera, Light, RenderModel, Renderer, Scene, SceneVars};
use prehend_sim::{BodyState, State};

/// Relative to the largest number of its kind.
const TOLERANCE: f64 = 1e-9;

/// Functions like the sine come with the system, fused products with the processor.
fn needs_the_same_bits() -> bool {
    std::env::var_os("PREHEND_GOLDEN_BITS").is_some()
}

/// Compares `found`, numbers by their kind, with those that are kept under `name`.
fn compare(name: &str, found: &[(&str, Vec<f64>)]) {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{name}.txt"));
    if std::env::var_os("PREHEND_WRITE_GOLDEN").is_some() {
        let mut text = String::new();
        for (kind, numbers) in found {
            // The shortest decimals that are read back as the same bits.
            numbers.iter().for_each(|number| writeln!(text, "{kind} {number:?}").unwrap());
        }
        return std::fs::write(file, text).unwrap();
    }
    let mut kept: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for line in std::fs::read_to_string(file).unwrap().lines() {
        let (kind, number) = line.split_once(' ').unwrap();
        kept.entry(kind.to_owned()).or_default().push(number.parse().unwrap());
    }
    assert_eq!(found.len(), kept.len(), "{name}");
    for (kind, numbers) in found {
        let kept = &kept[*kind];
        assert_eq!(numbers.len(), kept.len(), "{name} {kind}");
        let largest = kept.iter().fold(0.0_f64, |most, number| most.max(number.abs()));
        for (index, (number, kept)) in numbers.iter().zip(kept).enumerate() {
            let difference = (number - kept).abs() / largest.max(f64::MIN_POSITIVE);
            let is_same = number.to_bits() == kept.to_bits();
            assert!(
                is_same || (!needs_the_same_bits() && difference <= TOLERANCE),
                "{name} {kind} {index}: {number:?}, kept is {kept:?}, {difference:.1e} apart"
            );
        }
    }
}

fn pose<S: Scalar>(pose: &Isometry3<S>) -> Vec<S> {
    pose.rotation.coords.iter().chain(pose.translation.vector.iter()).copied().collect()
}

/// A box that is thrown onto the floor, slides and tumbles.
fn thrown<S: Scalar>(tangent: &[S]) -> BodyState<S> {
    let model = body_over_floor(12).unwrap();
    let mut start = BodyState::at_rest(Isometry3::translation(0.0, 0.0, 0.08));
    start.linear = Vector3::new(0.3, 0.0, -0.4);
    start.angular = Vector3::new(1.0, 3.0, -2.0);
    let still = BodyState::at_rest(Isometry3::identity()).cast();
    let start = start.retract(&std::array::from_fn(|i| tangent[i]));
    model.cast().simulate(&State::new([still, start]), 0.2).unwrap()[1]
}

#[test]
fn a_rollout() {
    let end: BodyState<f64> = thrown(&[0.0; 12]);
    let velocities = end.linear.iter().chain(end.angular.iter()).copied().collect();
    let (_, by) = gradient(
        |x| {
            let end = thrown(x);
            end.pose.translation.vector.norm_squared() + end.angular.norm_squared()
        },
        &[0.0; 12],
    );
    compare("rollout", &[("pose", pose(&end.pose)), ("velocities", velocities), ("gradient", by)]);
}

#[test]
fn a_picture() {
    let mut mesh = shapes::superellipsoid([0.04, 0.03, 0.05], [0.8, 0.8], 16);
    let color = |p: &Point3<f64>| [p.x, p.y, p.z].map(|v| (0.5 + 0.4 * (50.0 * v).sin()) as f32);
    mesh.colors = Some(mesh.vertices.iter().map(color).collect());
    let model = Arc::new(RenderModel::new(&mesh).unwrap());
    let camera = Camera { fx: 50.0, fy: 50.0, cx: 15.3, cy: 11.6, width: 32, height: 24 };
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.5, 0.7));
    let at = Isometry3::from_parts(Translation3::new(0.004, -0.003, 0.25), turn);
    let renderer = Renderer::new(Light::headlight(0.5, 0.5));
    let scene = |at| Scene::new(camera).with(model.clone(), at);
    let image = renderer.render(&scene(at)).buffers;
    let (_, by) = gradient(
        |x| {
            let moved = lift::<Var>(&at) * Translation3::new(x[0], x[1], x[2]);
            let vars = SceneVars { poses: vec![(0, moved)], ..SceneVars::default() };
            let image = renderer.record(&scene(Isometry3::identity()), &vars).unwrap();
            let color = image.color.as_flattened().iter().chain(&image.alpha);
            color.fold(Var::default(), |sum, part| sum + *part * *part)
        },
        &[0.0; 3],
    );
    let color = image.color.as_flattened().to_vec();
    compare("picture", &[("color", color), ("alpha", image.alpha), ("gradient", by)]);
}

#[test]
fn a_refinement() {
    let scene = default_scene(1).unwrap();
    let frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
    let (fused, short) = (Fused::default(), Heuristic { iterations: 10, ..Heuristic::combined() });
    let strategies: [(&str, &dyn Strategy); 2] = [("fused", &fused), ("combined", &short)];
    for (name, strategy) in strategies {
        let estimate = refine(&frame, &scene.initial, strategy).unwrap();
        let covariance =
            estimate.posterior.as_ref().map(|p| p.covariance().iter().copied().collect());
        let mut found = vec![("pose", pose(estimate.t_cam_object()))];
        found.extend(covariance.map(|numbers: Vec<f64>| ("covariance", numbers)));
        compare(name, &found);
    }
}

#[test]
fn a_rig() {
    let sequence = default_sequence(1, 13).unwrap();
    let objects = [(7, Arc::clone(&sequence.object))];
    let settings = CalibratorSettings::default();
    let mut calibrator = Calibrator::new(16, (640, 480), objects.into(), settings).unwrap();
    for is_refined in [false, true] {
        let mut pass = Pass::default();
        for frame in sequence.frames.iter().step_by(4) {
            let mut observation = frame.frame.clone();
            observation.camera.cx -= 2.0;
            let frame = CalibrationFrame {
                frame: observation,
                obj_id: 7,
                initial: frame.truth,
                is_refined,
            };
            pass.add(calibrator.visit(&frame).unwrap());
        }
        calibrator.solve(&mut pass).unwrap();
    }
    let rig = calibrator.rig();
    let parameters = rig.parameters().into_iter().map(|(_, number)| number).collect();
    let covariance = rig.covariance.diagonal().iter().copied().collect();
    compare("rig", &[("parameters", parameters), ("variances", covariance)]);
}
