//! The hard z-buffer.

mod small;

use glam::Vec2;
use nalgebra::Isometry3;
use rayon::prelude::*;

use crate::camera::Camera;
use crate::image::DepthImage;
use crate::model::RenderModel;
use crate::posed::Posed;
use crate::projected::{Projected, Region, signed_area};

/// Rows of the image that one task renders; results do not depend on it.
pub(crate) const BAND: usize = 16;

/// No face.
pub(crate) const MISS: u32 = u32::MAX;

/// The smallest whole number not below `v` ≥ 0 (`f32::ceil` is a function call on baseline x86-64).
#[inline(always)]
fn ceil(v: f32) -> i32 {
    // Wraps where `v` is beyond all pixels: callers compare both ends of a range first.
    let whole = v as i32;
    whole.wrapping_add(i32::from((whole as f32) < v))
}

/// The smaller and the larger of three numbers (`f32::min` would look for a NaN).
#[inline(always)]
fn span(a: f32, b: f32, c: f32) -> [f32; 2] {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    [if c < low { c } else { low }, if c > high { c } else { high }]
}

/// The pixel centers from `low` to `high` among those from `first` to `last`, if any.
#[inline(always)]
fn centers([low, high]: [f32; 2], first: usize, last: usize) -> Option<(usize, usize)> {
    let (first, last) = (first as f32, last as f32 - 1.0);
    let low = if low > first { low } else { first };
    let high = if high < last { high } else { last };
    let (start, end) = (ceil(low), high as i32);
    // Most faces of a fine mesh lie between pixel centers. (One branch, not two.)
    ((low <= high) & (start <= end)).then_some((start as usize, end as usize))
}

/// Visible faces of a block of rows.
pub(crate) struct Visible {
    pub(crate) region: Region,
    /// Nearest face per pixel, or [`MISS`].
    pub(crate) face: Vec<u32>,
    /// Its 1/Z \[1/m\].
    pub(crate) inverse_z: Vec<f32>,
}

/// Face at the pixel nearest to an image point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeenFace {
    /// The pixel.
    pub(crate) at: Vec2,
    /// The face, and its 1/Z \[1/m\].
    pub(crate) face: u32,
    pub(crate) inverse_z: f32,
}

impl Visible {
    pub(crate) fn new(region: Region) -> Self {
        let count = region.width() * (region.y1 - region.y0);
        Self { region, face: vec![MISS; count], inverse_z: vec![0.0; count] }
    }

    /// Face that the blocks show at the pixel nearest to a point of the image, if any.
    pub(crate) fn seen(blocks: &[Self], at: Vec2) -> Option<SeenFace> {
        let at = at.round();
        if at.x < 0.0 || at.y < 0.0 {
            return None;
        }
        let (face, inverse_z) = Self::at(blocks, at.x as usize, at.y as usize)?;
        Some(SeenFace { at, face, inverse_z })
    }

    /// The face that the blocks, [`BAND`] rows each, show at pixel (x, y), and its 1/Z \[1/m\]; `None` where there is none.
    #[inline]
    pub(crate) fn at(blocks: &[Self], x: usize, y: usize) -> Option<(u32, f32)> {
        let first_row = blocks.first()?.region.y0;
        let block = blocks.get(y.checked_sub(first_row)? / BAND)?;
        let width = block.region.width();
        let column = x.checked_sub(block.region.x0).filter(|column| *column < width)?;
        let at = (y - block.region.y0) * width + column;
        let face = *block.face.get(at)?;
        (face != MISS).then(|| (face, block.inverse_z[at]))
    }

    /// Column and row of the pixel with index `i`.
    #[inline]
    pub(crate) fn position(&self, i: usize) -> (usize, usize) {
        let width = self.region.width();
        (self.region.x0 + i % width, self.region.y0 + i / width)
    }

