//! The compute passes, and their pipelines.

use std::borrow::Cow;

use super::shaders::{Composed, DERIVATIVES};

/// A compute pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GpuPass {
    /// Entry point of its shader module.
    pub(super) entry: &'static str,
    /// With or without the computation of derivatives.
    pub(super) derivatives: bool,
}

const fn pass(entry: &'static str) -> GpuPass {
    GpuPass { entry, derivatives: false }
}

pub(super) const PROJECT: GpuPass = pass("project");
pub(super) const COUNT_FACES: GpuPass = pass("count_faces");
pub(super) const SCAN_BINS: GpuPass = pass("scan_bins");
pub(super) const SCATTER_FACES: GpuPass = pass("scatter_faces");
pub(super) const RASTER: GpuPass = pass("raster");
pub(super) const FIND_SEGMENTS: GpuPass = pass("find_segments");
pub(super) const FIND_PIECES: GpuPass = pass("find_pieces");
pub(super) const CONTOUR_VALUE: GpuPass = pass("contour_residuals");
pub(super) const CONTOUR_DERIVATIVES: GpuPass =
    GpuPass { entry: "contour_residuals", derivatives: true };
pub(super) const SOFTRAS_VALUE: GpuPass = pass("softras_residuals");
pub(super) const SOFTRAS_DERIVATIVES: GpuPass =
    GpuPass { entry: "softras_residuals", derivatives: true };
pub(super) const TOTAL: GpuPass = pass("total");

/// Bindings of group 0: the settings, then buffers that are only read, then buffers that are written too.
pub(super) const READ_ONLY: std::ops::Range<u32> = 1..8;
pub(super) const READ_WRITE: std::ops::Range<u32> = 8..17;

/// The layout that all passes share, though few of them use every binding.
pub(super) fn layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding: u32| {
        let ty = match binding {
            b if READ_ONLY.contains(&b) => wgpu::BufferBindingType::Storage { read_only: true },
            b if READ_WRITE.contains(&b) => wgpu::BufferBindingType::Storage { read_only: false },
            _ => wgpu::BufferBindingType::Uniform,
        };
        wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        }
    };
    let entries: Vec<_> = (0..READ_WRITE.end).map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("prehend"),
        entries: &entries,
    })
}

/// The pipelines of one entry point, which share its module: with and without derivatives where it computes any.
pub(super) fn pipelines(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    Composed { entry, module }: Composed,
) -> Vec<(GpuPass, wgpu::ComputePipeline)> {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("prehend"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    // A constant that the module lacks would be an error.
    let constants = module.overrides.len();
    let variants: &[bool] = if constants == 0 { &[false] } else { &[false, true] };
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(entry),
        source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
    });
    let pipeline = |&derivatives: &bool| {
        let given = [(DERIVATIVES, f64::from(u8::from(derivatives)))];
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: given.get(..constants).unwrap_or(&given),
                // The shaders write before they read.
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        (GpuPass { entry, derivatives }, pipeline)
    };
    variants.iter().map(pipeline).collect()
}
