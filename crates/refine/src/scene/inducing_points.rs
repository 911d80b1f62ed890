//! The places that describe a Gaussian process.

use nalgebra::Vector3;

/// The first of `places`, and others, each farther than `distance` from all before it and the farthest of those left; `most` at most.
pub(crate) fn far_apart(places: &[Vector3<f64>], distance: f64, most: usize) -> Vec<Vector3<f64>> {
    let mut chosen: Vec<Vector3<f64>> = places.first().copied().into_iter().collect();
    let mut nearest = vec![f64::INFINITY; places.len()];
    while let Some(last) = chosen.last().filter(|_| chosen.len() < most) {
        for (nearest, place) in nearest.iter_mut().zip(places) {
            *nearest = nearest.min((place - last).norm());
        }
        let farthest = nearest.iter().zip(places).max_by(|a, b| a.0.total_cmp(b.0));
        match farthest.filter(|(nearest, _)| **nearest > distance) {
            Some((_, place)) => chosen.push(*place),
            None => break,
        }
    }
    chosen
}
