//! How much of one surface lies near another.

use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;

use crate::closest::ClosestPoints;

/// Samples that one thread takes at a time.
const CHUNK: usize = 1024;
/// How far queries look, in reaches: a longer distance answers for more neighbors, a shorter one is found sooner.
const LOOK: f64 = 4.0;

/// Area of a surface of `area` \[m²\] that lies closer than `reach` \[m\] to `surface`, inside or outside of it \[m²\].
///
/// `samples` are area-uniform points of the first surface ([`surface_samples`](crate::sample::surface_samples)), which
/// `t_surface_samples` brings into the frame of `surface`. The standard error is at most
/// area·√(f(1−f)/n), f the fraction of the n samples that are near. Zero without samples, which a surface without area has none of.
///
/// A distance changes by no more than its point moves, so the distance of one sample answers for those around it: samples
/// in the order of their faces, as they are drawn, need a query for few of them.
pub fn contact_area(
    samples: &[Point3<f64>],
    area: f64,
    t_surface_samples: &Isometry3<f64>,
    surface: &ClosestPoints,
    reach: f64,
) -> f64 {
    let near = |chunk: &[Point3<f64>]| {
        // A point and its distance, which may be more where `exact` is not set.
        let mut known: Option<(Point3<f64>, f64, bool)> = None;
        let is_near = |sample: &&Point3<f64>| {
            let p = t_surface_samples * **sample;
            if let Some((q, distance, exact)) = known {
                let moved = (p - q).norm() + 1e-9 * reach;
                if distance - moved > reach {
                    return false;
                }
                if exact && distance + moved < reach {
                    return true;
                }
            }
            let found = surface.closest(&p, LOOK * reach).map(|c| c.distance);
            known = Some((p, found.unwrap_or(LOOK * reach), found.is_some()));
            found.is_some_and(|d| d < reach)
        };
        chunk.iter().filter(is_near).count()
    };
    let count: usize = samples.par_chunks(CHUNK).map(near).sum();
    count as f64 / samples.len().max(1) as f64 * area
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::surface_samples;
    use crate::volume::tests::{cuboid, icosphere};
    use nalgebra::Vector3;

    fn plane() -> ClosestPoints {
        ClosestPoints::new(&cuboid([20.0, 20.0, 2.0], [0.0, 0.0, -0.5])).unwrap()
    }

    #[test]
    fn a_square_on_a_plane_touches_by_its_lower_edge() {
        // A 10 cm square, upright, in a frame in which its y is the plane's z.
        let n = 200;
        let at = |i: usize| (i as f64 + 0.5) / n as f64 * 0.1;
        let samples: Vec<_> = (0..n * n).map(|i| Point3::new(at(i % n), at(i / n), 0.0)).collect();
        let pose = |z| {
            Isometry3::new(Vector3::new(3.0, 0.0, z), Vector3::x() * std::f64::consts::FRAC_PI_2)
        };
        // It reaches from 0.1 mm below the plane upward: the first 10 of 200 rows, 0.5 mm apart, are within 5 mm.
        let area = |z: f64| contact_area(&samples, 0.01, &pose(z), &plane(), 0.005);
        assert!((area(0.4999) - 0.01 * 10.0 / 200.0).abs() < 1e-13, "{}", area(0.4999));
        assert_eq!(area(3.5), 0.0);
        assert_eq!(contact_area(&[], 0.0, &pose(0.5), &plane(), 0.005), 0.0);
    }

    #[test]
    fn neighbors_answer_as_queries_do() {
        let ball = icosphere(0.05, 4);
        let samples: Vec<_> =
            surface_samples(&ball, 20_000, 1).into_iter().map(|s| s.point).collect();
        let surface = ClosestPoints::new(&cuboid([0.08, 0.03, 0.05], [0.0; 3])).unwrap();
        for (x, reach) in [(0.03, 0.005), (0.05, 0.02), (0.0, 0.001), (0.09, 0.005)] {
            let t = Isometry3::new(Vector3::new(x, 0.01, 0.0), Vector3::new(0.3, 0.1, 0.7));
            let near = |p: &&Point3<f64>| {
                surface.closest(&(t * **p), 1.0).is_some_and(|c| c.distance < reach)
            };
            let expected = samples.iter().filter(near).count() as f64 / 2e4 * ball.area();
            assert_eq!(contact_area(&samples, ball.area(), &t, &surface, reach), expected);
            assert!(expected > 0.0 && expected < 0.9 * ball.area(), "{expected}");
            for threads in [1, 2, 5] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let area =
                    pool.install(|| contact_area(&samples, ball.area(), &t, &surface, reach));
                assert_eq!(area.to_bits(), expected.to_bits());
            }
        }
    }

    #[test]
    fn a_sphere_lowered_onto_a_plane_touches_by_its_cap() {
        // Within the reach of the plane lies the zone of height reach + depth on one side and the cap of that depth.
        let (r, depth, reach) = (0.05, 0.003, 0.005);
        let ball = icosphere(r, 5);
        let samples: Vec<_> =
            surface_samples(&ball, 100_000, 1).into_iter().map(|s| s.point).collect();
        let t = Isometry3::translation(0.0, 0.0, 0.5 + r - depth);
        let area = contact_area(&samples, ball.area(), &t, &plane(), reach);
        let expected = std::f64::consts::TAU * r * (reach + depth);
        assert!((area / expected - 1.0).abs() < 0.02, "{area} {expected}");
    }
}
