//! A canvas measured in millimeters, on which the objects' textures are painted.

use crate::mesh::Texture;

use super::lettering::glyph;

/// An sRGB color as 0xRRGGBB.
pub(super) type Color = u32;

/// A rectangle \[mm\]: left, bottom, right, top.
pub(super) type Area = [f64; 4];

/// A picture with its origin at the lower left, x to the right and y up \[mm\].
pub(super) struct Canvas {
    width: usize,
    height: usize,
    /// Pixels a millimeter.
    scale: f64,
    pixels: Vec<[f32; 3]>,
}

fn channels(color: Color) -> [f32; 3] {
    [16, 8, 0].map(|shift| ((color >> shift) & 0xff) as f32 / 255.0)
}

impl Canvas {
    /// A canvas of `size` \[mm\] in one color, its longer side `pixels` wide.
    pub(super) fn new(size: [f64; 2], pixels: usize, color: Color) -> Self {
        let scale = pixels as f64 / size[0].max(size[1]);
        let [width, height] = size.map(|s| ((s * scale).round() as usize).max(1));
        Self { width, height, scale, pixels: vec![channels(color); width * height] }
    }

    /// Paints `color` within `area` where `inside` holds, with edges smoothed by nine samples a pixel.
    pub(super) fn shape(&mut self, area: Area, color: Color, inside: impl Fn(f64, f64) -> bool) {
        let color = channels(color);
        let column = |x: f64| (x * self.scale).clamp(0.0, self.width as f64);
        let row = |y: f64| (self.height as f64 - y * self.scale).clamp(0.0, self.height as f64);
        let (left, right) = (column(area[0]).floor() as usize, column(area[2]).ceil() as usize);
        let (top, bottom) = (row(area[3]).floor() as usize, row(area[1]).ceil() as usize);
        for r in top..bottom {
            for c in left..right {
                let mut hits = 0;
                for k in 0..9 {
                    let x = (c as f64 + (2 * (k % 3) + 1) as f64 / 6.0) / self.scale;
                    let y = (self.height as f64 - r as f64 - (2 * (k / 3) + 1) as f64 / 6.0)
                        / self.scale;
                    let bounded = x >= area[0] && x <= area[2] && y >= area[1] && y <= area[3];
                    hits += usize::from(bounded && inside(x, y));
                }
                let (alpha, pixel) = (hits as f32 / 9.0, &mut self.pixels[r * self.width + c]);
                *pixel = std::array::from_fn(|i| pixel[i] + alpha * (color[i] - pixel[i]));
            }
        }
    }

    pub(super) fn rectangle(&mut self, area: Area, color: Color) {
        self.shape(area, color, |_, _| true);
    }

    /// A rectangle with corners of radius `radius` \[mm\].
    pub(super) fn plate(&mut self, area: Area, radius: f64, color: Color) {
        let [x0, y0, x1, y1] = area;
        self.shape(area, color, |x, y| {
            let beyond =
                |v: f64, low: f64, high: f64| (low + radius - v).max(v - high + radius).max(0.0);
            beyond(x, x0, x1).hypot(beyond(y, y0, y1)) <= radius
        });
    }

    /// The ellipse that fills `area`.
    pub(super) fn ellipse(&mut self, area: Area, color: Color) {
        let [x0, y0, x1, y1] = area;
        self.shape(area, color, |x, y| {
            let (u, v) = ((2.0 * x - x0 - x1) / (x1 - x0), (2.0 * y - y0 - y1) / (y1 - y0));
            u * u + v * v <= 1.0
        });
    }

    pub(super) fn disc(&mut self, [x, y]: [f64; 2], radius: f64, color: Color) {
        self.ellipse([x - radius, y - radius, x + radius, y + radius], color);
    }

    /// A star of `rays` rays between two radii \[mm\].
    pub(super) fn star(&mut self, [cx, cy]: [f64; 2], radii: [f64; 2], rays: usize, color: Color) {
        let r = radii[0].max(radii[1]);
        self.shape([cx - r, cy - r, cx + r, cy + r], color, |x, y| {
            let turn = (y - cy).atan2(x - cx) / std::f64::consts::TAU * rays as f64;
            let wave = (turn - turn.floor() - 0.5).abs() * 2.0;
            (x - cx).hypot(y - cy) <= radii[0] + wave * (radii[1] - radii[0])
        });
    }

    /// Stripes of half the `period` \[mm\], leaning by `slope` (x a y).
    pub(super) fn stripes(&mut self, area: Area, period: f64, slope: f64, color: Color) {
        self.shape(area, color, |x, y| {
            ((x - area[0] - slope * (y - area[1])) / period).rem_euclid(1.0) < 0.5
        });
    }

