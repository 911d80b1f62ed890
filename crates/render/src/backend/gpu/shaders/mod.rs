//! The compute shaders: WGSL modules that import each other, and one file a pass with its entry point.
//!
//! A module owns the bindings it declares, and a pass is made of what it uses alone.

#[cfg(test)]
mod tests;

use naga_oil::compose::{
    ComposableModuleDescriptor, Composer, ComposerError, NagaModuleDescriptor,
};
use wgpu::naga::Module;
use wgpu::naga::compact::{KeepUnused, compact};

/// A file of WGSL.
struct Source {
    path: &'static str,
    text: &'static str,
}

impl Source {
    /// The entry point of a pass is called as its file.
    fn entry(&self) -> &'static str {
        self.path.trim_start_matches("passes/").trim_end_matches(".wgsl")
    }
}

macro_rules! sources {
    ($($path:literal),+ $(,)?) => {
        [$(Source { path: $path, text: include_str!(concat!("../../../shaders/", $path)) }),+]
    };
}

/// Modules that passes import, each after its own imports.
const MODULES: [Source; 26] = sources![
    "params.wgsl",
    "hypotheses.wgsl",
    "mesh.wgsl",
    "texture.wgsl",
    "goal.wgsl",
    "derivatives.wgsl",
    "tiles.wgsl",
    "squares.wgsl",
    "tallies.wgsl",
    "screen.wgsl",
    "bins.wgsl",
    "z_buffer.wgsl",
    "segments.wgsl",
    "pieces.wgsl",
    "results.wgsl",
    "sums.wgsl",
    "row.wgsl",
    "surface.wgsl",
    "pixel.wgsl",
    "contour.wgsl",
    "band.wgsl",
    "soft_face.wgsl",
    "fragment.wgsl",
    "softras.wgsl",
    "residuals.wgsl",
    "tile_span.wgsl",
];

/// A file with one entry point each.
const PASSES: [Source; 10] = sources![
    "passes/project.wgsl",
    "passes/count_faces.wgsl",
    "passes/scan_bins.wgsl",
    "passes/scatter_faces.wgsl",
    "passes/raster.wgsl",
    "passes/find_segments.wgsl",
    "passes/find_pieces.wgsl",
    "passes/contour_residuals.wgsl",
    "passes/softras_residuals.wgsl",
    "passes/total.wgsl",
];

/// The key of the constant that says whether a pass computes derivatives; see `shaders/derivatives.wgsl`.
pub(super) const DERIVATIVES: &str = "0";

/// Shader module of one entry point, for its pipelines.
pub(super) struct Composed {
    /// Name of the entry point.
    pub(super) entry: &'static str,
    pub(super) module: Module,
}

/// The module of every entry point, with what it uses alone. Names of what it imports are mangled.
///
/// # Errors
/// Message of the composer, with file and place.
pub(super) fn compose() -> Result<Vec<Composed>, String> {
    // The device validates what it is given.
    let mut composer = Composer::non_validating();
    add_modules(&mut composer)?;
    PASSES
        .iter()
        .map(|pass| {
            let mut composed = composed(&mut composer, pass)?;
            compact(&mut composed.module, KeepUnused::No);
            Ok(composed)
        })
        .collect()
}

fn add_modules(composer: &mut Composer) -> Result<(), String> {
    for Source { path, text } in MODULES {
        let module =
            ComposableModuleDescriptor { source: text, file_path: path, ..Default::default() };
        let added = composer.add_composable_module(module).map(|_| ());
        added.map_err(|error| told(&error, path, composer))?;
    }
    Ok(())
}

fn composed(composer: &mut Composer, pass: &Source) -> Result<Composed, String> {
    let Source { path, text } = *pass;
    let descriptor = NagaModuleDescriptor { source: text, file_path: path, ..Default::default() };
    match composer.make_naga_module(descriptor) {
        Ok(module) => Ok(Composed { entry: pass.entry(), module }),
        Err(error) => Err(told(&error, path, composer)),
    }
}

fn told(error: &ComposerError, path: &str, composer: &Composer) -> String {
    format!("{path}: {}", error.emit_to_string(composer))
}
