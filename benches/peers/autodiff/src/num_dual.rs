//! num-dual: forward mode by `gradient` over vectors of fixed size.

use ::num_dual::{DualSVec64, gradient};
use nalgebra::SVector;

use crate::ours::{Comparisons, Scenes, TOO_MANY};
use crate::workloads::point_mass;
use crate::workloads::rigid_body::{miss, wrench};

const FORWARD: &str = "num-dual, forward";

pub(crate) fn add<'a>(to: &mut Comparisons<'a>, scenes: &'a Scenes) {
    to.rosenbrock.add_absent(FORWARD, TOO_MANY);
    to.point_mass.add(FORWARD, forward(point_mass::miss));
    for (body, scene) in [(&mut to.corners, &scenes.corners), (&mut to.cloud, &scenes.cloud)] {
        body.add(FORWARD, forward(|x| miss(x, scene, wrench)));
    }
}

fn forward<const N: usize>(
    f: impl Fn(&[DualSVec64<N>; N]) -> DualSVec64<N>,
) -> impl FnMut(&[f64; N], &mut [f64; N]) -> f64 {
    move |x, out| {
        let (value, derivative) =
            gradient(|x: SVector<_, N>| f(&x.into()), &SVector::<f64, N>::from(*x));
        *out = derivative.into();
        value
    }
}
