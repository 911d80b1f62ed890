//! First-order light as an array.

use nalgebra::Vector3;
use numpy::PyArray;
use numpy::ndarray::IxDyn;
use prehend_render::{Light, Shader};
use pyo3::prelude::*;

use super::inputs::Input;
use crate::arrays::{Numbers, array};

/// Rows are channels; columns the ambient factor, the directional vector and the offset.
pub(super) const SHAPE: [usize; 2] = [3, 5];

/// A light from its numbers, row by row.
pub(super) fn light(values: &[f64]) -> Light {
    let channel = |k: usize| &values[5 * k..5 * k + 5];
    Light {
        ambient: [0, 1, 2].map(|k| channel(k)[0]),
        directional: [0, 1, 2].map(|k| Vector3::from_column_slice(&channel(k)[1..4])),
        offset: [0, 1, 2].map(|k| channel(k)[4]),
    }
}

/// Its numbers.
pub(super) fn to_array<'py>(
    py: Python<'py>,
    light: &Light,
) -> PyResult<Bound<'py, PyArray<f64, IxDyn>>> {
    array(py, light.parameters(), &SHAPE)
}

/// Ambient light, as an array of 3 × 5: colors are shown as stored times `strength`.
///
/// Rows of a light are the channels red, green and blue; columns are its ambient factor a, its directional vector d (3 numbers, camera frame,
/// towards the light) and its offset o. A surface of color c with the unit normal n shows c·max(0, a + d·n) + o.
#[pyfunction]
#[pyo3(signature = (strength=1.0))]
pub(crate) fn ambient_light(
    py: Python<'_>,
    strength: f64,
) -> PyResult<Bound<'_, PyArray<f64, IxDyn>>> {
    to_array(py, &Light::ambient(strength))
}

/// A light at the camera of strength `head` on surfaces that face it, over an ambient term, as an array of 3 × 5 (see `ambient_light`).
#[pyfunction]
#[pyo3(signature = (ambient=0.5, head=0.5))]
pub(crate) fn headlight(
    py: Python<'_>,
    ambient: f64,
    head: f64,
) -> PyResult<Bound<'_, PyArray<f64, IxDyn>>> {
    to_array(py, &Light::headlight(ambient, head))
}

/// The light of an array, that of colors as stored if none is given.
pub(super) fn given(numbers: Option<&Numbers<'_>>) -> PyResult<Light> {
    let Some(numbers) = numbers else { return Ok(Light::ambient(1.0)) };
    Ok(light(Input::new(numbers, &SHAPE, "light")?.of(0)))
}
