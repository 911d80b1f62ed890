//! Meshes and compounds.

use std::f64::consts::PI;

use nalgebra::Point3;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{Ball, Compound, Cuboid, HalfSpace, Shape as _, SharedShape, TriMesh};
use prehend_geometry::SplitMix64;
use prehend_sim::{Body, Shape, ShapeOptions, error::ShapeError};

use super::catalog::vector;
use super::derivatives::errors;
use super::rest::on;

fn box_mesh() -> TriMesh {
    let (vertices, triangles) = Cuboid::new(Vector::new(0.02, 0.03, 0.04)).to_trimesh();
    TriMesh::new(vertices, triangles).unwrap()
}

#[test]
fn a_mesh_is_a_grid_and_points() {
    let parry = box_mesh();
    let shape = Shape::from_parry(&parry).unwrap();
    let cuboid = Cuboid::new(Vector::new(0.02, 0.03, 0.04));
    let mut random = SplitMix64::new(51);
    let mut worst: f64 = 0.0;
    for _ in 0..1000 {
        let place = vector(&mut random) * 0.048;
        let place = Vector::new(place.x * 0.6, place.y * 0.8, place.z);
        let projected = cuboid.project_local_point(place, false);
        let length = (projected.point - place).length();
        let expected = if projected.is_inside { -length } else { length };
        // Within some cells of the surface: the grid rounds the middle, too.
        if expected.abs() < 5e-3 {
            let found = shape.field().distance(&place.to_array().into(), f64::INFINITY).unwrap();
            worst = worst.max((found - expected).abs());
            let off = errors(&**shape.field(), place.to_array());
            assert!(off[0] < 1e-6 && off[1] < 2e-2, "{off:?}");
        }
    }
    println!("mesh of a box: off by {worst:.1e} m");
    assert!(worst < 6e-4, "{worst}");
    let body = Body::from_shape("box", &shape, 1e3).unwrap();
    assert!((body.rigid().unwrap().mass() / 0.192 - 1.0).abs() < 1e-12);
    // Points on faces, edges and corners.
    let points = shape.surface().unwrap().points();
    let corner = Point3::new(0.02, -0.03, 0.04);
    assert_eq!(points.iter().filter(|p| (p.position - corner).norm() < 1e-12).count(), 1);
    assert!(points.iter().all(|p| p.radius == 0.0));
    let open = TriMesh::new(parry.vertices().to_vec(), parry.indices()[1..].to_vec()).unwrap();
    let refused = Body::from_shape("open", &Shape::from_parry(&open).unwrap(), 1e3).err();
    assert_eq!(refused, Some(ShapeError::FixedOnly { kind: "mesh that is not closed" }));
}

fn dumbbell() -> Compound {
    let rod = Cuboid::new(Vector::new(0.05, 0.01, 0.01));
    let ball = Ball::new(0.03);
    let at = |x: f64| Pose::translation(x, 0.0, 0.0);
    let turned = Pose::new(Vector::ZERO, Vector::new(0.3, 0.0, 0.0));
    Compound::new(vec![
        (at(-0.08), SharedShape::new(ball)),
        (turned, SharedShape::new(rod)),
        (at(0.08), SharedShape::new(ball)),
    ])
}

#[test]
fn a_compound_is_the_nearest_of_its_parts() {
    let parry = dumbbell();
    let options = ShapeOptions { rounding: Some(1e-8), ..ShapeOptions::default() };
    let shape = Shape::from_parry_with(&parry, &options).unwrap();
    let mut random = SplitMix64::new(52);
    for _ in 0..1000 {
        let place = vector(&mut random) * 0.1;
        let expected = parry.distance_to_local_point(place, true);
        let place = place.to_array().into();
        let found = shape.field().distance(&place, f64::INFINITY).unwrap();
        assert!((found.max(0.0) - expected).abs() < 1e-7);
        let sample = shape.field().sample(&place, 0.02);
        assert_eq!(sample.map(|s| s.distance), shape.field().distance(&place, 0.02));
        if found.abs() > 1e-3 {
            assert!(errors(&**shape.field(), place.coords.into())[0] < 1e-6);
        }
    }
    let expected = parry.mass_properties(1e3);
    let body = Body::from_shape("dumbbell", &shape, 1e3).unwrap();
    let rigid = body.rigid().unwrap();
    assert!((rigid.mass() / expected.mass() - 1.0).abs() < 1e-12);
    let inertia = expected.reconstruct_inertia_matrix().to_cols_array();
    let inertia = nalgebra::Matrix3::from_column_slice(&inertia);
    assert!((rigid.inertia() - inertia).norm() < 1e-11 * inertia.norm());
    let radii: Vec<f64> =
        shape.surface().unwrap().points().iter().map(|point| point.radius).collect();
    assert_eq!(radii.iter().filter(|r| **r == 0.03).count(), 2);
    assert!(radii.iter().any(|r| *r < 1e-6));
    let names: Vec<String> = shape.dimensions().into_iter().map(|(name, _)| name).collect();
    assert_eq!(names[0], "part_0_radius");
    assert_eq!(names[2], "part_1_half_extent_y");
}

#[test]
fn a_dumbbell_stands_on_its_balls_and_a_hull_on_its_face() {
    let ground = Shape::from_parry(&HalfSpace::new(Vector::Y)).unwrap();
    let shape = Shape::from_parry(&dumbbell()).unwrap();
    let (model, start) = on(&ground, &shape, 0.03 - 1e-5);
    let expected = 2.0 * 1e8 * 1e-5 * PI * 9e-4;
    assert!((model.wrenches(&start, 0)[1].y / expected - 1.0).abs() < 1e-4);
    let end = model.simulate(&start, 0.1).unwrap();
    assert!((end[1].pose.translation.vector - start[1].pose.translation.vector).norm() < 1e-4);
    // A pyramid, whose tip has four faces, and a prism.
    let half = 0.03;
    let base = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let base = base.map(|[x, z]| Vector::new(half * x, 0.0, half * z));
    let mut points = base.to_vec();
    points.push(Vector::new(0.0, 0.05, 0.0));
    let hull = SharedShape::convex_hull(&points).unwrap();
    let shape = Shape::from_parry(hull.as_ref()).unwrap();
    let (model, start) = on(&ground, &shape, -1e-5);
    let expected = 1e8 * 1e-5 * 4.0 * half * half;
    let found = model.wrenches(&start, 0)[1];
    println!("{} of the base's force", found.y / expected);
    assert!((found.y / expected - 1.0).abs() < 0.1);
    let settled = model.simulate(&start, 0.15).unwrap();
    let end = model.simulate(&settled, 0.15).unwrap();
    let moved = end[1].pose.translation.vector - settled[1].pose.translation.vector;
    assert!(moved.norm() < 1e-8, "{moved}");
}
