//! Friction coefficients of a body with what it touches.

use crate::world::body_id::BodyId;

/// Friction coefficients of a body with those that it touches: one number for all, or a function of the other body, such as
/// `|other: BodyId| if other == rubber { 1.0 } else { 0.3 }`.
pub trait PairFriction {
    /// The friction coefficient with `other`, zero or more.
    fn with(&self, other: BodyId) -> f64;
}

impl PairFriction for f64 {
    fn with(&self, _: BodyId) -> f64 {
        *self
    }
}

impl<F: Fn(BodyId) -> f64> PairFriction for F {
    fn with(&self, other: BodyId) -> f64 {
        self(other)
    }
}
