//! Arrays of one world, or of a batch of worlds.

use std::borrow::Cow;
use std::fmt::Display;

use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;

use crate::arrays::{Array, Numbers, array, in_order};
use crate::error::wrong;

/// The numbers of all worlds of a batch, or of one for all.
pub(crate) struct Input<'a> {
    pub(crate) numbers: Cow<'a, [f64]>,
    /// Numbers of a world.
    pub(crate) width: usize,
    pub(crate) batch: Option<usize>,
    pub(crate) shape: Vec<usize>,
}

impl<'a> Input<'a> {
    /// Numbers whose shape without a batch is `expected`.
    pub(crate) fn new(
        array: &'a Numbers<'_>,
        expected: &[usize],
        what: impl Display,
    ) -> PyResult<Self> {
        let shape = array.shape();
        let batch = match shape {
            own if own == expected => None,
            [batch, own @ ..] if own == expected => Some(*batch),
            _ => {
                let wanted: Vec<String> = expected.iter().map(ToString::to_string).collect();
                let wanted =
                    if wanted.is_empty() { "no dimension".to_owned() } else { wanted.join(" × ") };
                let text = format!(
                    "{what}: an array of {wanted} is expected, or a batch of them, not {shape:?}"
                );
                return Err(wrong(text));
            }
        };
        let (width, shape) = (expected.iter().product(), shape.to_vec());
        Ok(Self { numbers: in_order(array), width, batch, shape })
    }

    /// Those of `array`, or the same for all worlds.
    pub(crate) fn or(
        array: Option<&'a Numbers<'_>>,
        numbers: &'a [f64],
        shape: &[usize],
        what: impl Display,
    ) -> PyResult<Self> {
        let (width, owned) = (numbers.len(), || shape.to_vec());
        array.map_or_else(
            || Ok(Self { numbers: numbers.into(), width, batch: None, shape: owned() }),
            |array| Self::new(array, shape, what),
        )
    }

    /// Where the numbers of a world begin.
    pub(crate) fn start(&self, world: usize) -> usize {
        if self.batch.is_some() { world * self.width } else { 0 }
    }

    pub(crate) fn of(&self, world: usize) -> &[f64] {
        &self.numbers[self.start(world)..][..self.width]
    }

    /// Derivatives by this input: of each world, or their sum.
    pub(crate) fn gathered<'py, 'b>(
        &self,
        py: Python<'py>,
        each: impl Iterator<Item = &'b [f64]>,
    ) -> PyResult<Array<'py>> {
        let mut all = vec![0.0; self.numbers.len()];
        for (world, own) in each.enumerate() {
            let sums = &mut all[self.start(world)..][..self.width];
            sums.iter_mut().zip(own).for_each(|(sum, x)| *sum += x);
        }
        array(py, all, &self.shape)
    }
}

/// The number of worlds of all inputs, each with its name; none without a batch.
pub(crate) fn batch_of<'a, 'b: 'a>(
    inputs: impl Iterator<Item = (&'a str, &'a Input<'b>)>,
) -> PyResult<Option<usize>> {
    let mut batch = None;
    for (what, own) in inputs {
        match (batch, own.batch) {
            (Some(all), Some(own)) if all != own => {
                return Err(wrong(format!("{what}: a batch of {own}, but others are of {all}")));
            }
            (_, Some(own)) => batch = Some(own),
            _ => {}
        }
    }
    Ok(batch)
}

/// The shape of a batch of what has the shape `own`.
pub(crate) fn with_batch(batch: Option<usize>, own: &[usize]) -> Vec<usize> {
    batch.iter().chain(own).copied().collect()
}

/// One after the other, without a copy of a single one.
pub(crate) fn joined(mut parts: Vec<Vec<f64>>) -> Vec<f64> {
    match parts.len() {
        1 => parts.pop().unwrap_or_default(),
        _ => parts.concat(),
    }
}
