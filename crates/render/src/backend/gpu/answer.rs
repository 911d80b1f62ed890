//! Losses and tiles from the results of the device.

use super::layout::{
    SUM_COLOR, SUM_COLUMNS, SUM_CONTOUR, SUM_COVERED, SUM_DEPTH, SUM_GRADIENT, SUM_HESSIAN,
    SUM_HIDDEN, SUM_MASK, SUM_MISSED, SUM_WITH_DEPTH,
};
use crate::pose_loss::{Counts, Linearized, Loss, Target, Tile, unpacked};

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
