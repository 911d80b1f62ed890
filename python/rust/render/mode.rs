//! The two modes, from their names and settings.

use prehend_render::{ContourOptions, Mode, PoseLoss, SoftRasOptions};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{Raise, wrong};

/// A mode by name with the settings given; those that are not given are the defaults.
pub(super) fn mode(name: &str, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Mode> {
    let mut mode = match name {
        "contour" => Mode::Contour(ContourOptions::default()),
        "softras" => Mode::SoftRas(SoftRasOptions::default()),
        _ => {
            return Err(wrong(format!(
                "mode: \"contour\" or \"softras\" is expected, not {name:?}"
            )));
        }
    };
    for (key, value) in settings.into_iter().flatten() {
        let key: String = key.extract()?;
        match (&mut mode, key.as_str()) {
            (Mode::Contour(o), "half_width") => o.half_width = value.extract()?,
            (Mode::Contour(o), "creases") => o.creases = value.extract()?,
            (Mode::SoftRas(o), "blur_radius") => o.blur_radius = value.extract()?,
            (Mode::SoftRas(o), "sigma") => o.sigma = value.extract()?,
            (Mode::SoftRas(o), "gamma") => o.gamma = value.extract()?,
            (Mode::SoftRas(o), "faces_per_pixel") => o.faces_per_pixel = value.extract()?,
            (Mode::SoftRas(o), "z_near") => o.z_near = value.extract()?,
            (Mode::SoftRas(o), "z_far") => o.z_far = value.extract()?,
            (Mode::SoftRas(o), "perspective_correct") => o.perspective_correct = value.extract()?,
            (Mode::SoftRas(o), "clip_barycentric") => o.clip_barycentric = value.extract()?,
            (Mode::SoftRas(o), "cull_backfaces") => o.cull_backfaces = value.extract()?,
            (mode, _) => {
                let known = match mode {
                    Mode::Contour(_) => "half_width, creases",
                    Mode::SoftRas(_) => {
                        "blur_radius, sigma, gamma, faces_per_pixel, z_near, z_far, \
                         perspective_correct, clip_barycentric, cull_backfaces"
                    }
                };
                let text =
                    format!("mode {name:?} has no setting {key:?}; its settings are {known}");
                return Err(wrong(text));
            }
        }
    }
    // The check of a loss covers the settings of its mode.
    PoseLoss { mode, ..PoseLoss::default() }.check().raise()?;
    Ok(mode)
}
