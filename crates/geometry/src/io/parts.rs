//! Joins the differently colored parts of one file into a mesh with a single texture.

use std::path::Path;
use std::sync::Arc;

use super::limits::MAX_PIXELS;
use super::{MeshError, Result};
use crate::mesh::{Texture, TriMesh};

/// Geometry under one material.
pub(super) struct Part {
    /// Geometry and, where the file has them, UVs and vertex colors.
    pub(super) mesh: TriMesh,
    /// The image that the UVs of `mesh` refer to.
    pub(super) texture: Option<Arc<Texture>>,
    /// The color of the material where it has no image, a factor on vertex colors.
    pub(super) color: [f32; 3],
}

/// One mesh of all `parts`. A texture that all share stays as it is; several become one image, in which a plain
/// color is a tile too; without any, plain colors become vertex colors.
pub(super) fn join(parts: Vec<Part>, path: &Path) -> Result<TriMesh> {
    let first = parts.iter().find_map(|p| p.texture.clone());
    let Some(first) = first else { return Ok(join_plain(parts)) };
    let shared = parts.iter().all(|p| {
        p.mesh.uvs.is_some() && p.texture.as_ref().is_some_and(|t| Arc::ptr_eq(t, &first))
    });
    let parts = if shared { parts } else { into_atlas(parts, path)? };
    let mut whole = TriMesh::default();
    for Part { mut mesh, texture, .. } in parts {
        mesh.texture = texture;
        whole.append(&mesh);
    }
    Ok(whole)
}

fn join_plain(mut parts: Vec<Part>) -> TriMesh {
    if parts.iter().any(|p| p.mesh.colors.is_some() || p.color != [1.0; 3]) {
        for Part { mesh, color, .. } in &mut parts {
            let n = mesh.vertices.len();
            let colors = mesh.colors.get_or_insert_with(|| vec![[1.0; 3]; n]);
            colors.iter_mut().for_each(|c| (0..3).for_each(|k| c[k] *= color[k]));
        }
    }
    let mut whole = TriMesh::default();
    parts.iter().for_each(|p| whole.append(&p.mesh));
    whole
}

/// An image as often beside and above itself as texture coordinates reach: whole numbers along u and v.
struct TiledImage {
    image: Arc<Texture>,
    low: [f32; 2],
    high: [f32; 2],
}

impl TiledImage {
    fn of(image: Arc<Texture>, uvs: &[[f32; 2]]) -> Self {
        let mut tile = Self { image, low: [0.0; 2], high: [1.0; 2] };
        for (k, c) in uvs.iter().flat_map(|uv| uv.iter().enumerate()) {
            // Rounding leads across the edge of the image, and needs no other one.
            tile.low[k] = tile.low[k].min((c + 1e-3).floor());
            tile.high[k] = tile.high[k].max((c - 1e-3).ceil());
        }
        tile
    }

    /// True if it shows the same; the content counts for plain colors, of which each part makes its own image.
    fn is(&self, other: &Self) -> bool {
        (self.low, self.high) == (other.low, other.high)
            && (Arc::ptr_eq(&self.image, &other.image) || self.image == other.image)
    }

    /// Columns and rows, far too many at most.
    fn size(&self) -> [usize; 2] {
        let times = [0, 1].map(|k| (self.high[k] - self.low[k]) as usize);
        let own = [(self.image.width, times[0]), (self.image.height, times[1])];
        own.map(|(size, times)| size.saturating_mul(times).min(MAX_PIXELS + 1))
    }
}

