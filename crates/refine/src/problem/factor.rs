//! Factors: negative log-likelihoods of a state.

use std::fmt;

use rayon::prelude::*;

use super::{NormalEquations, Rows, State};

/// One kind of evidence: a negative log-likelihood of a [`State`] \[nat\], up to a constant.
///
/// A factor gives the [`rows`](Self::rows) of its residuals; cost and linearization follow. One whose cost is no sum of
/// weighted residuals implements [`cost`](Self::cost) and [`linearize`](Self::linearize) instead.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use prehend_refine::problem::{Factor, NoiseModel, Rows, State};
///
/// /// The object's center is believed to be at a height along `up` \[m\].
/// struct Height {
///     up: Vector3<f64>,
///     height: f64,
///     noise: NoiseModel,
/// }
///
/// impl Factor for Height {
///     fn name(&self) -> &'static str {
///         "height"
///     }
///     fn rows(&self, state: &State, rows: &mut Rows<'_>) {
///         let center = Point3::from(state.center());
///         let above = self.up.dot(&center.coords) - self.height;
///         rows.add(above, &self.noise.weighting(1), |row| row.object_point(state, &center, &self.up));
///     }
/// }
/// ```
pub trait Factor: Send + Sync {
    /// A short name for reports.
    fn name(&self) -> &'static str;

    /// Adds the residuals at `state`, each with its noise and its derivatives by blocks of the state.
    fn rows(&self, _state: &State, _rows: &mut Rows<'_>) {}

    /// The cost at `state` \[nat\]. No derivative is computed.
    fn cost(&self, state: &State) -> f64 {
        let mut rows = Rows::cost_only();
        self.rows(state, &mut rows);
        rows.cost()
    }

    /// The cost at `state` \[nat\]; adds gradient and Gauss–Newton Hessian by the requested blocks to `equations`.
    ///
    /// Blocks that the cost is constant in, or not differentiable by, are left as they are.
    fn linearize(&self, state: &State, equations: &mut NormalEquations) -> f64 {
        let mut rows = Rows::linearized(equations);
        self.rows(state, &mut rows);
        let cost = rows.cost();
        equations.mirror_lower();
        cost
    }

    /// The [`cost`](Self::cost) at each of several states, one for each and in their order. A factor that has a quicker way than one after the other writes its own.
    fn cost_all(&self, states: &[State]) -> Vec<f64> {
        states.par_iter().map(|state| self.cost(state)).collect()
    }

    /// As [`linearize`](Self::linearize) at each of several states, each with its `equations`; one cost for each. A factor that has a quicker way than one after
    /// the other writes its own.
    fn linearize_all(&self, states: &[State], equations: &mut [NormalEquations]) -> Vec<f64> {
        let each = states.par_iter().zip(equations);
        each.map(|(state, equations)| self.linearize(state, equations)).collect()
    }

    /// The factor given what it eliminates in closed form (a light), which has the values that are best at `state`; none if it
    /// eliminates nothing. Its gradient is that of its cost, and its cost takes less to compute.
    fn conditional_at(&self, _state: &State) -> Option<Box<dyn Factor + '_>> {
        None
    }
}

/// The name.
impl fmt::Debug for dyn Factor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.name(), f)
    }
}
