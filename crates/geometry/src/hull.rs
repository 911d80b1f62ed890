//! Convex hulls.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use crate::mesh::TriMesh;
use crate::predicates::Plane;

/// A triangle of a hull that grows.
struct HullFacet {
    /// Counterclockwise from outside.
    corners: [usize; 3],
    /// Across the edge from each corner to the next.
    neighbors: [usize; 3],
    /// Points that it sees, of which each is seen by one facet only.
    outside: Vec<usize>,
    is_gone: bool,
}

impl TriMesh {
    /// The convex hull of the vertices; `None` where they lie in a plane. What is coplanar is triangulated.
    ///
    /// Quickhull (Barber, Dobkin and Huhdanpaa 1996) with exact predicates.
    ///
    /// ```
    /// use nalgebra::Vector3;
    /// use prehend_geometry::shapes;
    ///
    /// let mut points = shapes::cuboid(Vector3::new(1.0, 2.0, 3.0)).welded();
    /// points.faces.clear();
    /// let hull = points.convex_hull().unwrap();
    /// assert_eq!((hull.vertices.len(), hull.faces.len()), (8, 12));
    /// ```
    pub fn convex_hull(&self) -> Option<Self> {
        let points = &self.vertices;
        let mut facets = first_facets(points)?;
        let mut open: Vec<usize> = (0..facets.len()).collect();
        while let Some(index) = open.pop() {
            if facets[index].is_gone {
                continue;
            }
            let corners = facets[index].corners.map(|c| points[c]);
            let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
            let height = |p: &usize| normal.dot(&(points[*p] - corners[0]));
            let outside = facets[index].outside.iter().copied();
            let Some(peak) = outside.max_by(|a, b| height(a).total_cmp(&height(b))) else {
                continue;
            };
            let (seen, horizon) = seen_from(points, &facets, index, peak);
            let first = facets.len();
            // New facets by the corner at which their edge of the horizon begins.
            let mut begins = BTreeMap::new();
            for (k, &(from, to, beyond)) in horizon.iter().enumerate() {
                begins.insert(from, first + k);
                let across = facets[beyond].corners.iter().position(|c| *c == to)?;
                facets[beyond].neighbors[across] = first + k;
                facets.push(HullFacet {
                    corners: [from, to, peak],
                    neighbors: [beyond, usize::MAX, usize::MAX],
                    outside: Vec::new(),
                    is_gone: false,
                });
            }
            for k in first..facets.len() {
                let next = *begins.get(&facets[k].corners[1])?;
                facets[k].neighbors[1] = next;
                facets[next].neighbors[2] = k;
            }
            let mut left = Vec::new();
            for facet in seen {
                facets[facet].is_gone = true;
                left.append(&mut facets[facet].outside);
            }
            let count = facets.len();
            give(points, &mut facets[first..], left.into_iter().filter(|p| *p != peak));
            open.extend(first..count);
        }
        let left = facets.iter().filter(|facet| !facet.is_gone);
        Some(TriMesh::compacted(
            points,
            left.map(|facet| facet.corners.map(|corner| corner as u32)),
        ))
    }
}

/// Six times the volume between a facet and a point, positive where the facet sees it, zero where the point is in its plane.
fn side(points: &[Point3<f64>], facet: &HullFacet, point: usize) -> f64 {
    let [a, b, c] = facet.corners.map(|c| &points[c]);
    Plane::new([a, b, c], true).side(&points[point]).value
}

/// Gives each of `left` to the first of `facets` that sees it; the others are inside.
fn give(points: &[Point3<f64>], facets: &mut [HullFacet], left: impl Iterator<Item = usize>) {
    for point in left {
        if let Some(facet) = facets.iter_mut().find(|f| side(points, f, point) > 0.0) {
            facet.outside.push(point);
        }
    }
}

type Edge = (usize, usize, usize);

