//! How many layers of surface are at a point of the image.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::Vec2;

use crate::projected::Region;

/// A silhouette edge: where the number of surface layers changes.
#[derive(Clone, Copy, Default)]
pub(super) struct Segment {
    pub(super) a: Vec2,
    pub(super) b: Vec2,
    /// Layers gained by crossing from the side where a→b runs up the rows.
    pub(super) layers: f32,
}

impl Segment {
    /// The layers that a ray to the right crosses with it from `(x, y)`.
    #[inline]
    fn crossed(&self, Vec2 { x, y }: Vec2) -> f32 {
        // Half-open in y, so that a shared vertex counts once.
        let up = self.a.y <= y;
        match up != (self.b.y <= y) && self.at_row(y) > x {
            true if up => self.layers,
            true => -self.layers,
            false => 0.0,
        }
    }

    /// Where its line is at the height `y`.
    #[inline]
    fn at_row(&self, y: f32) -> f32 {
        self.a.x + (y - self.a.y) / (self.b.y - self.a.y) * (self.b.x - self.a.x)
    }
}

/// Counts surface layers at image points, from the silhouette sorted into strips of rows.
pub(super) struct Layers {
    first_row: f32,
    /// Where each strip's segments begin, and where the last one's end.
    starts: Vec<u32>,
    segments: Vec<Segment>,
    /// Strips with so many segments that not all are asked.
    crowded: BTreeMap<usize, Crowded>,
}

/// Strips a row: fine meshes have edges much shorter than a pixel.
const STRIPS: f32 = 4.0;

/// Segments from which on a strip is [`Crowded`].
const CROWD: usize = 48;

/// The segments of a strip: first those that cross its whole height nearly upright, sorted by their left ends; then the rest, in any order.
struct Crowded {
    /// Left ends of those.
    lefts: Vec<f32>,
    /// Layers crossed with all from each of those on.
    sums: Vec<f32>,
}

/// How far a segment may go sideways in a strip to be sorted \[px\].
const WIDEST: f32 = 1.0;

/// Bound of the rounding error of a segment's position \[px\].
const ROUNDING: f32 = 0.01;

impl Layers {
    pub(super) fn new(segments: &[Segment], region: &Region, margin: f32) -> Self {
        let first_row = (region.y0 as f32 - margin).floor();
        let rows = (region.y1 as f32 + margin).ceil() - first_row;
        let count = (rows * STRIPS) as usize + 1;
        let strips = |s: &Segment| {
            let strip = |y: f32| ((y - first_row) * STRIPS).floor();
            let (low, high) = (strip(s.a.y.min(s.b.y)), strip(s.a.y.max(s.b.y)));
            if high < 0.0 || low >= count as f32 {
                return 0..0;
            }
            low.max(0.0) as usize..(high as usize).min(count - 1) + 1
        };
        let mut starts = vec![0u32; count + 1];
        for strip in segments.iter().flat_map(strips) {
            starts[strip + 1] += 1;
        }
        for strip in 0..count {
            starts[strip + 1] += starts[strip];
        }
        let mut next = starts.clone();
        let mut sorted = vec![Segment::default(); starts[count] as usize];
        for segment in segments {
            for strip in strips(segment) {
                sorted[next[strip] as usize] = *segment;
                next[strip] += 1;
            }
        }
        let mut crowded = BTreeMap::new();
        for strip in 0..count {
            let all = starts[strip] as usize..starts[strip + 1] as usize;
            if all.len() >= CROWD {
                let rows = [strip, strip + 1].map(|strip| first_row + strip as f32 / STRIPS);
                crowded.insert(strip, Crowded::new(&mut sorted[all], rows));
            }
        }
        Self { first_row, starts, segments: sorted, crowded }
    }

    /// Layers at a point.
    pub(super) fn at(&self, at: Vec2) -> f32 {
        let strip = ((at.y - self.first_row) * STRIPS).floor();
        if strip < 0.0 || strip >= (self.starts.len() - 1) as f32 {
            return 0.0;
        }
        let strip = strip as usize;
        let all = &self.segments[self.starts[strip] as usize..self.starts[strip + 1] as usize];
        let crossed = |segments: &[Segment]| segments.iter().map(|s| s.crossed(at)).sum::<f32>();
        if all.len() < CROWD {
            return crossed(all);
        }
        // Sums of whole numbers, in whatever order.
        let Some(crowded) = self.crowded.get(&strip) else { return crossed(all) };
        let near = crowded.near(at.x);
        crowded.sums[near.end] + crossed(&all[near]) + crossed(&all[crowded.lefts.len()..])
    }
}

