//! Errors of mesh and distance grid files.

use std::path::{Path, PathBuf};

/// Result of reading or writing a mesh or a distance grid.
pub(crate) type Result<T, E = MeshError> = std::result::Result<T, E>;

/// Why a mesh or a distance grid could not be read or written; every variant names the file.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file could not be opened or read.
    #[error("{path}: cannot be read: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file could not be written; nothing was left behind.
    #[error("{path}: cannot be written: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The extension is none of ply, obj, stl, gltf, glb, dae.
    #[error("{path}: not a known mesh format (expected .ply, .obj, .stl, .gltf, .glb or .dae)")]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file contradicts its format or itself.
    #[error("{path}: {element}: {reason}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The element or field, such as `vertex 12` or `header`.
        element: String,
        /// Reason why it cannot be used.
        reason: String,
    },
    /// The file asks for more than [`limits`](crate::limits) allow.
    #[error("{path}: {element}: {count}, more than the limit of {limit}")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Quantity above its limit, such as `file, bytes` or `vertices`.
        element: String,
        /// How much.
        count: u64,
        /// How much is read at most.
        limit: u64,
    },
    /// The file uses a part of its format that is not read here.
    #[error("{path}: {feature} not supported")]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The feature.
        feature: String,
    },
    /// A texture is missing or not an image.
    #[error("{path}: texture {texture}: {reason}")]
    Texture {
        /// The mesh file.
        path: PathBuf,
        /// The texture as the mesh names it.
        texture: String,
        /// Reason why it cannot be used.
        reason: String,
    },
    /// The file holds no triangles.
    #[error("{path}: the mesh is empty: {vertices} vertices, {faces} faces")]
    Empty {
        /// The file.
        path: PathBuf,
        /// Vertices found.
        vertices: usize,
        /// Triangles found.
        faces: usize,
    },
}

impl MeshError {
    pub(crate) fn malformed(
        path: &Path,
        element: impl Into<String>,
        reason: impl ToString,
    ) -> Self {
        Self::Malformed { path: path.into(), element: element.into(), reason: reason.to_string() }
    }

    /// [`MeshError::TooLarge`] where `count` is more than `limit`.
    pub(super) fn within(path: &Path, element: &str, count: usize, limit: usize) -> Result<()> {
        if count <= limit {
            return Ok(());
        }
        let (count, limit) = (count as u64, limit as u64);
        Err(Self::TooLarge { path: path.into(), element: element.into(), count, limit })
    }

    pub(super) fn texture(path: &Path, texture: impl Into<String>, reason: impl ToString) -> Self {
        Self::Texture { path: path.into(), texture: texture.into(), reason: reason.to_string() }
    }
}
