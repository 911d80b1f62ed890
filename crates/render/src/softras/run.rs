//! The faces that count at the pixels of a short run of them, side by side.

use super::candidate::{Candidate, Part};
use super::face::Face;
use super::fragment::Fragment;
use super::number::Number;
use super::settings::Settings;

/// Pixels whose faces are listed together: at most a vector register's worth is treated at once.
pub(crate) const RUN: usize = 8;

/// The faces that count at the pixels of a run, in the order in which they were given: the nearest by depth, of equals
/// the first.
pub(crate) struct Run<T: Number> {
    pub(crate) candidates: Vec<Candidate<T>>,
    /// How many faces there are at each pixel.
    count: T,
    /// The nearest that contains the pixel's center: its depth, infinite if there is none, and place in the list.
    pub(crate) inside_z: T,
    pub(crate) inside: T,
}

impl<T: Number> Run<T> {
    pub(crate) fn new(zero: T) -> Self {
        let far = zero.like(f32::INFINITY);
        Self { candidates: Vec::new(), count: zero, inside_z: far, inside: zero }
    }

    /// Finds out which of the faces `indices` count at the pixels from (`column`, `row`) on.
    #[inline(always)]
    pub(crate) fn collect(
        &mut self,
        faces: &[Face],
        indices: impl Iterator<Item = u32>,
        [column, row]: [usize; 2],
        settings: &Settings,
    ) {
        let is = |value: f32| self.count.like(value);
        let (zero, one) = (is(0.0), is(1.0));
        let (column, row) = places(zero, column, row);
        self.candidates.clear();
        (self.count, self.inside, self.inside_z) = (zero, zero, is(f32::INFINITY));
        for index in indices {
            let (mut fragment, extent) =
                Fragment::new(&faces[index as usize], column, row, settings);
            let counts = T::pick(extent.kept, one, zero);
            if !zero.any(extent.kept) {
                continue;
            }
            let closer = extent.kept & extent.inside & fragment.z.below(self.inside_z);
            self.inside_z = T::pick(closer, fragment.z, self.inside_z);
            let place = one.like(self.candidates.len() as f32);
            self.inside = T::pick(closer, place, self.inside);
            self.count = self.count + counts;
            // What is anything but a number must not reach sums, not even times zero.
            fragment.z = T::pick(extent.kept, fragment.z, zero);
            fragment.distance = T::pick(extent.kept, fragment.distance, zero);
            fragment.inverse_sum = T::pick(extent.kept, fragment.inverse_sum, one);
            let [a, b, c] = fragment.b;
            fragment.b = [
                T::pick(extent.kept, a, zero),
                T::pick(extent.kept, b, zero),
                T::pick(extent.kept, c, zero),
            ];
            let part = Part { presence: zero, absence: one, weight: zero };
            self.candidates.push(Candidate { face: index, fragment, counts, part });
        }
        for lane in 0..T::LANES {
            if self.count.lanes()[lane] > settings.faces as f32 {
                self.keep_nearest(lane, settings.faces);
            }
        }
    }

    /// Drops all but the `most` nearest faces of a pixel.
    fn keep_nearest(&mut self, lane: usize, most: usize) {
        // The bits of Z ≥ 0, which sort like Z, above the place in the list. (A negative zero would sort last.)
        let mut keys: Vec<u64> = Vec::with_capacity(self.candidates.len());
        for (place, candidate) in self.candidates.iter().enumerate() {
            if candidate.counts.lanes()[lane] > 0.0 {
                let z = candidate.fragment.z.lanes()[lane] + 0.0;
                keys.push(u64::from(z.to_bits()) << 32 | place as u64);
            }
        }
        keys.select_nth_unstable(most - 1);
        for key in &keys[most..] {
            self.candidates[*key as u32 as usize].counts.lanes_mut()[lane] = 0.0;
        }
        self.count.lanes_mut()[lane] = most as f32;
    }

    /// Zeros, as many as there are pixels.
    #[inline(always)]
    pub(crate) fn zero(&self) -> T {
        self.count.like(0.0)
    }

    /// Whether any face counts at a pixel.
    #[inline(always)]
    pub(crate) fn shows(&self, lane: usize) -> bool {
        self.count.lanes()[lane] > 0.0
    }

    /// The faces that count at a pixel.
    pub(crate) fn faces(&self, lane: usize) -> impl Iterator<Item = u32> {
        let here = self.candidates.iter().filter(move |c| c.counts.lanes()[lane] > 0.0);
        here.map(|candidate| candidate.face)
    }

    /// The nearest face that the pixel's center lies inside.
    #[inline(always)]
    pub(crate) fn inside(&self, lane: usize) -> Option<u32> {
        let candidate = self.candidates.get(self.inside.lanes()[lane] as usize)?;
        (self.inside_z.lanes()[lane] < f32::INFINITY).then_some(candidate.face)
    }
}

/// Columns and rows of the pixels of a run from (`column`, `row`) on.
#[inline(always)]
pub(crate) fn places<T: Number>(zero: T, column: usize, row: usize) -> (T, T) {
    let steps = zero.loaded(&STEPS[..T::LANES.min(RUN)]);
    (zero.like(column as f32) + steps, zero.like(row as f32))
}

const STEPS: [f32; RUN] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
