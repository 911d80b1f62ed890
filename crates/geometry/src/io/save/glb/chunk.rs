//! The container of a GLB file.

use std::path::Path;

use serde_json::{Value, json};

use crate::io::save::invalid;
use crate::io::{MeshError, Result, write_atomic};

pub(super) const FLOAT: u32 = 5126;
pub(super) const UNSIGNED_INT: u32 = 5125;

/// The binary chunk as it grows, and the lists that describe it.
#[derive(Default)]
pub(super) struct Chunk {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Chunk {
    /// Appends a view; returns its index.
    pub(super) fn view(&mut self, content: impl IntoIterator<Item = u8>) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(content);
        let length = self.bytes.len() - start;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length }));
        self.views.len() - 1
    }

    /// Appends a view with an accessor of its elements; returns the accessor's index.
    pub(super) fn accessor(
        &mut self,
        words: impl Iterator<Item = [u8; 4]>,
        count: usize,
        component: u32,
        kind: &str,
    ) -> usize {
        let view = self.view(words.flatten());
        self.accessors.push(json!({
            "bufferView": view, "componentType": component, "count": count, "type": kind,
        }));
        self.accessors.len() - 1
    }

    /// As [`accessor`](Self::accessor), of vectors of numbers, with their bounds where there are any.
    pub(super) fn bounded<const N: usize>(&mut self, list: &[[f32; N]], kind: &str) -> usize {
        let index = self.floats(list, kind);
        let edge = |pick: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
            (0..N).map(|k| list.iter().fold(start, |m, v| pick(m, v[k]))).collect()
        };
        if !list.is_empty() {
            self.accessors[index]["min"] = json!(edge(f32::min, f32::MAX));
            self.accessors[index]["max"] = json!(edge(f32::max, f32::MIN));
        }
        index
    }

    /// As [`accessor`](Self::accessor), of vectors of numbers.
    pub(super) fn floats<const N: usize>(&mut self, list: &[[f32; N]], kind: &str) -> usize {
        let words = list.iter().flatten().map(|c| c.to_le_bytes());
        self.accessor(words, list.len(), FLOAT, kind)
    }

    /// Writes `document`, completed by what describes the chunk, and the chunk.
    ///
    /// # Errors
    /// [`MeshError::Write`], and then no file has appeared or changed.
    pub(super) fn save(self, mut document: Value, path: &Path) -> Result<()> {
        document["asset"] = json!({ "version": "2.0", "generator": "prehend" });
        document["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        document["bufferViews"] = self.views.into();
        document["accessors"] = self.accessors.into();
        let content = container(document.to_string().into_bytes(), &self.bytes)
            .ok_or_else(|| invalid(path, "more than the 4 GiB that the format holds".into()))?;
        write_atomic(path, &content)
            .map_err(|source| MeshError::Write { path: path.into(), source })
    }
}

/// The header and the two chunks; `None` where a length does not fit.
fn container(mut json: Vec<u8>, binary: &[u8]) -> Option<Vec<u8>> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = u32::try_from(28 + json.len() + binary.len()).ok()?;
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend(length.to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", binary)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    Some(out)
}
