//! Height fields: terrain over a rectangle.

use std::sync::Arc;

use super::asset::{Assets, Files};
use super::element::Element;
use super::error::{MjcfError, Result};
use crate::io::read_plain;
use crate::limits::{MAX_ELEMENTS, MAX_FILE_BYTES};
use crate::mesh::Texture;

/// Terrain over a rectangle around the origin, on a box that reaches below it.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    /// Half of the rectangle along x and y \[m\].
    pub half_extents: [f64; 2],
    /// Height of the highest point, where the lowest is at zero \[m\].
    pub height: f64,
    /// How far the box reaches below \[m\].
    pub base: f64,
    /// Points along x and along y.
    pub counts: [usize; 2],
    /// Heights \[m\], row after row along x, the first at the least y.
    pub heights: Vec<f64>,
}

/// The height fields of a model.
pub(super) struct HeightFields<'a> {
    assets: Assets<'a, Arc<HeightField>>,
    files: Files<'a>,
}

impl<'a> HeightFields<'a> {
    pub(super) fn new(root: &'a Element, files: Files<'a>) -> Result<Self> {
        let fields = ["nrow", "ncol", "elevation", "size", "content_type"];
        Ok(Self { assets: Assets::new(root, "hfield", &fields)?, files })
    }

    /// The height field that the attribute `hfield` of `geom` names.
    pub(super) fn get(&self, geom: &Element, name: &str) -> Result<Arc<HeightField>> {
        self.assets.get(geom, name, |e| {
            let [x, y, height, base] = e.numbers::<4>("size")?.ok_or_else(|| e.missing("size"))?;
            if [x, y, height, base].iter().any(|s| *s <= 0.0) {
                return Err(e.invalid("size", "must be positive"));
            }
            let (counts, mut heights) = match e.text("file") {
                Some(file) => self.load(e, file)?,
                None => written(e)?,
            };
            let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
            let span = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
            let scale = if span > 0.0 { height / span } else { 0.0 };
            heights.iter_mut().for_each(|h| *h = (*h - low) * scale);
            let half_extents = [x, y];
            Ok(Arc::new(HeightField { half_extents, height, base, counts, heights }))
        })
    }

    fn load(&self, e: &Element, name: &str) -> Result<([usize; 2], Vec<f64>)> {
        let path = self.files.path(e, name)?;
        let is_png = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("png"));
        let wrong = |reason: String| e.unusable(name, reason);
        if is_png {
            let image = Texture::load(&path).map_err(|error| wrong(error.to_string()))?;
            // White is high; the last row of an image is the first here.
            let gray = |[r, g, b]: [u8; 3]| (f64::from(r) + f64::from(g) + f64::from(b)) / 3.0;
            let rows = image.pixels.chunks_exact(image.width).rev();
            let heights = rows.flatten().map(|pixel| gray(*pixel)).collect();
            return Ok(([image.width, image.height], heights));
        }
        let bytes = read_plain(&path, MAX_FILE_BYTES).map_err(|error| wrong(error.to_string()))?;
        let words = bytes.as_chunks::<4>().0;
        let Some((counts, data)) = words.split_first_chunk::<2>() else {
            return Err(wrong("ends within its first two numbers".to_owned()));
        };
        let [rows, columns] = counts.map(|word| u32::from_le_bytes(word) as usize);
        if rows.checked_mul(columns) != Some(data.len()) || rows < 2 || columns < 2 {
            return Err(wrong(format!("has {} heights, not {rows} by {columns}", data.len())));
        }
        let heights: Vec<f64> = data.iter().map(|w| f64::from(f32::from_le_bytes(*w))).collect();
        if heights.iter().any(|h| !h.is_finite()) {
            return Err(wrong("has heights that are no finite numbers".to_owned()));
        }
        Ok(([columns, rows], heights))
    }
}

/// The heights in the attributes of `e`; those that are not told are zero.
fn written(e: &Element) -> Result<([usize; 2], Vec<f64>)> {
    let count = |field| -> Result<usize> {
        let count: usize = e.integer(field)?.ok_or_else(|| e.missing(field))?;
        match (2..=MAX_ELEMENTS).contains(&count) {
            true => Ok(count),
            false => Err(e.invalid(field, "must be 2 or more")),
        }
    };
    let (rows, columns) = (count("nrow")?, count("ncol")?);
    let expected = rows.saturating_mul(columns);
    if expected > MAX_ELEMENTS {
        return Err(MjcfError::TooLarge { what: "heights", count: expected, limit: MAX_ELEMENTS });
    }
    let heights = match e.list("elevation", MAX_ELEMENTS)? {
        None => vec![0.0; expected],
        Some(list) if list.len() == expected => {
            list.chunks_exact(columns).rev().flatten().copied().collect()
        }
        Some(list) => {
            let reason = format!("has {} numbers, not {rows} by {columns}", list.len());
            return Err(e.invalid("elevation", reason));
        }
    };
    Ok(([columns, rows], heights))
}
