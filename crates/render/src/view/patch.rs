//! Numbers of many pixels side by side, for loops that the compiler vectorizes.
//!
//! The number of lanes is the same on every machine, and so are the results: only how many of them one instruction
//! treats differs. (For the same reason nothing here multiplies and adds in one rounding.)

/// Pixels side by side.
pub(crate) const LANES: usize = 32;

/// One number of each.
pub(crate) type Lane = [f32; LANES];

/// The numbers of lane `l`.
#[inline(always)]
pub(crate) fn get<const N: usize>(lanes: &[Lane; N], l: usize) -> [f32; N] {
    let mut out = [0.0; N];
    for i in 0..N {
        out[i] = lanes[i][l];
    }
    out
}

/// Sets the numbers of lane `l`.
#[inline(always)]
pub(crate) fn put<const N: usize>(lanes: &mut [Lane; N], l: usize, values: [f32; N]) {
    for i in 0..N {
        lanes[i][l] = values[i];
    }
}

/// Pixels side by side. Depths are of those inside the object alone, where nothing is blended and coverage is one.
pub(crate) struct Patch {
    /// How many of the lanes are in use. The others hold finite numbers.
    pub(crate) count: usize,
    /// Index of the pixel in the image.
    pub(crate) at: [usize; LANES],
    /// Z \[m\].
    pub(crate) z: Lane,
    pub(crate) color: [Lane; 3],
    pub(crate) color_rows: [[Lane; 6]; 3],
    pub(crate) z_row: [Lane; 6],
}

impl Patch {
    pub(crate) fn new() -> Self {
        const ZERO: Lane = [0.0; LANES];
        Self {
            count: 0,
            at: [0; LANES],
            z: ZERO,
            color: [ZERO; 3],
            color_rows: [[ZERO; 6]; 3],
            z_row: [ZERO; 6],
        }
    }
}
