//! A problem on a graphics device.

use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use super::device::Device;
use super::layout::{
    PICTURE_COLUMNS, Params, SUM_COLOR, SUM_COLUMNS, SUM_CONTOUR, SUM_COVERED, SUM_DEPTH,
    SUM_GRADIENT, SUM_HESSIAN, SUM_HIDDEN, SUM_MASK, SUM_MISSED, SUM_WITH_DEPTH, Usage,
};
use super::passes::{
    CONTOUR_DERIVATIVES, CONTOUR_PICTURE, CONTOUR_VALUE, COUNT_FACES, FIND_PIECES, FIND_SEGMENTS,
    NEEDS, PROJECT, Pass, RASTER, SCAN_BINS, SCATTER_FACES, SOFTRAS_DERIVATIVES, SOFTRAS_PICTURE,
    SOFTRAS_VALUE, TOTAL,
};
use super::upload;
use super::work::{self, BUDGET, Capacity, Work};
use crate::backend::{BackendError, Hypothesis, PoseProblem, Session};
use crate::image::{DepthImage, RgbImage};
use crate::mode::Mode;
use crate::pose_loss::{Counts, Linearized, Loss, PoseImage, Tile, unpacked};

/// How long a call back may take once the device is done.
const PATIENCE: Duration = Duration::from_secs(1);

/// What a call wants to know.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Value,
    Derivatives,
    Picture,
}

/// An uploaded problem with the buffers of its passes.
pub(super) struct GpuSession {
    device: Arc<Device>,
    problem: PoseProblem,
    params: Params,
    settings: wgpu::Buffer,
    /// Positions, faces, corners, edges, texels and target.
    model: Vec<wgpu::Buffer>,
    pub(super) capacity: Capacity,
    /// Memory for the work buffers [bytes].
    pub(super) budget: u64,
    work: Option<Work>,
}

impl GpuSession {
    pub(super) fn new(device: Arc<Device>, problem: &PoseProblem) -> Result<Self, BackendError> {
        problem.loss.check()?;
        let model = &problem.model;
        let unsupported = |what| {
            let device = device.name.clone();
            BackendError::Unsupported { device, what }
        };
        if problem.loss.samples > 1 {
            return Err(unsupported("more than one sample a pixel"));
        }
        if matches!(problem.loss.mode, Mode::Contour(options) if options.creases) {
            return Err(unsupported("creases that blend"));
        }
        if !upload::texels_fit(model) {
            return Err(unsupported("texels outside 0..=1"));
        }
        let params = upload::params(problem)
            .ok_or_else(|| device.failed("the texture has too many levels"))?;
        let capacity = Capacity::guess(&params);
        // Fails early where not even one hypothesis fits.
        work::batch(&device, &params, &capacity, BUDGET, 1)?;
        check_dispatch(&device, &params)?;
        let (positions, faces) = (upload::positions(model), upload::faces(model));
        let (corners, edges) = (upload::corners(model), upload::edges(model));
        let (texels, target) = (upload::texels(model), upload::target(&problem.target));
        let contents: [&[u8]; 6] = [
            bytemuck::cast_slice(&positions),
            bytemuck::cast_slice(&faces),
            bytemuck::cast_slice(&corners),
            bytemuck::cast_slice(&edges),
            bytemuck::cast_slice(&texels),
            bytemuck::cast_slice(&target),
        ];
        let limit =
            device.limits.max_storage_buffer_binding_size.min(device.limits.max_buffer_size);
        if let Some(large) = contents.iter().find(|c| c.len() as u64 > limit) {
            return Err(BackendError::TooLarge {
                device: device.name.clone(),
                what: "the model or the image",
                needed: large.len() as u64,
                limit,
            });
        }
        // Not `create_buffer_init`, which panics when memory is short or the device lost.
        let upload = |contents: &[u8], usage: wgpu::BufferUsages| {
            let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                // A binding must not be empty.
                size: contents.len().max(16) as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            device.queue.write_buffer(&buffer, 0, contents);
            buffer
        };
        let (settings, model) = device.watched(|| {
            let storage = wgpu::BufferUsages::STORAGE;
            let settings = upload(bytemuck::bytes_of(&params), wgpu::BufferUsages::UNIFORM);
            (settings, contents.map(|c| upload(c, storage)).into())
        })?;
        let problem = problem.clone();
        Ok(Self { device, problem, params, settings, model, capacity, budget: BUDGET, work: None })
    }

    /// The sums of each hypothesis.
    fn sums(
        &mut self,
        hypotheses: &[Hypothesis],
        wanted: Wanted,
    ) -> Result<Vec<f32>, BackendError> {
        let mut sums = Vec::with_capacity(hypotheses.len() * SUM_COLUMNS);
        let mut rest = hypotheses;
        while !rest.is_empty() {
            let count = self.prepare(rest.len())?;
            sums.extend(self.attempt(&rest[..count], wanted)?.unwrap_or_default());
            rest = &hypotheses[sums.len() / SUM_COLUMNS..];
        }
        Ok(sums)
    }

