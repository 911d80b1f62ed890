//! Buffers that the passes share, sized for a number of hypotheses.

use super::device::Device;
use super::layout::{
    BIN, ENTRY, Hypothesis, PIECE, Params, SCREEN, SEGMENT, SUM_COLUMNS, TALLY, TILE, Usage,
    VISIBLE,
};
use super::passes::{READ_ONLY, READ_WRITE};
use crate::backend::BackendError;

/// Memory that a session's work buffers may take together \[bytes\]. More hypotheses are worked off in turns.
pub(super) const BUDGET: u64 = 768 << 20;

/// Numbers of buffer entries that one hypothesis needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Capacity {
    /// Faces in tiles, on average over the hypotheses, who share a pool.
    pub(super) entries: usize,
    /// Silhouette edges.
    pub(super) segments: usize,
    /// Pieces of contours.
    pub(super) pieces: usize,
}

impl Capacity {
    /// A first guess: what smooth bodies need. Too small a guess costs one repetition.
    pub(super) fn guess(params: &Params) -> Self {
        let (faces, edges) = (params.faces as usize, params.edges as usize);
        let tiles = params.tiles[0] as usize * params.tiles[1] as usize;
        let segments = edges.min(128 + 8 * edges.isqrt());
        let pieces = segments + (params.size[0] + params.size[1]) as usize;
        Self { entries: 256 + faces / 2 + 4 * tiles, segments, pieces }
    }

    /// Whether `usage` of hypotheses that share a pool of `pool` entries stayed within bounds.
    pub(super) fn holds(&self, usage: &Usage, pool: usize) -> bool {
        usage.entries as usize <= pool
            && usage.segments as usize <= self.segments
            && usage.pieces as usize <= self.pieces
    }

    /// Enough for `usage` of `count` hypotheses, with a quarter to spare where something was short.
    ///
    /// Too few segments hide how many pieces there would have been, so that those may need another round.
    pub(super) fn grown(&self, usage: &Usage, count: usize) -> Self {
        let enough = |have: usize, needed: usize| match needed > have {
            true => needed + needed / 4 + 1,
            false => have,
        };
        Self {
            entries: enough(self.entries, (usage.entries as usize).div_ceil(count)),
            segments: enough(self.segments, usage.segments as usize),
            pieces: enough(self.pieces, usage.pieces as usize),
        }
    }
}

/// Sizes of the written buffers in the order of their bindings \[bytes\].
fn sizes(params: &Params, capacity: &Capacity, hypotheses: usize) -> [u64; 9] {
    let [width, height] = params.size.map(|v| v as usize);
    let tiles = width.div_ceil(TILE) * height.div_ceil(TILE);
    let parts = params.parts as usize * params.parts as usize;
    let [across, down] = params.squares.map(|v| v as usize);
    let sums = hypotheses * across * down * SUM_COLUMNS;
    [
        hypotheses * params.vertices as usize * SCREEN,
        hypotheses * TALLY,
        hypotheses * tiles * BIN,
        hypotheses * capacity.entries * ENTRY,
        hypotheses * width * height * VISIBLE,
        hypotheses * capacity.segments * SEGMENT,
        hypotheses * capacity.pieces * PIECE,
        hypotheses * tiles * parts * SUM_COLUMNS * size_of::<f32>(),
        size_of::<Usage>() + sums * size_of::<f32>(),
    ]
    .map(|size| size.max(16) as u64)
}

const NAMES: [&str; 9] = [
    "projected vertices",
    "tallies",
    "tiles",
    "faces in tiles",
    "z-buffer",
    "silhouette",
    "contours",
    "sums of tiles",
    "results",
];

