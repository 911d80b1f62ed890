//! Symmetries of meshes.

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::TriMesh;
use prehend_geometry::objects::YcbObject;
use prehend_geometry::shapes::{cone, cuboid, cylinder, sphere};
use prehend_refine::symmetry::{Symmetries, SymmetrySettings, find_symmetries};

fn found(mesh: &TriMesh) -> Symmetries {
    find_symmetries(mesh, &SymmetrySettings::default()).unwrap()
}

/// The mesh somewhere else, so that no axis is one of the frame's.
fn moved(mesh: &TriMesh) -> (TriMesh, Isometry3<f64>) {
    let pose = Isometry3::new(Vector3::new(0.1, -0.2, 0.05), Vector3::new(0.4, -0.7, 0.3));
    (mesh.transformed(&pose), pose)
}

fn assert_maps_onto_itself(mesh: &TriMesh, symmetries: &Symmetries) {
    let surface = prehend_geometry::ClosestPoints::new(mesh).unwrap();
    for motion in symmetries.transforms() {
        for vertex in &mesh.vertices {
            let distance = surface.closest(&(motion * vertex), f64::INFINITY).unwrap().distance;
            assert!(distance < 1.5e-3, "{distance}");
        }
    }
}

#[test]
fn boxes_have_the_rotations_of_their_edges() {
    for (edges, rotations) in [([0.04, 0.09, 0.17], 3), ([0.06, 0.06, 0.15], 7), ([0.08; 3], 23)] {
        let (mesh, _) = moved(&cuboid(Vector3::from(edges)));
        let symmetries = found(&mesh);
        assert_eq!((symmetries.discrete.len(), symmetries.continuous.len()), (rotations, 0));
        assert_maps_onto_itself(&mesh, &symmetries);
    }
}

#[test]
fn a_can_has_an_axis_and_a_flip_and_a_cup_no_flip() {
    let (can, pose) = moved(&cylinder(0.034, 0.1, 64));
    let symmetries = found(&can);
    assert_eq!((symmetries.discrete.len(), symmetries.continuous.len()), (1, 1));
    let axis = symmetries.continuous[0].axis;
    let across = axis.dot(&(pose * Vector3::z())).abs();
    assert!(across > 0.9999, "{across}");
    assert_maps_onto_itself(&can, &symmetries);

    let cup = cone([0.034, 0.051], 0.1, 64);
    let symmetries = found(&cup);
    assert_eq!((symmetries.discrete.len(), symmetries.continuous.len()), (0, 1));
}

#[test]
fn a_sphere_has_three_axes() {
    let symmetries = found(&sphere(0.05, 48));
    assert_eq!((symmetries.discrete.len(), symmetries.continuous.len()), (0, 3));
}

#[test]
fn print_breaks_the_symmetry_of_a_can_and_a_bottle_has_one_by_shape() {
    let can = YcbObject::TomatoSoupCan.mesh();
    assert_eq!(found(&can).continuous.len(), 1);
    let printed = SymmetrySettings { color_tolerance: Some(0.05), ..SymmetrySettings::default() };
    let symmetries = find_symmetries(&can, &printed).unwrap();
    assert_eq!(symmetries, Symmetries::default());
    let bottle = found(&YcbObject::MustardBottle.mesh());
    assert_eq!((bottle.discrete.len(), bottle.continuous.len()), (1, 0), "{bottle:?}");
}
