//! How much a file may ask for.
//!
//! A mesh beyond a limit is refused with [`MeshError::TooLarge`](crate::MeshError::TooLarge). Whatever a header claims, memory
//! is taken for what has been read, so that a small file costs little: counts are checked first, and nothing is
//! reserved on their word.

/// Largest file, and largest sum of the buffers that a glTF file draws in \[bytes\].
pub const MAX_FILE_BYTES: usize = 1 << 30;

/// Largest file of JSON, TOML or a table in text \[bytes\]: what is read of it takes some ten times as much.
pub const MAX_TEXT_BYTES: usize = 1 << 30;

/// No number that describes a scene is as large, in any unit that a format has: squares of such fit into single precision.
pub const MAX_NUMBER: f64 = 1e9;

/// Most vertices of a mesh, and most triangles.
pub const MAX_ELEMENTS: usize = 50_000_000;

/// Most pixels of an image, and of all images of a mesh together: 192 MiB as 8-bit RGB.
pub const MAX_PIXELS: usize = 1 << 26;

/// Longest PLY header \[bytes\].
pub const MAX_PLY_HEADER: usize = 1 << 20;

/// Largest robot description \[bytes\].
pub const MAX_URDF_BYTES: usize = 1 << 26;

/// Largest MJCF model with all files that it includes \[bytes\].
pub const MAX_MJCF_BYTES: usize = 1 << 26;

/// Most elements of an MJCF model.
pub const MAX_MJCF_ELEMENTS: usize = 1 << 18;

/// Most default classes of an MJCF model.
pub const MAX_MJCF_CLASSES: usize = 1 << 12;

/// Deepest nesting of tags in an MJCF model, which is read by recursion: bodies lie in the bodies that carry them.
pub const MAX_MJCF_DEPTH: usize = 256;