    /// Makes sure that there are buffers, and says for how many of `wanted` hypotheses.
    fn prepare(&mut self, wanted: usize) -> Result<usize, BackendError> {
        let count = work::batch(&self.device, &self.params, &self.capacity, self.budget, wanted)?;
        let fits = |w: &Work| w.hypotheses >= count && w.capacity == self.capacity;
        if !self.work.as_ref().is_some_and(fits) {
            // The old buffers go first: the new ones may need their memory.
            self.work = None;
            let (device, model) = (&self.device, &self.model);
            self.work = Some(device.watched(|| {
                Work::new(device, &self.params, self.capacity, count, &self.settings, model)
            })?);
        }
        Ok(count)
    }

    /// One round trip. `None` when a buffer was too small: they are larger the next time.
    fn attempt(
        &mut self,
        hypotheses: &[Hypothesis],
        wanted: Wanted,
    ) -> Result<Option<Vec<f32>>, BackendError> {
        let answer = self.round_trip(hypotheses, wanted);
        if answer.is_err() {
            // Whatever state they are in now.
            self.work = None;
        }
        answer
    }

    fn round_trip(
        &mut self,
        hypotheses: &[Hypothesis],
        wanted: Wanted,
    ) -> Result<Option<Vec<f32>>, BackendError> {
        let Some(work) = &self.work else { return Ok(None) };
        let poses: Vec<_> =
            hypotheses.iter().map(|h| upload::hypothesis(&self.problem, h)).collect();
        self.params.hypotheses = hypotheses.len() as u32;
        self.params.entry_capacity = work.pool() as u32;
        self.params.segment_capacity = work.capacity.segments as u32;
        self.params.piece_capacity = work.capacity.pieces as u32;
        // A picture shows the object alone, cut at the image's border as on the CPU.
        self.params.bounds = match wanted {
            Wanted::Picture => [0; 4],
            _ => upload::bounds(&self.problem.target.bounds),
        };
        let values = match wanted {
            Wanted::Picture => {
                (self.params.size[0] * self.params.size[1]) as usize * PICTURE_COLUMNS
            }
            _ => hypotheses.len() * SUM_COLUMNS,
        };
        let size = (size_of::<Usage>() + values * size_of::<f32>()) as u64;
        let queue = &self.device.queue;
        let received = self.device.watched(|| {
            queue.write_buffer(&self.settings, 0, bytemuck::bytes_of(&self.params));
            queue.write_buffer(&work.poses, 0, bytemuck::cast_slice(&poses));
            queue.submit([self.encode(work, wanted, size)]);
            receive(&self.device, &work.readback, size)
        })?;
        let bytes = received.map_err(|reason| self.device.failed(reason))?;
        let (usage, values) = bytes.split_at(size_of::<Usage>());
        let usage: Usage = bytemuck::pod_read_unaligned(usage);
        if work.capacity.holds(&usage, work.pool()) {
            return Ok(Some(bytemuck::pod_collect_to_vec(values)));
        }
        self.capacity = self.capacity.grown(&usage, hypotheses.len());
        Ok(None)
    }

    fn encode(&self, work: &Work, wanted: Wanted, size: u64) -> wgpu::CommandBuffer {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&work.tallies, 0, None);
        encoder.clear_buffer(&work.bins, 0, None);
        encoder.clear_buffer(&work.results, 0, Some(size_of::<Usage>() as u64));
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_bind_group(0, &work.bind_group, &[]);
            let p = &self.params;
            let mut run = |stage: Pass, x: u32, y: u32| {
                if let Some(pipeline) = self.device.pipeline(stage) {
                    pass.set_pipeline(pipeline);
                    pass.dispatch_workgroups(x, y, p.hypotheses);
                }
            };
            let [across, down] = p.tiles;
            run(PROJECT, p.vertices.div_ceil(256), 1);
            run(COUNT_FACES, p.faces.div_ceil(64), 1);
            run(SCAN_BINS, 1, 1);
            run(SCATTER_FACES, p.faces.div_ceil(64), 1);
            let pixels = match (&self.problem.loss.mode, wanted) {
                (Mode::Contour(_), Wanted::Value) => CONTOUR_VALUE,
                (Mode::Contour(_), Wanted::Derivatives) => CONTOUR_DERIVATIVES,
                (Mode::Contour(_), Wanted::Picture) => CONTOUR_PICTURE,
                (Mode::SoftRas(_), Wanted::Value) => SOFTRAS_VALUE,
                (Mode::SoftRas(_), Wanted::Derivatives) => SOFTRAS_DERIVATIVES,
                (Mode::SoftRas(_), Wanted::Picture) => SOFTRAS_PICTURE,
            };
            if let Mode::Contour(_) = self.problem.loss.mode {
                run(RASTER, across, down);
                run(FIND_SEGMENTS, p.edges.div_ceil(64), 1);
                run(FIND_PIECES, p.segment_capacity.div_ceil(64), 1);
            }
            run(pixels, across, down);
            match wanted {
                Wanted::Picture => run(NEEDS, 1, 1),
                _ => run(TOTAL, 1, 1),
            }
        }
        encoder.copy_buffer_to_buffer(&work.results, 0, &work.readback, 0, size);
        encoder.finish()
    }

    fn loss(&self, sums: &[f32]) -> Loss {
        let count = |i: usize| sums[i] as usize;
        let counts = Counts {
            covered: count(SUM_COVERED),
            contour: count(SUM_CONTOUR),
            hidden: count(SUM_HIDDEN),
            missed: count(SUM_MISSED),
            depth: count(SUM_WITH_DEPTH),
        };
        let shares = [SUM_COLOR, SUM_MASK, SUM_DEPTH].map(|i| f64::from(sums[i]));
        Loss::new(shares, counts, &self.problem.target)
    }

    fn linearized(&self, sums: &[f32]) -> Linearized {
        // In the order of the processor's own sums.
        const { assert!(SUM_HESSIAN == SUM_GRADIENT + 6) };
        let entries = std::array::from_fn(|i| f64::from(sums[SUM_GRADIENT + i]));
        let (gradient, hessian) = unpacked(&entries, self.problem.target.normalization);
        Linearized { loss: self.loss(sums), gradient, hessian }
    }
}