    /// Draws one face where it is nearer than what is there; of equals the first stays.
    #[inline(always)]
    pub(crate) fn draw(&mut self, projected: &Projected, face: u32) {
        let [a, b, c] = projected.corners(face as usize);
        let region = self.region;
        let Some((y0, y1)) = centers(span(a.y, b.y, c.y), region.y0, region.y1) else { return };
        let Some((x0, x1)) = centers(span(a.x, b.x, c.x), region.x0, region.x1) else { return };
        let area = signed_area([a, b, c]);
        let scale = 1.0 / area;
        let width = region.width();
        for y in y0..=y1 {
            let py = y as f32;
            let (ay, by, cy) = (a.y - py, b.y - py, c.y - py);
            let row = (y - region.y0) * width;
            for x in x0..=x1 {
                let px = x as f32;
                let (ax, bx, cx) = (a.x - px, b.x - px, c.x - px);
                // The other face of an edge has exactly the opposite number, so that none of its pixels is lost.
                let e = [
                    (bx * cy - by * cx) * scale,
                    (cx * ay - cy * ax) * scale,
                    (ax * by - ay * bx) * scale,
                ];
                if (e[0] < 0.0) | (e[1] < 0.0) | (e[2] < 0.0) {
                    continue;
                }
                let inverse_z = e[0] * a.z + e[1] * b.z + e[2] * c.z;
                let at = row + x - region.x0;
                if inverse_z > self.inverse_z[at] {
                    self.inverse_z[at] = inverse_z;
                    self.face[at] = face;
                }
            }
        }
    }
}

/// The faces that touch each block of [`BAND`] rows of `region`, in ascending order.
pub(crate) fn bin(projected: &Projected, region: &Region) -> Vec<Vec<u32>> {
    let count = (region.y1 - region.y0).div_ceil(BAND);
    // Each face is drawn in one block or two; a closed body shows half of its faces.
    let expected = projected.faces.len().checked_div(count).unwrap_or(0);
    let mut bins: Vec<Vec<u32>> = (0..count).map(|_| Vec::with_capacity(expected)).collect();
    for (f, _) in projected.facing.iter().enumerate().filter(|(_, facing)| **facing != 0) {
        let [a, b, c] = projected.corners(f);
        let Some((top, bottom)) = centers(span(a.y, b.y, c.y), region.y0, region.y1) else {
            continue;
        };
        for bin in &mut bins[(top - region.y0) / BAND..=(bottom - region.y0) / BAND] {
            bin.push(f as u32);
        }
    }
    bins
}

/// The rows of band `index` of `region`.
pub(crate) fn band(region: &Region, index: usize) -> Region {
    let y0 = region.y0 + index * BAND;
    Region { y0, y1: (y0 + BAND).min(region.y1), ..*region }
}

/// Visible faces over `region`, band by band, in parallel.
pub(crate) fn rasterize(projected: &Projected, region: &Region) -> Vec<Visible> {
    bin(projected, region)
        .par_iter()
        .enumerate()
        .map(|(index, faces)| {
            let mut visible = Visible::new(band(region, index));
            visible.draw_all(projected, faces);
            visible
        })
        .collect()
}

/// Depth of the nearest surface of several posed models per pixel center: Z in the camera frame \[m\], 0 where
/// there is none.
///
/// Each body is given with `t_cam_body`. Bodies behind the camera, or with a pose that is not finite, are not
/// drawn, nor are faces with a corner within a millimeter of its plane or behind it: cut large tables and walls into small faces.
/// Meant for what is known and does not move during a refinement, such as the hand.
pub fn depth_map(camera: &Camera, bodies: &[(&RenderModel, Isometry3<f64>)]) -> DepthImage {
    let mut depth = DepthImage::default();
    draw_depth(&mut depth, camera, bodies);
    depth
}