    /// A line of text, centered in `area` and as large as fits, in letters of 5 × 7 blocks.
    pub(super) fn text(&mut self, area: Area, text: &str, color: Color) {
        let columns = (6 * text.len()).saturating_sub(1).max(1) as f64;
        let block = ((area[2] - area[0]) / columns).min((area[3] - area[1]) / 7.0);
        let x0 = 0.5 * (area[0] + area[2] - columns * block);
        let top = 0.5 * (area[1] + area[3] + 7.0 * block);
        let cells: Vec<[u8; 7]> = text.chars().map(glyph).collect();
        let set = |x: f64, y: f64| {
            let (column, row) = ((x / block).floor() as usize, (y / block).floor() as usize);
            let bits = cells.get(column / 6).and_then(|g| g.get(row)).copied().unwrap_or(0);
            x >= 0.0 && column % 6 < 5 && bits >> (4 - column % 6) & 1 == 1
        };
        // Strokes are drawn a little wider than their blocks, as in a bold type.
        let bold = 0.4 * block;
        self.shape([x0, top - 7.0 * block, x0 + columns * block + bold, top], color, |x, y| {
            set(x - x0, top - y) || set(x - x0 - bold, top - y)
        });
    }

    /// Small print: `lines` lines of words, ragged on the right, derived from `seed`.
    pub(super) fn small_print(&mut self, area: Area, lines: usize, seed: u64, color: Color) {
        let pitch = (area[3] - area[1]) / lines as f64;
        for line in 0..lines {
            let y = area[3] - (line as f64 + 0.75) * pitch;
            let (mut x, mut word) = (area[0], 0);
            loop {
                let length = pitch * (1.0 + 3.0 * hash(seed, line as i64, word));
                word += 1;
                // The last line is half as long, like a paragraph's.
                let end = if line + 1 == lines { 0.5 * (area[0] + area[2]) } else { area[2] };
                if x + length > end {
                    break;
                }
                self.rectangle([x, y, x + length, y + 0.5 * pitch], color);
                x += length + 0.6 * pitch;
            }
        }
    }

    /// A bar code that fills `area`, derived from `seed`.
    pub(super) fn bar_code(&mut self, area: Area, seed: u64) {
        self.rectangle(area, 0xffffff);
        let module = (area[2] - area[0]) / 40.0;
        for k in 2..38 {
            if hash(seed, k, 0) < 0.5 {
                let x = area[0] + k as f64 * module;
                self.rectangle([x, area[1] + module, x + module, area[3] - module], 0x161616);
            }
        }
    }

    /// Multiplies brightness by 1 ± `amplitude`, smoothly varying over `period` \[mm\].
    pub(super) fn grain(&mut self, area: Area, period: f64, amplitude: f64, seed: u64) {
        for r in 0..self.height {
            for c in 0..self.width {
                let [x, y] = [
                    (c as f64 + 0.5) / self.scale,
                    (self.height as f64 - r as f64 - 0.5) / self.scale,
                ];
                if x >= area[0] && x <= area[2] && y >= area[1] && y <= area[3] {
                    let gain = 1.0 + amplitude * (2.0 * noise(seed, x / period, y / period) - 1.0);
                    self.pixels[r * self.width + c].iter_mut().for_each(|v| *v *= gain as f32);
                }
            }
        }
    }

    pub(super) fn into_texture(self) -> Texture {
        let byte = |v: f32| (255.0 * v.clamp(0.0, 1.0)).round() as u8;
        let pixels = self.pixels.iter().map(|p| p.map(byte)).collect();
        Texture { width: self.width, height: self.height, pixels }
    }
}

/// A number in 0..1 that depends on its arguments alone (the finalizer of SplitMix64).
pub(super) fn hash(seed: u64, i: i64, j: i64) -> f64 {
    let mut h = seed
        ^ (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (j as u64).wrapping_mul(0xd1b5_4a32_d192_ed03);
    h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((h ^ (h >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Value noise in 0..1 with cells of unit size.
fn noise(seed: u64, x: f64, y: f64) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (u, v) = (ease(x - i), ease(y - j));
    let at = |a: i64, b: i64| hash(seed, i as i64 + a, j as i64 + b);
    let row = |b: i64| at(0, b) + u * (at(1, b) - at(0, b));
    row(0) + v * (row(1) - row(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_smooths_edges() {
        let mut canvas = Canvas::new([4.0, 2.0], 4, 0x000000);
        canvas.rectangle([0.5, 0.0, 2.0, 1.0], 0xffffff);
        let texture = canvas.into_texture();
        assert_eq!((texture.width, texture.height), (4, 2));
        // The lower row: half a pixel, a full one (two of three sample columns lie beyond 0.5), nothing.
        assert_eq!(texture.pixels[4..].iter().map(|p| p[0]).collect::<Vec<_>>(), [170, 255, 0, 0]);
        assert!(texture.pixels[..4].iter().all(|p| *p == [0; 3]));
    }

    #[test]
    fn text_reads_from_left_to_right_and_top_to_bottom() {
        let mut canvas = Canvas::new([11.0, 7.0], 11, 0x000000);
        canvas.text([0.0, 0.0, 11.0, 7.0], "LT", 0xffffff);
        let rows: Vec<String> = (canvas.into_texture().pixels.chunks(11))
            .map(|row| row.iter().map(|p| if p[0] > 127 { '#' } else { '.' }).collect())
            .collect();
        assert_eq!((rows[0].as_str(), rows[6].as_str()), ("#.....#####", "#####...#.."));
    }

    #[test]
    fn noise_is_continuous_and_within_bounds() {
        for k in 0..1000 {
            let (x, y) = (k as f64 * 0.037, k as f64 * -0.021);
            let value = noise(7, x, y);
            assert!((0.0..=1.0).contains(&value) && (noise(7, x + 1e-6, y) - value).abs() < 1e-5);
        }
    }
}
