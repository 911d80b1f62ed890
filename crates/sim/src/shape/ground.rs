//! Shapes without dimensions.

use std::sync::Arc;

use prehend_geometry::{DistanceField, Moments};

use super::solid::RoundSample;

/// A shape without dimensions: a half-space, a height field, a mesh.
#[derive(Clone)]
pub(crate) struct Ground {
    /// Its name.
    pub(crate) kind: &'static str,
    pub(crate) field: Arc<dyn DistanceField>,
    pub(crate) samples: Vec<RoundSample<f64>>,
    /// None of what has no inside or no end.
    pub(crate) moments: Option<Moments>,
}

impl Ground {
    /// Ground, which is only ever touched.
    pub(crate) fn endless(kind: &'static str, field: impl DistanceField + 'static) -> Self {
        Self { kind, field: Arc::new(field), samples: Vec::new(), moments: None }
    }
}
