//! Lengths that a shape does not say itself.

use super::error::ShapeError;

/// Lengths that a shape does not say itself \[m\]. Those that are not given follow from its size when it is made, and stay when its
/// dimensions change.
///
/// ```
/// use prehend_sim::ShapeOptions;
///
/// let options = ShapeOptions { spacing: Some(5e-3), ..ShapeOptions::default() };
/// assert_eq!(options.rounding, None);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeOptions {
    /// Radius of the edges of sharp shapes: more than the depth to which anything presses. Otherwise 2 % of the smallest
    /// extent. Round shapes have their own.
    pub rounding: Option<f64>,
    /// Distance between samples along edges and on faces, about at most. Otherwise a third of the smallest extent, but not less than
    /// 1/24 of the largest: edges of thin plates that cross are felt only where samples lie.
    pub spacing: Option<f64>,
    /// Distance between the samples of a distance grid, which meshes have. Otherwise 1/64 of the largest extent.
    pub cell: Option<f64>,
}

/// The options of a shape of some size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lengths {
    pub(super) rounding: f64,
    pub(super) spacing: f64,
    pub(super) cell: f64,
}

impl ShapeOptions {
    /// Lengths of a shape with these extents \[m\].
    pub(super) fn lengths(&self, extents: &[f64]) -> Result<Lengths, ShapeError> {
        let smallest = extents.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = extents.iter().copied().fold(0.0, f64::max);
        let check = |name, given: Option<f64>, own: f64| match given {
            Some(value) if !(value > 0.0 && value.is_finite()) => {
                Err(ShapeError::Option { name, value })
            }
            _ => Ok(given.unwrap_or(own)),
        };
        Ok(Lengths {
            rounding: check("rounding", self.rounding, 0.02 * smallest)?,
            spacing: check("spacing", self.spacing, (smallest / 3.0).max(largest / 24.0))?,
            cell: check("cell", self.cell, largest / 64.0)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_that_are_not_given_follow_from_the_size() {
        let lengths = |extents: &[f64]| {
            let Lengths { rounding, spacing, cell } =
                ShapeOptions::default().lengths(extents).unwrap();
            [rounding, spacing, cell].map(|x| (x * 1e9).round() / 1e9)
        };
        assert_eq!(lengths(&[0.3, 0.4, 0.32]), [0.006, 0.1, 0.00625]);
        assert_eq!(lengths(&[0.96, 0.01, 0.64]), [0.0002, 0.04, 0.015]);
    }
}
