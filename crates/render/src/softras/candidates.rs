//! The faces that count at each pixel of a short run of pixels.

use super::face::Face;
use super::fragment::Fragment;
use super::settings::Settings;
use crate::mode::SoftRasOptions;

/// Pixels of a run: a vector register's worth.
pub(crate) const RUN: usize = 8;

/// Room for the faces of one pixel. When it is full, all but the nearest are dropped.
const ROOM: usize = 2 * SoftRasOptions::MOST_FACES;

/// A face by depth, of equals the first: the bits of Z ≥ 0, which sort like Z, above the face's index.
#[inline(always)]
fn key(z: f32, face: u32) -> u64 {
    // A negative zero would sort last.
    ((z + 0.0).to_bits() as u64) << 32 | face as u64
}

/// The faces that count at the pixels of a run.
pub(crate) struct Candidates {
    keys: [[u64; ROOM]; RUN],
    count: [usize; RUN],
    /// Only faces below this are among the nearest.
    limit: [u64; RUN],
    /// The nearest that the pixel's centre lies inside.
    inside: [u64; RUN],
}

impl Candidates {
    pub(crate) fn new() -> Self {
        Self {
            keys: [[0; ROOM]; RUN],
            count: [0; RUN],
            limit: [u64::MAX; RUN],
            inside: [u64::MAX; RUN],
        }
    }

    pub(crate) fn clear(&mut self) {
        self.count = [0; RUN];
        self.limit = [u64::MAX; RUN];
        self.inside = [u64::MAX; RUN];
    }

    /// Adds `face` with index `index` to the `lanes` pixels from `pixel` (column, row) on, where it counts.
    #[inline(always)]
    pub(crate) fn add(
        &mut self,
        face: &Face,
        index: u32,
        pixel: [f32; 2],
        lanes: usize,
        settings: &Settings,
    ) {
        let [column, row] = pixel;
        let (mut z, mut state) = ([0.0f32; RUN], [0u32; RUN]);
        // A number of turns that the compiler does not know: it makes vectors of such a loop, and would unroll another.
        for (lane, (z, state)) in z[..lanes].iter_mut().zip(&mut state[..lanes]).enumerate() {
            let fragment = Fragment::new(face, column + lane as i32 as f32, row, settings);
            *z = fragment.z;
            *state = fragment.kept as u32 + ((fragment.kept & fragment.inside) as u32) * 2;
        }
        for lane in 0..lanes {
            if state[lane] == 0 {
                continue;
            }
            let key = key(z[lane], index);
            if state[lane] > 1 {
                self.inside[lane] = self.inside[lane].min(key);
            }
            if key < self.limit[lane] {
                self.keys[lane][self.count[lane]] = key;
                self.count[lane] += 1;
                if self.count[lane] == ROOM {
                    self.keep(lane, settings.faces);
                }
            }
        }
    }

    /// Keeps the `most` nearest faces of a pixel.
    fn keep(&mut self, lane: usize, most: usize) {
        let count = self.count[lane];
        if count > most {
            let (_, last, _) = self.keys[lane][..count].select_nth_unstable(most - 1);
            self.limit[lane] = *last;
            self.count[lane] = most;
        }
    }

    /// The faces that count at a pixel, the nearest first.
    pub(crate) fn nearest(
        &mut self,
        lane: usize,
        most: usize,
    ) -> impl ExactSizeIterator<Item = u32> {
        self.keep(lane, most);
        let keys = &self.keys[lane][..self.count[lane]];
        keys.iter().map(|key| *key as u32)
    }

    /// The nearest face that the pixel's centre lies inside.
    pub(crate) fn inside(&self, lane: usize) -> Option<u32> {
        (self.inside[lane] != u64::MAX).then_some(self.inside[lane] as u32)
    }
}
