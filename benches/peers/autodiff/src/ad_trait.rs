//! ad_trait: reverse mode over its global graph, and forward mode with all tangents at once. It brings an
//! older nalgebra, over which the workloads are compiled once more.

use ::ad_trait::AD;
use ::ad_trait::differentiable_function::{
    DerivativeMethodTrait, DifferentiableFunctionTrait, ForwardADMulti, ReverseAD,
};
use ::ad_trait::forward_ad::adfn::adfn;

use crate::older::workloads::rigid_body::{Scene, miss, wrench};
use crate::older::workloads::{point_mass, rosenbrock};
use crate::ours::{Comparisons, TOO_MANY};

const FORWARD: &str = "ad_trait, forward";
const REVERSE: &str = "ad_trait, reverse";

pub(crate) fn add(to: &mut Comparisons) {
    to.rosenbrock.add_absent(FORWARD, TOO_MANY);
    to.rosenbrock.add(REVERSE, gradient(ReverseAD::new(), rosenbrock::sum));
    to.point_mass.add(FORWARD, gradient(ForwardADMulti::<adfn<9>>::new(), point_mass::miss));
    to.point_mass.add(REVERSE, gradient(ReverseAD::new(), point_mass::miss));
    for (body, scene) in
        [(&mut to.corners, Scene::corners as fn() -> _), (&mut to.cloud, Scene::cloud)]
    {
        let (forward, reverse) = (ForwardADMulti::<adfn<12>>::new(), ReverseAD::new());
        let here = scene();
        body.add(FORWARD, gradient(forward, move |x| miss(x, &here, wrench)));
        let here = scene();
        body.add(REVERSE, gradient(reverse, move |x| miss(x, &here, wrench)));
    }
}

/// A function of an array in the form that the crate asks for.
struct Function<F, const N: usize>(F);

impl<T: AD, F: Fn(&[T; N]) -> T, const N: usize> DifferentiableFunctionTrait<T> for Function<F, N> {
    const NAME: &'static str = "workload";

    fn call(&self, inputs: &[T], _freeze: bool) -> Vec<T> {
        vec![(self.0)(inputs.try_into().expect("as many inputs as there are variables"))]
    }

    fn num_inputs(&self) -> usize {
        N
    }

    fn num_outputs(&self) -> usize {
        1
    }
}

fn gradient<M: DerivativeMethodTrait, const N: usize>(
    method: M,
    f: impl Fn(&[M::T; N]) -> M::T,
) -> impl FnMut(&[f64; N], &mut [f64; N]) -> f64 {
    let function = Function(f);
    move |x, out| {
        let (values, derivative) = method.derivative(x, &function);
        out.copy_from_slice(derivative.as_slice());
        values[0]
    }
}
