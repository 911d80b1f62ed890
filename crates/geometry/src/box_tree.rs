//! Which of many boxes meet a given one.

use std::time::Duration;

use nalgebra::{Point3, Vector3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

/// Smallest and largest corner \[m\].
pub(crate) type Bounds = (Point3<f64>, Point3<f64>);

/// A tree over boxes.
///
/// It holds them in single precision about their common centre, rounded outwards: no box that meets another is
/// missed, whatever the unit.
pub(crate) struct BoxTree {
    tree: Bvh2,
    centre: Vector3<f64>,
    size: f64,
}

impl BoxTree {
    /// Prepares queries of `boxes`, each known by its place.
    pub(crate) fn new(boxes: &[Bounds]) -> Self {
        let everywhere = Point3::from([f64::INFINITY; 3]);
        let (low, high) =
            boxes.iter().fold((everywhere, -everywhere), |(l, h), b| (l.inf(&b.0), h.sup(&b.1)));
        // Halved first: the size of finite boxes may be no finite number.
        let centre = 0.5 * low.coords + 0.5 * high.coords;
        let size = (0.5 * high.coords - 0.5 * low.coords).max().max(f64::MIN_POSITIVE);
        let mut tree = Self { tree: Bvh2::default(), centre, size };
        if !boxes.is_empty() {
            let boxes: Vec<Aabb> = boxes.iter().map(|b| tree.rounded(b)).collect();
            let mut params = BvhBuildParams::medium_build();
            params.max_prims_per_leaf = 2;
            tree.tree = build_bvh2(&boxes, params, &mut Duration::default());
        }
        tree
    }

    fn rounded(&self, (low, high): &Bounds) -> Aabb {
        let local = |p: &Point3<f64>| (p.coords - self.centre) / self.size;
        // Subtraction and division lose far less than a step of single precision.
        let low = local(low).map(|c| (c as f32).next_down().next_down());
        let high = local(high).map(|c| (c as f32).next_up().next_up());
        Aabb::new([low.x, low.y, low.z].into(), [high.x, high.y, high.z].into())
    }

    /// Hands the place of each box that meets `query`, and of some that miss it by a rounding, to `visit`, until
    /// that answers false.
    pub(crate) fn meeting(&self, query: &Bounds, mut visit: impl FnMut(usize) -> bool) {
        self.tree.aabb_traverse(self.rounded(query), |tree, node| {
            let node = &tree.nodes[node as usize];
            let first = node.first_index as usize;
            let leaf = &tree.primitive_indices[first..first + node.prim_count as usize];
            leaf.iter().all(|&i| visit(i as usize))
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;

    #[test]
    fn it_finds_what_testing_every_box_finds() {
        for scale in [1e-300, 1e-3, 1.0, 1e30] {
            let mut random = SplitMix64::new(5);
            let mut unit = || random.unit();
            let boxes: Vec<Bounds> = (0..300)
                .map(|_| {
                    let low = Point3::new(unit(), unit(), unit()) * scale;
                    (low, low + Vector3::new(unit(), unit(), unit()) * (0.2 * scale))
                })
                .collect();
            let tree = BoxTree::new(&boxes);
            for query in &boxes {
                let mut found = vec![false; boxes.len()];
                tree.meeting(query, |i| {
                    found[i] = true;
                    true
                });
                for (b, found) in boxes.iter().zip(found) {
                    let meets = (0..3).all(|k| b.0[k] <= query.1[k] && query.0[k] <= b.1[k]);
                    assert!(found || !meets);
                }
            }
            let mut count = 0;
            tree.meeting(&boxes[0], |_| {
                count += 1;
                false
            });
            assert_eq!(count, 1);
        }
        BoxTree::new(&[]).meeting(&(Point3::origin(), Point3::origin()), |_| panic!("no boxes"));
    }
}
