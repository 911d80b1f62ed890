//! Patches of the object's surface that may each be off by themselves.

use nalgebra::{DMatrix, Vector3};

use crate::Observation;

/// How far the surface of an object is from that of its model.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelSettings {
    /// Standard deviation of a place of the surface from where the model has it, in each direction \[m\]; zero if models are exact.
    pub deviation: f64,
    /// Distance over which that changes \[m\].
    pub length: f64,
}

impl Default for ModelSettings {
    /// A scan, or a careful model, of a thing that fits into a hand.
    fn default() -> Self {
        Self { deviation: 7e-4, length: 20e-3 }
    }
}

/// Patches at most, about: that many tiles of the image would cover the mask.
const MOST_PATCHES: f64 = 30.0;

/// Width of a patch at least, as a share of the distance over which the deviation changes.
const LEAST_SIDE: f64 = 0.6;

/// Tiles are so many pixels wide, or a multiple, to be of whole pixels in smaller images too.
const UNIT: usize = 4;

/// Measured depths that are farther than this share of the object's distance from it are of something else.
const NEAR: f64 = 0.2;

/// What is independent in patches however near they are, as a share of the variance; keeps their covariance regular.
const OWN: f64 = 1e-3;

/// What an observation shows of the object, cut into patches by square tiles of the image, where the object may be off from its
/// model: each patch is displaced, and neighbours alike, by a Gaussian process over space.
///
/// Patches are of the image rather than of the model, so that only what is seen has any.
#[derive(Clone, Debug)]
pub(crate) struct Patches {
    /// Width of a tile \[px\].
    side: usize,
    /// The first tile's column and row, and how many columns there are.
    first: [usize; 2],
    columns: usize,
    /// Number of the patch in each tile, row-major.
    numbers: Vec<Option<usize>>,
    /// Inverse of the covariance of the patches' displacements in one direction \[1/m²\].
    precision: DMatrix<f64>,
}

impl Patches {
    /// Of the object in `observation`, which is about `distance` from the camera \[m\] where no depth is measured. `None` if there is
    /// nothing of it to be seen, or models are exact.
    pub(crate) fn new(
        observation: &Observation,
        distance: f64,
        settings: &ModelSettings,
    ) -> Option<Self> {
        let &ModelSettings { deviation, length } = settings;
        if !(deviation > 0.0 && length > 0.0) {
            return None;
        }
        let (mask, camera) = (&observation.mask, &observation.camera);
        let width = camera.width;
        let seen = || mask.pixels().iter().enumerate().filter(|(_, m)| **m).map(|(i, _)| i);
        let least = LEAST_SIDE * length * camera.fx / distance;
        let side = (seen().count() as f64 / MOST_PATCHES).sqrt().max(least);
        let side = (side as usize).div_ceil(UNIT).max(1) * UNIT;
        let tile = |pixel: usize| [pixel % width / side, pixel / width / side];
        let first = [0, 1].map(|k| seen().map(|i| tile(i)[k]).min());
        let last = [0, 1].map(|k| seen().map(|i| tile(i)[k]).max());
        let ([Some(left), Some(top)], [Some(right), Some(bottom)]) = (first, last) else {
            return None;
        };
        let columns = right - left + 1;
        // Sums of places and numbers of pixels.
        let mut tiles = vec![(Vector3::zeros(), 0.0); columns * (bottom - top + 1)];
        for pixel in seen() {
            let [column, row] = tile(pixel);
            let measured = f64::from(observation.depth.pixels()[pixel]);
            let near = (measured - distance).abs() < NEAR * distance;
            let depth = if near { measured } else { distance };
            let place = camera.unproject((pixel % width) as f64, (pixel / width) as f64, depth);
            let (sum, count) = &mut tiles[(row - top) * columns + column - left];
            *sum += place.coords;
            *count += 1.0;
        }
        let mut places = Vec::new();
        let number = |(sum, count): &(Vector3<f64>, f64)| {
            (*count > 0.0).then(|| {
                places.push(sum / *count);
                places.len() - 1
            })
        };
        let numbers = tiles.iter().map(number).collect();
        let covariance = DMatrix::from_fn(places.len(), places.len(), |i, j| {
            let squared = (places[i] - places[j]).norm_squared();
            let own = if i == j { OWN } else { 0.0 };
            deviation.powi(2) * ((-0.5 * squared / length.powi(2)).exp() + own)
        });
        let precision = covariance.cholesky()?.inverse();
        Some(Self { side, first: [left, top], columns, numbers, precision })
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.precision.nrows()
    }

    /// Width of a tile \[px\].
    pub(crate) fn side(&self) -> usize {
        self.side
    }

    /// The patch in a tile of the image.
    pub(crate) fn in_tile(&self, column: usize, row: usize) -> Option<usize> {
        let [left, top] = self.first;
        let (column, row) = (column.checked_sub(left)?, row.checked_sub(top)?);
        if column >= self.columns {
            return None;
        }
        *self.numbers.get(row * self.columns + column)?
    }

    /// The patch at pixel (x, y).
    pub(crate) fn at(&self, x: usize, y: usize) -> Option<usize> {
        self.in_tile(x / self.side, y / self.side)
    }

    /// Inverse of the covariance of the patches' displacements in one direction \[1/m²\].
    pub(crate) fn precision(&self) -> &DMatrix<f64> {
        &self.precision
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::default_scene;

    #[test]
    fn every_pixel_of_the_mask_is_in_a_patch_and_neighbours_are_off_alike() {
        let scene = default_scene(1).unwrap();
        let (observation, distance) = (&scene.observation, scene.truth.translation.z);
        let settings = ModelSettings::default();
        let patches = Patches::new(observation, distance, &settings).unwrap();
        let width = observation.camera.width;
        let mut seen = vec![0; patches.count()];
        for (pixel, _) in observation.mask.pixels().iter().enumerate().filter(|(_, m)| **m) {
            seen[patches.at(pixel % width, pixel / width).unwrap()] += 1;
        }
        assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
        assert!((8..=60).contains(&seen.len()), "{} patches", seen.len());
        assert_eq!(patches.side() % UNIT, 0);
        assert_eq!(patches.at(0, 0), None);
        let covariance = patches.precision().clone().cholesky().unwrap().inverse();
        let variance = settings.deviation.powi(2);
        assert!(covariance.diagonal().iter().all(|v| (v / variance - 1.0).abs() < 0.01));
        let correlations =
            covariance.upper_triangle() - DMatrix::from_diagonal(&covariance.diagonal());
        assert!(correlations.max() > 0.5 * variance, "{}", correlations.max() / variance);
        assert!(covariance.min() < 0.1 * variance);
    }

    #[test]
    fn an_exact_model_has_none() {
        let scene = default_scene(1).unwrap();
        let settings = ModelSettings { deviation: 0.0, ..ModelSettings::default() };
        assert!(Patches::new(&scene.observation, 0.5, &settings).is_none());
        let mut unseen = scene.observation.clone();
        unseen.mask = prehend_render::Mask::filled(640, 480, false);
        assert!(Patches::new(&unseen, 0.5, &ModelSettings::default()).is_none());
    }
}
