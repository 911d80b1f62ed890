//! One mistake at a time in four built-in scenes: each is named, and without any nothing is.

use std::sync::{Arc, OnceLock};

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use super::inputs::CheckInputs;
use super::kind::Correction;
use super::*;
use crate::scene::Target;
use crate::scene::{Object, Scene, default_scene};

/// Scenes of one object, each about at its first pose.
fn scenes() -> impl Iterator<Item = Scene> {
    static SCENES: OnceLock<Vec<Scene>> = OnceLock::new();
    let scenes = SCENES.get_or_init(|| (1..=4).map(|seed| default_scene(seed).unwrap()).collect());
    scenes.iter().map(|scene| Scene {
        frame: scene.frame.clone(),
        object: Arc::clone(&scene.object),
        hand: Arc::clone(&scene.hand),
        urdf: String::new(),
        ..*scene
    })
}

/// Findings in four scenes with the same `change`, without hand and depth if `bare`.
fn found(bare: bool, change: &dyn Fn(&mut Scene)) -> Vec<Finding> {
    found_in(4, bare, change)
}

/// Findings in the first `count` scenes.
fn found_in(count: usize, bare: bool, change: &dyn Fn(&mut Scene)) -> Vec<Finding> {
    let settings = CorrectionSettings::default();
    let trial = |(k, mut scene): (usize, Scene)| {
        change(&mut scene);
        let Scene { frame: mut observation, object, initial, .. } = scene;
        if bare {
            observation.depth.pixels_mut().fill(0.0);
        }
        observation.hand = observation.hand.filter(|_| !bare);
        let trial = CorrectionTrial::new(&observation, &object, &initial, &settings);
        (Target { scene_id: 1, im_id: k as u32, obj_id: 5, instance: 0 }, trial.unwrap())
    };
    let trials: Vec<_> = scenes().take(count).enumerate().map(trial).collect();
    find_corrections(&trials, &settings)
}

#[track_caller]
fn named(correction: Correction, factor: f64, change: impl Fn(&mut Scene)) -> Finding {
    named_of(false, correction, factor, &change)
}

#[track_caller]
fn named_of(
    bare: bool,
    correction: Correction,
    factor: f64,
    change: &dyn Fn(&mut Scene),
) -> Finding {
    let found = found(bare, change);
    let [finding] = &found[..] else { panic!("{correction:?}: {found:#?}") };
    assert_eq!(finding.correction, correction, "{finding:#?}");
    assert!((finding.factor / factor).ln().abs() < 0.02, "{finding:#?}");
    assert_eq!(finding.frames.len(), 4);
    finding.clone()
}

fn posed(change: impl Fn(Isometry3<f64>) -> Isometry3<f64>) -> impl Fn(&mut Scene) {
    move |scene| scene.initial = change(scene.initial)
}

fn turned(change: impl Fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>) -> impl Fn(&mut Scene) {
    posed(move |pose| Isometry3::from_parts(pose.translation, change(pose.rotation)))
}

fn moved(factor: f64) -> impl Fn(&mut Scene) {
    posed(move |mut pose| {
        pose.translation.vector *= factor;
        pose
    })
}

fn sized(factor: f64) -> impl Fn(&mut Scene) {
    move |scene| {
        let mesh = scene.object.mesh.clone().scaled(factor);
        let inertial = Some(scene.object.inertial.clone());
        scene.object = Arc::new(Object::new("scaled", mesh, inertial, 0).unwrap());
    }
}

/// Half a turn about the x-axis: between axes of OpenCV and OpenGL.
fn flip() -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
}

#[test]
fn right_inputs_need_no_correction() {
    for bare in [false, true] {
        let found = found(bare, &|_| ());
        assert!(found.is_empty(), "{found:#?}");
    }
}

#[test]
fn conventions_of_poses() {
    for bare in [false, true] {
        let named = |correction, change: &dyn Fn(&mut Scene)| {
            named_of(bare, correction, 1.0, change);
        };
        named(Correction::PoseInverted, &posed(|pose| pose.inverse()));
        named(Correction::OpenGlAxes, &posed(|pose| flip() * pose));
        named(Correction::PoseInvertedOpenGl, &posed(|pose| (flip() * pose).inverse()));
    }
    named(Correction::RotationTransposed, 1.0, turned(|q| q.inverse()));
    named(Correction::QuaternionXyzw, 1.0, turned(|q| quaternion(q.i, q.j, q.k, q.w)));
}

