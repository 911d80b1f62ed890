//! Coarser meshes for drawing.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use crate::box_tree::Bounds;
use crate::mesh::{Texture, TriMesh};

/// Finest grid: cells along the longest side of the bounding box.
const FINEST: u32 = 1024;

/// Color of what has none.
const GRAY: [f32; 3] = [0.7; 3];

impl TriMesh {
    /// A mesh of at most `limit` vertices that looks much the same: vertices in one cell of a grid become their mean, as in J. Rossignac and
    /// P. Borrel, "Multi-resolution 3D approximations for rendering complex scenes", 1993. Colors are those of vertices or of the texture, gray
    /// where there are none; other attributes are left out. For drawing only: faces may cross each other, and thin walls vanish.
    pub fn simplified(&self, limit: usize) -> TriMesh {
        let fits = |cells: u32| self.cluster(cells).count <= limit.max(1);
        let clusters = if self.vertices.len() <= limit {
            let of_vertex = (0..self.vertices.len() as u32).collect();
            Clusters { of_vertex, count: self.vertices.len() }
        } else {
            // The finest grid that fits; one cell always does.
            let (mut coarse, mut fine) = (1, FINEST + 1);
            while fine - coarse > 1 {
                let middle = (coarse + fine) / 2;
                *(if fits(middle) { &mut coarse } else { &mut fine }) = middle;
            }
            self.cluster(coarse)
        };
        let mut sums = vec![(Vector3::zeros(), [0.0_f32; 3], 0_u32); clusters.count];
        for (vertex, cluster) in clusters.of_vertex.iter().enumerate() {
            let (position, color, count) = &mut sums[*cluster as usize];
            *position += self.vertices[vertex].coords;
            let own = self.color_of(vertex);
            color.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
            *count += 1;
        }
        let corners = self.faces.iter().map(|f| f.map(|v| clusters.of_vertex[v as usize]));
        let faces = corners.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        let vertices = sums.iter().map(|(sum, _, n)| Point3::from(sum / f64::from(*n))).collect();
        let colors = sums.iter().map(|(_, sum, n)| sum.map(|c| c / *n as f32)).collect();
        TriMesh { colors: Some(colors), ..TriMesh::new(vertices, faces) }
    }

    /// Vertices by the cell of a grid that they are in, of so many cells along the longest side.
    fn cluster(&self, cells: u32) -> Clusters {
        // Of all vertices: those that no face uses are in cells of their own.
        let Bounds { low, high } = Bounds::of(&self.vertices);
        let size = (high - low).max() / f64::from(cells);
        let mut known: HashMap<[i64; 3], u32> = HashMap::new();
        let mut cluster = |v: &Point3<f64>| {
            // A vertex on the far side is in the last cell, not behind it.
            let cell = (v - low).map(|c| ((c / size) as i64).min(i64::from(cells) - 1)).into();
            let next = known.len() as u32;
            *known.entry(cell).or_insert(next)
        };
        let of_vertex = self.vertices.iter().map(&mut cluster).collect();
        Clusters { of_vertex, count: known.len() }
    }

    /// The color of a vertex, sRGB in 0..=1.
    fn color_of(&self, vertex: usize) -> [f32; 3] {
        match (&self.texture, &self.uvs, &self.colors) {
            (Some(texture), Some(uvs), _) => texture.nearest(uvs[vertex]),
            (_, _, Some(colors)) => colors[vertex],
            _ => GRAY,
        }
    }
}

impl Texture {
    /// The pixel at `uv`, (0, 0) in the lower-left corner, sRGB in 0..=1; the texture repeats.
    fn nearest(&self, [u, v]: [f32; 2]) -> [f32; 3] {
        let at = |t: f32, size: usize| ((t.rem_euclid(1.0) * size as f32) as usize).min(size - 1);
        if self.pixels.is_empty() {
            return GRAY;
        }
        let (column, row) = (at(u, self.width), at(1.0 - v, self.height));
        self.pixels[row * self.width + column].map(|c| f32::from(c) / 255.0)
    }
}

/// Which vertices become one.
struct Clusters {
    of_vertex: Vec<u32>,
    count: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{cuboid, sphere};
    use std::sync::Arc;

    #[test]
    fn a_sphere_stays_a_sphere() {
        let sphere = sphere(1.0, 96);
        let simple = sphere.simplified(1000);
        assert!((500..=1000).contains(&simple.vertices.len()), "{}", simple.vertices.len());
        assert!(simple.vertices.iter().all(|v| (v.coords.norm() - 1.0).abs() < 0.02));
        assert!((simple.area() / sphere.area() - 1.0).abs() < 0.03);
        let outward = |f: usize| simple.area_vector(f).dot(&simple.triangle(f)[0].coords) > 0.0;
        assert!((0..simple.faces.len()).all(outward));
    }

    #[test]
    fn small_meshes_keep_their_geometry_and_tiny_limits_do_no_harm() {
        let cube = cuboid(Vector3::repeat(1.0));
        let same = cube.simplified(100);
        assert_eq!((&same.vertices, &same.faces), (&cube.vertices, &cube.faces));
        let one = cube.simplified(0);
        assert_eq!((one.vertices.len(), one.faces.len()), (1, 0));
        assert!(TriMesh::default().simplified(10).vertices.is_empty());
    }

    #[test]
    fn colors_come_from_the_texture() {
        let mut quad = TriMesh::new(
            vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)],
            vec![[0, 1, 2]],
        );
        quad.uvs = Some(vec![[0.1, 0.9], [0.9, 0.9], [0.1, 0.1]]);
        let pixels = vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [0, 0, 0]];
        quad.texture = Some(Arc::new(Texture { width: 2, height: 2, pixels }));
        let colors = quad.simplified(3).colors.unwrap();
        assert_eq!(colors, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    }
}
