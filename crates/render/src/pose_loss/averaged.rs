//! Pixels that are means of finer ones.

use rayon::prelude::*;

use crate::view::{Pixel, Row, Seen, View, scaled_sum};

/// A view whose pixels are the means of `samples` by `samples` pixels of a finer one.
///
/// A camera's pixel averages over its area, and so do the colors, the coverage and the rows of these: creases, fine
/// texture and folds count for as much of a pixel as they fill. Depth is the mean over the part that shows a face, by the weight
/// that it has there, so that it does not jump as an outline passes over the samples.
pub(super) struct Averaged<V> {
    fine: V,
    samples: usize,
}

/// Sums over fine pixels.
#[derive(Clone, Copy, Default)]
struct Accumulated {
    /// Colors, coverage and weight of depth, with their rows.
    sum: Pixel,
    /// Depth times its weight, with its row, where a face is hit.
    weighted: f32,
    weighted_row: Row,
    /// Depth of all that is seen.
    depth: f32,
    hits: usize,
    seen: usize,
    near_outline: bool,
}

fn add(sum: &mut Row, row: &Row) {
    sum.iter_mut().zip(row).for_each(|(a, b)| *a += b);
}

impl Accumulated {
    fn add<const DERIVATIVES: bool>(&mut self, Seen { pixel, hit, near_outline }: &Seen) {
        self.seen += 1;
        self.near_outline |= near_outline;
        (0..3).for_each(|k| self.sum.color[k] += pixel.color[k]);
        self.sum.coverage += pixel.coverage;
        self.depth += pixel.z;
        if *hit {
            self.hits += 1;
            self.sum.depth_weight += pixel.depth_weight;
            self.weighted += pixel.depth_weight * pixel.z;
        }
        if !DERIVATIVES {
            return;
        }
        for k in 0..3 {
            add(&mut self.sum.color_rows[k], &pixel.color_rows[k]);
        }
        add(&mut self.sum.coverage_row, &pixel.coverage_row);
        if *hit {
            let row =
                scaled_sum(pixel.depth_weight, &pixel.z_row, pixel.z, &pixel.depth_weight_row);
            add(&mut self.weighted_row, &row);
            add(&mut self.sum.depth_weight_row, &pixel.depth_weight_row);
        }
    }

    fn merge(&mut self, other: &Self) {
        (0..3).for_each(|k| {
            self.sum.color[k] += other.sum.color[k];
            add(&mut self.sum.color_rows[k], &other.sum.color_rows[k]);
        });
        self.sum.coverage += other.sum.coverage;
        self.sum.depth_weight += other.sum.depth_weight;
        add(&mut self.sum.coverage_row, &other.sum.coverage_row);
        add(&mut self.sum.depth_weight_row, &other.sum.depth_weight_row);
        self.weighted += other.weighted;
        add(&mut self.weighted_row, &other.weighted_row);
        self.depth += other.depth;
        self.hits += other.hits;
        self.seen += other.seen;
        self.near_outline |= other.near_outline;
    }

    /// The mean over `count` fine pixels; those that show nothing are black.
    fn mean(&self, count: usize) -> Option<Seen> {
        if self.seen == 0 {
            return None;
        }
        let share = 1.0 / count as f32;
        let scaled = |row: &Row| row.map(|v| v * share);
        // Without weight the depth only tells what hides the pixel.
        let weight = self.sum.depth_weight;
        let by_weight = if weight > 0.0 { 1.0 / weight } else { 0.0 };
        let plain = self.depth / self.seen as f32;
        let z = if weight > 0.0 { self.weighted * by_weight } else { plain };
        let pixel = Pixel {
            color: self.sum.color.map(|v| v * share),
            coverage: self.sum.coverage * share,
            z,
            depth_weight: self.sum.depth_weight * share,
            color_rows: self.sum.color_rows.each_ref().map(scaled),
            coverage_row: scaled(&self.sum.coverage_row),
            z_row: scaled_sum(
                by_weight,
                &self.weighted_row,
                -z * by_weight,
                &self.sum.depth_weight_row,
            ),
            depth_weight_row: scaled(&self.sum.depth_weight_row),
        };
        Some(Seen { pixel, hit: self.hits > 0, near_outline: self.near_outline })
    }
}

/// The pixels that a block of the finer view contributes to, row by row from `top`.
#[derive(Default)]
struct SampledPart {
    top: usize,
    rows: Vec<Vec<(usize, Accumulated)>>,
}

impl<V: View> Averaged<V> {
    /// `fine` is seen by the same camera at `samples` times its resolution.
    pub(super) fn new(fine: V, samples: usize) -> Self {
        Self { fine, samples }
    }

    fn part<const DERIVATIVES: bool>(&self, block: usize) -> SampledPart {
        let mut part = SampledPart::default();
        self.fine.visit::<DERIVATIVES>(block, |x, y, seen| {
            let (x, y) = (x / self.samples, y / self.samples);
            if part.rows.is_empty() {
                part.top = y;
            }
            // Pixels come row by row.
            while part.rows.len() <= y - part.top {
                part.rows.push(Vec::new());
            }
            let row = &mut part.rows[y - part.top];
            let start = row.first().map_or(x, |first| first.0);
            if row.len() <= x - start {
                row.push((x, Accumulated::default()));
            }
            if let Some(seen) = seen {
                row[x - start].1.add::<DERIVATIVES>(&seen);
            }
        });
        part
    }
}

