//! echidna: reverse mode by `grad` (which keeps its tape between calls), reverse mode by a recorded tape
//! that is evaluated again, and forward mode by `DualVec`.

use ::echidna::{BReverse, DualVec, Reverse, Scalar, grad, record};

use crate::ours::{Comparisons, Scenes, TOO_MANY};
use crate::workloads::rigid_body::{miss, wrench};
use crate::workloads::{point_mass, rosenbrock};

const FORWARD: &str = "echidna, forward";
const REVERSE: &str = "echidna, reverse";
const RECORDED: &str = "echidna, recorded once";
const BRANCHES: &str =
    "The tape replays the branches taken when it was recorded, so it is wrong elsewhere.";

pub(crate) fn add<'a>(to: &mut Comparisons<'a>, scenes: &'a Scenes) {
    to.rosenbrock.add_absent(FORWARD, TOO_MANY);
    to.rosenbrock.add(REVERSE, reverse(rosenbrock::sum));
    to.rosenbrock.add(RECORDED, recorded(rosenbrock::sum, rosenbrock::inputs()));
    to.point_mass.add(FORWARD, forward(point_mass::miss));
    to.point_mass.add(REVERSE, reverse(point_mass::miss));
    to.point_mass.add_absent(RECORDED, BRANCHES);
    for (body, scene) in [(&mut to.corners, &scenes.corners), (&mut to.cloud, &scenes.cloud)] {
        body.add(FORWARD, forward(|x| miss(x, scene, wrench)));
        body.add(REVERSE, reverse(|x| miss(x, scene, wrench)));
        body.add_absent(RECORDED, BRANCHES);
    }
}

fn forward<const N: usize>(
    f: impl Fn(&[DualVec<f64, N>; N]) -> DualVec<f64, N>,
) -> impl FnMut(&[f64; N], &mut [f64; N]) -> f64 {
    move |x, out| {
        let result = f(&std::array::from_fn(|i| DualVec::with_tangent(x[i], i)));
        *out = result.eps;
        result.re
    }
}

fn reverse<const N: usize>(
    f: impl Fn(&[Reverse<f64>; N]) -> Reverse<f64>,
) -> impl FnMut(&[f64; N], &mut [f64; N]) -> f64 {
    move |x, out| {
        let mut value = 0.0;
        let gradient = grad(
            |x| {
                let result = f(x.try_into().expect("as many variables as inputs"));
                value = result.value();
                result
            },
            x,
        );
        out.copy_from_slice(&gradient);
        value
    }
}

fn recorded<const N: usize>(
    f: impl Fn(&[BReverse<f64>; N]) -> BReverse<f64>,
    at: [f64; N],
) -> impl FnMut(&[f64; N], &mut [f64; N]) -> f64 {
    let f = |x: &[_]| f(x.try_into().expect("as many variables as inputs"));
    let (mut tape, _) = record(f, &at);
    let mut adjoints = Vec::new();
    move |x, out| {
        out.copy_from_slice(&tape.gradient_with_buf(x, &mut adjoints));
        tape.output_value()
    }
}
