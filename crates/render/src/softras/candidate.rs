//! The faces that may be seen in a pixel.

use super::fragment::Fragment;

/// A fragment's part in its pixel.
#[derive(Clone, Copy)]
pub(crate) struct Part<T> {
    /// p = sigmoid(−d/σ).
    pub(crate) presence: T,
    /// 1 − p, without cancellation.
    pub(crate) absence: T,
    /// w = p exp((ζ − ζ_max)/γ).
    pub(crate) weight: T,
}

/// A face that counts at some of the pixels.
#[derive(Clone, Copy)]
pub(crate) struct Candidate<T> {
    pub(crate) face: u32,
    /// Fragment; `b`, `z`, `distance` and `inverse_sum` are finite where the face does not count.
    pub(crate) fragment: Fragment<T>,
    /// 1 where the face counts, else 0.
    pub(crate) counts: T,
    /// Part in the pixel, set by [`Blend`](super::blend::Blend).
    pub(crate) part: Part<T>,
}