impl<V: View> View for Averaged<V> {
    /// All is one block: those of the finer view, which are worked on in parallel, may share rows of pixels.
    fn blocks(&self) -> usize {
        self.fine.blocks().min(1)
    }

    fn right(&self) -> usize {
        self.fine.right().div_ceil(self.samples)
    }

    fn visit<const DERIVATIVES: bool>(
        &self,
        _block: usize,
        mut each: impl FnMut(usize, usize, Option<Seen>),
    ) {
        let blocks = 0..self.fine.blocks();
        let parts: Vec<SampledPart> =
            blocks.into_par_iter().map(|block| self.part::<DERIVATIVES>(block)).collect();
        let count = self.samples * self.samples;
        let mut finish = |y: usize, row: Vec<(usize, Accumulated)>| {
            row.iter().for_each(|(x, sum)| each(*x, y, sum.mean(count)));
        };
        let mut waiting: Option<(usize, Vec<(usize, Accumulated)>)> = None;
        for part in parts {
            for (i, row) in part.rows.into_iter().enumerate() {
                let y = part.top + i;
                match &mut waiting {
                    Some((last, sums)) if *last == y => {
                        sums.iter_mut().zip(row).for_each(|(a, b)| a.1.merge(&b.1));
                    }
                    _ => {
                        if let Some((last, sums)) = waiting.replace((y, row)) {
                            finish(last, sums);
                        }
                    }
                }
            }
        }
        if let Some((last, sums)) = waiting {
            finish(last, sums);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Noise, camera, full_options, lamp, pose, target_of, textured_box};
    use crate::contour::{ContourView, DrawStep};
    use crate::mode::{ContourOptions, Mode, SoftRasOptions};
    use crate::model::RenderModel;
    use crate::pose_loss::PoseLoss;
    use crate::projected::Region;
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn a_pixel_is_the_mean_of_its_samples() {
        let model = RenderModel::new(&textured_box()).unwrap();
        let pose = pose(&mut Noise(3));
        let loss = PoseLoss::default();
        for samples in [2, 3] {
            let coarse = loss.with_samples(samples).render(&model, &pose, &camera(), &lamp());
            let DrawStep::Smooth(w) = ContourOptions::default().drawing(samples).step else {
                panic!()
            };
            let fine = ContourOptions { half_width: w.into(), ..ContourOptions::default() };
            let fine = PoseLoss::new(Mode::Contour(fine), full_options());
            let fine = fine.render(&model, &pose, &camera().scaled(samples as f64), &lamp());
            let mean = fine.color.downsampled(samples);
            let pixels = coarse.color.pixels().iter().zip(mean.pixels());
            let worst = pixels.flat_map(|(a, b)| (0..3).map(move |k| (a[k] - b[k]).abs()));
            assert!(worst.fold(0.0, f32::max) < 1e-5);
            assert!(coarse.depth.pixels().iter().filter(|z| **z > 0.0).count() > 1000);
        }
    }

    #[test]
    fn gradients_match_differences_in_both_modes() {
        let model = RenderModel::new(&textured_box()).unwrap();
        let truth = pose(&mut Noise(4));
        let target = target_of(&model, &truth, &lamp(), None, 0.5);
        let mut guess = truth;
        guess.translation.vector.x += 0.002;
        let soft = SoftRasOptions::default();
        // Faded colors of texture beyond a face's border jump, which differences over long steps see (`softras` lists the jumps).
        for (mode, step) in [(Mode::default(), 4e-5), (Mode::SoftRas(soft), 1e-6)] {
            let loss = PoseLoss::new(mode, full_options()).with_samples(2);
            let center = guess * model.center();
            let at = loss.linearize(&model, &guess, &center, &lamp(), &target);
            for axis in 0..3 {
                let value = |s: f64| {
                    let mut pose = guess;
                    pose.translation.vector[axis] += s * step;
                    loss.evaluate(&model, &pose, &lamp(), &target).total
                };
                let difference = (value(1.0) - value(-1.0)) / (2.0 * step);
                let error = (difference - at.gradient[axis]).abs();
                assert!(error < 0.05 * at.gradient.norm(), "{mode:?} {axis}: {error}");
            }
        }
    }

    #[test]
    fn rows_shared_by_blocks_come_once() {
        let model = RenderModel::new(&textured_box()).unwrap();
        let pose = pose(&mut Noise(5));
        let camera = camera().scaled(3.0);
        let (options, light) = (ContourOptions::default(), lamp());
        let also = Region { x0: 1, y0: 2, x1: 100, y1: 110 };
        let center = Point3::origin();
        let view =
            ContourView::new(options.drawing(3), &model, &pose, &center, &camera, &light, &also);
        let mut seen = std::collections::HashSet::new();
        let averaged = Averaged::new(view, 3);
        averaged.visit::<false>(0, |x, y, _| assert!(seen.insert((x, y)), "{x} {y}"));
        assert!(seen.len() > 1000);
    }
}