impl Session for GpuSession {
    fn name(&self) -> &str {
        &self.device.name
    }

    fn evaluate(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Loss>, BackendError> {
        let sums = self.sums(hypotheses, Wanted::Value)?;
        Ok(sums.chunks_exact(SUM_COLUMNS).map(|s| self.loss(s)).collect())
    }

    fn linearize(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Linearized>, BackendError> {
        let sums = self.sums(hypotheses, Wanted::Derivatives)?;
        Ok(sums.chunks_exact(SUM_COLUMNS).map(|s| self.linearized(s)).collect())
    }

    fn linearize_tiles(
        &mut self,
        _hypotheses: &[Hypothesis],
        _side: usize,
    ) -> Result<Vec<Vec<Tile>>, BackendError> {
        let device = self.device.name.clone();
        Err(BackendError::Unsupported { device, what: "sums by tiles" })
    }

    fn render(&mut self, hypothesis: &Hypothesis) -> Result<PoseImage, BackendError> {
        let values = loop {
            self.prepare(1)?;
            if let Some(values) = self.attempt(&[*hypothesis], Wanted::Picture)? {
                break values;
            }
        };
        let [width, height] = self.params.size.map(|v| v as usize);
        let mut picture = PoseImage {
            color: RgbImage::filled(width, height, [0.0; 3]),
            coverage: values.iter().skip(3).step_by(PICTURE_COLUMNS).copied().collect(),
            depth: DepthImage::filled(width, height, 0.0),
            normal: values.chunks_exact(PICTURE_COLUMNS).map(|v| [v[5], v[6], v[7]]).collect(),
            face: values.chunks_exact(PICTURE_COLUMNS).map(|v| face(v[8])).collect(),
        };
        let pixels = picture.color.pixels_mut().iter_mut().zip(picture.depth.pixels_mut());
        for ((color, depth), v) in pixels.zip(values.chunks_exact(PICTURE_COLUMNS)) {
            *color = [v[0], v[1], v[2]];
            *depth = v[4];
        }
        Ok(picture)
    }
}

/// The face of a picture's last column.
fn face(column: f32) -> Option<u32> {
    (column > 0.0).then(|| column as u32 - 1)
}

/// The dispatches of a pass must not be larger than the device allows.
fn check_dispatch(device: &Device, params: &Params) -> Result<(), BackendError> {
    let groups = [
        params.vertices.div_ceil(256),
        params.faces.div_ceil(64),
        params.edges.div_ceil(64),
        params.tiles[0],
        params.tiles[1],
    ];
    let limit = device.limits.max_compute_workgroups_per_dimension;
    match groups.into_iter().max() {
        Some(most) if most > limit => Err(BackendError::TooLarge {
            device: device.name.clone(),
            what: "a dispatch in workgroups",
            needed: most.into(),
            limit: limit.into(),
        }),
        _ => Ok(()),
    }
}

/// Waits for a buffer's bytes.
fn receive(device: &Device, buffer: &wgpu::Buffer, size: u64) -> Result<Vec<u8>, String> {
    let (sender, receiver) = channel();
    buffer.map_async(wgpu::MapMode::Read, ..size, move |result| {
        // Nobody listens any more if the device failed meanwhile.
        let _ = sender.send(result);
    });
    let poll =
        || device.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| e.to_string());
    poll()?;
    let done = Instant::now();
    loop {
        // The call may still be on its way in another thread, which polled for a session of its own.
        match receiver.recv_timeout(PATIENCE / 100) {
            Ok(mapped) => break mapped.map_err(|e| e.to_string())?,
            Err(RecvTimeoutError::Disconnected) => return Err("no answer".into()),
            // A lost device may never call back.
            Err(RecvTimeoutError::Timeout) if device.is_lost() || done.elapsed() > PATIENCE => {
                return Err("no answer".into());
            }
            Err(RecvTimeoutError::Timeout) => {
                poll()?;
            }
        }
    }
    let bytes = buffer.get_mapped_range(..size).map_err(|e| e.to_string())?.to_vec();
    buffer.unmap();
    Ok(bytes)
}
