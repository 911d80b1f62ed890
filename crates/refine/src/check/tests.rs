//! One fault at a time in the built-in scene: each is named, and without any nothing is.

use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, Vector3};
use prehend_render::Mask;

use super::*;
use crate::scene::{Frame, Hand, HandMeasurement, Scene, StatedSize, default_scene};

fn found(scene: &Scene, t_cam_object: &Isometry3<f64>) -> Vec<Warning> {
    let mut all = check_object(&scene.object, true);
    all.extend(check_frame(&scene.frame, &scene.object, t_cam_object));
    all
}

/// That `change` of a scene is named, by a warning on `subject` whose sentence has `words`, and nothing else is: the sentence.
#[track_caller]
fn named(subject: Subject, words: &str, change: impl Fn(&mut Scene)) -> String {
    let mut scene = default_scene(1).unwrap();
    change(&mut scene);
    let truth = scene.truth;
    let warnings = found(&scene, &truth);
    let [warning] = &warnings[..] else { panic!("{subject:?}: {warnings:#?}") };
    let sentence = warning.to_string();
    assert!(warning.subject == subject && sentence.contains(words), "{warning:#?}");
    sentence
}

fn hand(scene: &mut Scene) -> &mut HandMeasurement {
    scene.frame.hand.as_mut().unwrap()
}

/// Moves the hand's base, in the camera frame \[m\].
fn moved(scene: &mut Scene, by: [f64; 3]) {
    let hand = hand(scene);
    hand.t_cam_hand = Translation3::from(by) * hand.t_cam_hand;
}

/// Shifts the mask \[px\].
fn shifted(scene: &mut Scene, columns: isize, rows: isize) {
    let mask = scene.frame.mask.clone();
    let width = mask.width();
    let from = |i: usize| {
        let x = (i % width).checked_add_signed(-columns)?;
        let y = (i / width).checked_add_signed(-rows)?;
        mask.get(x, y)
    };
    let pixels = scene.frame.mask.pixels_mut().iter_mut().enumerate();
    pixels.for_each(|(i, pixel)| *pixel = from(i).unwrap_or(false));
}

#[test]
fn a_right_scene_is_silent_at_the_truth_and_at_poses_to_start_from() {
    for seed in 1..=6 {
        let scene = default_scene(seed).unwrap();
        assert_eq!(found(&scene, &scene.truth), []);
        assert_eq!(found(&scene, &scene.initial), []);
        let Scene { frame, object, initial, .. } = scene;
        let bare = Frame { hand: None, ..frame };
        assert_eq!(check_frame(&bare, &object, &initial), []);
    }
}

#[test]
fn joints_in_degrees_and_beyond_their_limits() {
    let sentence = named(Subject::Hand, "are joints in degrees?", |scene| {
        hand(scene).joints.iter_mut().for_each(|q| *q = q.to_degrees());
    });
    assert!(sentence.contains(" rad outside its limits"), "{sentence}");
    let mut scene = default_scene(1).unwrap();
    let limit = scene.hand.tree.joint_limits()[4].0;
    hand(&mut scene).joints[4] = limit - 0.3;
    let warnings = found(&scene, &scene.truth);
    let sentence = warnings[0].to_string();
    assert!(sentence.contains("0.300 rad outside its limits -0.470 to 0.470"), "{sentence}");
    // Encoders are not exact.
    hand(&mut scene).joints[4] = default_scene(1).unwrap().frame.hand.unwrap().joints[4];
    hand(&mut scene).joints[5] = scene.hand.tree.joint_limits()[5].0 - 0.05;
    assert!(found(&scene, &scene.truth).iter().all(|w| !w.message.contains("limits")));
}

#[test]
fn a_hand_that_is_not_where_it_is_said_to_be() {
    named(Subject::Hand, "in the unit of the format", |scene| {
        hand(scene).t_cam_hand.translation.vector *= 1e3;
    });
    named(Subject::Hand, "0.0005 m from the camera", |scene| {
        hand(scene).t_cam_hand.translation.vector *= 1e-3;
    });
    named(Subject::Hand, "the hand is behind the camera", |scene| moved(scene, [0.0, 0.0, -1.0]));
    named(Subject::Hand, "no pixel of the hand is in the image", |scene| {
        moved(scene, [1.0, 0.0, 0.0]);
    });
    for by in [[0.05, 0.0, 0.0], [-0.05, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, -0.05, 0.0]] {
        named(Subject::Hand, "where the hand should be seen", |scene| moved(scene, by));
    }
    let sentence = named(Subject::Hand, "cam_t_b2c", |scene| moved(scene, [0.0, 0.0, 0.05]));
    let by: f64 = sentence.split(' ').nth(3).unwrap().parse().unwrap();
    assert!((by - 5.0).abs() < 0.5 && sentence.contains(" cm in front of the hand"), "{sentence}");
}

