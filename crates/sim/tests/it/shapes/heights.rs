//! Height fields.

use std::time::Instant;

use nalgebra::{Point3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{Ball, HeightField};
use parry3d_f64::utils::Array2;
use prehend_geometry::SplitMix64;
use prehend_sim::{Body, Shape, error::ShapeError};

use super::derivatives::errors;
use super::rest::on;

/// Waves 1 cm high on a slope, over 1 m by 0.8 m.
fn height(x: f64, z: f64) -> f64 {
    0.01 * (10.0 * x).sin() * (12.0 * z).cos() - 0.2 * x
}

fn field(cells: usize, height: impl Fn(f64, f64) -> f64) -> HeightField {
    let place = |i: usize, scale: f64| scale * (i as f64 / cells as f64 - 0.5);
    let heights =
        Array2::from_fn(cells + 1, cells + 1, |i, j| height(place(j, 1.0), place(i, 0.8)) / 0.5);
    HeightField::new(heights, Vector::new(1.0, 0.5, 0.8))
}

#[test]
fn distances_are_those_of_parry() {
    let mut random = SplitMix64::new(41);
    // Of a plane exactly, of waves as far as triangles differ from a spline.
    let plane = |x: f64, z: f64| 0.3 * x - 0.2 * z + 0.05;
    let cases: [(HeightField, f64); 2] = [(field(20, plane), 1e-12), (field(400, height), 1e-5)];
    for (parry, tolerance) in cases {
        let shape = Shape::from_parry(&parry).unwrap();
        let mut worst: f64 = 0.0;
        for _ in 0..1000 {
            let [x, y, z] = std::array::from_fn(|_| random.uniform() - 0.5);
            let place = Vector::new(0.6 * x, 0.1 * y, 0.5 * z);
            let found = shape.field().distance(&place.to_array().into(), f64::INFINITY).unwrap();
            let projected = parry.project_local_point(place, false);
            worst = worst.max((found.abs() - (projected.point - place).length()).abs());
        }
        println!("off by {worst:.1e} m");
        assert!(worst < tolerance, "{worst}");
    }
}

#[test]
fn derivatives_match_differences() {
    let shape = Shape::from_parry(&field(50, height)).unwrap();
    let mut random = SplitMix64::new(42);
    let mut worst = [0.0_f64; 2];
    for _ in 0..1000 {
        let [x, z, above] = std::array::from_fn(|_| random.uniform() - 0.5);
        // Beyond the border, too.
        let at = [1.3 * x, height(1.3 * x, z) + 0.1 * above, z];
        let off = errors(&**shape.field(), at);
        worst = [0, 1].map(|i| worst[i].max(off[i]));
    }
    println!("gradient off by {:.1e}, Hessian by {:.1e}", worst[0], worst[1]);
    assert!(worst[0] < 1e-7 && worst[1] < 2e-4, "{worst:?}");
}

#[test]
fn what_is_far_is_told_at_once() {
    let shape = Shape::from_parry(&field(50, height)).unwrap();
    let mut random = SplitMix64::new(43);
    let points: Vec<Point3<f64>> = (0..1000)
        .map(|_| {
            let [x, y, z] = std::array::from_fn(|_| random.uniform() - 0.5);
            Point3::new(x, height(x, z) + 0.1 * y, z)
        })
        .collect();
    for point in &points {
        let distance = shape.field().distance(point, f64::INFINITY).unwrap();
        for reach in [distance - 1e-9, distance, 0.02] {
            let found = shape.field().distance(point, reach);
            assert_eq!(found, (distance <= reach).then_some(distance));
            assert_eq!(shape.field().sample(point, reach).map(|s| s.distance), found);
        }
    }
    let start = Instant::now();
    let sum: f64 = (0..20)
        .flat_map(|_| &points)
        .filter_map(|p| shape.field().sample(p, f64::INFINITY))
        .map(|sample| sample.distance)
        .sum();
    let each = start.elapsed().as_secs_f64() / (20.0 * points.len() as f64);
    println!("{:.0} ns a sample ({sum})", 1e9 * each);
}

#[test]
fn a_ball_rolls_down() {
    // A plane, where its acceleration is known, and waves on it.
    let slope = 0.2_f64;
    for (ground, tolerance) in [(field(20, |x, _| -slope * x), 1e-2), (field(50, height), 0.5)] {
        let ground = Shape::from_parry(&ground).unwrap();
        let ball = Shape::from_parry(&Ball::new(0.02)).unwrap();
        let high = ground.field().distance(&Point3::new(0.0, 1.0, 0.0), f64::INFINITY).unwrap();
        let along = (1.0 + slope * slope).sqrt();
        let (model, mut start) = on(&ground, &ball, 0.0);
        let normal = Vector3::new(slope, 1.0, 0.0) / along;
        start[1].pose.translation.vector = normal * 0.02;
        let at = start[1].pose.translation.vector.into();
        let gap = ground.field().distance(&at, f64::INFINITY).unwrap() - 0.02;
        start[1].pose.translation.vector -= normal * (gap + 1e-6);
        let end = model.simulate(&start, 0.3).unwrap();
        let expected = 5.0 / 7.0 * 9.81 * slope / along * 0.3;
        let found = end[1].linear.norm();
        println!("{found} m/s beside {expected} m/s on a plane, {high}");
        assert!((found / expected - 1.0).abs() < tolerance);
    }
}

#[test]
fn height_fields_are_ground() {
    let mut parry = field(4, height);
    let shape = Shape::from_parry(&parry).unwrap();
    let refused = Body::from_shape("ground", &shape, 1e3).err();
    assert_eq!(refused, Some(ShapeError::FixedOnly { kind: "height field" }));
    assert!(shape.moments().is_none() && shape.surface().is_none());
    parry.set_cell_status(1, 1, parry3d_f64::shape::HeightFieldCellStatus::CELL_REMOVED);
    assert!(matches!(Shape::from_parry(&parry), Err(ShapeError::Kind { .. })));
}
