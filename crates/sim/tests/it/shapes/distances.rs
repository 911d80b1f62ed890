//! Distances beside parry's.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query;
use parry3d_f64::shape::{Ball, Shape as Shape3, TypedShape};
use prehend_geometry::SplitMix64;
use prehend_sim::{Shape, ShapeOptions};

use super::catalog::{ROUND, SHARP, vector};

const PAIRS: usize = 1000;

/// Edges next to nothing, so that distances are those of sharp shapes.
const SHARP_EDGES: ShapeOptions = ShapeOptions { rounding: Some(1e-8), spacing: None, cell: None };

fn point(v: Vector) -> Point3<f64> {
    Point3::new(v.x, v.y, v.z)
}

/// Signed distance by parry. That to a round shape is found by its distance to the inner one: its own is an approximation, some
/// 25 µm off where points are near the border.
fn signed_distance(shape: &dyn Shape3, place: Vector) -> f64 {
    let (inner, border): (&dyn Shape3, f64) = match shape.as_typed_shape() {
        TypedShape::RoundCuboid(round) => (&round.inner_shape, round.border_radius),
        TypedShape::RoundCylinder(round) => (&round.inner_shape, round.border_radius),
        TypedShape::RoundCone(round) => (&round.inner_shape, round.border_radius),
        TypedShape::RoundConvexPolyhedron(round) => (&round.inner_shape, round.border_radius),
        _ => (shape, 0.0),
    };
    let projected = inner.project_local_point(place, false);
    let length = (projected.point - place).length();
    if projected.is_inside { -length - border } else { length - border }
}

#[test]
fn distances_of_points_are_those_of_parry() {
    let mut random = SplitMix64::new(11);
    for (name, draw) in SHARP.into_iter().chain(ROUND) {
        let (mut worst, mut inside): (f64, usize) = (0.0, 0);
        for _ in 0..PAIRS {
            let parry = draw(&mut random);
            let shape = Shape::from_parry_with(&*parry.0, &SHARP_EDGES).unwrap();
            let place = vector(&mut random) * 0.05;
            let found = shape.field().distance(&point(place), f64::INFINITY).unwrap();
            let expected = signed_distance(&*parry.0, place);
            inside += usize::from(expected < 0.0);
            worst = worst.max((found - expected).abs());
        }
        println!("{name}: {inside} of {PAIRS} points inside, off by {worst:.1e} m at most");
        // Hulls of parry have faces that are flat to some micrometers.
        let tolerance = if name.ends_with("hull") { 1e-5 } else { 2e-7 };
        assert!(worst < tolerance && inside > 60, "{name}: {worst}");
    }
}

fn pose(random: &mut SplitMix64, reach: f64) -> Isometry3<f64> {
    let [place, turn] = [vector(random) * reach, vector(random) * 3.0];
    let turn = Vector3::new(turn.x, turn.y, turn.z);
    Isometry3::from_parts(
        Translation3::new(place.x, place.y, place.z),
        UnitQuaternion::from_scaled_axis(turn),
    )
}

fn to_parry(pose: &Isometry3<f64>) -> Pose {
    let [t, r] = [pose.translation.vector, pose.rotation.scaled_axis()];
    Pose::new(Vector::new(t.x, t.y, t.z), Vector::new(r.x, r.y, r.z))
}

/// How near the samples of `a` come to the field of `b`.
fn nearest_sample(a: &Shape, b: &Shape, t_b_a: &Isometry3<f64>) -> f64 {
    let gap = |p: &prehend_sim::SurfacePoint| {
        b.field().distance(&(t_b_a * p.position), f64::INFINITY).unwrap() - p.radius
    };
    a.surface().unwrap().points().iter().map(gap).fold(f64::INFINITY, f64::min)
}

#[test]
fn balls_are_as_far_from_everything_as_in_parry() {
    let mut random = SplitMix64::new(12);
    for (name, draw) in SHARP.into_iter().chain(ROUND) {
        let mut worst: f64 = 0.0;
        for _ in 0..PAIRS {
            let (parry, ball) = (draw(&mut random), Ball::new(0.02 + 0.02 * random.uniform()));
            let pose = pose(&mut random, 0.2);
            let distance = query::distance(&Pose::IDENTITY, &*parry.0, &to_parry(&pose), &ball)
                .unwrap()
                .distance;
            if distance > 0.0 {
                let shape = Shape::from_parry_with(&*parry.0, &SHARP_EDGES).unwrap();
                let found = nearest_sample(&Shape::from_parry(&ball).unwrap(), &shape, &pose);
                worst = worst.max((found - distance).abs());
            }
        }
        println!("ball and {name}: off by {worst:.1e} m at most");
        let tolerance = if name.ends_with("hull") { 1e-5 } else { 2e-6 };
        assert!(worst < tolerance, "{name}: {worst}");
    }
}

#[test]
fn equal_kinds_are_as_far_apart_as_in_parry_but_for_samples() {
    let mut random = SplitMix64::new(13);
    for (name, draw) in SHARP.into_iter().chain(ROUND) {
        let (mut most, mut least, mut sum): (f64, f64, f64) = (0.0, 0.0, 0.0);
        let mut count = 0;
        while count < PAIRS {
            let [a, b] = [draw(&mut random), draw(&mut random)];
            let pose = pose(&mut random, 0.2);
            let distance =
                query::distance(&Pose::IDENTITY, &*b.0, &to_parry(&pose), &*a.0).unwrap().distance;
            if distance <= 0.0 {
                continue;
            }
            count += 1;
            let options = ShapeOptions { spacing: Some(5e-3), ..ShapeOptions::default() };
            let [a, b] = [a, b].map(|s| Shape::from_parry_with(&*s.0, &options).unwrap());
            let found = nearest_sample(&a, &b, &pose).min(nearest_sample(&b, &a, &pose.inverse()));
            (most, least) = (most.max(found - distance), least.min(found - distance));
            sum += (found - distance).abs();
        }
        println!(
            "two of {name}: {least:.1e} to {most:.1e} m too far, {:.1e} in the mean",
            sum / PAIRS as f64
        );
        // Too far where edges cross between samples, and at the tips of thin cones. Never too near, for samples are parts of their
        // shape: where parry says so, of nearly parallel capsules, it is parry that is off.
        let mean = sum / PAIRS as f64;
        assert!(least > -5e-5 && most < 6e-3 && mean < 2e-3, "{name}: {least} {most} {mean}");
    }
}