fn quaternion(w: f64, x: f64, y: f64, z: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}

/// Whatever an object looks like from there.
#[test]
fn corrections_undo_mistakes_of_rotation() {
    let right = scenes().next().unwrap().initial;
    let camera = scenes().next().unwrap().frame.camera;
    type Mistake = fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>;
    let mistakes: [(Correction, Mistake); 4] = [
        (Correction::RotationTransposed, |q| q.inverse()),
        (Correction::OpenGlRotation, |q| flip() * q),
        // (x, y, z, w) taken for (w, x, y, z), and the other way round.
        (Correction::QuaternionXyzw, |q| quaternion(q.i, q.j, q.k, q.w)),
        (Correction::QuaternionWxyz, |q| quaternion(q.k, q.w, q.i, q.j)),
    ];
    for (correction, mistake) in mistakes {
        let wrong = Isometry3::from_parts(right.translation, mistake(right.rotation));
        assert!(wrong.rotation.angle_to(&right.rotation) > 0.3, "{correction:?}");
        let corrected = CheckInputs::new(camera, wrong).corrected(correction, 1.0).t_cam_object;
        assert!(corrected.rotation.angle_to(&right.rotation) < 1e-9, "{correction:?}");
        assert_eq!(corrected.translation, right.translation);
    }
}

#[test]
fn units_of_poses_meshes_and_depth() {
    for factor in [1e-3, 1e1] {
        named(Correction::PoseUnit, factor, moved(factor.recip()));
        named(Correction::ModelUnit, factor, sized(factor.recip()));
        named_of(true, Correction::ModelUnit, factor, &sized(factor.recip()));
        named(Correction::DepthUnit, factor, |scene| {
            let depths = scene.frame.depth.pixels_mut().iter_mut();
            depths.for_each(|z| *z /= factor as f32);
        });
        named(Correction::ModelAndPoseUnit, factor, |scene| {
            sized(factor.recip())(scene);
            moved(factor.recip())(scene);
        });
    }
    named(Correction::Translation, 1.0, moved(1.6));
    let sizes = found(true, &moved(1.6));
    assert!(sizes.iter().all(|f| f.correction != Correction::ModelScale), "{sizes:#?}");
    named(Correction::DepthScale, 0.25, |scene| {
        scene.frame.depth.pixels_mut().iter_mut().for_each(|z| *z *= 4.0);
    });
}

#[test]
fn masks_and_cameras() {
    named(Correction::MaskInverted, 1.0, |scene| {
        scene.frame.mask.pixels_mut().iter_mut().for_each(|masked| *masked = !*masked);
    });
    named(Correction::PrincipalPointSwapped, 1.0, |scene| {
        let camera = &mut scene.frame.camera;
        (camera.cx, camera.cy) = (camera.cy, camera.cx);
    });
    for factor in [0.5, 2.0, 1.5] {
        for bare in [false, true] {
            named_of(bare, Correction::CameraOfOtherSize, factor, &|scene| {
                let camera = &mut scene.frame.camera;
                let (width, height) = (camera.width, camera.height);
                *camera = prehend_render::Camera { width, height, ..camera.scaled(factor.recip()) };
            });
        }
    }
}

