//! Many queries at once: neighbours in space follow each other, so that each starts from the last one's answer.

use nalgebra::Point3;
use rayon::prelude::*;

use super::{Closest, ClosestPoints};

/// Queries that one worker does in a row: fixed, although the answers do not depend on it.
const CHUNK: usize = 1024;

impl ClosestPoints {
    /// Closest points of many points, in their order, in parallel: the very answers of [`Self::closest`].
    pub fn closest_many(&self, points: &[Point3<f64>], max_distance: f64) -> Vec<Option<Closest>> {
        self.in_order(points, |i, hint| match hint {
            Some(face) => self.closest_from(&points[i], max_distance, face),
            None => self.closest(&points[i], max_distance),
        })
    }

    /// As [`Self::closest_many`], each from a face of its own, such as the answer before the points moved a little;
    /// points without a hint start from scratch.
    pub fn closest_many_from(
        &self,
        points: &[Point3<f64>],
        max_distance: f64,
        hints: &[u32],
    ) -> Vec<Option<Closest>> {
        let mut found = vec![None; points.len()];
        found.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, found)| {
            for (k, found) in found.iter_mut().enumerate() {
                let i = chunk * CHUNK + k;
                *found = match hints.get(i) {
                    Some(&face) => self.closest_from(&points[i], max_distance, face),
                    None => self.closest(&points[i], max_distance),
                };
            }
        });
        found
    }

    /// Signed distances of many points, in their order, in parallel: the very answers of
    /// [`Self::signed_distance`].
    pub fn signed_distance_many(&self, points: &[Point3<f64>]) -> Vec<(f64, Closest)> {
        let found = self.closest_many(points, f64::INFINITY);
        points.par_iter().zip(found).with_min_len(CHUNK).map(|(p, c)| self.signed(p, c)).collect()
    }

    /// Answers point `i` by `query(i, face of an answer nearby)`, along a curve through space.
    fn in_order(
        &self,
        points: &[Point3<f64>],
        query: impl Fn(usize, Option<u32>) -> Option<Closest> + Sync,
    ) -> Vec<Option<Closest>> {
        let order = morton_order(points, &self.bounds);
        let chunks: Vec<Vec<Option<Closest>>> = order
            .par_chunks(CHUNK)
            .map(|indices| {
                let mut hint = None;
                indices
                    .iter()
                    .map(|&i| {
                        let found = query(i as usize, hint);
                        hint = found.map(|c| c.face).or(hint);
                        found
                    })
                    .collect()
            })
            .collect();
        let mut answers = vec![None; points.len()];
        for (&i, found) in order.iter().zip(chunks.into_iter().flatten()) {
            answers[i as usize] = found;
        }
        answers
    }
}

/// Indices of the points along a Z-order curve (Morton 1966) through twice the box `bounds`, those outside of it at
/// its border.
fn morton_order(points: &[Point3<f64>], bounds: &(Point3<f64>, Point3<f64>)) -> Vec<u32> {
    let cells = f64::from(1 << 10);
    let low = bounds.0 - (bounds.1 - bounds.0) * 0.5;
    let scale = (bounds.1 - bounds.0).map(|s| if s > 0.0 { 0.5 * cells / s } else { 0.0 });
    let mut keys: Vec<u64> = points
        .iter()
        .enumerate()
        .map(|(i, p)| {
            // A cast saturates, and takes NaN for zero.
            let cell = |axis: usize| {
                spread((((p[axis] - low[axis]) * scale[axis]) as u32).min(cells as u32 - 1))
            };
            u64::from(cell(0) << 2 | cell(1) << 1 | cell(2)) << 32 | i as u64
        })
        .collect();
    keys.sort_unstable();
    keys.into_iter().map(|key| key as u32).collect()
}

/// Moves bit k of ten to bit 3 k.
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_every_point_once_and_octants_one_by_one() {
        assert_eq!((spread(0x3ff), spread(5)), (0x0924_9249, 0b1000001));
        let bounds = (Point3::new(-0.25, -0.25, -0.25), Point3::new(0.25, 0.25, 0.25));
        let mut random = crate::SplitMix64::new(2);
        let mut points: Vec<Point3<f64>> =
            (0..500).map(|_| Point3::from([(); 3].map(|()| random.unit() - 0.5))).collect();
        points.extend([Point3::new(f64::NAN, 1e300, -1e300), Point3::new(f64::INFINITY, 0.0, 0.0)]);
        let order = morton_order(&points, &bounds);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().copied().eq(0..502));
        let octant = |i: &u32| points[*i as usize].map(|x| x >= 0.0);
        let changes = order.windows(2).filter(|w| octant(&w[0]) != octant(&w[1])).count();
        assert!(changes <= 9, "{changes}");
    }
}
