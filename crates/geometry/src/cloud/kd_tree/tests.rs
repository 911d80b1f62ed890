use super::*;
use crate::random::SplitMix64;
use proptest::prelude::*;

/// Points on a lattice, so that ties are common, or spread out.
fn cloud(n: usize, seed: u64, lattice: bool) -> Vec<Point3<f64>> {
    let mut random = SplitMix64::new(seed);
    let mut next = || {
        let x = random.uniform() - 0.5;
        if lattice { (8.0 * x).round() / 8.0 } else { x }
    };
    (0..n).map(|_| Point3::new(next(), next(), 0.1 * next())).collect()
}

/// All points by distance, then index.
fn sorted(distance_squared: impl Fn(&Point3<f64>) -> f64, points: &[Point3<f64>]) -> Vec<Neighbor> {
    let mut all: Vec<_> = points
        .iter()
        .enumerate()
        .map(|(index, p)| Neighbor { index, distance_squared: distance_squared(p) })
        .collect();
    all.sort_by(|a, b| {
        a.distance_squared.total_cmp(&b.distance_squared).then(a.index.cmp(&b.index))
    });
    all
}

proptest! {
    #[test]
    fn every_query_agrees_with_exhaustive_search(
        n in 1_usize..400,
        seed in any::<u64>(),
        lattice in any::<bool>(),
        shift in prop::sample::select(vec![0.0, 1.0, 1e4]),
        reach in 0.0..0.6_f64,
    ) {
        let offset = nalgebra::Vector3::new(shift, -shift, 0.5 * shift);
        let points: Vec<_> = cloud(n, seed, lattice).iter().map(|p| p + offset).collect();
        let tree = KdTree::new(&points).unwrap();
        let queries = cloud(20, seed ^ 1, lattice);
        for (i, q) in queries.iter().map(|q| q * 1.3 + offset).enumerate() {
            let all = sorted(|p| (q - p).norm_squared(), &points);
            prop_assert_eq!(tree.nearest(&q, f64::INFINITY), Some(all[0]));
            prop_assert_eq!(tree.nearest_with_hint(&q, f64::INFINITY, 7 * i), Some(all[0]));
            let near: Vec<_> =
                all.iter().copied().take_while(|m| m.distance_squared <= reach * reach).collect();
            prop_assert_eq!(tree.nearest(&q, reach), near.first().copied());
            prop_assert_eq!(tree.nearest_with_hint(&q, reach, i), near.first().copied());
            prop_assert_eq!(tree.within(&q, reach), near);
            prop_assert_eq!(tree.k_nearest(&q, 9), &all[..all.len().min(9)]);
        }
    }
}

#[test]
fn larger_trees_agree_too() {
    // More than the points one thread orders, so that the parallel build is seen.
    let points = cloud(40_000, 3, false);
    let tree = KdTree::new(&points).unwrap();
    for (i, q) in cloud(50, 4, false).iter().enumerate() {
        let all = sorted(|p| (q - p).norm_squared(), &points);
        assert_eq!(tree.nearest_with_hint(q, f64::INFINITY, i), Some(all[0]));
        assert_eq!(tree.k_nearest(q, 25), &all[..25]);
    }
}

#[test]
fn many_equal_points_and_none() {
    let same = KdTree::new(&vec![Point3::new(1.0, 2.0, 2.0); 1000]).unwrap();
    let nearest = same.nearest_with_hint(&Point3::origin(), 3.0, 500);
    assert_eq!(nearest, Some(Neighbor { index: 0, distance_squared: 9.0 }));
    assert_eq!(same.within(&Point3::origin(), 3.0).len(), 1000);
    assert_eq!(same.k_nearest(&Point3::origin(), 3).iter().map(|n| n.index).sum::<usize>(), 3);

    let none = KdTree::new(&[]).unwrap();
    assert_eq!(none.nearest(&Point3::origin(), f64::INFINITY), None);
    assert_eq!(none.nearest_with_hint(&Point3::origin(), f64::INFINITY, 0), None);
    assert!(none.k_nearest(&Point3::origin(), 3).is_empty());
    assert!(none.within(&Point3::origin(), f64::INFINITY).is_empty());
}

#[test]
fn queries_without_meaning_find_nothing() {
    let tree = KdTree::new(&cloud(100, 1, false)).unwrap();
    let nowhere = Point3::new(0.0, f64::NAN, 0.0);
    assert_eq!(tree.nearest(&nowhere, f64::INFINITY), None);
    assert_eq!(tree.nearest(&Point3::origin(), f64::NAN), None);
    assert_eq!(tree.nearest(&Point3::origin(), -1.0), None);
    assert!(
        tree.k_nearest(&nowhere, 3).is_empty() && tree.k_nearest(&Point3::origin(), 0).is_empty()
    );
    assert_eq!(tree.within(&Point3::origin(), f64::INFINITY).len(), 100);
}
