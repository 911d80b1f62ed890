//! Writing GLB (glTF 2.0, Khronos Group 2021, sections 3.6 and 4): a mesh with its texture inside, or a film of bodies that move.

mod chunk;
mod film;
mod primitive;
mod tracks;

use std::path::Path;

use serde_json::json;

use self::chunk::Chunk;
pub use self::film::{FilmBody, FilmCamera, FilmKey, GlbFilm};
use self::primitive::{ColorSpace, Parts};
use crate::io::MeshError;
use crate::mesh::TriMesh;

impl TriMesh {
    /// Writes GLB with every attribute the mesh has, in single precision; the texture goes inside as PNG.
    ///
    /// Vertex colors are written as they are (sRGB-encoded), though glTF takes them for linear ones: this library
    /// reads the same numbers again, a viewer shows them lighter.
    ///
    /// # Errors
    /// [`MeshError::Write`], and then no file has appeared or changed; also for coordinates that single
    /// precision does not hold, and for more than 4 GiB.
    pub fn save_glb(&self, path: &Path) -> Result<(), MeshError> {
        let (mut chunk, mut parts) = (Chunk::default(), Parts::default());
        let primitive = parts.add(self, [1.0; 3], ColorSpace::AsStored, &mut chunk, path)?;
        let mut document = json!({
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [primitive] }],
        });
        parts.describe(&mut document);
        chunk.save(document, path)
    }
}
