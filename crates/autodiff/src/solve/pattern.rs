//! Which entries a matrix has.

#[cfg(feature = "faer")]
use std::sync::Arc;

/// Where an entry stands in the matrix. A symmetric entry stands in two places, a repeated one in one
/// place with others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) entry: usize,
    pub(super) row: usize,
    pub(super) column: usize,
}

/// The places of a square matrix's entries; cheap to clone.
#[derive(Clone, Debug)]
pub(super) enum Pattern {
    /// Every place of a matrix of this size, column by column.
    Dense(usize),
    #[cfg(feature = "faer")]
    Sparse { size: usize, places: Arc<[Place]> },
}

impl Pattern {
    pub(super) fn size(&self) -> usize {
        match self {
            Self::Dense(size) => *size,
            #[cfg(feature = "faer")]
            Self::Sparse { size, .. } => *size,
        }
    }

    /// Visits the places in a fixed order.
    pub(super) fn visit(&self, mut visit: impl FnMut(Place)) {
        match self {
            Self::Dense(size) => {
                for column in 0..*size {
                    for row in 0..*size {
                        visit(Place { entry: column * size + row, row, column });
                    }
                }
            }
            #[cfg(feature = "faer")]
            Self::Sparse { places, .. } => places.iter().copied().for_each(visit),
        }
    }
}
