//! How softly a constraint gives way.

use super::element::Element;
use super::error::Result;

/// MuJoCo's parameters of a soft constraint, `solref` and `solimp`, as the file has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverParameters {
    /// Time constant \[s\] and damping ratio \[1\]; where both are negative, stiffness and damping with opposite sign.
    pub reference: [f64; 2],
    /// Impedance at the limit and beyond `width`, `width` \[m or rad\], midpoint and power of the transition.
    pub impedance: [f64; 5],
}

impl Default for SolverParameters {
    fn default() -> Self {
        Self { reference: [0.02, 1.0], impedance: [0.9, 0.95, 0.001, 0.5, 2.0] }
    }
}

impl SolverParameters {
    pub(super) fn read(
        &mut self,
        e: &Element,
        [reference, impedance]: [&'static str; 2],
    ) -> Result<()> {
        e.leading(reference, &mut self.reference)?;
        e.leading(impedance, &mut self.impedance)
    }
}
