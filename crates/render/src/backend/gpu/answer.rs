//! Losses, tiles and pictures from the results of the device.

use super::layout::{
    PICTURE_COLUMNS, SUM_COLOR, SUM_COLUMNS, SUM_CONTOUR, SUM_COVERED, SUM_DEPTH, SUM_GRADIENT,
    SUM_HESSIAN, SUM_HIDDEN, SUM_MASK, SUM_MISSED, SUM_WITH_DEPTH,
};
use crate::image::{DepthImage, RgbImage};
use crate::pose_loss::{Counts, Linearized, Loss, PoseImage, Target, Tile, unpacked};

/// From the sums of one square.
pub(super) fn loss(sums: &[f32], target: &Target) -> Loss {
    let count = |i: usize| sums[i] as usize;
    let counts = Counts {
        covered: count(SUM_COVERED),
        contour: count(SUM_CONTOUR),
        hidden: count(SUM_HIDDEN),
        missed: count(SUM_MISSED),
        depth: count(SUM_WITH_DEPTH),
    };
    let shares = [SUM_COLOR, SUM_MASK, SUM_DEPTH].map(|i| f64::from(sums[i]));
    Loss::new(shares, counts, target)
}

/// From the sums of one square.
pub(super) fn linearized(sums: &[f32], target: &Target) -> Linearized {
    // In the order of the processor's own sums.
    const { assert!(SUM_HESSIAN == SUM_GRADIENT + 6) };
    let entries = std::array::from_fn(|i| f64::from(sums[SUM_GRADIENT + i]));
    let (gradient, hessian) = unpacked(&entries, target.normalization);
    Linearized { loss: loss(sums, target), gradient, hessian }
}

/// From the sums of all squares of a hypothesis, row by row: those in which something is drawn or missed, column by column
/// as the processor gives them.
pub(super) fn tiles(sums: &[f32], [across, down]: [u32; 2], target: &Target) -> Vec<Tile> {
    let places = (0..across as usize).flat_map(|x| (0..down as usize).map(move |y| (x, y)));
    let tile = |(column, row): (usize, usize)| {
        let first = (row * across as usize + column) * SUM_COLUMNS;
        let at = linearized(&sums[first..first + SUM_COLUMNS], target);
        (at.loss.counts != Counts::default()).then_some(Tile { column, row, at })
    };
    places.filter_map(tile).collect()
}

/// From the columns of all pixels.
pub(super) fn picture(size: [u32; 2], values: &[f32]) -> PoseImage {
    let [width, height] = size.map(|v| v as usize);
    let mut picture = PoseImage {
        color: RgbImage::filled(width, height, [0.0; 3]),
        coverage: values.iter().skip(3).step_by(PICTURE_COLUMNS).copied().collect(),
        depth: DepthImage::filled(width, height, 0.0),
        normal: values.chunks_exact(PICTURE_COLUMNS).map(|v| [v[5], v[6], v[7]]).collect(),
        face: values.chunks_exact(PICTURE_COLUMNS).map(|v| face(v[8])).collect(),
    };
    let pixels = picture.color.pixels_mut().iter_mut().zip(picture.depth.pixels_mut());
    for ((color, depth), v) in pixels.zip(values.chunks_exact(PICTURE_COLUMNS)) {
        *color = [v[0], v[1], v[2]];
        *depth = v[4];
    }
    picture
}

/// The face of a picture's last column.
fn face(column: f32) -> Option<u32> {
    (column > 0.0).then(|| column as u32 - 1)
}
