//! Arrays that are the same for all pictures of a batch, or one for each.

use std::borrow::Cow;

use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;

use crate::arrays::{Numbers, in_order};
use crate::error::wrong;

/// The numbers of all pictures, or of each.
pub(super) struct Input<'a> {
    numbers: Cow<'a, [f64]>,
    /// Shape of what belongs to one picture.
    own: Vec<usize>,
    batch: Option<usize>,
}

impl<'a> Input<'a> {
    /// Whose shape without a batch is `own`.
    pub(super) fn new(array: &'a Numbers<'_>, own: &[usize], what: &str) -> PyResult<Self> {
        let batch = match array.shape() {
            shape if shape == own => None,
            [batch, shape @ ..] if shape == own => Some(*batch),
            shape => {
                let own: Vec<String> = own.iter().map(usize::to_string).collect();
                let own = own.join(" × ");
                let text = format!(
                    "{what}: an array of {own} is expected, or a batch of them, not {shape:?}"
                );
                return Err(wrong(text));
            }
        };
        Ok(Self { numbers: in_order(array), own: own.to_vec(), batch })
    }

    pub(super) fn batch(&self) -> Option<usize> {
        self.batch
    }

    /// The numbers of a picture.
    pub(super) fn of(&self, picture: usize) -> &[f64] {
        let width: usize = self.own.iter().product();
        let start = if self.batch.is_some() { picture * width } else { 0 };
        &self.numbers[start..][..width]
    }
}

/// The length of the batch of all inputs, at least one; None if there is no batch.
pub(super) fn batch_of(inputs: &[(&str, Option<usize>)]) -> PyResult<Option<usize>> {
    let mut all = None;
    for (what, own) in inputs {
        match (all, *own) {
            (Some(all), Some(own)) if all != own => {
                return Err(wrong(format!("{what}: a batch of {own}, but others are of {all}")));
            }
            (_, Some(0)) => return Err(wrong(format!("{what}: the batch is empty"))),
            (_, Some(own)) => all = Some(own),
            _ => {}
        }
    }
    Ok(all)
}
