//! Gradients and Hessians of distance fields beside differences.

use nalgebra::Point3;
use prehend_autodiff::check::finite_difference_jacobian;
use prehend_geometry::{DistanceField, FieldSample, SplitMix64};
use prehend_sim::{Shape, ShapeOptions};

use super::catalog::{ROUND, SHARP, vector};

/// Largest differences of gradient and Hessian from differences at `at`.
pub(crate) fn errors(field: &dyn DistanceField, at: [f64; 3]) -> [f64; 2] {
    let sample = |x: &[f64]| field.sample(&Point3::from_slice(x), f64::INFINITY).unwrap();
    let numbers = |x: &[f64]| {
        let FieldSample { distance, gradient, .. } = sample(x);
        vec![distance, gradient.x, gradient.y, gradient.z]
    };
    let FieldSample { gradient, hessian, .. } = sample(&at);
    let differences = finite_difference_jacobian(numbers, &at, 1e-7);
    let mut errors = [0.0_f64; 2];
    for j in 0..3 {
        errors[0] = errors[0].max((gradient[j] - differences[0][j]).abs());
        for i in 0..3 {
            errors[1] = errors[1].max((hessian[(i, j)] - differences[1 + i][j]).abs());
        }
    }
    errors
}

#[test]
fn gradients_and_hessians_match_differences_in_every_region() {
    let mut random = SplitMix64::new(31);
    for (name, draw) in SHARP.into_iter().chain(ROUND) {
        let mut off = Vec::new();
        for _ in 0..1000 {
            let options = ShapeOptions { rounding: Some(3e-3), ..ShapeOptions::default() };
            let shape = Shape::from_parry_with(&*draw(&mut random).0, &options).unwrap();
            let place = vector(&mut random) * 0.08;
            let field = shape.field();
            let distance = field.distance(&place.to_array().into(), f64::INFINITY).unwrap();
            // Outside of all cores.
            if distance > -1.5e-3 {
                off.push(errors(&**field, place.to_array()));
            }
        }
        // At the borders of regions the Hessian jumps, and the gradient does not.
        let gradient = off.iter().map(|e| e[0]).fold(0.0, f64::max);
        let jumps = off.iter().filter(|e| e[1] > 1e-4).count();
        println!(
            "{name}: {} points, gradients off by {gradient:.1e}, {jumps} on borders",
            off.len()
        );
        assert!(off.len() > 300 && gradient < 1e-6 && jumps < 3, "{name}");
    }
}

#[test]
fn the_gradient_is_continuous_at_the_borders_of_regions() {
    let mut random = SplitMix64::new(32);
    for (name, draw) in SHARP.into_iter().chain(ROUND) {
        for _ in 0..100 {
            let options = ShapeOptions { rounding: Some(3e-3), ..ShapeOptions::default() };
            let shape = Shape::from_parry_with(&*draw(&mut random).0, &options).unwrap();
            let [a, b] = [vector(&mut random), vector(&mut random)].map(|v| v.normalize());
            // An arc around the shape crosses regions.
            let gradient = |i: i32| {
                let part = f64::from(i) / 2000.0;
                let at = (a * (1.0 - part) + b * part).normalize() * 0.1;
                let sample = shape.field().sample(&at.to_array().into(), f64::INFINITY);
                (sample.unwrap().gradient, at)
            };
            for i in 0..2000 {
                let [(g, x), (h, y)] = [gradient(i), gradient(i + 1)];
                // Curvature is at most one over the distance from the core, which is 1 cm here.
                assert!((g - h).norm() < 150.0 * (x - y).length() + 1e-9, "{name}");
            }
        }
    }
}
