//! Mass properties beside parry's, and of round shapes beside sums over cells.

use nalgebra::{Matrix3, Point3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::shape::{self as parry, HalfSpace};
use prehend_geometry::{DistanceField, Moments, SplitMix64};
use prehend_sim::{Body, Shape, error::ShapeError};

use super::catalog::{ROUND, SHARP};

#[test]
fn sharp_solids_have_the_mass_of_parry() {
    let mut random = SplitMix64::new(21);
    let density = 1234.5;
    for (name, draw) in SHARP {
        let mut worst: f64 = 0.0;
        for _ in 0..100 {
            let parry = draw(&mut random);
            let expected = parry.mass_properties(density);
            let body = Body::from_shape(name, &Shape::from_parry(&*parry.0).unwrap(), density);
            let body = body.unwrap();
            let rigid = body.rigid().unwrap();
            let com = expected.local_com;
            let inertia = expected.reconstruct_inertia_matrix();
            let inertia = Matrix3::from_column_slice(&inertia.to_cols_array());
            // Where a hull's inertia is not diagonal, the frame that parry finds is not one of principal axes: what is left to compare
            // is the trace.
            let inertia_off = match name {
                "hull" => rigid.inertia().trace() / inertia.trace() - 1.0,
                _ => (rigid.inertia() - inertia).norm() / inertia.norm(),
            };
            let off = [
                rigid.mass() / expected.mass() - 1.0,
                (rigid.com().coords - Vector3::new(com.x, com.y, com.z)).norm() / 0.05,
                inertia_off,
            ];
            worst = off.into_iter().fold(worst, |worst, off| worst.max(off.abs()));
        }
        println!("{name}: off by {worst:.1e}");
        assert!(worst < 1e-12, "{name}: {worst}");
    }
}

/// Sums over cells within the box of ±`reach`.
fn counted(field: &dyn DistanceField, reach: f64) -> Moments {
    let cells = 120;
    let edge = 2.0 * reach / f64::from(cells);
    let place = |i: i32| (f64::from(i) + 0.5) * edge - reach;
    let mut sum = Moments::zero();
    for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
        for k in 0..cells {
            let x = Vector3::new(place(i), place(j), place(k));
            let distance = field.distance(&Point3::from(x), f64::INFINITY).unwrap();
            let share = (0.5 - distance / edge).clamp(0.0, 1.0) * edge.powi(3);
            sum = sum
                + Moments { volume: share, first: x * share, second: x * x.transpose() * share };
        }
    }
    sum
}

#[test]
fn round_solids_have_the_mass_of_their_border_too() {
    let mut random = SplitMix64::new(22);
    for (name, draw) in ROUND {
        let parry = draw(&mut random);
        let shape = Shape::from_parry(&*parry.0).unwrap();
        let found = shape.moments().unwrap();
        let expected = counted(&**shape.field(), 0.07);
        let size = expected.volume.cbrt();
        let off = [
            found.volume / expected.volume - 1.0,
            (found.first - expected.first).norm() / (expected.volume * size),
            (found.second - expected.second).norm() / expected.second.norm(),
        ];
        println!("{name}: off by {off:?}");
        assert!(off.into_iter().all(|off| off.abs() < 2e-3), "{name}: {off:?}");
        assert!(found.volume > 1.05 * parry.mass_properties(1.0).mass());
    }
}

#[test]
fn what_is_no_body_is_refused() {
    let ground = Shape::from_parry(&HalfSpace::new(Vector::Y)).unwrap();
    let refused = Body::from_shape("ground", &ground, 1e3).err();
    assert_eq!(refused, Some(ShapeError::FixedOnly { kind: "half-space" }));
    let body = Body::fixed_from_shape("ground", &ground);
    assert!(body.surface.is_none() && body.field.is_some() && body.rigid().is_none());
    let segment = parry::Segment::new(Vector::ZERO, Vector::Y);
    let refused = Shape::from_parry(&segment).unwrap_err();
    assert_eq!(refused.to_string(), "no bodies are made of a Segment");
    let flat = parry::Cuboid::new(Vector::new(1.0, 0.0, 1.0));
    let refused = Shape::from_parry(&flat).unwrap_err();
    assert!(
        matches!(refused, ShapeError::Dimension { .. } | ShapeError::Option { .. }),
        "{refused:?}"
    );
    let mut ball = Shape::from_parry(&parry::Ball::new(0.1)).unwrap();
    let refused = ball.set_dimension("edge", 0.1).unwrap_err();
    assert_eq!(refused.to_string(), "the shape has no dimension called \"edge\": one of radius");
    assert!(ball.set_dimension("radius", -0.1).is_err());
}

#[test]
fn bodies_of_one_shape_share_samples_and_field() {
    let shape = Shape::from_parry(&parry::Cuboid::new(Vector::splat(0.02))).unwrap();
    let [mut a, b] = ["a", "b"].map(|name| Body::from_shape(name, &shape, 1e3).unwrap());
    let same = |a: &Body, b: &Body| {
        let surfaces = [a, b].map(|body| body.surface.clone().unwrap());
        std::sync::Arc::ptr_eq(&surfaces[0], &surfaces[1])
    };
    assert!(same(&a, &b));
    a.set_dimension("half_extent_z", 0.04).unwrap();
    assert!(!same(&a, &b));
    assert!((a.rigid().unwrap().mass() - 0.128).abs() < 1e-12);
}
