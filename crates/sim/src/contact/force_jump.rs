//! Tests whether a contact's force begins at zero.

use nalgebra::Vector3;

use super::dynamic::DynContactLaw;
use super::gap_smoothing::GapSmoothing;
use super::point::ContactKinematics;

/// Depths \[m\] just after touch, and where a force is to be compared with.
const DEPTHS: [f64; 2] = [1e-12, 1e-4];
/// More of the force at the larger depth than this at the smaller one is a jump: even that of the root of the depth is less.
const JUMP: f64 = 1e-3;

/// True if the force of `law` with parameters `p` jumps as a contact begins at 1 m/s, sliding as fast.
pub(crate) fn jumps(law: &dyn DynContactLaw, p: &[f64], smoothing: &GapSmoothing) -> bool {
    let [touch, pressed] = DEPTHS.map(|depth| {
        let activation = match *smoothing {
            // The slope of a softplus where it is -depth.
            GapSmoothing::Softplus { width } => -(-depth / width).exp_m1(),
            GapSmoothing::Hard | GapSmoothing::Leaky { .. } => 1.0,
        };
        let gap = law.cutoff() - depth;
        let (slip, normal) = (Vector3::x(), Vector3::z());
        let contact =
            ContactKinematics { gap, normal_speed: -activation, slip, normal, area: 1e-4 };
        let response = law.force(p, &contact);
        response.normal.abs() + response.tangential.norm()
    });
    touch > JUMP * pressed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ContactLaw;

    #[test]
    fn damping_without_penetration_jumps_unless_it_fades_in() {
        let jump = |smoothing| {
            let law = crate::scenes::penalty(1e7, 1e4, 0.5, 1e-2);
            jumps(&law, law.params(), &smoothing)
        };
        assert!(jump(GapSmoothing::Hard) && jump(GapSmoothing::grasp_d()));
        assert!(!jump(GapSmoothing::Softplus { width: 1e-5 }));
    }
}
