//! Accessors: typed numbers within the buffers of a glTF file.
//!
//! Decoded here, since the `gltf` crate's own readers panic where an accessor reaches outside its buffer.

use std::path::Path;

use ::gltf::accessor::DataType;
use ::gltf::accessor::sparse::IndexType;
use ::gltf::{Accessor, buffer};

use crate::io::limits::MAX_ELEMENTS;
use crate::io::{MeshError, Result};

/// The content of a file's buffers.
pub(super) struct GltfBuffers<'a> {
    pub(super) path: &'a Path,
    pub(super) content: Vec<Vec<u8>>,
}

impl GltfBuffers<'_> {
    /// The bytes of a view; `None` where it reaches outside its buffer.
    pub(super) fn view(&self, view: &buffer::View) -> Option<&[u8]> {
        let end = view.offset().checked_add(view.length())?;
        self.content.get(view.buffer().index())?.get(view.offset()..end)
    }

    /// The first `N` components of each element.
    pub(super) fn floats<const N: usize>(&self, accessor: &Accessor) -> Result<Vec<[f32; N]>> {
        self.floats_as(accessor, N, |v| {
            let mut out = [0.0; N];
            out.iter_mut().zip(v).for_each(|(o, c)| *o = *c as f32);
            out
        })
    }

    /// The accessor's elements, each of at least `width` components, normalized integers in 0..=1 or −1..=1.
    pub(super) fn floats_as<T>(
        &self,
        accessor: &Accessor,
        width: usize,
        f: impl Fn(&[f64]) -> T,
    ) -> Result<Vec<T>> {
        let bad = |reason: &str| {
            MeshError::malformed(self.path, format!("accessor {}", accessor.index()), reason)
        };
        let components = accessor.dimensions().multiplicity();
        if components < width {
            return Err(bad("too few components"));
        }
        let number = accessor.data_type();
        let own = Layout { number, components, normalized: accessor.normalized() };
        let mut all = match accessor.view() {
            Some(view) => self.read(&view, accessor.offset(), accessor.count(), own, &f),
            // Without a view all are zero.
            None => {
                MeshError::within(self.path, "accessor", accessor.count(), MAX_ELEMENTS)?;
                Ok((0..accessor.count()).map(|_| f(&vec![0.0; components])).collect())
            }
        }
        .map_err(bad)?;
        if let Some(sparse) = accessor.sparse() {
            let (indices, values, count) = (sparse.indices(), sparse.values(), sparse.count());
            let number = match indices.index_type() {
                IndexType::U8 => DataType::U8,
                IndexType::U16 => DataType::U16,
                IndexType::U32 => DataType::U32,
            };
            let layout = Layout { number, components: 1, normalized: false };
            let places =
                self.read(&indices.view(), indices.offset(), count, layout, &|v| v[0] as usize);
            let values = self.read(&values.view(), values.offset(), count, own, &f);
            for (place, value) in places.map_err(bad)?.into_iter().zip(values.map_err(bad)?) {
                *all.get_mut(place).ok_or_else(|| bad("a sparse index is out of range"))? = value;
            }
        }
        Ok(all)
    }

    /// The elements of a view from `offset` on.
    fn read<T>(
        &self,
        view: &buffer::View,
        offset: usize,
        count: usize,
        Layout { number, components, normalized }: Layout,
        f: &impl Fn(&[f64]) -> T,
    ) -> Result<Vec<T>, &'static str> {
        let (size, element) = (number.size(), number.size() * components);
        let stride = view.stride().unwrap_or(element);
        let bytes = self.view(view).and_then(|v| v.get(offset..)).ok_or("outside its buffer")?;
        let needed = match count {
            0 => Some(0),
            n => (n - 1).checked_mul(stride).and_then(|b| b.checked_add(element)),
        };
        if needed.is_none_or(|n| n > bytes.len()) {
            return Err("outside its buffer view");
        }
        let mut values = vec![0.0; components];
        let read = |i: usize| {
            for (k, value) in values.iter_mut().enumerate() {
                let at = i * stride + k * size;
                *value = component(&bytes[at..at + size], number, normalized);
            }
            f(&values)
        };
        Ok((0..count).map(read).collect())
    }
}

/// Storage of the numbers of an element.
#[derive(Clone, Copy)]
struct Layout {
    number: DataType,
    components: usize,
    normalized: bool,
}

fn component(bytes: &[u8], number: DataType, normalized: bool) -> f64 {
    let at = |k: usize| bytes.get(k).copied().unwrap_or_default();
    let (value, full) = match number {
        DataType::I8 => (f64::from(at(0) as i8), 127.0),
        DataType::U8 => (f64::from(at(0)), 255.0),
        DataType::I16 => (f64::from(i16::from_le_bytes([at(0), at(1)])), 32767.0),
        DataType::U16 => (f64::from(u16::from_le_bytes([at(0), at(1)])), 65535.0),
        DataType::U32 => {
            (f64::from(u32::from_le_bytes([at(0), at(1), at(2), at(3)])), f64::from(u32::MAX))
        }
        DataType::F32 => (f64::from(f32::from_le_bytes([at(0), at(1), at(2), at(3)])), 1.0),
    };
    if normalized { (value / full).max(-1.0) } else { value }
}
