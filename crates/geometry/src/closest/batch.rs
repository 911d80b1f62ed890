//! Many queries at once: neighbors in space follow each other, so that each starts from the last one's answer.

use nalgebra::Point3;
use rayon::prelude::*;

use super::{Closest, ClosestPoints};

/// Queries that one worker does in a row: fixed, although the answers do not depend on it.
const CHUNK: usize = 1024;

impl ClosestPoints {
    /// Closest points of many points, in their order, in parallel: the very answers of [`Self::closest`].
    pub fn closest_many(&self, points: &[Point3<f64>], max_distance: f64) -> Vec<Option<Closest>> {
        in_order(&along_a_curve(points, &self.bounds), |i, last| {
            self.search(&points[i], max_distance, last)
        })
    }

    /// Signed distances of many points, in their order, in parallel: the very answers of
    /// [`Self::signed_distance`].
    pub fn signed_distance_many(&self, points: &[Point3<f64>]) -> Vec<(f64, Closest)> {
        let found = self.closest_many(points, f64::INFINITY);
        points.par_iter().zip(found).with_min_len(CHUNK).map(|(p, c)| self.signed(p, c)).collect()
    }
}

/// Answers every point i of `order` by `query(i, face of the answer before)`, in parallel.
fn in_order(
    order: &[u32],
    query: impl Fn(usize, Option<u32>) -> Option<Closest> + Sync,
) -> Vec<Option<Closest>> {
    let of_chunk = |indices: &[u32]| -> Vec<Option<Closest>> {
        let mut last = None;
        let mut answer = |&i: &u32| {
            let found = query(i as usize, last);
            last = found.map(|c| c.face).or(last);
            found
        };
        indices.iter().map(&mut answer).collect()
    };
    let chunks: Vec<_> = order.par_chunks(CHUNK).map(of_chunk).collect();
    let mut answers = vec![None; order.len()];
    for (&i, found) in order.iter().zip(chunks.into_iter().flatten()) {
        answers[i as usize] = found;
    }
    answers
}

/// Indices of the points along a Z-order curve (Morton 1966) through twice the box `bounds`, those outside of it at
/// its border.
fn along_a_curve(points: &[Point3<f64>], bounds: &(Point3<f64>, Point3<f64>)) -> Vec<u32> {
    let cells = f64::from(1 << 10);
    let low = bounds.0 - (bounds.1 - bounds.0) * 0.5;
    let scale = (bounds.1 - bounds.0).map(|s| if s > 0.0 { 0.5 * cells / s } else { 0.0 });
    let key = |p: &Point3<f64>| {
        // A cast saturates, and takes NaN for zero.
        let cell = |axis: usize| {
            spread((((p[axis] - low[axis]) * scale[axis]) as u32).min(cells as u32 - 1))
        };
        cell(0) << 2 | cell(1) << 1 | cell(2)
    };
    sorted(&points.iter().map(key).collect::<Vec<_>>())
}

/// The indices of `keys` in ascending order of those, equal ones in their own: counted by eleven bits at a time, the
/// lowest first.
fn sorted(keys: &[u32]) -> Vec<u32> {
    const BITS: u32 = 11;
    let top = keys.iter().fold(0, |top, key| top | key);
    let mut order: Vec<u32> = (0..keys.len() as u32).collect();
    let mut next = vec![0; keys.len()];
    let mut shift = 0;
    while shift < u32::BITS && top >> shift != 0 {
        let digit = |i: u32| (keys[i as usize] >> shift) as usize & ((1 << BITS) - 1);
        let mut place = [0_u32; (1 << BITS) + 1];
        order.iter().for_each(|&i| place[digit(i) + 1] += 1);
        (0..1 << BITS).for_each(|d| place[d + 1] += place[d]);
        for &i in &order {
            let place = &mut place[digit(i)];
            next[*place as usize] = i;
            *place += 1;
        }
        std::mem::swap(&mut order, &mut next);
        shift += BITS;
    }
    order
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
        let mut random = crate::random::SplitMix64::new(2);
        let mut points: Vec<Point3<f64>> =
            (0..500).map(|_| Point3::from([(); 3].map(|()| random.uniform() - 0.5))).collect();
        points.extend([Point3::new(f64::NAN, 1e300, -1e300), Point3::new(f64::INFINITY, 0.0, 0.0)]);
        let order = along_a_curve(&points, &bounds);
        let mut all = order.clone();
        all.sort_unstable();
        assert!(all.iter().copied().eq(0..502));
        let octant = |i: &u32| points[*i as usize].map(|x| x >= 0.0);
        let changes = order.windows(2).filter(|w| octant(&w[0]) != octant(&w[1])).count();
        assert!(changes <= 9, "{changes}");
    }

    #[test]
    fn sorting_by_counting_is_sorting() {
        let mut random = crate::random::SplitMix64::new(4);
        for bits in [0, 3, 11, 12, 30, 32] {
            let keys: Vec<u32> =
                (0..3000).map(|_| (random.uniform() * 2_f64.powi(bits)) as u32).collect();
            let mut expected: Vec<u32> = (0..3000).collect();
            expected.sort_by_key(|&i| keys[i as usize]);
            assert_eq!(sorted(&keys), expected);
        }
        assert!(sorted(&[]).is_empty());
    }
}
