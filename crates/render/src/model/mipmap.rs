//! Texture lookup: bilinear inside a level, linear between levels of a box-filtered pyramid.

use prehend_geometry::Texture;

/// A texture with its pyramid of halved copies.
#[derive(Clone, Debug)]
pub(crate) struct Mipmap {
    pub(super) levels: Vec<Level>,
}

/// One level of the pyramid.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) texels: Vec<[f32; 3]>,
}

/// A filtered color and its derivatives, per channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Texel {
    /// Color.
    pub(crate) color: [f32; 3],
    /// By the first texture coordinate.
    pub(crate) du: [f32; 3],
    /// By the second texture coordinate.
    pub(crate) dv: [f32; 3],
    /// By the pyramid level.
    pub(crate) dlevel: [f32; 3],
}

impl Mipmap {
    /// The pyramid of `texture`; `None` when it has no pixels or the wrong number of them.
    pub(crate) fn new(texture: &Texture) -> Option<Self> {
        let (width, height) = (texture.width, texture.height);
        if width == 0 || height == 0 || texture.pixels.len() != width * height {
            return None;
        }
        let texels = texture.pixels.iter().map(|p| p.map(|v| v as f32 / 255.0)).collect();
        Some(Self::of_texels(width, height, texels))
    }

    /// The pyramid over a finest level.
    pub(super) fn of_texels(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Self {
        let mut levels = vec![Level { width, height, texels }];
        while let Some(next) = levels.last().and_then(Level::halved) {
            levels.push(next);
        }
        Self { levels }
    }

    /// Columns and rows of the finest level.
    pub(crate) fn size(&self) -> (usize, usize) {
        (self.levels[0].width, self.levels[0].height)
    }

    /// The coarsest level.
    pub(crate) fn last_level(&self) -> f32 {
        (self.levels.len() - 1) as f32
    }

    /// Columns, rows and row-major texels of each level, from the finest on.
    #[cfg(feature = "gpu")]
    pub(crate) fn levels(&self) -> impl ExactSizeIterator<Item = (usize, usize, &[[f32; 3]])> {
        self.levels.iter().map(|l| (l.width, l.height, l.texels.as_slice()))
    }

    /// Color at texture coordinates (`u`, `v`) (v up, repeating) on pyramid level `level` (0 the finest,
    /// fractions blend).
    #[inline]
    pub(crate) fn sample(&self, u: f32, v: f32, level: f32) -> Texel {
        let (fine, blend) = self.split(level);
        let a = self.levels[fine].sample(u, v);
        if blend == 0.0 {
            return a;
        }
        a.blended(&self.levels[fine + 1].sample(u, v), blend)
    }

    /// The whole part of a pyramid level within the pyramid, and the weight of the next coarser one.
    #[inline]
    pub(crate) fn split(&self, level: f32) -> (usize, f32) {
        let level = level.clamp(0.0, self.last_level());
        let fine = level as usize;
        (fine, level - fine as f32)
    }

    /// Level `index` alone.
    #[inline]
    pub(crate) fn level(&self, index: usize) -> &Level {
        &self.levels[index]
    }
}

impl Texel {
    /// Between this level and the next coarser one.
    #[inline(always)]
    pub(crate) fn blended(&self, coarse: &Self, blend: f32) -> Self {
        let mix = |x: [f32; 3], y: [f32; 3]| {
            [
                x[0] + blend * (y[0] - x[0]),
                x[1] + blend * (y[1] - x[1]),
                x[2] + blend * (y[2] - x[2]),
            ]
        };
        let (near, far) = (self.color, coarse.color);
        Self {
            color: mix(near, far),
            du: mix(self.du, coarse.du),
            dv: mix(self.dv, coarse.dv),
            dlevel: [far[0] - near[0], far[1] - near[1], far[2] - near[2]],
        }
    }

    /// Between four texels of a level: upper left, upper right, lower left, lower right.
    #[inline(always)]
    pub(crate) fn bilinear(texels: &[[f32; 3]; 4], cell: &Cell, size: [f32; 2]) -> Self {
        let [a, b, c, d] = texels;
        let (x, y) = (cell.x, cell.y);
        let mut out = Self::default();
        for k in 0..3 {
            let (top, bottom) = (b[k] - a[k], d[k] - c[k]);
            let (left, right) = (c[k] - a[k], d[k] - b[k]);
            out.color[k] = a[k] + x * top + y * (left + x * (bottom - top));
            out.du[k] = (top + y * (bottom - top)) * size[0];
            // Rows run down while v runs up.
            out.dv[k] = -(left + x * (right - left)) * size[1];
        }
        out
    }
}

/// Where a point lies between texel centers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cell {
    /// Share of the way from the left to the right texels, and from the upper to the lower.
    pub(crate) x: f32,
    pub(crate) y: f32,
    /// Column of the right texels and row of the lower ones, before clamping to the texture.
    pub(crate) right: i32,
    pub(crate) lower: i32,
}

