//! Patches of the object's surface that may each be off by themselves.

use nalgebra::{DMatrix, Point3, Vector3};

use crate::scene::{Frame, ModelErrorSettings, squared_exponential};

/// Independent variance of a patch as a share of σ²: keeps the covariance of near patches regular.
const OWN: f64 = 1e-3;

/// Patches of the object's visible surface, one per square tile of the image, each displaced from the model. Their prior is a Gaussian process over space.
///
/// Patches tile the image rather than the model, so that only visible surface has any.
#[derive(Clone, Debug)]
pub(crate) struct SurfacePatches {
    tiles: Tiles,
    /// Number of the patch in each tile.
    numbers: Vec<Option<usize>>,
    /// Centroid of the visible points of each patch (camera frame) \[m\].
    places: Vec<Point3<f64>>,
    /// Inverse of the covariance of the patches' displacements in one direction \[1/m²\].
    precision: DMatrix<f64>,
}

/// Square tiles over a part of an image, row-major.
#[derive(Clone, Debug)]
struct Tiles {
    /// Width of a tile \[px\].
    side: usize,
    /// Column and row of the first, and how many columns and rows there are.
    first: [usize; 2],
    size: [usize; 2],
}

impl Tiles {
    /// Those that have a part in the rectangle of this left, top, width and height, not zero.
    fn around([left, top, width, height]: [usize; 4], side: usize) -> Self {
        let first = [left / side, top / side];
        let last = [(left + width - 1) / side, (top + height - 1) / side];
        Self { side, first, size: [0, 1].map(|k| last[k] - first[k] + 1) }
    }

    /// How many there are.
    fn len(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// The one in this column and row of the image's tiles.
    fn index(&self, column: usize, row: usize) -> Option<usize> {
        let column = column.checked_sub(self.first[0]).filter(|column| *column < self.size[0])?;
        let row = row.checked_sub(self.first[1]).filter(|row| *row < self.size[1])?;
        Some(row * self.size[0] + column)
    }

    /// The one with this pixel.
    fn at(&self, [x, y]: [usize; 2]) -> Option<usize> {
        self.index(x / self.side, y / self.side)
    }
}

impl SurfacePatches {
    /// Patches of the object in `observation`, taken at `distance` from the camera \[m\] where no depth near that is measured. Tiles are a multiple
    /// of `unit` pixels wide, so that they are whole pixels of images downsampled by it. `None` if the mask is empty or the model exact.
    pub(crate) fn new(
        observation: &Frame,
        distance: f64,
        settings: &ModelErrorSettings,
        unit: usize,
    ) -> Option<Self> {
        let &ModelErrorSettings { sigma, length_scale, patches, max_patches, min_width, near } =
            settings;
        if !(sigma > 0.0 && length_scale > 0.0) {
            return None;
        }
        let (mask, camera) = (&observation.mask, &observation.camera);
        let width = camera.width;
        let bounds = mask.bounds()?;
        let [left, top, columns, rows] = bounds;
        let within = (top..top + rows).flat_map(|y| (left..left + columns).map(move |x| [x, y]));
        let seen = within.filter(|[x, y]| mask.pixels()[y * width + x]);
        let largest = width.max(camera.height);
        let least = min_width * length_scale * camera.fx / distance;
        let wanted = (mask.count() as f64 / patches).sqrt().max(least);
        let mut side = (wanted.min(largest as f64).ceil() as usize).max(1).next_multiple_of(unit);
        let count = |tiles: &Tiles| {
            let mut shown = vec![false; tiles.len()];
            seen.clone().filter_map(|pixel| tiles.at(pixel)).for_each(|tile| shown[tile] = true);
            shown.into_iter().filter(|shown| *shown).count()
        };
        // Specks of a mask would each have a tile of their own.
        let mut tiles = Tiles::around(bounds, side);
        while side < largest && count(&tiles) > max_patches {
            side += side.div_ceil(4).next_multiple_of(unit);
            tiles = Tiles::around(bounds, side);
        }
        // Sums of places and numbers of pixels.
        let mut sums = vec![(Vector3::zeros(), 0.0); tiles.len()];
        for [x, y] in seen {
            let measured = f64::from(observation.depth.pixels()[y * width + x]);
            let is_near = (measured - distance).abs() < near * distance;
            let depth = if is_near { measured } else { distance };
            let place = camera.unproject(x as f64, y as f64, depth);
            if let Some((sum, count)) = tiles.at([x, y]).map(|tile| &mut sums[tile]) {
                *sum += place.coords;
                *count += 1.0;
            }
        }
        let mut places = Vec::new();
        let number = |(sum, count): &(Vector3<f64>, f64)| {
            (*count > 0.0).then(|| {
                places.push(Point3::from(sum / *count));
                places.len() - 1
            })
        };
        let numbers = sums.iter().map(number).collect();
        let covariance = DMatrix::from_fn(places.len(), places.len(), |i, j| {
            let own = if i == j { OWN } else { 0.0 };
            let [a, b] = [i, j].map(|k| &places[k].coords);
            sigma.powi(2) * (squared_exponential(a, b, length_scale) + own)
        });
        let patches = Self { tiles, numbers, places, precision: DMatrix::zeros(0, 0) };
        patches.with_covariance(covariance)
    }

