//! A picture of a film.

use std::path::Path;

use prehend_refine::data::{Assets, Target};
use prehend_refine::tracker::TrackStatus;
use prehend_render::{RenderModel, RgbImage, draw_outline};

use super::done::Done;

/// Frames side by side, and rows of them.
const COLUMNS: usize = 4;
const ROWS: usize = 2;
/// Pictures are so many times smaller than images, and so far apart \[px\].
const SMALLER: usize = 2;
const GAP: usize = 4;
/// Width of outlines before that \[px\], their color where the object was seen, and where it was only expected.
pub(super) const LINE: f64 = 4.0;
const SEEN: [f32; 3] = [0.2, 0.9, 0.3];
const EXPECTED: [f32; 3] = [0.95, 0.2, 0.15];

/// Color of the outline where the object is followed so.
pub(super) fn color_of(status: TrackStatus) -> [f32; 3] {
    match status {
        TrackStatus::Tracked | TrackStatus::Relocalized => SEEN,
        TrackStatus::Predicted | TrackStatus::Lost => EXPECTED,
    }
}

/// Writes some of `frames`, evenly in time, with the object's outline.
///
/// # Errors
/// If an image cannot be read again, or the picture not be written.
pub(super) fn write(
    file: &Path,
    frames: &[&Done],
    instance: usize,
    assets: &mut Assets<'_>,
) -> anyhow::Result<()> {
    let count = frames.len().min(COLUMNS * ROWS);
    let (mut strip, mut model) = (None, None);
    for k in 0..count {
        let Done { row, status, .. } = &frames[k * (frames.len() - 1) / (count - 1).max(1)];
        let (scene_id, im_id, obj_id) = (row.scene_id, row.im_id, row.obj_id);
        let input = assets.load(&Target { scene_id, im_id, obj_id, instance }, &[])?;
        let mut image = input.observation.color;
        let camera = &input.observation.camera;
        let model = match &model {
            Some(model) => model,
            None => model.insert(RenderModel::new(&input.object.mesh)?),
        };
        draw_outline(&mut image, camera, model, &row.t_cam_model, color_of(*status), LINE);
        let small = image.downsampled(SMALLER);
        let (width, height) = (small.width(), small.height());
        let strip: &mut RgbImage = strip.get_or_insert_with(|| {
            let (columns, rows) = (count.min(COLUMNS), count.div_ceil(COLUMNS));
            let size = |pictures: usize, size: usize| pictures * (size + GAP) - GAP;
            RgbImage::filled(size(columns, width), size(rows, height), [1.0; 3])
        });
        let (left, top) = (k % COLUMNS * (width + GAP), k / COLUMNS * (height + GAP));
        let row_length = strip.width();
        for (y, line) in small.pixels().chunks(width).enumerate() {
            let from = (top + y) * row_length + left;
            // Of images of different sizes, what fits.
            if let Some(to) = strip.pixels_mut().get_mut(from..from + width) {
                to.copy_from_slice(line);
            }
        }
    }
    if let Some(strip) = strip {
        strip.save(file)?;
    }
    Ok(())
}