/// How many of `wanted` hypotheses can be worked off at once within `budget` \[bytes\].
///
/// # Errors
/// When not even one can.
pub(super) fn batch(
    device: &Device,
    params: &Params,
    capacity: &Capacity,
    budget: u64,
    wanted: usize,
) -> Result<usize, BackendError> {
    let limits = &device.limits;
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let one = sizes(params, capacity, 1);
    let too_large = |what: &'static str, needed: u64, limit: u64| BackendError::TooLarge {
        device: device.name.clone(),
        what,
        needed,
        limit,
    };
    if let Some(i) = (0..one.len()).find(|&i| one[i] > most) {
        return Err(too_large(NAMES[i], one[i], most));
    }
    let all: u64 = one.iter().sum();
    if all > budget {
        return Err(too_large("one hypothesis", all, budget));
    }
    let by_buffer = one.iter().map(|size| most / size).min().unwrap_or(1);
    let by_dispatch = u64::from(limits.max_compute_workgroups_per_dimension);
    let count = by_buffer.min(budget / all).min(by_dispatch) as usize;
    // Turns of equal size.
    Ok(wanted.div_ceil(wanted.div_ceil(count.max(1))))
}

/// The dispatches of a pass must not be larger than the device allows.
///
/// # Errors
/// When one is.
pub(super) fn check_dispatch(device: &Device, params: &Params) -> Result<(), BackendError> {
    let groups = [
        params.vertices.div_ceil(256),
        params.faces.div_ceil(64),
        params.edges.div_ceil(64),
        params.tiles[0],
        params.tiles[1],
        params.squares[0],
        params.squares[1],
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

/// Buffers for up to `hypotheses` hypotheses, bound together with what the session uploaded.
pub(super) struct Work {
    pub(super) hypotheses: usize,
    pub(super) capacity: Capacity,
    /// Sizes of the written buffers \[bytes\].
    sizes: [u64; 9],
    pub(super) poses: wgpu::Buffer,
    pub(super) tallies: wgpu::Buffer,
    pub(super) bins: wgpu::Buffer,
    pub(super) results: wgpu::Buffer,
    pub(super) readback: wgpu::Buffer,
    pub(super) bind_group: wgpu::BindGroup,
}

impl Work {
    /// `settings` is the uniform buffer, `model` what comes after the hypotheses among the buffers only read.
    pub(super) fn new(
        device: &Device,
        params: &Params,
        capacity: Capacity,
        hypotheses: usize,
        settings: &wgpu::Buffer,
        model: &[wgpu::Buffer],
    ) -> Self {
        let buffer = |label: &str, size: u64, usage: wgpu::BufferUsages| {
            device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let sizes = sizes(params, &capacity, hypotheses);
        let storage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        let written: Vec<wgpu::Buffer> =
            sizes.iter().zip(NAMES).map(|(size, name)| buffer(name, *size, storage)).collect();
        let poses = buffer("hypotheses", (hypotheses * size_of::<Hypothesis>()) as u64, storage);
        let readback = buffer(
            "readback",
            sizes[8],
            wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        );
        let bound = std::iter::once(settings).chain([&poses]).chain(model).chain(&written);
        let entries: Vec<wgpu::BindGroupEntry> = bound
            .zip(0..)
            .map(|(buffer, binding)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        debug_assert_eq!(entries.len(), READ_WRITE.end as usize);
        debug_assert_eq!(model.len() + 1, READ_ONLY.len());
        let bind_group = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("prehend"),
            layout: &device.layout,
            entries: &entries,
        });
        let [tallies, bins, results] = [1, 2, 8].map(|i: usize| written[i].clone());
        Self { hypotheses, capacity, sizes, poses, tallies, bins, results, readback, bind_group }
    }

    /// Whether it serves `count` hypotheses with these settings.
    pub(super) fn serves(&self, params: &Params, capacity: &Capacity, count: usize) -> bool {
        let needed = sizes(params, capacity, count);
        self.hypotheses >= count
            && self.capacity == *capacity
            && self.sizes.iter().zip(needed).all(|(size, needed)| *size >= needed)
    }

    /// Entries of all hypotheses together.
    pub(super) fn pool(&self) -> usize {
        self.hypotheses * self.capacity.entries
    }
}
