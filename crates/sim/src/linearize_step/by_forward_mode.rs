//! The Jacobian of a step direction by direction: for what has no closed form, and to test that.

use nalgebra::{DMatrix, DVector};
use prehend_autodiff::{Fwd, Scalar};

use super::LinearizedStep;
use super::generalized::Generalized;
use crate::error::Result;
use crate::integrator::semi_implicit::SemiImplicitEuler;
use crate::model::Model;
use crate::state::State;
use crate::time::Step;

impl Model {
    /// [`Model::linearize_step`] by forward mode, direction by direction: what its closed form is tested against.
    ///
    /// # Errors
    /// As there.
    #[doc(hidden)]
    pub fn linearize_step_by_forward_mode(
        &self,
        state: &State,
        step: Step,
    ) -> Result<LinearizedStep> {
        let n = self.degrees_of_freedom();
        let next = self.step(&SemiImplicitEuler, state, step)?;
        let start = self.with_deflections(state.clone());
        let slopes = |after: &State<Fwd<1>>| {
            let displacement = self.displacement(&next, after).into_iter();
            DVector::from_iterator(2 * n, displacement.map(|x| x.derivative[0]))
        };
        let [mut by_state, mut by_force] = [2 * n, n].map(|columns| DMatrix::zeros(2 * n, columns));
        let lifted = self.cast::<Fwd<1>>();
        let zeros = vec![Fwd::<1>::constant(0.0); 2 * n];
        for column in 0..2 * n {
            let mut along = zeros.clone();
            along[column] = Fwd::variable(0.0, 0);
            let displaced = self.displaced(&start, &along);
            let after = lifted.step(&SemiImplicitEuler, &displaced, step)?;
            by_state.set_column(column, &slopes(&after));
        }
        let still = self.displaced(&start, &zeros);
        for (slot, body) in self.free_bodies().into_iter().enumerate() {
            for k in 0..6 {
                let mut model = lifted.clone();
                model.bodies[body].external_wrench[k].derivative[0] = 1.0;
                let after = model.step(&SemiImplicitEuler, &still, step)?;
                by_force.set_column(6 * slot + k, &slopes(&after));
            }
        }
        let forces = Generalized::without_forces(self, start.rows());
        let mut scratch = DMatrix::zeros(2 * n, 2 * n);
        self.joints_after(next.rows(), &forces, step.dt, &mut scratch, &mut by_force);
        self.finite(LinearizedStep { state: next, by_state, by_force }, step)
    }
}
