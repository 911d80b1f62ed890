//! Images as arrays.

use numpy::ndarray::IxDyn;
use numpy::{
    Element, PyArray, PyArrayDescrMethods, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods,
};
use prehend_render::{DepthImage, Mask, RgbImage};
use pyo3::prelude::*;

use crate::arrays::Array;
use crate::error::{Raise, wrong};

/// The pixels of an image in the order of C, as numbers of another type where `dtype` says so; not copied if that is how they are.
fn pixels<'py, T: Element>(
    image: &Bound<'py, PyAny>,
    dtype: &str,
) -> PyResult<Bound<'py, PyArray<T, IxDyn>>> {
    let numpy = image.py().import("numpy")?;
    Ok(numpy.call_method1("ascontiguousarray", (image, dtype))?.cast_into()?)
}

/// An array, or what becomes one, and its kind of numbers: `u` for whole ones, `f`, `b` for booleans.
fn array<'py>(image: &Bound<'py, PyAny>) -> PyResult<(Bound<'py, PyUntypedArray>, u8)> {
    let numpy = image.py().import("numpy")?;
    let array: Bound<'py, PyUntypedArray> =
        numpy.call_method1("asarray", (image,))?.cast_into::<PyUntypedArray>()?;
    let kind = array.dtype().getattr("kind")?.extract::<String>()?;
    Ok((array, kind.bytes().next().unwrap_or_default()))
}

/// A color image: H × W × 3, uint8.
pub(super) fn color(image: &Bound<'_, PyAny>) -> PyResult<RgbImage> {
    let (array, kind) = array(image)?;
    let (height, width) = match array.shape() {
        [height, width, 3] if (kind, array.dtype().itemsize()) == (b'u', 1) => (*height, *width),
        shape => {
            let dtype = array.dtype();
            return Err(wrong(format!(
                "rgb: an array of H × W × 3 of uint8 is expected, not {shape:?} of {dtype}"
            )));
        }
    };
    let pixels = pixels::<u8>(array.as_any(), "uint8")?;
    let pixels = pixels.try_readonly().raise()?;
    // As files are read.
    let channels = pixels.as_slice().raise()?.as_chunks::<3>().0.iter();
    let colors = channels.map(|rgb| rgb.map(|channel| f32::from(channel) / 255.0)).collect();
    RgbImage::new(width, height, colors).raise()
}

/// A depth image: H × W, in meters, or in units of `scale` meters if they are whole numbers. What is not finite, or below zero, is missing.
pub(super) fn depth(image: &Bound<'_, PyAny>, scale: Option<f64>) -> PyResult<DepthImage> {
    let (array, kind) = array(image)?;
    let [height, width] = *array.shape() else {
        return Err(wrong(format!(
            "depth: an array of H × W is expected, not {:?}",
            array.shape()
        )));
    };
    let whole = matches!(kind, b'u' | b'i');
    if !whole && kind != b'f' {
        return Err(wrong(format!("depth: numbers are expected, not {}", array.dtype())));
    }
    if whole && scale.is_none() {
        return Err(wrong("depth: whole numbers need depth_scale, how many meters one of them is"));
    }
    let scale = scale.unwrap_or(1.0);
    if !(scale.is_finite() && scale > 0.0) {
        return Err(wrong(format!("depth_scale: {scale} is no length")));
    }
    let missing = |z: f32| if z.is_finite() && z > 0.0 { z } else { 0.0 };
    // In double precision where there is a scale, as files are read.
    let depths = if whole || scale != 1.0 {
        let units = pixels::<f64>(array.as_any(), "float64")?;
        let units = units.try_readonly().raise()?;
        units.as_slice().raise()?.iter().map(|z| missing((z * scale) as f32)).collect()
    } else {
        let meters = pixels::<f32>(array.as_any(), "float32")?;
        let meters = meters.try_readonly().raise()?;
        meters.as_slice().raise()?.iter().map(|z| missing(*z)).collect()
    };
    DepthImage::new(width, height, depths).raise()
}

/// A mask: H × W, set where it is not zero.
pub(super) fn mask(image: &Bound<'_, PyAny>) -> PyResult<Mask> {
    let (array, kind) = array(image)?;
    let [height, width] = *array.shape() else {
        return Err(wrong(format!("mask: an array of H × W is expected, not {:?}", array.shape())));
    };
    if !matches!(kind, b'b' | b'u' | b'i') {
        return Err(wrong(format!(
            "mask: booleans or whole numbers are expected, not {}",
            array.dtype()
        )));
    }
    if kind == b'i' && array.as_any().call_method0("min")?.extract::<i64>()? < 0 {
        return Err(wrong("mask: it has negative numbers: give True where the object is"));
    }
    let set = pixels::<bool>(array.as_any(), "bool")?;
    let set = set.try_readonly().raise()?;
    Mask::new(width, height, set.as_slice().raise()?.to_vec()).raise()
}

/// The array of an image's numbers.
pub(super) fn image<'py, T: Element>(
    py: Python<'py>,
    pixels: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArray<T, IxDyn>>> {
    PyArray::from_vec(py, pixels).reshape(IxDyn(shape))
}

/// The array of a color image: H × W × 3, uint8.
pub(super) fn rgb<'py>(py: Python<'py>, image: &RgbImage) -> PyResult<Array<'py, u8>> {
    let byte = |v: &f32| (255.0 * v.clamp(0.0, 1.0)).round() as u8;
    let pixels = image.pixels().iter().flatten().map(byte).collect();
    self::image(py, pixels, &[image.height(), image.width(), 3])
}
