//! The diameter of a model, as BOP has it.

use nalgebra::Point3;

/// Largest distance between two of `points`; 0 without two.
pub fn diameter(points: &[Point3<f64>]) -> f64 {
    let from = |(i, p): (usize, &Point3<f64>)| {
        points[i + 1..].iter().map(|q| (q - p).norm_squared()).fold(0.0, f64::max)
    };
    points.iter().enumerate().map(from).fold(0.0, f64::max).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_diameter_is_the_longest_distance() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-2.0, 4.0, 0.0], [0.0, 0.0, 3.0]];
        assert_eq!(diameter(&points.map(Point3::from)), 29f64.sqrt());
        assert_eq!(diameter(&[]), 0.0);
    }
}