#[test]
fn a_hand_out_of_sight_is_judged_by_touch() {
    // Depth of the hand is missing, as of a black one.
    let unseen = |scene: &mut Scene| {
        let Frame { depth, mask, .. } = &mut scene.frame;
        let pixels = depth.pixels_mut().iter_mut().zip(mask.pixels());
        pixels.filter(|(_, masked)| !**masked).for_each(|(z, _)| *z = 0.0);
    };
    named(Subject::Hand, "cm from the hand where mask and depth have it", |scene| {
        unseen(scene);
        moved(scene, [-0.2, 0.0, 0.0]);
    });
    named(Subject::Touch, "has what they read without load been subtracted?", |scene| {
        unseen(scene);
        hand(scene).forces.iter_mut().for_each(|f| f.y += 0.3);
    });
}

#[test]
fn depth_in_another_unit_and_of_another_scale() {
    for factor in [1.03, 0.96, 1.2] {
        let scale = |scene: &mut Scene| {
            let depths = scene.frame.depth.pixels_mut();
            depths.iter_mut().for_each(|z| *z *= factor as f32);
        };
        let mut scene = default_scene(1).unwrap();
        scale(&mut scene);
        let warnings = found(&scene, &scene.truth);
        assert!(!warnings.is_empty(), "{factor}");
        for warning in warnings {
            let ratio = format!("({factor:.3} times");
            assert_eq!(warning.subject, Subject::Depth, "{warning}");
            assert!(warning.message.contains(&ratio), "{warning}");
        }
    }
    let mut scene = default_scene(1).unwrap();
    scene.frame.depth.pixels_mut().iter_mut().for_each(|z| *z *= 1e3);
    let warnings = found(&scene, &scene.initial);
    let of_units = |w: &Warning| w.to_string().contains("check depth_scale and units");
    assert!(warnings.len() == 1 && of_units(&warnings[0]), "{warnings:#?}");
}

#[test]
fn masks_that_are_not_of_the_object() {
    for (columns, rows) in [(20, 0), (-20, 0), (0, 20), (0, -20)] {
        named(Subject::Mask, "", |scene| shifted(scene, columns, rows));
    }
    named(Subject::Mask, "does not touch its mask", |scene| {
        let mask = &mut scene.frame.mask;
        *mask = Mask::filled(mask.width(), mask.height(), false);
        mask.pixels_mut()[100] = true;
    });
    let mut scene = default_scene(1).unwrap();
    scene.frame.mask.pixels_mut().iter_mut().for_each(|masked| *masked = !*masked);
    let warnings = found(&scene, &scene.initial);
    assert!(
        warnings.iter().any(|w| w.to_string().contains("does not touch its mask")
            || w.to_string().contains("inverted")),
        "{warnings:#?}"
    );
}

/// Depth and the hand are compared nevertheless, where the object at its pose should be seen.
#[test]
fn without_a_mask_none_is_judged() {
    for seed in 1..=3 {
        let mut scene = default_scene(seed).unwrap();
        let [left, top, width, height] = scene.frame.mask.bounds().unwrap();
        let (columns, rows) = (scene.frame.mask.width(), scene.frame.mask.height());
        for bounds in [[0; 4], [left, top, width, height]] {
            scene.frame.mask = Mask::of_box(columns, rows, bounds);
            assert_eq!(found(&scene, &scene.truth), []);
            assert_eq!(found(&scene, &scene.initial), []);
        }
    }
    let no_mask = |scene: &mut Scene| scene.frame.mask.pixels_mut().fill(false);
    named(Subject::Depth, "check depth_scale and units", |scene| {
        no_mask(scene);
        scene.frame.depth.pixels_mut().iter_mut().for_each(|z| *z *= 1e3);
    });
    named(Subject::Hand, "cam_t_b2c", |scene| {
        no_mask(scene);
        moved(scene, [0.0, 0.0, 0.05]);
    });
    named(Subject::Pose, "no pixel should show the object", |scene| {
        no_mask(scene);
        scene.truth.translation.vector.x += 1.0;
    });
}

