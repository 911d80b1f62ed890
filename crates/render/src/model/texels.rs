//! A filtered texture as a weighted sum of texels: its derivatives by place, level and texels.

use prehend_autodiff::Scalar;

use super::mipmap::{Level, Mipmap};

/// A texel and its weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tap<S> {
    pub(crate) level: usize,
    pub(crate) index: usize,
    pub(crate) weight: S,
}

impl Mipmap {
    /// The texels whose weighted sum is [`Mipmap::sample`].
    #[inline]
    pub(crate) fn taps<S: Scalar>(&self, u: S, v: S, level: S) -> [Tap<S>; 8] {
        let last = self.levels.len() - 1;
        let fine = (level.value().max(0.0) as usize).min(last);
        let blend = if fine == last { S::zero() } else { level.plus(-(fine as f64)) };
        let near = self.levels[fine].taps(u, v);
        let far = self.levels[(fine + 1).min(last)].taps(u, v);
        let tap = |level: usize, (index, weight): (usize, S), share: S| Tap {
            level,
            index,
            weight: weight * share,
        };
        std::array::from_fn(|i| match i {
            0..4 => tap(fine, near[i], S::one() - blend),
            _ => tap((fine + 1).min(last), far[i - 4], blend),
        })
    }

    /// The color that `taps` add up to.
    #[inline]
    pub(crate) fn blend<S: Scalar>(&self, taps: &[Tap<S>; 8]) -> [S; 3] {
        let mut color = [S::zero(); 3];
        for tap in taps {
            let texel = self.levels[tap.level].texels[tap.index];
            (0..3).for_each(|c| color[c] += tap.weight.times(texel[c] as f64));
        }
        color
    }

    /// Zeros for every texel of every level.
    pub(crate) fn zeros(&self) -> Vec<Vec<[f64; 3]>> {
        self.levels.iter().map(|level| vec![[0.0; 3]; level.texels.len()]).collect()
    }

    /// The derivative by the finest texels, given that by the texels of each level as if they were independent.
    pub(crate) fn gather(&self, mut by_level: Vec<Vec<[f64; 3]>>) -> Vec<[f64; 3]> {
        while by_level.len() > 1 {
            let Some(coarse) = by_level.pop() else { break };
            let last = by_level.len() - 1;
            let (level, width) = (&self.levels[last], self.levels[last + 1].width);
            for (at, adjoint) in coarse.iter().enumerate() {
                if *adjoint == [0.0; 3] {
                    continue;
                }
                for index in level.below(at % width, at / width) {
                    (0..3).for_each(|c| by_level[last][index][c] += 0.25 * adjoint[c]);
                }
            }
        }
        by_level.pop().unwrap_or_default()
    }
}

impl Level {
    #[inline]
    fn taps<S: Scalar>(&self, u: S, v: S) -> [(usize, S); 4] {
        // As in `Level::sample`: rows run down, coordinates beyond 0..=1 repeat.
        let wrap = |t: S| match t.value() {
            x if (0.0..=1.0).contains(&x) => t,
            x => t.plus(-x.floor()),
        };
        let cell = |t: S, size: usize| {
            let position = t.times(size as f64).plus(-0.5);
            let floor = position.value().floor();
            let index = |i: f64| i.clamp(0.0, size as f64 - 1.0) as usize;
            (position.plus(-floor), index(floor), index(floor + 1.0))
        };
        let (x, x0, x1) = cell(wrap(u), self.width);
        let (y, y0, y1) = cell(S::one() - wrap(v), self.height);
        let (left, top) = (S::one() - x, S::one() - y);
        [
            (y0 * self.width + x0, left * top),
            (y0 * self.width + x1, x * top),
            (y1 * self.width + x0, left * y),
            (y1 * self.width + x1, x * y),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prehend_autodiff::Fwd;

    fn map() -> Mipmap {
        let texels = (0..13 * 8).map(|i| [i * 37 % 251, i * 91 % 253, i].map(|v| v as f32 / 255.0));
        Mipmap::of_texels(13, 8, texels.collect())
    }

    #[test]
    fn taps_add_up_to_the_sample_and_its_derivatives() {
        let map = map();
        for (u, v, level) in [
            (0.31, 0.77, 0.0),
            (0.62, 0.2, 0.6),
            (1.43, -0.3, 1.3),
            (0.5, 0.45, 2.2),
            (0.1, 0.9, 9.0),
        ] {
            let color = map.blend(&map.taps(u, v, level));
            let sample = map.sample(u as f32, v as f32, level as f32);
            let by = map.blend(&map.taps::<Fwd<3>>(
                Fwd::variable(u, 0),
                Fwd::variable(v, 1),
                Fwd::variable(level, 2),
            ));
            for c in 0..3 {
                assert!((color[c] - sample.color[c] as f64).abs() < 1e-5);
                let expected = [sample.du[c], sample.dv[c], sample.dlevel[c]];
                let count = if level == 0.0 { 2 } else { 3 };
                for (a, b) in by[c].derivative.iter().zip(expected).take(count) {
                    assert!((a - b as f64).abs() < 1e-3 * (1.0 + a.abs()), "{u} {v} {level}");
                }
            }
        }
    }

    #[test]
    fn the_pyramid_passes_adjoints_down() {
        // A texel's derivative is the change of the sampled color when it alone is set.
        let map = map();
        let (u, v, level) = (0.93, 0.13, 1.7);
        let mut by_level = map.zeros();
        for tap in map.taps(u, v, level) {
            by_level[tap.level][tap.index][1] += tap.weight;
        }
        let gradient = map.gather(by_level);
        let before = map.blend(&map.taps(u, v, level))[1];
        let mut total = 0.0;
        for (at, by) in gradient.iter().enumerate() {
            let mut texels = map.levels[0].texels.clone();
            texels[at][1] += 1.0;
            let after = Mipmap::of_texels(13, 8, texels);
            let change = after.blend(&after.taps(u, v, level))[1] - before;
            assert!((change - by[1]).abs() < 1e-6, "{at}: {change} {by:?}");
            total += by[1];
        }
        assert!((total - 1.0).abs() < 1e-12);
    }
}
