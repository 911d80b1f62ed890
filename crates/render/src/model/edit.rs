//! Estimable values of a model, and models with other values.

use nalgebra::{Point3, Vector3};

use super::{Albedo, CREASE, Mipmap, ModelError, RenderModel, expect, topology};
use crate::precision::{double, single};

impl RenderModel {
    /// Welded vertices, mesh frame \[m\].
    pub fn positions(&self) -> Vec<Point3<f64>> {
        self.positions.iter().map(|p| self.center + double(p)).collect()
    }

    /// The faces drawn, as indices into [`Self::positions`].
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// A color a welded vertex, if the model is colored by vertices. Where a mesh has several colors at one place,
    /// that of the last face there.
    pub fn vertex_colors(&self) -> Option<Vec<[f32; 3]>> {
        let Albedo::Corners(corners) = &self.albedo else { return None };
        let mut colors = vec![[0.0; 3]; self.positions.len()];
        for (face, corners) in self.faces.iter().zip(corners) {
            (0..3).for_each(|k| colors[face[k] as usize] = corners[k]);
        }
        Some(colors)
    }

    /// Columns, rows and texels (row-major from the top-left, 0..=1) of the texture, if there is one.
    pub fn texture(&self) -> Option<(usize, usize, &[[f32; 3]])> {
        let Albedo::Texture(map, _) = &self.albedo else { return None };
        let (width, height) = map.size();
        Some((width, height, &map.levels[0].texels))
    }

    /// Model of the same topology with other welded vertices, mesh frame \[m\]. Normals follow them. The [center](Self::center),
    /// the [radius](Self::radius) and the choice of texture levels stay those of the original, so that images change smoothly.
    ///
    /// # Errors
    /// When there are not as many, or one is not finite.
    pub fn with_positions(mut self, positions: &[Point3<f64>]) -> Result<Self, ModelError> {
        expect("positions", positions.len(), self.positions.len())?;
        let finite = |p: &Point3<f64>| p.iter().all(|v| v.is_finite());
        if let Some(vertex) = positions.iter().position(|p| !finite(p)) {
            return Err(ModelError::NotFinite { vertex });
        }
        self.positions = positions.iter().map(|p| single(&(p - self.center))).collect();
        let face_normal = |f: &[u32; 3]| {
            let [a, b, c] = f.map(|v| positions[v as usize]);
            (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or(Vector3::zeros())
        };
        let face_normals: Vec<Vector3<f64>> = self.faces.iter().map(face_normal).collect();
        let normals = topology::corner_normals(positions, &self.faces, &face_normals, CREASE);
        self.normals = normals.iter().map(|n| n.each_ref().map(single)).collect();
        self.find_creases();
        Ok(self)
    }

    /// Model of the same shape with a color a welded vertex (0..=1).
    ///
    /// # Errors
    /// When there are not as many.
    pub fn with_colors(mut self, colors: &[[f32; 3]]) -> Result<Self, ModelError> {
        expect("colors", colors.len(), self.positions.len())?;
        let corners = self.faces.iter().map(|f| f.map(|v| colors[v as usize])).collect();
        self.albedo = Albedo::Corners(corners);
        self.texel_density = 0.0;
        self.find_creases();
        Ok(self)
    }

    /// Model with other texels, in the order of [`Self::texture`].
    ///
    /// # Errors
    /// When there are not as many; without a texture the model has none.
    pub fn with_texels(mut self, texels: Vec<[f32; 3]>) -> Result<Self, ModelError> {
        let (width, height) = self.texture().map_or((0, 0), |(width, height, _)| (width, height));
        expect("texels", texels.len(), width * height)?;
        if let Albedo::Texture(map, _) = &mut self.albedo {
            *map = Mipmap::of_texels(width, height, texels);
        }
        Ok(self)
    }

    /// Model of the same shape in one color (0..=1).
    pub fn with_uniform_color(mut self, color: [f32; 3]) -> Self {
        self.albedo = Albedo::Uniform(color);
        self.texel_density = 0.0;
        self.find_creases();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes_for_tests::{lump, painted};

    #[test]
    fn a_models_own_values_give_the_same_model() {
        let model = RenderModel::new(&painted(lump(0.05, 12), 0.05)).unwrap();
        let same = model.clone().with_positions(&model.positions()).unwrap();
        assert_eq!(same.positions, model.positions);
        for (a, b) in same.normals.iter().flatten().zip(model.normals.iter().flatten()) {
            assert!(a.distance(*b) < 1e-5);
        }
        let colors = model.vertex_colors().unwrap();
        let same = model.clone().with_colors(&colors).unwrap();
        assert_eq!(same.vertex_colors().unwrap(), colors);
        assert!(model.texture().is_none() && !matches!(model.albedo, Albedo::Uniform(_)));
    }

    #[test]
    fn wrong_counts_and_numbers_are_errors() {
        let model = RenderModel::new(&lump(0.05, 8)).unwrap();
        let mut positions = model.positions();
        positions[3].x = f64::NAN;
        let error = model.clone().with_positions(&positions).unwrap_err();
        assert_eq!(error, ModelError::NotFinite { vertex: 3 });
        positions.pop();
        let error = model.clone().with_positions(&positions).unwrap_err();
        assert!(matches!(error, ModelError::Count { what: "positions", .. }));
        let error = model.clone().with_texels(vec![[0.0; 3]]).unwrap_err();
        assert_eq!(error, ModelError::Count { what: "texels", found: 1, expected: 0 });
        assert!(model.with_colors(&[]).is_err());
    }
}