impl Crowded {
    /// Puts the segments of a strip between the heights `rows` into its order.
    fn new(segments: &mut [Segment], [low, high]: [f32; 2]) -> Self {
        // With the rounding of heights.
        let (low, high) = (low - ROUNDING, high + ROUNDING);
        let left = |s: &Segment| {
            let goes_through = s.a.y.min(s.b.y) < low && s.a.y.max(s.b.y) > high;
            let ends = [s.at_row(low), s.at_row(high)];
            let is_steep = (ends[0] - ends[1]).abs() < WIDEST - 2.0 * ROUNDING;
            // What is not a number comes last, too.
            if goes_through && is_steep { ends[0].min(ends[1]) - ROUNDING } else { f32::INFINITY }
        };
        let mut all: Vec<(f32, Segment)> = segments.iter().map(|s| (left(s), *s)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        segments.iter_mut().zip(&all).for_each(|(to, (_, s))| *to = *s);
        let lefts: Vec<f32> =
            all.iter().map(|(left, _)| *left).take_while(|l| l.is_finite()).collect();
        let mut sums = vec![0.0; lefts.len() + 1];
        for (k, s) in segments[..lefts.len()].iter().enumerate().rev() {
            sums[k] = sums[k + 1] + if s.a.y < s.b.y { s.layers } else { -s.layers };
        }
        Self { lefts, sums }
    }

    /// Those of the sorted segments that may be on either side of `x`: what is before them is to the left, what is behind them to the right.
    fn near(&self, x: f32) -> Range<usize> {
        let first = self.lefts.partition_point(|left| *left <= x - WIDEST);
        first..self.lefts.partition_point(|left| *left <= x)
    }
}

#[cfg(test)]
mod tests {
    use glam::vec2;
    use prehend_geometry::SplitMix64;

    use super::*;

    /// Edges of random triangles: every one once, in the order of its triangle.
    fn triangles(count: usize, random: &mut SplitMix64) -> Vec<Segment> {
        let mut segments = Vec::new();
        for _ in 0..count {
            let mut number = |width: f64| ((random.uniform() - 0.5) * width) as f32;
            let center = vec2(number(60.0), number(60.0));
            // Some long, some shorter than a strip, some level or upright.
            let size = f64::from(10f32.powf(1.0 + number(4.0)));
            let corners = [(); 3].map(|()| center + vec2(number(size), number(size)));
            let mut corners =
                corners.map(|corner| corner.clamp(Vec2::splat(-40.0), Vec2::splat(40.0)));
            if segments.len() % 4 == 0 {
                corners[1].y = corners[0].y;
                corners[2].x = corners[0].x;
            }
            let pairs = [0, 1, 2].map(|k| (corners[k], corners[(k + 1) % 3]));
            segments.extend(pairs.map(|(a, b)| Segment { a, b, layers: 1.0 }));
        }
        segments
    }

    #[test]
    fn crowds_are_counted_as_one_by_one() {
        let mut random = SplitMix64::new(7);
        let region = Region { x0: 0, y0: 0, x1: 30, y1: 30 };
        for count in [3, 200, 800] {
            let segments = triangles(count, &mut random);
            let layers = Layers::new(&segments, &region, 8.0);
            assert_eq!(layers.crowded.is_empty(), count == 3);
            for _ in 0..20_000 {
                let mut number = || ((random.uniform() - 0.1) * 40.0) as f32;
                let mut at = vec2(number(), number());
                if at.x < 0.0 {
                    // On a corner.
                    at = segments[(at.y.abs() as usize) % segments.len()].a;
                }
                let within = at.y >= -8.0 && at.y < 38.0;
                let expected: f32 = segments.iter().map(|s| s.crossed(at)).sum();
                assert_eq!(layers.at(at), if within { expected } else { 0.0 }, "{count} {at}");
            }
        }
    }

    /// A heap of a thousand triangles once took time by the square of their number.
    #[test]
    fn of_a_crowd_few_segments_are_asked() {
        let mut random = SplitMix64::new(3);
        let region = Region { x0: 0, y0: 0, x1: 30, y1: 30 };
        let layers = Layers::new(&triangles(10_000, &mut random), &region, 8.0);
        let (mut all, mut asked) = (0, 0);
        for (&strip, crowded) in &layers.crowded {
            let count = (layers.starts[strip + 1] - layers.starts[strip]) as usize;
            for x in 0..30 {
                all += count;
                asked += crowded.near(x as f32).len() + count - crowded.lefts.len();
            }
        }
        assert!(asked * 5 < all, "{asked} of {all}");
    }
}
