//! Modes of this crate in the comparison: one line for each workload and mode.

use prehend_autodiff::{Fwd, LocalFunction, Recording, Scalar, Var, gradient_into};

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
        a.add_taped(
            "ours, summed terms",
            reverse(|x: &[Var; rosenbrock::INPUTS]| {
                Var::sum_local(x, (1..x.len()).map(|i| (RosenbrockTerm, [i - 1, i])))
            }),
        );
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

/// Term of two neighbors in the Rosenbrock chain.
struct RosenbrockTerm;

impl LocalFunction<2, 1> for RosenbrockTerm {
    #[inline]
    fn evaluate<S: Scalar>(&self, [a, b]: [S; 2]) -> [S; 1] {
        let (bend, offset) = (b - a * a, S::one() - a);
        [(bend * bend).times(100.0) + offset * offset]
    }
}
