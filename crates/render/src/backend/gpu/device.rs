//! An adapter with its compiled passes.

use std::sync::{Arc, Mutex};

use super::shaders;
use crate::backend::BackendError;

/// A compute pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pass {
    /// Entry point of the shader module.
    pub(super) entry: &'static str,
    /// With or without the computation of derivatives.
    pub(super) derivatives: bool,
}

const fn pass(entry: &'static str) -> Pass {
    Pass { entry, derivatives: false }
}

pub(super) const PROJECT: Pass = pass("project");
pub(super) const COUNT_FACES: Pass = pass("count_faces");
pub(super) const SCAN_BINS: Pass = pass("scan_bins");
pub(super) const SCATTER_FACES: Pass = pass("scatter_faces");
pub(super) const RASTER: Pass = pass("raster");
pub(super) const FIND_SEGMENTS: Pass = pass("find_segments");
pub(super) const FIND_PIECES: Pass = pass("find_pieces");
pub(super) const CONTOUR_VALUE: Pass = pass("contour_residuals");
pub(super) const CONTOUR_DERIVATIVES: Pass = Pass { entry: "contour_residuals", derivatives: true };
pub(super) const CONTOUR_PICTURE: Pass = pass("contour_picture");
pub(super) const SOFTRAS_VALUE: Pass = pass("softras_residuals");
pub(super) const SOFTRAS_DERIVATIVES: Pass = Pass { entry: "softras_residuals", derivatives: true };
pub(super) const SOFTRAS_PICTURE: Pass = pass("softras_picture");
pub(super) const TOTAL: Pass = pass("total");
pub(super) const NEEDS: Pass = pass("needs");

/// All of them.
pub(super) const PASSES: [Pass; 15] = [
    PROJECT,
    COUNT_FACES,
    SCAN_BINS,
    SCATTER_FACES,
    RASTER,
    FIND_SEGMENTS,
    FIND_PIECES,
    CONTOUR_VALUE,
    CONTOUR_DERIVATIVES,
    CONTOUR_PICTURE,
    SOFTRAS_VALUE,
    SOFTRAS_DERIVATIVES,
    SOFTRAS_PICTURE,
    TOTAL,
    NEEDS,
];

/// Bindings of group 0: the settings, then buffers that are only read, then buffers that are written too.
pub(super) const READ_ONLY: std::ops::Range<u32> = 1..8;
pub(super) const READ_WRITE: std::ops::Range<u32> = 8..17;

/// A device, open and ready.
pub(super) struct Device {
    pub(super) name: String,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) limits: wgpu::Limits,
    pub(super) layout: wgpu::BindGroupLayout,
    pipelines: Vec<wgpu::ComputePipeline>,
    /// Why the device was lost, if it was.
    lost: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// Opens the best adapter and compiles all passes.
    pub(super) fn open(software: bool) -> Result<Self, BackendError> {
        let adapter = best_adapter(software)?;
        let info = adapter.get_info();
        let name = format!("{} ({})", info.name, info.backend);
        let limits = adapter.limits();
        let buffers = READ_WRITE.end - READ_ONLY.start;
        if limits.max_storage_buffers_per_shader_stage < buffers {
            return Err(BackendError::NoDevice(format!(
                "{name} binds fewer than {buffers} buffers"
            )));
        }
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("prehend"),
            required_limits: limits.clone(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..Default::default()
        };
        let failed = |reason: String| BackendError::Device { device: name.clone(), reason };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|e| failed(e.to_string()))?;
        let lost = Arc::new(Mutex::new(None));
        let note = lost.clone();
        device.set_device_lost_callback(move |reason, message| {
            if let Ok(mut lost) = note.lock() {
                *lost = Some(format!("device lost ({reason:?}): {message}"));
            }
        });
        // Errors outside of a scope, such as those of another thread's dropped buffers, must not abort the program.
        device.on_uncaptured_error(Arc::new(|error| log::warn!("graphics device: {error}")));
        let (layout, pipelines) = watched(&device, || compile(&device)).map_err(failed)?;
        Ok(Self { name, device, queue, limits, layout, pipelines, lost })
    }

    /// Runs `work` and turns whatever the device complains about meanwhile into an error.
    pub(super) fn watched<T>(&self, work: impl FnOnce() -> T) -> Result<T, BackendError> {
        let result = watched(&self.device, work);
        match (result, self.lost_because()) {
            (_, Some(reason)) | (Err(reason), None) => Err(self.failed(reason)),
            (Ok(value), None) => Ok(value),
        }
    }

    pub(super) fn is_lost(&self) -> bool {
        self.lost_because().is_some()
    }

    fn lost_because(&self) -> Option<String> {
        self.lost.lock().ok().and_then(|lost| lost.clone())
    }

    pub(super) fn failed(&self, reason: impl Into<String>) -> BackendError {
        BackendError::Device { device: self.name.clone(), reason: reason.into() }
    }

    pub(super) fn pipeline(&self, pass: Pass) -> Option<&wgpu::ComputePipeline> {
        PASSES.iter().position(|p| *p == pass).and_then(|i| self.pipelines.get(i))
    }
}

fn watched<T>(device: &wgpu::Device, work: impl FnOnce() -> T) -> Result<T, String> {
    let filters = [
        wgpu::ErrorFilter::Internal,
        wgpu::ErrorFilter::OutOfMemory,
        wgpu::ErrorFilter::Validation,
    ];
    let mut scopes: Vec<_> = filters.into_iter().map(|f| device.push_error_scope(f)).collect();
    let value = work();
    let mut reason = None;
    while let Some(scope) = scopes.pop() {
        let error = pollster::block_on(scope.pop());
        reason = error.map(|e| e.to_string()).or(reason);
    }
    match reason {
        Some(reason) => Err(reason),
        None => Ok(value),
    }
}

/// Discrete before integrated; software only where asked for, and then before all others, so that tests know what they test.
fn best_adapter(software: bool) -> Result<wgpu::Adapter, BackendError> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let found: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
    let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => Some(1),
        wgpu::DeviceType::IntegratedGpu => Some(2),
        wgpu::DeviceType::VirtualGpu => Some(3),
        wgpu::DeviceType::Cpu => software.then_some(0),
        wgpu::DeviceType::Other => software.then_some(4),
    };
    let best = adapters.into_iter().filter_map(|a| Some((rank(&a)?, a))).min_by_key(|(r, _)| *r);
    best.map(|(_, adapter)| adapter).ok_or_else(|| {
        BackendError::NoDevice(match found.is_empty() {
            true => "no adapter found".into(),
            false => format!("only software adapters found ({})", found.join(", ")),
        })
    })
}

fn compile(device: &wgpu::Device) -> (wgpu::BindGroupLayout, Vec<wgpu::ComputePipeline>) {
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
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("prehend"),
        entries: &entries,
    });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("prehend"),
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("prehend"),
        source: wgpu::ShaderSource::Wgsl(shaders::source().into()),
    });
    let pipeline = |pass: &Pass| {
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(pass.entry),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(pass.entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &[("DERIVATIVES", f64::from(u8::from(pass.derivatives)))],
                // The shaders write before they read.
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        })
    };
    let pipelines = PASSES.iter().map(pipeline).collect();
    (layout, pipelines)
}
