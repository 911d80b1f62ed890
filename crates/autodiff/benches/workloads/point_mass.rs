//! A point of unit mass that bounces and slides on the floor z = 0: a long chain of small steps, each
//! of which branches on contact.

use super::nalgebra::RealField;
use super::{constant, value};

/// Position \[m\], velocity \[m/s\], stiffness \[N/m\] and damping \[s/m\] of the floor, and its coefficient
/// of friction.
pub(crate) const INPUTS: [f64; 9] = [0.0, 0.0, 0.02, 1.0, 0.5, -1.0, 1e4, 0.6, 0.3];

const STEPS: usize = 1000;
/// \[s\]
const STEP: f64 = 1e-3;
/// \[m/s²\]
const GRAVITY: f64 = 9.81;
/// Square of the sliding speed below which friction fades out \[m²/s²\].
const CREEP: f64 = 1e-4;
/// Where the point should end \[m\].
const TARGET: [f64; 3] = [0.5, 0.2, 0.1];

/// Squared distance from the target after a second of semi-implicit Euler steps, with a Hunt–Crossley
/// penalty for the floor and regularized Coulomb friction \[m²\].
#[inline]
pub(crate) fn miss<T: RealField + Copy>(inputs: &[T; 9]) -> T {
    let [mut x, mut y, mut z, mut vx, mut vy, mut vz, stiffness, damping, friction] = *inputs;
    let step = constant::<T>(STEP);
    for _ in 0..STEPS {
        if value(z) < 0.0 {
            let normal = stiffness * -z * (T::one() - vz * damping);
            let slip = (vx * vx + vy * vy + constant(CREEP)).sqrt();
            let drag = friction * normal / slip;
            vx -= drag * vx * step;
            vy -= drag * vy * step;
            vz += (normal - constant(GRAVITY)) * step;
        } else {
            vz -= constant(GRAVITY * STEP);
        }
        x += vx * step;
        y += vy * step;
        z += vz * step;
    }
    let [tx, ty, tz] = TARGET.map(constant::<T>);
    let (dx, dy, dz) = (x - tx, y - ty, z - tz);
    dx * dx + dy * dy + dz * dz
}

/// The squared distance, and its gradient derived by hand: the rollout keeps the state before each step
/// in `states`, and the way back computes everything else again.
pub(crate) fn adjoint(
    inputs: &[f64; 9],
    gradient: &mut [f64; 9],
    states: &mut Vec<[f64; 6]>,
) -> f64 {
    let [mut x, mut y, mut z, mut vx, mut vy, mut vz, stiffness, damping, friction] = *inputs;
    states.clear();
    for _ in 0..STEPS {
        states.push([x, y, z, vx, vy, vz]);
        if z < 0.0 {
            let normal = stiffness * -z * (1.0 - vz * damping);
            let drag = friction * normal / (vx * vx + vy * vy + CREEP).sqrt();
            vx -= drag * vx * STEP;
            vy -= drag * vy * STEP;
            vz += (normal - GRAVITY) * STEP;
        } else {
            vz -= GRAVITY * STEP;
        }
        x += vx * STEP;
        y += vy * STEP;
        z += vz * STEP;
    }
    let (dx, dy, dz) = (x - TARGET[0], y - TARGET[1], z - TARGET[2]);

    // Names ending in `_bar` are derivatives of the result with respect to the quantity so named.
    let (x_bar, y_bar, mut z_bar) = (2.0 * dx, 2.0 * dy, 2.0 * dz);
    let (mut vx_bar, mut vy_bar, mut vz_bar) = (0.0, 0.0, 0.0);
    let (mut stiffness_bar, mut damping_bar, mut friction_bar) = (0.0, 0.0, 0.0);
    for &[_, _, z, vx, vy, vz] in states.iter().rev() {
        vx_bar += x_bar * STEP;
        vy_bar += y_bar * STEP;
        vz_bar += z_bar * STEP;
        if z < 0.0 {
            let approach = 1.0 - vz * damping;
            let elastic = stiffness * -z;
            let normal = elastic * approach;
            let inverse_slip = 1.0 / (vx * vx + vy * vy + CREEP).sqrt();
            let drag = friction * normal * inverse_slip;

            let drag_bar = -STEP * (vx_bar * vx + vy_bar * vy);
            let normal_bar = vz_bar * STEP + drag_bar * friction * inverse_slip;
            // Of the slip, divided by it: the velocity's share is this times the velocity.
            let slip_bar = -drag_bar * drag * inverse_slip * inverse_slip;
            friction_bar += drag_bar * normal * inverse_slip;
            vx_bar += slip_bar * vx - vx_bar * drag * STEP;
            vy_bar += slip_bar * vy - vy_bar * drag * STEP;
            z_bar -= normal_bar * stiffness * approach;
            stiffness_bar -= normal_bar * z * approach;
            vz_bar -= normal_bar * elastic * damping;
            damping_bar -= normal_bar * elastic * vz;
        }
    }
    *gradient =
        [x_bar, y_bar, z_bar, vx_bar, vy_bar, vz_bar, stiffness_bar, damping_bar, friction_bar];
    dx * dx + dy * dy + dz * dz
}