/// The facets around `start` that see `peak` or lie in its plane, and the edges around them, from and to which corner, with the facet beyond.
fn seen_from(
    points: &[Point3<f64>],
    facets: &[HullFacet],
    start: usize,
    peak: usize,
) -> (Vec<usize>, Vec<Edge>) {
    let mut seen = BTreeMap::from([(start, true)]);
    let (mut open, mut horizon) = (vec![start], Vec::new());
    while let Some(index) = open.pop() {
        let HullFacet { corners, neighbors, .. } = &facets[index];
        for k in 0..3 {
            let neighbor = neighbors[k];
            let known = seen.get(&neighbor).copied();
            let sees = known.unwrap_or_else(|| side(points, &facets[neighbor], peak) >= 0.0);
            if known.is_none() {
                seen.insert(neighbor, sees);
                if sees {
                    open.push(neighbor);
                }
            }
            if !sees {
                horizon.push((corners[k], corners[(k + 1) % 3], neighbor));
            }
        }
    }
    (seen.into_iter().filter(|(_, sees)| *sees).map(|(facet, _)| facet).collect(), horizon)
}

/// A tetrahedron of far points, with all others that its facets see.
fn first_facets(points: &[Point3<f64>]) -> Option<Vec<HullFacet>> {
    let all = || 0..points.len();
    let farthest = |measure: &dyn Fn(usize) -> f64| {
        all().max_by(|a, b| measure(*a).total_cmp(&measure(*b))).filter(|p| measure(*p) > 0.0)
    };
    let a = all().min_by(|a, b| points[*a].x.total_cmp(&points[*b].x))?;
    let b = farthest(&|p| (points[p] - points[a]).norm_squared())?;
    let along: Vector3<f64> = points[b] - points[a];
    let c = farthest(&|p| along.cross(&(points[p] - points[a])).norm_squared())?;
    let base =
        |corners| HullFacet { corners, neighbors: [0; 3], outside: Vec::new(), is_gone: false };
    let d = farthest(&|p| side(points, &base([a, b, c]), p).abs())?;
    let (b, c) = if side(points, &base([a, b, c]), d) > 0.0 { (c, b) } else { (b, c) };
    // The base does not see d.
    let mut facets = vec![base([a, b, c]), base([a, d, b]), base([b, d, c]), base([c, d, a])];
    for (facet, neighbors) in facets.iter_mut().zip([[1, 2, 3], [3, 2, 0], [1, 3, 0], [2, 1, 0]]) {
        facet.neighbors = neighbors;
    }
    let corners = [a, b, c, d];
    give(points, &mut facets, all().filter(|p| !corners.contains(p)));
    Some(facets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mass::mass_properties;
    use crate::shapes;

    fn hull(points: Vec<Point3<f64>>) -> Option<TriMesh> {
        TriMesh::new(points, Vec::new()).convex_hull()
    }

    #[test]
    fn a_grid_of_points_has_the_hull_of_its_corners() {
        // Coplanar, collinear and repeated points.
        let points = |n: i32| {
            let axis = move || (0..=n).map(move |i| f64::from(i) / f64::from(n));
            let all =
                axis().flat_map(move |x| axis().flat_map(move |y| axis().map(move |z| (x, y, z))));
            all.map(|(x, y, z)| Point3::new(x, 2.0 * y, 3.0 * z)).collect::<Vec<_>>()
        };
        for n in [1, 2, 3, 6] {
            let mut all = points(n);
            all.extend(points(n));
            let hull = hull(all).unwrap();
            let solid = mass_properties(&hull, 1.0).unwrap();
            assert!((solid.mass - 6.0).abs() < 1e-12, "{n}: {}", solid.mass);
        }
    }

    #[test]
    fn points_on_and_in_a_ball_are_all_within_their_hull() {
        let mut ball = shapes::sphere(1.0, 30).welded();
        let count = ball.vertices.len();
        let inner: Vec<_> = ball.vertices.iter().map(|p| Point3::from(p.coords * 0.9)).collect();
        ball.vertices.extend(inner);
        let hull = ball.convex_hull().unwrap();
        assert_eq!((hull.vertices.len(), hull.faces.len()), (count, 2 * count - 4));
        let within =
            |f: usize, p: &Point3<f64>| hull.area_vector(f).dot(&(p - hull.triangle(f)[0])) < 1e-12;
        assert!((0..hull.faces.len()).all(|f| ball.vertices.iter().all(|p| within(f, p))));
    }

    #[test]
    fn what_is_flat_has_none() {
        let p = Point3::new;
        assert!(hull(vec![p(0., 0., 0.), p(1., 0., 0.), p(0., 1., 0.), p(1., 1., 0.)]).is_none());
        assert!(hull(vec![p(1., 2., 3.); 9]).is_none() && hull(Vec::new()).is_none());
    }
}
