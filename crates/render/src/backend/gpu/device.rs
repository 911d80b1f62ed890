//! An adapter with its compiled passes.

use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use super::passes::{self, GpuPass, READ_ONLY, READ_WRITE};
use super::shaders;
use crate::backend::BackendError;

/// A device, open and ready.
pub(super) struct Device {
    pub(super) name: String,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) limits: wgpu::Limits,
    pub(super) layout: wgpu::BindGroupLayout,
    pipelines: Vec<(GpuPass, wgpu::ComputePipeline)>,
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
        let (opened, composed) = rayon::join(
            || pollster::block_on(adapter.request_device(&descriptor)),
            shaders::compose,
        );
        let (device, queue) = opened.map_err(|e| failed(e.to_string()))?;
        let composed = composed.map_err(&failed)?;
        let lost = Arc::new(Mutex::new(None));
        let note = lost.clone();
        device.set_device_lost_callback(move |reason, message| {
            if let Ok(mut lost) = note.lock() {
                *lost = Some(format!("device lost ({reason:?}): {message}"));
            }
        });
        // Errors outside of a scope, such as those of another thread's dropped buffers, must not abort the program.
        device.on_uncaptured_error(Arc::new(|error| log::warn!("graphics device: {error}")));
        let layout = watched(&device, || passes::layout(&device)).map_err(&failed)?;
        // Most of the time goes to the driver's compiler, which takes one pipeline a thread. Each thread watches its own errors.
        let compiled = composed.into_par_iter().map(|one| {
            watched(&device, || passes::pipelines(&device, &layout, one)).map_err(&failed)
        });
        let compiled: Vec<_> = compiled.collect::<Result<_, _>>()?;
        let pipelines = compiled.into_iter().flatten().collect();
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

    /// The pipeline of a pass; every pass has one.
    pub(super) fn pipeline(&self, pass: GpuPass) -> Option<&wgpu::ComputePipeline> {
        self.pipelines.iter().find(|(other, _)| *other == pass).map(|(_, pipeline)| pipeline)
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
