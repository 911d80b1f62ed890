//! A problem on a graphics device.

use std::sync::Arc;

use super::answer;
use super::device::Device;
use super::layout::{Params, SUM_COLUMNS, Usage};
use super::passes::{
    CONTOUR_DERIVATIVES, CONTOUR_VALUE, COUNT_FACES, FIND_PIECES, FIND_SEGMENTS, GpuPass, PROJECT,
    RASTER, SCAN_BINS, SCATTER_FACES, SOFTRAS_DERIVATIVES, SOFTRAS_VALUE, TOTAL,
};
use super::readback::receive;
use super::upload;
use super::work::{self, BUDGET, Capacity, Work};
use crate::backend::{BackendError, Hypothesis, PoseProblem, Session};
use crate::mode::Mode;
use crate::pose_loss::{Linearized, Loss, Tile};

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
        work::check_dispatch(&device, &params)?;
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

    /// Numbers that come back of each hypothesis.
    fn sum_columns(&self) -> usize {
        (self.params.squares[0] * self.params.squares[1]) as usize * SUM_COLUMNS
    }

    /// The sums of each hypothesis, square by square, with those of derivatives or without.
    fn sums(
        &mut self,
        hypotheses: &[Hypothesis],
        derivatives: bool,
    ) -> Result<Vec<f32>, BackendError> {
        let columns = self.sum_columns();
        let mut sums = Vec::with_capacity(hypotheses.len() * columns);
        let mut rest = hypotheses;
        while !rest.is_empty() {
            let count = self.prepare(rest.len())?;
            sums.extend(self.attempt(&rest[..count], derivatives)?.unwrap_or_default());
            rest = &hypotheses[sums.len() / columns..];
        }
        Ok(sums)
    }

    /// Makes sure that there are buffers, and says for how many of `wanted` hypotheses.
    fn prepare(&mut self, wanted: usize) -> Result<usize, BackendError> {
        let count = work::batch(&self.device, &self.params, &self.capacity, self.budget, wanted)?;
        let serves = |work: &Work| work.serves(&self.params, &self.capacity, count);
        if !self.work.as_ref().is_some_and(serves) {
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
        derivatives: bool,
    ) -> Result<Option<Vec<f32>>, BackendError> {
        let answer = self.round_trip(hypotheses, derivatives);
        if answer.is_err() {
            // Whatever state they are in now.
            self.work = None;
        }
        answer
    }

    fn round_trip(
        &mut self,
        hypotheses: &[Hypothesis],
        derivatives: bool,
    ) -> Result<Option<Vec<f32>>, BackendError> {
        let Some(work) = &self.work else { return Ok(None) };
        let poses: Vec<_> =
            hypotheses.iter().map(|h| upload::hypothesis(&self.problem, h)).collect();
        self.params.hypotheses = hypotheses.len() as u32;
        self.params.entry_capacity = work.pool() as u32;
        self.params.segment_capacity = work.capacity.segments as u32;
        self.params.piece_capacity = work.capacity.pieces as u32;
        let values = hypotheses.len() * self.sum_columns();
        let size = (size_of::<Usage>() + values * size_of::<f32>()) as u64;
        let queue = &self.device.queue;
        let received = self.device.watched(|| {
            queue.write_buffer(&self.settings, 0, bytemuck::bytes_of(&self.params));
            queue.write_buffer(&work.poses, 0, bytemuck::cast_slice(&poses));
            queue.submit([self.encode(work, derivatives, size)]);
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

    fn encode(&self, work: &Work, derivatives: bool, size: u64) -> wgpu::CommandBuffer {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&work.tallies, 0, None);
        encoder.clear_buffer(&work.bins, 0, None);
        encoder.clear_buffer(&work.results, 0, Some(size_of::<Usage>() as u64));
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_bind_group(0, &work.bind_group, &[]);
            let p = &self.params;
            let mut run = |stage: GpuPass, x: u32, y: u32| {
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
            let pixels = match (&self.problem.loss.mode, derivatives) {
                (Mode::Contour(_), false) => CONTOUR_VALUE,
                (Mode::Contour(_), true) => CONTOUR_DERIVATIVES,
                (Mode::SoftRas(_), false) => SOFTRAS_VALUE,
                (Mode::SoftRas(_), true) => SOFTRAS_DERIVATIVES,
            };
            if let Mode::Contour(_) = self.problem.loss.mode {
                run(RASTER, across, down);
                run(FIND_SEGMENTS, p.edges.div_ceil(64), 1);
                run(FIND_PIECES, p.segment_capacity.div_ceil(64), 1);
            }
            run(pixels, across, down);
            run(TOTAL, p.squares[0], p.squares[1]);
        }
        encoder.copy_buffer_to_buffer(&work.results, 0, &work.readback, 0, size);
        encoder.finish()
    }
}

impl Session for GpuSession {
    fn evaluate(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Loss>, BackendError> {
        let sums = self.sums(hypotheses, false)?;
        let target = &self.problem.target;
        Ok(sums.chunks_exact(SUM_COLUMNS).map(|s| answer::loss(s, target)).collect())
    }

    fn linearize(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Linearized>, BackendError> {
        let sums = self.sums(hypotheses, true)?;
        let target = &self.problem.target;
        Ok(sums.chunks_exact(SUM_COLUMNS).map(|s| answer::linearized(s, target)).collect())
    }

    fn linearize_tiles(
        &mut self,
        hypotheses: &[Hypothesis],
        side: usize,
    ) -> Result<Vec<Vec<Tile>>, BackendError> {
        upload::set_squares(&mut self.params, side);
        let (squares, columns) = (self.params.squares, self.sum_columns());
        let sums = work::check_dispatch(&self.device, &self.params)
            .and_then(|()| self.sums(hypotheses, true));
        // The other calls ask for one square, even after an error.
        upload::set_squares(&mut self.params, usize::MAX);
        let (sums, target) = (sums?, &self.problem.target);
        Ok(sums.chunks_exact(columns).map(|s| answer::tiles(s, squares, target)).collect())
    }
}
