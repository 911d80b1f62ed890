//! Edges at which what the surface looks like jumps.

use super::{Albedo, Edge, NONE, RenderModel};

/// Normals that differ by less than this (1 − cosine: 2.6 degrees) count as one.
const LEAST_TURN: f32 = 1e-3;

impl RenderModel {
    /// Lists the creases anew; to be called when normals or colors have changed.
    pub(super) fn find_creases(&mut self) {
        let jumps = |edge: &Edge| edge.other != NONE && self.jumps(edge);
        let indices = self.edges.iter().enumerate().filter(|(_, edge)| jumps(edge));
        self.creases = indices.map(|(index, _)| index as u32).collect();
    }

    /// Whether the two faces of an edge differ at one of its ends.
    fn jumps(&self, edge: &Edge) -> bool {
        let (own, other) = (edge.face as usize, edge.other as usize);
        let (first, second) = (edge.corner as usize, edge.other_corner as usize);
        // The other face runs through the edge the other way.
        [(first, (second + 1) % 3), ((first + 1) % 3, second)].into_iter().any(|(i, j)| {
            let turned = self.normals[own][i].dot(self.normals[other][j]) < 1.0 - LEAST_TURN;
            turned
                || match &self.albedo {
                    Albedo::Uniform(_) => false,
                    Albedo::Corners(colors) => colors[own][i] != colors[other][j],
                    Albedo::Texture(_, places) => places[own][i] != places[other][j],
                }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes_for_tests::{lump, painted, textured_box};
    use nalgebra::Vector3;
    use prehend_geometry::shapes::cuboid;

    #[test]
    fn boxes_have_creases_along_their_edges_and_smooth_bodies_none() {
        let mut mesh = cuboid(Vector3::repeat(0.1));
        assert_eq!(RenderModel::new(&mesh).unwrap().creases.len(), 12);
        mesh.colors = Some((0..mesh.vertices.len()).map(|i| [i as f32, 0.0, 0.0]).collect());
        assert!(RenderModel::new(&mesh).unwrap().creases.len() >= 12);
        let smooth = RenderModel::new(&painted(lump(0.05, 40), 0.05)).unwrap();
        assert!(smooth.creases.is_empty());
        // A texture with seams, and the same body in one color.
        let printed = RenderModel::new(&textured_box([32, 32], [3.0, 4.0])).unwrap();
        let plain = printed.clone().with_uniform_color([0.5; 3]);
        assert!(printed.creases.len() >= plain.creases.len());
        assert_eq!(plain.creases.len(), 12);
    }
}
