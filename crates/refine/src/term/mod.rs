//! The evidence: each term is a negative log-likelihood of the state, up to a constant.

mod depth;
mod physics;
mod rendering;
mod tactile;

pub use depth::{DepthSettings, DepthTerm};
pub use physics::{PhysicsSettings, PhysicsTerm};
pub use rendering::{RenderingSettings, RenderingTerm};
pub use tactile::{TactileSettings, TactileTerm};

use crate::{Block, Normal, State};

/// One kind of evidence about a [`State`].
///
/// Values are in nats (squared residuals over twice their variance), so that a decrease of one term
/// can be weighed against a decrease of another.
pub trait Term: Send + Sync {
    /// A short name for reports.
    fn name(&self) -> &'static str;

    /// The blocks that the term has derivatives for; it is constant in, or not differentiable by, others.
    fn blocks(&self) -> &'static [Block];

    /// The term at `state`. Cheap: candidate steps are judged by it.
    fn value(&self, state: &State) -> f64;

    /// The term at `state`; adds its gradient and Gauss–Newton Hessian to `normal`.
    fn linearise(&self, state: &State, normal: &mut Normal) -> f64;

    /// Solves in closed form for nuisance parameters of `state` that only this term sees.
    fn refresh(&self, _state: &mut State) {}
}
