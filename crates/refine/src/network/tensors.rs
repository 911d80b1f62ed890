//! Files of named tensors, in the format safetensors: the length of a JSON header, the header, and numbers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use prehend_geometry::{read_plain, write_atomic};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

/// An array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Length of each dimension; the last one varies fastest.
    pub shape: Vec<usize>,
    /// Numbers.
    pub values: Vec<f32>,
}

/// Tensors by name.
pub type Tensors = BTreeMap<String, Tensor>;

/// Reason that a network cannot be read or written.
#[derive(Debug, Error)]
#[error("{}: {problem}", file.display())]
pub struct NetworkError {
    /// File.
    pub file: PathBuf,
    /// Fault, after the name of the tensor if one is at fault.
    pub problem: String,
}

impl NetworkError {
    pub(super) fn new(file: &Path, problem: impl ToString) -> Self {
        Self { file: file.to_owned(), problem: problem.to_string() }
    }
}

/// Entry of the header.
#[derive(Serialize, Deserialize)]
struct TensorEntry {
    dtype: String,
    shape: Vec<usize>,
    data_offsets: [usize; 2],
}

/// Largest file, and largest header \[bytes\].
const LIMIT: usize = 1 << 30;
const HEADER: usize = 1 << 24;

/// Tensors of a file; what is not of 32-bit floats is an error.
///
/// # Errors
/// [`NetworkError`] naming the file, and the tensor if one is at fault.
pub fn read_tensors(file: &Path) -> Result<Tensors, NetworkError> {
    let bytes = read_plain(file, LIMIT).map_err(|reason| NetworkError::new(file, reason))?;
    let format =
        |problem: String| NetworkError::new(file, format!("no safetensors file: {problem}"));
    let (length, rest) =
        bytes.split_first_chunk::<8>().ok_or_else(|| format("less than 8 bytes".into()))?;
    let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
    if length > HEADER.min(rest.len()) {
        return Err(format(format!("a header of {length} bytes")));
    }
    let (header, data) = rest.split_at(length);
    let header: BTreeMap<String, Value> =
        serde_json::from_slice(header).map_err(|e| format(format!("header: {e}")))?;
    let entries = header.into_iter().filter(|(name, _)| name != "__metadata__");
    let read = |(name, entry): (String, Value)| match values(entry, data) {
        Ok(tensor) => Ok((name, tensor)),
        Err(problem) => Err(NetworkError::new(file, format!("tensor {name}: {problem}"))),
    };
    entries.map(read).collect()
}

fn values(entry: Value, data: &[u8]) -> Result<Tensor, String> {
    let TensorEntry { dtype, shape, data_offsets: [start, end] } =
        serde_json::from_value(entry).map_err(|e| e.to_string())?;
    if dtype != "F32" {
        return Err(format!("is of {dtype}, must be of F32"));
    }
    let bytes = data.get(start..end).ok_or("lies beyond the end of the file")?;
    let count = shape.iter().try_fold(4_usize, |product, n| product.checked_mul(*n));
    if count != Some(bytes.len()) {
        return Err(format!("has {} bytes for the shape {shape:?}", bytes.len()));
    }
    let values: Vec<f32> = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    match values.iter().position(|v| !v.is_finite()) {
        Some(at) => Err(format!("number {at} is {}", values[at])),
        None => Ok(Tensor { shape, values }),
    }
}

/// Writes `tensors` to a file, whole or not at all.
///
/// # Errors
/// [`NetworkError`] if the file cannot be written.
pub fn write_tensors(file: &Path, tensors: &Tensors) -> Result<(), NetworkError> {
    let (mut header, mut data) = (BTreeMap::new(), Vec::new());
    for (name, tensor) in tensors {
        let start = data.len();
        data.extend(tensor.values.iter().flat_map(|v| v.to_le_bytes()));
        let data_offsets = [start, data.len()];
        header.insert(
            name,
            TensorEntry { dtype: "F32".into(), shape: tensor.shape.clone(), data_offsets },
        );
    }
    let mut header = serde_json::to_vec(&header).map_err(|e| NetworkError::new(file, e))?;
    // Numbers begin at a multiple of eight bytes, as the format has it.
    header.resize(header.len().next_multiple_of(8), b' ');
    let length = (header.len() as u64).to_le_bytes();
    write_atomic(file, &[&length, header.as_slice(), &data].concat())
        .map_err(|reason| NetworkError::new(file, reason))
}