/// Depth as of [`depth_map`], written over the contents of an existing image.
pub fn draw_depth(
    depth: &mut DepthImage,
    camera: &Camera,
    bodies: &[(&RenderModel, Isometry3<f64>)],
) {
    let drawn = |(model, pose): &(&RenderModel, Isometry3<f64>)| {
        let projected = Posed::new(model, camera, pose, 0.0).projected;
        rasterize(&projected, &projected.region)
    };
    let drawn: Vec<Vec<Visible>> = bodies.par_iter().map(drawn).collect();
    depth.refill(camera.width, camera.height, 0.0);
    let nearest = depth.pixels_mut();
    for body in &drawn {
        for part in body {
            let width = part.region.width();
            for (row, values) in part.inverse_z.chunks(width.max(1)).enumerate() {
                let start = (part.region.y0 + row) * camera.width + part.region.x0;
                for (old, new) in nearest[start..start + width].iter_mut().zip(values) {
                    *old = old.max(*new);
                }
            }
        }
    }
    // So far 1/Z, which is what faces are flat in.
    nearest.iter_mut().filter(|w| **w > 0.0).for_each(|w| *w = 1.0 / *w);
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};
    use prehend_geometry::shapes::{cuboid, sphere};

    fn camera() -> Camera {
        Camera { fx: 200.0, fy: 210.0, cx: 63.5, cy: 47.5, width: 128, height: 96 }
    }

    fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.5, 0.2)),
        )
    }

    #[test]
    fn a_sphere_has_the_depth_of_a_sphere() {
        let model = RenderModel::new(&sphere(0.08, 400)).unwrap();
        let pose = at(0.01, -0.02, 0.5);
        let depth = depth_map(&camera(), &[(&model, pose)]);
        let center = pose.translation.vector;
        let mut worst = 0.0f64;
        let mut count = 0;
        for y in 0..96 {
            for x in 0..128 {
                let ray = camera().ray(x as f64, y as f64);
                // Nearest root of |z ray - center| = radius.
                let (a, b) = (ray.norm_squared(), ray.dot(&center));
                let c = center.norm_squared() - 0.08 * 0.08;
                let discriminant = b * b - a * c;
                let z = depth.get(x, y).unwrap() as f64;
                if discriminant > 1e-4 {
                    worst = worst.max(((b - discriminant.sqrt()) / a - z).abs());
                    count += 1;
                } else if discriminant < 0.0 {
                    assert_eq!(z, 0.0);
                }
            }
        }
        assert!(count > 2500 && worst < 1e-4, "{count} {worst}");
    }

    #[test]
    fn no_pixel_is_lost_between_faces() {
        let model = RenderModel::new(&sphere(0.08, 400)).unwrap();
        let depth = depth_map(&camera(), &[(&model, at(0.0, 0.0, 0.4))]);
        for y in 1..95 {
            for x in 1..127 {
                let z = |dx: usize, dy: usize| depth.get(x + dx - 1, y + dy - 1).unwrap();
                let lone = z(0, 1) > 0.0 && z(2, 1) > 0.0 && z(1, 0) > 0.0 && z(1, 2) > 0.0;
                assert!(!lone || z(1, 1) > 0.0, "hole at {x}, {y}");
            }
        }
    }

    #[test]
    fn the_nearer_body_wins_and_what_is_behind_is_not_drawn() {
        let model = RenderModel::new(&cuboid(Vector3::repeat(0.1))).unwrap();
        let upright = |z: f64| Isometry3::translation(0.0, 0.0, z);
        let both = depth_map(&camera(), &[(&model, upright(0.4)), (&model, upright(0.7))]);
        assert!((both.get(63, 47).unwrap() - 0.35).abs() < 1e-5);
        for pose in [upright(-0.5), upright(0.0), upright(f64::NAN), upright(f64::INFINITY)] {
            let depth = depth_map(&camera(), &[(&model, pose)]);
            assert!(depth.pixels().iter().all(|z| *z >= 0.0));
        }
        let behind = depth_map(&camera(), &[(&model, upright(-0.5))]);
        assert!(behind.pixels().iter().all(|z| *z == 0.0));
    }

    #[test]
    fn open_meshes_are_seen_from_both_sides() {
        let mut mesh = cuboid(Vector3::repeat(0.1));
        // Without its two near faces one looks at the inside of the far ones.
        let nearest = |f: &[u32; 3]| f.iter().all(|v| mesh.vertices[*v as usize].z < 0.0);
        let open: Vec<[u32; 3]> = mesh.faces.iter().copied().filter(|f| !nearest(f)).collect();
        assert_eq!(open.len(), mesh.faces.len() - 2);
        mesh.faces = open;
        let model = RenderModel::new(&mesh).unwrap();
        let depth = depth_map(&camera(), &[(&model, Isometry3::translation(0.0, 0.0, 0.4))]);
        assert!((depth.get(63, 47).unwrap() - 0.45).abs() < 1e-5);
    }
}
