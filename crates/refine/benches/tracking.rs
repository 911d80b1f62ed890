//! Tracks a short film and prints frames a second, peak memory and what a frame allocates: `cargo bench -p prehend-refine --bench tracking`.
//!
//! The film is the built-in sequence, 640 × 480 pixels at 30 Hz, with a mask in its first frame only. What a frame allocates is counted within
//! `Tracker::push` alone, after the first ten frames: reading and decoding images has no part in it.

#![allow(unsafe_code)] // an allocator that counts is unsafe to write

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use prehend_refine::RefineError;
use prehend_refine::scene::default_sequence;
use prehend_refine::tracker::{TrackStatus, Tracker, TrackerSettings};

/// Frames of the film, and those at its beginning that are not measured.
const FRAMES: usize = 90;
const FIRST: usize = 10;

/// Color, depth and mask of the film.
const BYTES_A_PIXEL: usize = 12 + 4 + 1;

/// The system's allocator, counting while it is told to.
struct Counting;

static COUNTING: AtomicBool = AtomicBool::new(false);
static BYTES: AtomicUsize = AtomicUsize::new(0);
static BLOCKS: AtomicUsize = AtomicUsize::new(0);
/// Bytes of blocks that are large enough to be pages of their own.
static LARGE_BYTES: AtomicUsize = AtomicUsize::new(0);
const LARGE: usize = 64 << 10;

fn count(bytes: usize) {
    if COUNTING.load(Ordering::Relaxed) {
        BYTES.fetch_add(bytes, Ordering::Relaxed);
        BLOCKS.fetch_add(1, Ordering::Relaxed);
        if bytes >= LARGE {
            LARGE_BYTES.fetch_add(bytes, Ordering::Relaxed);
        }
    }
}

// SAFETY: all is handed on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size.saturating_sub(layout.size()));
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn main() -> Result<(), RefineError> {
    let mut film = default_sequence(1, FRAMES)?;
    for frame in &mut film.frames[1..] {
        frame.frame.mask.pixels_mut().fill(false);
    }
    let pixels: usize = film.frames.iter().map(|f| f.frame.mask.pixels().len()).sum();
    let mut tracker = Tracker::new(Arc::clone(&film.object), TrackerSettings::default())?;
    tracker.start_from(&film.initial);
    let mut seconds = Vec::new();
    let mut followed = 0;
    for (number, frame) in film.frames.into_iter().enumerate() {
        COUNTING.store(number >= FIRST, Ordering::Relaxed);
        let start = Instant::now();
        let tracked = tracker.push(frame.frame, frame.time)?;
        let time = start.elapsed().as_secs_f64();
        COUNTING.store(false, Ordering::Relaxed);
        if number >= FIRST {
            seconds.push(time);
            followed += usize::from(tracked.status == TrackStatus::Tracked);
        }
    }
    let frames = seconds.len();
    seconds.sort_by(f64::total_cmp);
    let (total, median) = (seconds.iter().sum::<f64>(), 1e3 * seconds[frames / 2]);
    let rate = frames as f64 / total;
    println!("{followed} of {frames} frames followed at {rate:.1} a second, median {median:.1} ms");
    let a_frame = |what: &AtomicUsize| what.load(Ordering::Relaxed) as f64 / frames as f64;
    println!(
        "a frame allocates {:.1} kB in {:.0} blocks, {:.1} kB of it in blocks of {} kB and more",
        a_frame(&BYTES) / 1e3,
        a_frame(&BLOCKS),
        a_frame(&LARGE_BYTES) / 1e3,
        LARGE >> 10,
    );
    match peak_memory() {
        Some(kilobytes) => println!(
            "peak resident memory {:.0} MB, {:.0} MB of it the film",
            kilobytes as f64 / 1e3,
            (pixels * BYTES_A_PIXEL) as f64 / 1e6,
        ),
        None => println!("peak resident memory is not known on this system"),
    }
    Ok(())
}

/// The largest resident memory of this process so far \[kB\]; none where the system does not tell as Linux does.
fn peak_memory() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}
