//! Independent random sequences from one seed.

use prehend_geometry::SplitMix64;

/// What a sequence is for: numbers for one use must not change when another use takes more of them.
#[derive(Clone, Copy, Debug)]
pub(super) enum Use {
    /// The object model that the estimator is given, by object.
    Model = 1,
    /// The grasp and its trajectory, by object and grasp.
    Grasp,
    /// Sensor faults that last through a grasp, by object and grasp.
    Rig,
    /// What differs from frame to frame, by object and frame.
    Frame,
    /// Initial poses of the lower level, by object and frame.
    InitialLow,
    /// Initial poses of the higher level, by object and frame.
    InitialHigh,
}

/// A seed for one `purpose`, one object and one number.
pub(super) fn seed(seed: u64, purpose: Use, obj_id: u32, number: u32) -> u64 {
    // The finalizer of SplitMix64 after each word, so that near words give unrelated seeds.
    let words = [seed, purpose as u64, u64::from(obj_id), u64::from(number)];
    words.into_iter().fold(0_u64, |state, word| {
        let mut z = (state ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

/// The sequence of [`seed`].
pub(super) fn sequence(from: u64, purpose: Use, obj_id: u32, number: u32) -> SplitMix64 {
    SplitMix64::new(seed(from, purpose, obj_id, number))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn seeds_differ_in_every_argument() {
        let mut seen = BTreeSet::new();
        for from in 0..4 {
            for purpose in [Use::Model, Use::Grasp, Use::Rig, Use::Frame, Use::InitialHigh] {
                for obj_id in 1..10 {
                    (0..50).for_each(|n| assert!(seen.insert(seed(from, purpose, obj_id, n))));
                }
            }
        }
    }
}
