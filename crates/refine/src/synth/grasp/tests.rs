use std::sync::LazyLock;

use nalgebra::Vector3;
use prehend_geometry::hand::{ALLEGRO_XELA_URDF, taxels};
use prehend_geometry::objects::YcbObject;
use prehend_geometry::robot::KinematicTree as Tree;

use super::preshape::Preshape;
use super::simulation::GraspSimulation;
use super::*;
use crate::scene::{Hand, Object};

static HAND: LazyLock<Hand> = LazyLock::new(|| {
    Hand::new(Tree::from_urdf_str(ALLEGRO_XELA_URDF, None).unwrap(), taxels()).unwrap()
});

/// Two fingers that slide towards each other before a plate.
const GRIPPER: &str = r#"<robot name="gripper">
    <link name="base"><collision><origin xyz="0 0 -0.02"/><geometry><box size="0.06 0.2 0.04"/></geometry></collision></link>
    <link name="left"><collision><origin xyz="0 0 0.04"/><geometry><box size="0.03 0.02 0.08"/></geometry></collision></link>
    <link name="right"><collision><origin xyz="0 0 0.04"/><geometry><box size="0.03 0.02 0.08"/></geometry></collision></link>
    <joint name="l" type="prismatic"><parent link="base"/><child link="left"/><origin xyz="0 0.07 0.002"/><axis xyz="0 -1 0"/><limit lower="0" upper="0.055" effort="1" velocity="1"/></joint>
    <joint name="r" type="prismatic"><parent link="base"/><child link="right"/><origin xyz="0 -0.07 0.002"/><axis xyz="0 1 0"/><limit lower="0" upper="0.055" effort="1" velocity="1"/></joint>
    </robot>"#;

fn object(ycb: YcbObject) -> Object {
    Object::with_mass(ycb.name(), ycb.mesh(), Some(ycb.mass()), 0).unwrap()
}

/// The first of eight seeds that leads to a grasp, and that grasp.
fn first(grasper: &Grasper<'_>) -> (u64, Grasp) {
    (0..8).find_map(|seed| Some((seed, grasper.grasp(seed).ok()?))).unwrap()
}

/// The forces of the contacts on the object at rest under `gravity`, and how far it has moved by then.
fn loaded(
    grasper: &Grasper<'_>,
    grasp: &Grasp,
    gravity: Vector3<f64>,
) -> (Vector3<f64>, (f64, f64)) {
    let mut simulation =
        GraspSimulation::new(grasper, &grasp.joints, &grasp.t_hand_object, grasp.grip).unwrap();
    let still = vec![0.0; grasp.joints.len()];
    for _ in 0..40 {
        simulation.advance(&still, Some(gravity)).unwrap();
    }
    let moved = grasper.moved(&grasp.t_hand_object, &simulation.t_hand_object()).unwrap();
    (simulation.touches().iter().map(|t| t.force).sum(), moved)
}

