//! The direction along which a step's sensitivity is followed.

use prehend_autodiff::Fwd;
use prehend_geometry::SplitMix64;

use crate::body_state::{BodyState, Rows};

/// A number with its derivative along the direction of the sensitivity.
pub(super) type Tangent = Fwd<1>;

/// The states with derivatives along a direction in which everything that is free moves: each coordinate of the bodies and joints by half to all of its
/// unit.
pub(super) fn seeded(
    states: &Rows,
    units: impl Iterator<Item = (usize, [f64; 12])>,
) -> Vec<BodyState<Tangent>> {
    let mut random = SplitMix64::new(7);
    let mut seeded: Vec<BodyState<Tangent>> = states.iter().map(BodyState::cast).collect();
    for (place, units) in units {
        let tangent = units.map(|unit| {
            let (size, sign) = (0.5 + 0.5 * random.uniform(), (random.uniform() - 0.5).signum());
            Fwd { value: 0.0, derivative: [unit * size * sign] }
        });
        seeded[place] = states[place].retract(&tangent);
    }
    seeded
}