/// In any light: bright, dark, or tinted.
#[test]
fn channels_that_are_swapped() {
    for gains in [[1.0; 3], [1.6; 3], [0.3; 3], [0.8, 1.0, 1.2], [1.2, 1.0, 0.8]] {
        let lit = |scene: &mut Scene| {
            for color in scene.frame.color.pixels_mut() {
                *color = [0, 1, 2].map(|c| (color[c] * gains[c]).min(1.0));
            }
        };
        let right = found(false, &lit);
        assert!(right.is_empty(), "{gains:?}: {right:#?}");
        for bare in [false, true] {
            named_of(bare, Correction::ChannelsSwapped, 1.0, &|scene| {
                lit(scene);
                scene.frame.color.pixels_mut().iter_mut().for_each(|color| color.reverse());
            });
        }
    }
    // Gray pictures, and models without colors, tell nothing.
    let gray = found(false, &|scene| {
        scene.frame.color.pixels_mut().iter_mut().for_each(|color| *color = [color[1]; 3]);
    });
    assert!(gray.is_empty(), "{gray:#?}");
    let plain = found(false, &|scene| {
        let mut mesh = scene.object.mesh.clone();
        (mesh.colors, mesh.texture) = (None, None);
        let inertial = Some(scene.object.inertial.clone());
        scene.object = Arc::new(Object::new("plain", mesh, inertial, 0).unwrap());
    });
    assert!(plain.is_empty(), "{plain:#?}");
}

#[test]
fn without_a_mask_nothing_is_tried() {
    let found = found(false, &|scene| {
        scene.frame.mask.pixels_mut().fill(false);
        scene.initial = scene.initial.inverse();
    });
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn sizes_of_models_and_focal_lengths() {
    for factor in [0.83, 0.95, 1.05, 1.2] {
        let of_model = sized(1.0 / factor);
        named(Correction::ModelScale, factor, of_model);
        named(Correction::FocalLength, factor, |scene| {
            let camera = &mut scene.frame.camera;
            (camera.fx, camera.fy) = (camera.fx / factor, camera.fy / factor);
        });
    }
}

/// Models far from their size, with the hand or without.
#[test]
fn models_of_another_size() {
    for factor in [0.5, 0.62, 0.7, 1.4, 1.6, 1.8, 2.0] {
        named(Correction::ModelScale, factor, sized(1.0 / factor));
        let found = found(false, &|scene| {
            sized(1.0 / factor)(scene);
            scene.frame.hand = None;
        });
        let [finding] = &found[..] else { panic!("{factor}: {found:#?}") };
        assert_eq!(finding.correction, Correction::ModelScale, "{finding:#?}");
        assert!((finding.factor / factor).ln().abs() < 0.05, "{factor}: {finding:#?}");
    }
}

/// One view does not tell which mistake of a rotation it is.
#[test]
fn rotations_of_a_single_view() {
    let about_view = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let mistakes: [&dyn Fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>; 3] =
        [&|q| q.inverse(), &|q| flip() * q, &|q| about_view * q];
    for mistake in mistakes {
        let found = found_in(1, false, &turned(mistake));
        let kinds: Vec<_> = found.iter().map(|finding| finding.correction).collect();
        assert!(kinds.is_empty() || kinds == [Correction::Rotation], "{found:#?}");
    }
}

#[test]
fn messages_name_file_field_and_edit() {
    let names = &FieldNames {
        poses: "init.csv".into(),
        rotation: "R",
        translation: "t",
        mesh: "models/obj_000005.ply".into(),
        camera: "scene_camera.json".into(),
        intrinsics: "cam_K",
        depth_scale: "depth_scale",
        masks: "mask_visib".into(),
        colors: "rgb".into(),
    };
    let said = |correction: Correction, factor| correction.message(names, factor);
    for (correction, factor, words) in [
        (Correction::PoseUnit, 1e3, ["init.csv: t: ", "another unit", "multiply t by 1000"]),
        (Correction::ModelUnit, 1e-1, ["models/obj_000005.ply: ", "another unit", "by 0.1"]),
        (
            Correction::DepthUnit,
            1e-3,
            ["scene_camera.json: depth_scale: ", "another unit", "by 0.001"],
        ),
        (Correction::ModelScale, 0.9524, ["obj_000005.ply: ", "too large", "by 0.952"]),
        (Correction::FocalLength, 1.1, ["scene_camera.json: cam_K: ", "too short", "by 1.1"]),
        (Correction::PrincipalPointSwapped, 1.0, ["cam_K: ", "cx and cy are swapped", "exchange"]),
        (Correction::ChannelsSwapped, 1.0, ["rgb: ", "red and blue are swapped", "exchange"]),
    ] {
        let said = said(correction, factor);
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
}