#[test]
fn forces_in_another_unit_and_of_another_sign() {
    for factor in [1e3, 1e-3] {
        named(Subject::Touch, "newtons in a frame file", |scene| {
            hand(scene).forces.iter_mut().for_each(|f| *f *= factor);
        });
    }
    named(Subject::Touch, "pull at the skin", |scene| {
        hand(scene).forces.iter_mut().for_each(|f| *f = -*f);
    });
    named(Subject::Touch, "1 of 368 taxel forces are no numbers", |scene| {
        hand(scene).forces[7].x = f64::NAN;
    });
    named(Subject::Touch, "367 taxel forces were given for 368 taxels", |scene| {
        hand(scene).forces.pop();
    });
    named(Subject::TouchPlace, "are forces in the order of the layout", |scene| {
        hand(scene).forces.fill(Vector3::zeros());
        // Of the palm, below the object.
        hand(scene).forces[348] = -scene.hand.taxels[348].normal;
    });
    named(Subject::Touch, "is the layout in meters", |scene| {
        let mut taxels = scene.hand.taxels.clone();
        taxels.iter_mut().for_each(|taxel| taxel.position *= 1e3);
        let tree = scene.hand.tree.clone();
        hand(scene).hand = Arc::new(Hand::new(tree, taxels).unwrap());
    });
}

#[test]
fn forces_of_which_nothing_is_known_are_no_fault() {
    let mut scene = default_scene(1).unwrap();
    hand(&mut scene).forces[..40].fill(HandMeasurement::UNKNOWN_FORCE);
    assert_eq!(found(&scene, &scene.truth), []);
}

#[test]
fn models_that_are_not_of_their_size() {
    let changed = |change: &dyn Fn(&mut StatedSize)| {
        let scene = default_scene(1).unwrap();
        let vertices = &scene.object.mesh.vertices;
        let (low, high) = scene.object.mesh.bounds().unwrap();
        let from = |a: &nalgebra::Point3<f64>| {
            vertices.iter().map(|b| nalgebra::distance(a, b)).fold(0.0, f64::max)
        };
        let diameter = vertices.iter().map(from).fold(0.0, f64::max);
        let mut stated = StatedSize { diameter, bounds: Some((low, high)) };
        change(&mut stated);
        let mut object = Arc::into_inner(scene.object).unwrap();
        object.stated_size = Some(stated);
        check_object(&object, true)
    };
    assert_eq!(changed(&|_| ()), []);
    for (factor, words) in [
        (1e3, [" times the ", "are both in millimeters?"]),
        (1e-3, ["0.0010 times", "are both in millimeters?"]),
        (1.1, ["1.1000 times", "at that scale?"]),
        (0.97, ["0.9700 times", "at that scale?"]),
    ] {
        let warnings = changed(&|stated| stated.diameter /= factor);
        let sentence = warnings[0].to_string();
        assert!(words.iter().all(|words| sentence.contains(words)), "{factor}: {warnings:#?}");
    }
    let turned = changed(&|stated| {
        let (low, high) = stated.bounds.as_mut().unwrap();
        *low = low.yzx();
        *high = high.yzx();
    });
    assert!(turned[0].to_string().contains("with the same axes?"), "{turned:#?}");
    let moved = changed(&|stated| {
        let (low, high) = stated.bounds.as_mut().unwrap();
        low.z += 0.05;
        high.z += 0.05;
    });
    assert!(moved[0].to_string().contains("is its origin"), "{moved:#?}");
}

#[test]
fn what_is_no_number() {
    named(Subject::Hand, "joint 'joint_3.0': position is not valid", |scene| {
        hand(scene).joints[3] = f64::NAN;
    });
    named(Subject::Hand, "is no number", |scene| {
        hand(scene).t_cam_hand.translation.vector.y = f64::NAN;
    });
    named(Subject::Pose, "(z = NaN m)", |scene| scene.truth.translation.vector.z = f64::NAN);
}

#[test]
fn an_object_behind_the_camera() {
    named(Subject::Pose, "(z = -", |scene| {
        scene.truth.translation.vector.z = -scene.truth.translation.vector.z;
    });
}
