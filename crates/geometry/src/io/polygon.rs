//! Triangles of polygons.

use earcut::Earcut;
use nalgebra::{Point3, Unit, Vector3};

/// Polygons, each a list of corners.
pub(super) struct Polygons<C> {
    corners: Vec<C>,
    ends: Vec<usize>,
}

impl<C> Default for Polygons<C> {
    fn default() -> Self {
        Self { corners: Vec::new(), ends: Vec::new() }
    }
}

impl<C> Polygons<C> {
    pub(super) fn push(&mut self, polygon: impl IntoIterator<Item = C>) {
        self.corners.extend(polygon);
        self.ends.push(self.corners.len());
    }

    pub(super) fn corners_mut(&mut self) -> impl Iterator<Item = &mut C> {
        self.corners.iter_mut()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &[C]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.corners[start..end])
    }
}

/// Triangles of a polygon, as positions in its list of corners: a fan around the first corner where no triangle of it is turned over, else ears cut off.
pub(super) fn triangles(polygon: &[Point3<f64>]) -> Vec<[usize; 3]> {
    let count = polygon.len();
    let fan: Vec<[usize; 3]> = (2..count).map(|k| [0, k - 1, k]).collect();
    if count < 4 {
        return fan;
    }
    let area = |[a, b, c]: [usize; 3]| (polygon[b] - polygon[a]).cross(&(polygon[c] - polygon[a]));
    let total: Vector3<f64> = fan.iter().map(|&triangle| area(triangle)).sum();
    // A polygon without area, and one with a corner that is no number, has no side.
    let Some(normal) = Unit::try_new(total, 0.0) else { return fan };
    if fan.iter().all(|&triangle| area(triangle).dot(&normal) >= 0.0) {
        return fan;
    }
    let across = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    let up = normal.cross(&across);
    let flat = polygon.iter().map(|p| [across, up].map(|axis| axis.dot(&(p - polygon[0]))));
    let mut cut: Vec<u32> = Vec::new();
    Earcut::new().earcut(flat, &[], &mut cut);
    let ears: Vec<[usize; 3]> = cut
        .as_chunks()
        .0
        .iter()
        .map(|&ear: &[u32; 3]| ear.map(|corner| corner as usize))
        .map(|[a, b, c]| if area([a, b, c]).dot(&normal) < 0.0 { [a, c, b] } else { [a, b, c] })
        .collect();
    // Corners that coincide, or an outline that crosses itself.
    if ears.len() == fan.len() { ears } else { fan }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[[f64; 2]]) -> Vec<Point3<f64>> {
        // In a tilted plane.
        corners.iter().map(|&[x, y]| Point3::new(x, y, 0.5 * x - y)).collect()
    }

    /// Twice the area across z, and that of the absolute values.
    fn areas(polygon: &[Point3<f64>]) -> [f64; 2] {
        let area =
            |[a, b, c]: [usize; 3]| (polygon[b] - polygon[a]).cross(&(polygon[c] - polygon[a])).z;
        let all: Vec<f64> = triangles(polygon).into_iter().map(area).collect();
        [all.iter().sum(), all.iter().map(|a| a.abs()).sum()]
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        // An L, whose fan around its second corner leaves it, and an arrow.
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let arrow = [[0.0, 3.0], [-1.0, 0.0], [0.0, 1.0], [1.0, 0.0]];
        for (corners, area) in [(l.as_slice(), 6.0), (arrow.as_slice(), 4.0)] {
            for first in 0..corners.len() {
                let mut turned = corners.to_vec();
                turned.rotate_left(first);
                for _ in 0..2 {
                    let [sum, absolute] = areas(&polygon(&turned));
                    assert!((sum.abs() - area).abs() < 1e-12 && (absolute - area).abs() < 1e-12);
                    assert_eq!(triangles(&polygon(&turned)).len(), corners.len() - 2);
                    turned.reverse();
                }
            }
        }
    }

    #[test]
    fn convex_polygons_are_fans() {
        let square = polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangles(&square), [[0, 1, 2], [0, 2, 3]]);
        let (flat, nan) = (vec![Point3::origin(); 5], vec![Point3::new(f64::NAN, 0.0, 0.0); 4]);
        assert_eq!((triangles(&flat).len(), triangles(&nan).len()), (3, 2));
        assert!(triangles(&square[..2]).is_empty());
    }
}
