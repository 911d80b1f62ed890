//! Pictures, masks and depth that were observed.

use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use prehend_render::{Camera, DepthImage, Mask, RgbImage, Target};
use pyo3::prelude::*;

use crate::arrays::{Numbers, in_order};
use crate::error::{Raise, wrong};

/// An observed picture H × W × 3: bytes, or numbers in 0..=1.
pub(super) fn picture(given: &Bound<'_, PyAny>) -> PyResult<RgbImage> {
    let numbers: Numbers<'_> = given.extract()?;
    let &[rows, columns, 3] = numbers.shape() else {
        let shape = numbers.shape();
        return Err(wrong(format!("image: an array of H × W × 3 is expected, not {shape:?}")));
    };
    let unit = if given.cast::<PyArrayDyn<u8>>().is_ok() { 1.0 / 255.0 } else { 1.0 };
    let values = in_order(&numbers);
    let pixels = values.as_chunks().0.iter().map(|c: &[f64; 3]| c.map(|v| (v * unit) as f32));
    RgbImage::new(columns, rows, pixels.collect()).raise()
}

/// An image H × W of depth \[m\].
pub(super) fn depth(given: &Numbers<'_>, what: &str) -> PyResult<DepthImage> {
    let [rows, columns] = plane(given, what)?;
    DepthImage::new(columns, rows, in_order(given).iter().map(|z| *z as f32).collect()).raise()
}

/// The target of a loss: what `image` shows where `mask` is set, or, if its numbers are floating-point ones, the picture of the object before
/// black and how much of each pixel it covers.
pub(super) fn target(
    camera: Camera,
    image: &RgbImage,
    mask: &Bound<'_, PyAny>,
) -> PyResult<Target> {
    let matte = mask.cast::<PyArrayDyn<f64>>().is_ok() || mask.cast::<PyArrayDyn<f32>>().is_ok();
    let numbers: Numbers<'_> = mask.extract()?;
    let [rows, columns] = plane(&numbers, "mask")?;
    let values = in_order(&numbers);
    if matte && (rows, columns) == (camera.height, camera.width) {
        let coverage = values.iter().map(|a| *a as f32).collect();
        return Target::from_matte(camera, image, coverage).raise();
    }
    let mask = Mask::new(columns, rows, values.iter().map(|v| *v != 0.0).collect()).raise()?;
    Target::new(camera, image, &mask).raise()
}

fn plane(given: &Numbers<'_>, what: &str) -> PyResult<[usize; 2]> {
    <[usize; 2]>::try_from(given.shape()).map_err(|_| {
        wrong(format!("{what}: an array of H × W is expected, not {:?}", given.shape()))
    })
}
