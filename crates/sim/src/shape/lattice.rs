//! Lattices on triangles.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use prehend_autodiff::Scalar;

use super::rows::parts;

/// Cosine of the angle between normals below which a face is another.
const OTHER_FACE: f64 = 0.9;

/// A triangle of a surface, and the factor by which its samples stand for more than its area.
pub(super) struct MeshFace<T: Scalar> {
    pub(super) corners: [Point3<T>; 3],
    pub(super) stretch: T,
}

/// Nodes of lattices on `triangles`, corners and edges included, with distances of `spacing` \[m\] at most, and the areas that they
/// stand for.
///
/// Each small triangle gives a third of its area to each of its corners, which keeps area and center of every face. A node on
/// an edge or a corner has the mean of its shares of the faces that meet there, since one of them touches at a time.
pub(super) fn lattice<T: Scalar>(triangles: &[MeshFace<T>], spacing: f64) -> Vec<(Point3<T>, T)> {
    let mut nodes: BTreeMap<[i64; 3], MeshNode<T>> = BTreeMap::new();
    let mut order = Vec::new();
    for MeshFace { corners: [a, b, c], stretch } in triangles {
        let cross = (b - a).cross(&(c - a));
        let values = cross.map(T::value);
        let Some(normal) = values.try_normalize(0.0) else { continue };
        let sides = [b - a, c - b, a - c].map(|side| side.map(T::value).norm());
        let parts = parts(sides.into_iter().fold(0.0, f64::max), spacing);
        let small = cross.norm() * stretch.times(1.0 / (6.0 * (parts * parts) as f64));
        for i in 0..=parts {
            for j in 0..=parts - i {
                let [u, v] = [i, j].map(|x| x as f64 / parts as f64);
                let place = a + (b - a) * T::constant(u) + (c - a) * T::constant(v);
                // Small triangles that meet: six inside, three on an edge, one in a corner.
                let ends = [i, j, parts - i - j].iter().filter(|x| **x == 0).count();
                let share = small.times([6.0, 3.0, 1.0][ends]);
                // Off the places where roundings meet.
                let key =
                    place.coords.map(|x| (x.value() / (1e-6 * spacing) + 0.317).round() as i64);
                let key: [i64; 3] = key.into();
                let node = nodes.entry(key).or_insert_with(|| {
                    order.push(key);
                    MeshNode { place, faces: Vec::new() }
                });
                node.add(&normal, share);
            }
        }
    }
    order.iter().filter_map(|key| nodes.get(key)).map(|node| (node.place, node.area())).collect()
}

/// A node, and what it stands for on each of the faces that meet there.
struct MeshNode<T: Scalar> {
    place: Point3<T>,
    faces: Vec<(Vector3<f64>, T)>,
}

impl<T: Scalar> MeshNode<T> {
    fn add(&mut self, normal: &Vector3<f64>, share: T) {
        match self.faces.iter_mut().find(|(own, _)| own.dot(normal) > OTHER_FACE) {
            Some((_, area)) => *area += share,
            None => self.faces.push((*normal, share)),
        }
    }

    fn area(&self) -> T {
        let sum = self.faces.iter().fold(T::zero(), |sum, (_, area)| sum + *area);
        sum.times(1.0 / self.faces.len() as f64)
    }
}
