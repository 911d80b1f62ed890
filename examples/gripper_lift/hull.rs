//! Convex hulls in the plane.

/// The corners of the convex hull, one after the other (A. M. Andrew, 1979).
pub(crate) fn convex_hull(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut hull: Vec<(f64, f64)> = Vec::new();
    for half in 0..2 {
        let first = hull.len();
        let turns_left = |hull: &[(f64, f64)], c: (f64, f64)| {
            let [.., a, b] = hull else { return true };
            (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0) > 0.0
        };
        let mut add = |point: (f64, f64)| {
            while hull.len() >= first + 2 && !turns_left(&hull, point) {
                hull.pop();
            }
            hull.push(point);
        };
        match half {
            0 => points.iter().for_each(|point| add(*point)),
            _ => points.iter().rev().for_each(|point| add(*point)),
        }
        hull.pop();
    }
    hull
}
