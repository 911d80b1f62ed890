//! Numbers of pixels by their part in the loss.

/// Numbers of pixels by their part in the loss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// The object is seen here.
    pub covered: usize,
    /// Within the contour band (inside and outside).
    pub contour: usize,
    /// The object or its band lies behind a known body: no residual.
    pub hidden: usize,
    /// In the mask but not covered by the object, nor in its band.
    pub missed: usize,
    /// Depth was compared.
    pub depth: usize,
}