/// Stacks the images of `parts` from the top down, each within a border of repeated pixels so that filtering does
/// not mix neighbors, and moves the UVs along.
fn into_atlas(mut parts: Vec<Part>, path: &Path) -> Result<Vec<Part>> {
    let mut tiles: Vec<TiledImage> = Vec::new();
    let mut tile_of = Vec::new();
    for part in &mut parts {
        let painted = part.texture.clone().zip(part.mesh.uvs.as_ref());
        let tile = match painted.map(|(image, uvs)| TiledImage::of(image, uvs)) {
            Some(tile) if tile.size().iter().product::<usize>() <= MAX_PIXELS => tile,
            other => {
                if other.is_some() {
                    let path = path.display();
                    log::warn!("{path}: a texture repeats too often: its faces get a plain color");
                }
                part.mesh.uvs = Some(vec![[0.5; 2]; part.mesh.vertices.len()]);
                let pixel = part.color.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
                TiledImage::of(Arc::new(Texture { width: 1, height: 1, pixels: vec![pixel] }), &[])
            }
        };
        let known = tiles.iter().position(|own| own.is(&tile));
        tile_of.push(known.unwrap_or_else(|| {
            tiles.push(tile);
            tiles.len() - 1
        }));
    }
    let width = tiles.iter().map(|t| t.size()[0] + 2).max().unwrap_or(0);
    let height: usize = tiles.iter().map(|t| t.size()[1] + 2).sum();
    // A wide tile beside a tall one spans far more than both.
    let area = width.saturating_mul(height);
    MeshError::within(path, "joined texture, pixels", area, 2 * MAX_PIXELS)?;
    let mut pixels = Vec::with_capacity(width * height);
    let mut top = Vec::new();
    for tile in &tiles {
        top.push(pixels.len() / width);
        let ([columns, rows], image) = (tile.size(), &tile.image);
        for y in 0..rows + 2 {
            let row = y.saturating_sub(1).min(rows - 1) % image.height * image.width;
            let column = |x: usize| x.saturating_sub(1).min(columns - 1) % image.width;
            pixels.extend((0..width).map(|x| image.pixels[row + column(x)]));
        }
    }
    let atlas = Arc::new(Texture { width, height, pixels });
    for (part, tile) in parts.iter_mut().zip(tile_of) {
        let TiledImage { image, low, high } = &tiles[tile];
        let (w, h) = (image.width as f32, image.height as f32);
        for uv in part.mesh.uvs.iter_mut().flatten() {
            let from_top = top[tile] as f32 + 1.0 + (high[1] - uv[1]) * h;
            *uv = [(1.0 + (uv[0] - low[0]) * w) / width as f32, 1.0 - from_top / height as f32];
        }
        (part.mesh.colors, part.texture) = (None, Some(atlas.clone()));
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn part(uvs: Option<[[f32; 2]; 3]>, texture: Option<&Arc<Texture>>, color: [f32; 3]) -> Part {
        let mut mesh = TriMesh::new(vec![Point3::origin(); 3], vec![[0, 1, 2]]);
        mesh.uvs = uvs.map(Vec::from);
        Part { mesh, texture: texture.cloned(), color }
    }

    /// The pixel under `uv`, as the convention of `TriMesh::uvs` has it.
    fn pixel(texture: &Texture, uv: [f32; 2]) -> [u8; 3] {
        let (x, y) = (uv[0] * texture.width as f32, (1.0 - uv[1]) * texture.height as f32);
        texture.pixels[y as usize * texture.width + x as usize]
    }

    #[test]
    fn several_textures_become_one_image_with_the_same_colors() {
        let path = Path::new("m.glb");
        let image = |w: usize, h: usize, k: u8| {
            Arc::new(Texture {
                width: w,
                height: h,
                pixels: (0..w * h).map(|i| [i as u8, k, 0]).collect(),
            })
        };
        let (a, b) = (image(4, 2, 1), image(3, 5, 2));
        let uvs = [[0.1, 0.1], [0.9, 0.3], [0.4, 0.95]];
        let parts = vec![
            part(Some(uvs), Some(&a), [1.0; 3]),
            part(None, None, [1.0, 0.0, 0.2]),
            part(Some(uvs), Some(&b), [1.0; 3]),
            part(Some(uvs), Some(&a), [1.0; 3]),
        ];
        let mesh = join(parts, path).unwrap();
        let (texture, atlas_uvs) = (mesh.texture.unwrap(), mesh.uvs.unwrap());
        for (k, uv) in uvs.into_iter().enumerate() {
            assert_eq!(pixel(&texture, atlas_uvs[k]), pixel(&a, uv));
            assert_eq!(pixel(&texture, atlas_uvs[3 + k]), [255, 0, 51]);
            assert_eq!(pixel(&texture, atlas_uvs[6 + k]), pixel(&b, uv));
            assert_eq!(atlas_uvs[9 + k], atlas_uvs[k]);
        }
        let repeated = [[0.1_f32, 1.9], [0.9, 0.3], [2.4, -0.95]];
        let parts = vec![
            part(Some(repeated), Some(&a), [1.0; 3]),
            part(None, None, [1.0, 0.0, 0.2]),
            part(Some([[0.0, 1e9]; 3]), Some(&b), [0.2, 0.0, 1.0]),
        ];
        let mesh = join(parts, path).unwrap();
        let (texture, atlas_uvs) = (mesh.texture.unwrap(), mesh.uvs.unwrap());
        for (k, uv) in repeated.into_iter().enumerate() {
            assert_eq!(pixel(&texture, atlas_uvs[k]), pixel(&a, uv.map(|c| c.rem_euclid(1.0))));
            assert_eq!(pixel(&texture, atlas_uvs[3 + k]), [255, 0, 51]);
            assert_eq!(pixel(&texture, atlas_uvs[6 + k]), [51, 0, 255]);
        }
        let (wide, tall) = (image(20_000, 1, 0), image(1, 20_000, 0));
        let cross =
            vec![part(Some(uvs), Some(&wide), [1.0; 3]), part(Some(uvs), Some(&tall), [1.0; 3])];
        assert!(matches!(join(cross, path), Err(MeshError::TooLarge { .. })));
    }

    #[test]
    fn a_shared_texture_stays_and_plain_colors_reach_the_vertices() {
        let a = Arc::new(Texture { width: 1, height: 1, pixels: vec![[1, 2, 3]] });
        let repeated = [[0.0, 2.0]; 3];
        let mesh = join(
            vec![
                part(Some(repeated), Some(&a), [1.0; 3]),
                part(Some(repeated), Some(&a), [1.0; 3]),
            ],
            Path::new("m"),
        );
        let mesh = mesh.unwrap();
        assert!(Arc::ptr_eq(mesh.texture.as_ref().unwrap(), &a));
        assert_eq!(mesh.uvs.unwrap(), [[0.0, 2.0]; 6]);
        let mesh = join(
            vec![part(None, None, [1.0; 3]), part(None, None, [0.5, 0.0, 1.0])],
            Path::new("m"),
        )
        .unwrap();
        assert_eq!(mesh.colors.unwrap()[2..4], [[1.0; 3], [0.5, 0.0, 1.0]]);
        assert!(join(vec![part(None, None, [1.0; 3])], Path::new("m")).unwrap().colors.is_none());
    }
}