impl Level {
    fn halved(&self) -> Option<Self> {
        if self.width == 1 && self.height == 1 {
            return None;
        }
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut texels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let mut sum = [0.0f32; 3];
                for index in self.below(x, y) {
                    (0..3).for_each(|c| sum[c] += 0.25 * self.texels[index][c]);
                }
                texels.push(sum);
            }
        }
        Some(Self { width, height, texels })
    }

    /// The four texels whose mean is texel (x, y) of the next level.
    pub(super) fn below(&self, x: usize, y: usize) -> [usize; 4] {
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| {
            // Odd sizes repeat their last row and column.
            let (sx, sy) = ((2 * x + dx).min(self.width - 1), (2 * y + dy).min(self.height - 1));
            sy * self.width + sx
        })
    }

    /// Bilinear color, and derivatives by (u, v) with no entry for the level.
    #[inline]
    fn sample(&self, u: f32, v: f32) -> Texel {
        let cell = self.cell(u, v);
        Texel::bilinear(&self.around(cell.right, cell.lower), &cell, self.size())
    }

    /// Columns and rows.
    #[inline(always)]
    pub(crate) fn size(&self) -> [f32; 2] {
        [self.width as f32, self.height as f32]
    }

    /// The cell of texture coordinates (`u`, `v`).
    #[inline(always)]
    pub(crate) fn cell(&self, u: f32, v: f32) -> Cell {
        // Coordinates within 0..=1 stay (an edge at exactly 1 must not wrap to 0); others repeat.
        let wrap = |t: f32| {
            let beyond = !(0.0..=1.0).contains(&t);
            t - if beyond { floor(t) } else { 0.0 }
        };
        let place = |t: f32, size: f32| {
            let position = t * size - 0.5;
            // Truncation rounds down once nothing is negative.
            let above = (position + 1.0) as i32;
            (position - (above as f32 - 1.0), above)
        };
        let [width, height] = self.size();
        let (x, right) = place(wrap(u), width);
        let (y, lower) = place(1.0 - wrap(v), height);
        Cell { x, y, right, lower }
    }

    /// The four texels of a cell: upper left, upper right, lower left, lower right.
    #[inline]
    pub(crate) fn around(&self, right: i32, lower: i32) -> [[f32; 3]; 4] {
        let (right, lower) = (right.max(0) as usize, lower.max(0) as usize);
        let (x0, x1) = (right.saturating_sub(1).min(self.width - 1), right.min(self.width - 1));
        let (y0, y1) = (lower.saturating_sub(1).min(self.height - 1), lower.min(self.height - 1));
        let (upper, lower) = (y0 * self.width, y1 * self.width);
        [upper + x0, upper + x1, lower + x0, lower + x1].map(|i| self.texels[i])
    }
}

/// The largest whole number not above `t` (`f32::floor` is a function call on baseline x86-64).
#[inline(always)]
fn floor(t: f32) -> f32 {
    let whole = t as i32 as f32;
    whole - if whole > t { 1.0 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture() -> Texture {
        let pixels = (0..13 * 8).map(|i| [(i * 37 % 251) as u8, (i * 91 % 253) as u8, i as u8]);
        Texture { width: 13, height: 8, pixels: pixels.collect() }
    }

    #[test]
    fn the_lower_left_corner_is_the_origin() {
        let map = Mipmap::new(&texture()).unwrap();
        let texel = map.sample(0.5 / 13.0, 0.5 / 8.0, 0.0);
        let lower_left = texture().pixels[7 * 13];
        (0..3).for_each(|c| assert!((texel.color[c] - lower_left[c] as f32 / 255.0).abs() < 1e-6));
    }

    #[test]
    fn derivatives_match_finite_differences() {
        let map = Mipmap::new(&texture()).unwrap();
        let step = 1e-3;
        for (u, v, level) in
            [(0.31, 0.77, 0.0), (0.62, 0.2, 0.6), (1.43, -0.3, 1.3), (0.5, 0.45, 2.2)]
        {
            let texel = map.sample(u, v, level);
            for (axis, derivative) in [(0, texel.du), (1, texel.dv), (2, texel.dlevel)] {
                if level == 0.0 && axis == 2 {
                    continue;
                }
                let at = |sign: f32| {
                    let d = |i: i32| if i == axis { sign * step } else { 0.0 };
                    map.sample(u + d(0), v + d(1), level + d(2)).color
                };
                let (high, low) = (at(1.0), at(-1.0));
                for c in 0..3 {
                    let difference = (high[c] - low[c]) / (2.0 * step);
                    assert!((difference - derivative[c]).abs() < 2e-3 * (1.0 + difference.abs()));
                }
            }
        }
    }

    #[test]
    fn the_coarsest_level_is_one_texel() {
        let even = Texture { width: 4, height: 4, ..texture() };
        let even = Texture { pixels: even.pixels[..16].to_vec(), ..even };
        let map = Mipmap::new(&even).unwrap();
        assert_eq!(map.last_level(), 2.0);
        let mean = even.pixels.iter().map(|p| p[0] as f32 / 255.0).sum::<f32>() / 16.0;
        assert!((map.sample(0.2, 0.9, 9.0).color[0] - mean).abs() < 1e-6);
        assert!(Mipmap::new(&Texture { width: 5, ..even }).is_none());
    }
}