#[test]
fn settled_grasps_keep_their_bounds_and_carry_the_weight() {
    for ycb in [YcbObject::TunaCan, YcbObject::MustardBottle] {
        let settings = GraspSettings::default();
        let grasper = Grasper::new(&HAND, &object(ycb), &settings).unwrap();
        let (_, grasp) = first(&grasper);
        assert!(grasp.intersection_volume <= settings.intersection_volume, "{grasp:?}");
        assert!((20.0..=60.0).contains(&grasp.contact_area), "{grasp:?}");
        assert!(grasp.links.len() >= 3, "{grasp:?}");
        assert!(grasp.drift <= 5e-3 && grasp.turn <= 5f64.to_radians(), "{grasp:?}");
        HAND.tree.check_joints(&grasp.joints).unwrap();
        // Gravity that the grasp has not been chosen by.
        for down in [Vector3::x(), -Vector3::x(), Vector3::new(0.6, 0.0, -0.8)] {
            let (force, (distance, angle)) = loaded(&grasper, &grasp, 9.81 * down);
            let weight = 9.81 * ycb.mass() * down;
            assert!((force + weight).norm() < 0.03 * weight.norm(), "{force} {weight}");
            assert!(distance < 5e-3 && angle < 5f64.to_radians(), "{distance} {angle}");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let grasper =
        Grasper::new(&HAND, &object(YcbObject::TunaCan), &GraspSettings::default()).unwrap();
    let (seed, grasp) = first(&grasper);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let again = pool.install(|| grasper.grasp(seed)).unwrap();
        (again, pool.install(|| grasper.trajectory(&grasp, 3, 4)).unwrap())
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one, three);
    assert_eq!(one.0, grasp);
    let moments = one.1;
    assert_eq!(moments.len(), 4);
    assert_ne!(moments, grasper.trajectory(&grasp, 4, 4).unwrap());
    for moment in &moments {
        assert!((moment.gravity.norm() - 9.81).abs() < 1e-9);
        assert_eq!((moment.joints.len(), moment.taxel_forces.len()), (16, 368));
        let quiet = moment.taxel_forces.iter().filter(|f| **f == Vector3::zeros()).count();
        assert!((100..366).contains(&quiet), "{quiet}");
        // Taxels are pushed in rather than pulled.
        let pushed: f64 =
            HAND.taxels.iter().zip(&moment.taxel_forces).map(|(t, f)| -t.normal.dot(f)).sum();
        assert!(pushed > 0.5 && pushed < 100.0, "{pushed}");
    }
}

#[test]
fn a_gripper_of_two_sliding_fingers_holds_a_brick() {
    let robot = Hand::new(Tree::from_urdf_str(GRIPPER, None).unwrap(), Vec::new()).unwrap();
    let preshape = Preshape::guess(&robot).unwrap();
    assert_eq!(preshape.open, [0.0, 0.0]);
    assert!(preshape.speed.iter().all(|s| *s > 0.0));
    let out = preshape.t_hand_palm.rotation * Vector3::z();
    let axis = preshape.t_hand_palm.rotation * Vector3::y();
    assert!((out - Vector3::z()).norm() < 1e-9 && axis.x.abs() > 0.999);
    let settings =
        GraspSettings { links: 2, contact_area: (10.0, 80.0), ..GraspSettings::default() };
    let grasper = Grasper::new(&robot, &object(YcbObject::FoamBrick), &settings).unwrap();
    let (_, grasp) = first(&grasper);
    assert!([1, 2].iter().all(|l| grasp.links.contains(l)), "{grasp:?}");
    assert!(grasp.intersection_volume < 0.2 && grasp.drift < 2e-3, "{grasp:?}");
    let moments = grasper.trajectory(&grasp, 1, 3).unwrap();
    assert!(moments.iter().all(|m| m.taxel_forces.is_empty()));
}

#[test]
fn settings_and_robots_that_cannot_grasp_are_refused() {
    let brick = object(YcbObject::FoamBrick);
    let bad = GraspSettings { stiffness: 0.0, ..GraspSettings::default() };
    let error = Grasper::new(&HAND, &brick, &bad).map(|_| ()).unwrap_err();
    assert_eq!(error.to_string(), "the setting stiffness must be positive, is 0");
    let post = r#"<robot name="post"><link name="post"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link></robot>"#;
    let post = Hand::new(Tree::from_urdf_str(post, None).unwrap(), Vec::new()).unwrap();
    let error = Grasper::new(&post, &brick, &GraspSettings::default()).map(|_| ()).unwrap_err();
    assert_eq!(error.to_string(), "the robot has no joint that would close its fingers");
}

#[test]
fn a_guess_for_the_built_in_hand_curls_its_fingers() {
    let guess = Preshape::guess(&HAND).unwrap();
    let own = Preshape::of(&HAND).unwrap();
    for finger in 0..3 {
        for joint in 1..3 {
            assert!(guess.speed[4 * finger + joint] > 0.0, "{guess:?}");
        }
    }
    let out = |p: &Preshape| p.t_hand_palm.rotation * Vector3::z();
    assert!(out(&guess).dot(&out(&own)) > 0.8, "{guess:?}");
}
