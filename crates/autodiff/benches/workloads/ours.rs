//! Modes of this crate in the comparison: one line for each workload and mode.

use prehend_autodiff::{CustomVjp, Fwd, Recording, Scalar, Var, custom, gradient_into};

use super::rigid_blocks;
use super::table::{Comparison, print};
use super::workloads::rigid_body::{self, Scene, miss, wrench};
use super::workloads::{point_mass, rosenbrock};

/// Why forward mode has no place in the comparison of the Rosenbrock chain.
pub(crate) const TOO_MANY: &str =
    "Forward mode would carry 1000 derivatives through every operation.";

/// One comparison for each workload.
pub(crate) struct Comparisons<'a> {
    pub(crate) rosenbrock: Comparison<'a, { rosenbrock::INPUTS }>,
    pub(crate) point_mass: Comparison<'a, 9>,
    pub(crate) corners: Comparison<'a, 12>,
    pub(crate) cloud: Comparison<'a, 12>,
}

/// Where the bodies of the workloads are kept.
pub(crate) struct Scenes {
    pub(crate) corners: Scene,
    pub(crate) cloud: Scene,
}

impl Scenes {
    pub(crate) fn new() -> Self {
        Self { corners: Scene::corners(), cloud: Scene::cloud() }
    }
}

impl<'a> Comparisons<'a> {
    /// Plain numbers, derivatives by hand, and all modes of this crate.
    pub(crate) fn new(scenes: &'a Scenes) -> Self {
        let mut a = Comparison::new("a Rosenbrock", rosenbrock::inputs(), rosenbrock::sum);
        a.add("by hand", rosenbrock::adjoint);
        a.add_taped("ours, reverse", reverse(rosenbrock::sum));
        a.add_taped("ours, summed terms", reverse(summed_terms));
        a.add_absent("ours, forward", TOO_MANY);

        let mut b = Comparison::new("b point mass", point_mass::INPUTS, point_mass::miss);
        let mut states = Vec::new();
        b.add_taped("by hand", move |x, gradient| {
            let value = point_mass::adjoint(x, gradient, &mut states);
            (value, size_of_val(states.as_slice()))
        });
        b.add("ours, forward", forward(point_mass::miss));
        b.add_taped("ours, reverse", reverse(point_mass::miss));

        let bodies = [("c8 box", &scenes.corners), ("d ellipsoid", &scenes.cloud)];
        let [c, d] = bodies.map(|(workload, scene)| {
            let start = rigid_body::INPUTS;
            let mut body = Comparison::new(workload, start, |x| miss(x, scene, wrench));
            body.add("ours, forward", forward(|x| miss(x, scene, wrench)));
            body.add_taped("ours, reverse", reverse(|x| miss(x, scene, wrench)));
            body.add_taped("ours, blocks", reverse(|x| rigid_blocks::miss(x, scene)));
            body
        });
        Self { rosenbrock: a, point_mass: b, corners: c, cloud: d }
    }

    /// Times everything and prints the table.
    pub(crate) fn print(self) {
        print(&[
            self.rosenbrock.measure(),
            self.point_mass.measure(),
            self.corners.measure(),
            self.cloud.measure(),
        ]);
    }
}

/// All `N` directions at once.
fn forward<const N: usize>(
    f: impl Fn(&[Fwd<N>; N]) -> Fwd<N>,
) -> impl FnMut(&[f64; N], &mut [f64; N]) -> f64 {
    move |x, gradient| {
        let output = f(&Fwd::variables(*x));
        *gradient = output.derivative;
        output.value
    }
}

/// A recording and a sweep back over it.
fn reverse<const N: usize>(
    f: impl Fn(&[Var; N]) -> Var,
) -> impl FnMut(&[f64; N], &mut [f64; N]) -> (f64, usize) {
    let mut bytes = None;
    move |x, gradient| {
        // The size of the tape is asked for once, not every time.
        let bytes = *bytes.get_or_insert_with(|| {
            let recording = Recording::start();
            f(&recording.variables(*x));
            recording.statistics().bytes
        });
        let on_slice = |inputs: &[Var]| f(inputs.try_into().expect("one variable an input"));
        (gradient_into(on_slice, x, gradient), bytes)
    }
}

/// The Rosenbrock chain as one node, whose gradient forward mode adds up term by term.
fn summed_terms(x: &[Var; rosenbrock::INPUTS]) -> Var {
    let (mut sum, mut gradient) = (0.0, vec![0.0; rosenbrock::INPUTS]);
    for i in 1..x.len() {
        let [a, b] = Fwd::<2>::variables([x[i - 1].value(), x[i].value()]);
        let (bend, offset) = (b - a * a, Fwd::constant(1.0) - a);
        let term = (bend * bend).times(100.0) + offset * offset;
        sum += term.value;
        gradient[i - 1] += term.derivative[0];
        gradient[i] += term.derivative[1];
    }
    custom(x, &[sum], Gradient(gradient))[0]
}

/// The gradient of a sum.
struct Gradient(Vec<f64>);

impl CustomVjp for Gradient {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        for (adjoint, slope) in input_adjoints.iter_mut().zip(&self.0) {
            *adjoint += output_adjoints[0] * slope;
        }
    }
}