    /// Patches with this covariance of the displacements in each direction \[m²\]; `None` if it is singular.
    pub(crate) fn with_covariance(self, covariance: DMatrix<f64>) -> Option<Self> {
        let factor = covariance.cholesky()?;
        Some(Self { precision: factor.inverse(), ..self })
    }

    /// Centroid of each patch (camera frame) \[m\].
    pub(crate) fn places(&self) -> &[Point3<f64>] {
        &self.places
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.precision.nrows()
    }

    /// Width of a tile \[px\].
    pub(crate) fn side(&self) -> usize {
        self.tiles.side
    }

    /// The patch in a tile of the image.
    pub(crate) fn in_tile(&self, column: usize, row: usize) -> Option<usize> {
        *self.numbers.get(self.tiles.index(column, row)?)?
    }

    /// The patch at pixel (x, y).
    pub(crate) fn at(&self, x: usize, y: usize) -> Option<usize> {
        *self.numbers.get(self.tiles.at([x, y])?)?
    }

    /// Inverse of the covariance of the patches' displacements in one direction \[1/m²\].
    pub(crate) fn precision(&self) -> &DMatrix<f64> {
        &self.precision
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn every_pixel_of_the_mask_is_in_a_patch_and_neighbors_are_off_alike() {
        let scene = default_scene(1).unwrap();
        let (observation, distance) = (&scene.frame, scene.truth.translation.z);
        let settings = ModelErrorSettings::default();
        let patches = SurfacePatches::new(observation, distance, &settings, 4).unwrap();
        let width = observation.camera.width;
        let mut seen = vec![0; patches.count()];
        for (pixel, _) in observation.mask.pixels().iter().enumerate().filter(|(_, m)| **m) {
            seen[patches.at(pixel % width, pixel / width).unwrap()] += 1;
        }
        assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
        assert!((8..=settings.max_patches).contains(&seen.len()), "{} patches", seen.len());
        assert_eq!(patches.side() % 4, 0);
        assert_eq!(patches.at(0, 0), None);
        let covariance = patches.precision().clone().cholesky().unwrap().inverse();
        let variance = settings.sigma.powi(2);
        assert!(covariance.diagonal().iter().all(|v| (v / variance - 1.0).abs() < 0.01));
        let correlations =
            covariance.upper_triangle() - DMatrix::from_diagonal(&covariance.diagonal());
        assert!(correlations.max() > 0.5 * variance, "{}", correlations.max() / variance);
        assert!(covariance.min() < 0.1 * variance);
    }

    #[test]
    fn an_exact_model_has_none() {
        let scene = default_scene(1).unwrap();
        let settings = ModelErrorSettings { sigma: 0.0, ..ModelErrorSettings::default() };
        assert!(SurfacePatches::new(&scene.frame, 0.5, &settings, 1).is_none());
        let mut unseen = scene.frame.clone();
        unseen.mask = prehend_render::Mask::filled(640, 480, false);
        assert!(SurfacePatches::new(&unseen, 0.5, &ModelErrorSettings::default(), 1).is_none());
    }

    #[test]
    fn specks_and_a_stiff_model_make_few() {
        let scene = default_scene(1).unwrap();
        let mut specks = scene.frame.clone();
        let speck =
            |pixel: usize| (pixel % 640).is_multiple_of(29) && (pixel / 640).is_multiple_of(31);
        let mask = (0..640 * 480).map(speck).collect();
        specks.mask = prehend_render::Mask::new(640, 480, mask).unwrap();
        let settings = ModelErrorSettings::default();
        let patches = SurfacePatches::new(&specks, 0.5, &settings, 3).unwrap();
        assert!(patches.count() <= settings.max_patches && patches.side().is_multiple_of(3));
        for (length_scale, distance) in [(f64::INFINITY, 0.5), (20e-3, 0.0)] {
            let settings = ModelErrorSettings { length_scale, ..settings.clone() };
            let patches = SurfacePatches::new(&scene.frame, distance, &settings, 4).unwrap();
            assert!((1..=2).contains(&patches.count()), "{}", patches.count());
        }
    }
}
