//! Depth of one camera as another one would measure it.

use nalgebra::{Isometry3, Vector3};

use crate::{Camera, DepthImage};

/// Neighbors whose depths differ by a larger part than this are of two surfaces: nothing is drawn between them.
const JUMP: f32 = 0.02;

/// `depth` \[m\], which `depth_camera` measured, as `camera` sees it \[m\]; `t_cam_depth` takes coordinates of the depth camera to
/// those of `camera` \[m\]. Zero where nothing was measured.
///
/// The surface through the measured points is drawn, which leaves no holes where `camera` has the finer pixels. It is not
/// drawn across jumps of depth. The nearest surface hides the others; what the depth camera did not see stays empty.
///
/// ```
/// use nalgebra::Isometry3;
/// use prehend_render::{Camera, DepthImage, register_depth};
///
/// let coarse = Camera { fx: 100.0, fy: 100.0, cx: 31.5, cy: 23.5, width: 64, height: 48 };
/// let wall = DepthImage::filled(64, 48, 2.0);
/// let fine = coarse.scaled(4.0);
/// let nearer = Isometry3::translation(0.05, 0.0, -0.5);
/// let seen = register_depth(&wall, &coarse, &nearer, &fine);
/// assert!((seen.get(128, 96).unwrap() - 1.5).abs() < 1e-6);
/// ```
///
/// # Panics
/// If `depth` has not the size of `depth_camera`.
pub fn register_depth(
    depth: &DepthImage,
    depth_camera: &Camera,
    t_cam_depth: &Isometry3<f64>,
    camera: &Camera,
) -> DepthImage {
    let (width, height) = (depth_camera.width, depth_camera.height);
    assert_eq!((depth.width(), depth.height()), (width, height), "the depth camera's size");
    let mut drawn = DepthImage::filled(camera.width, camera.height, 0.0);
    let corner = |x: usize, y: usize| {
        let measured = depth.pixels()[y * width + x];
        if !(measured > 0.0 && measured.is_finite()) {
            return None;
        }
        let place = depth_camera.unproject(x as f64, y as f64, f64::from(measured));
        let place = t_cam_depth * place;
        let seen = camera.project(&place)?;
        Some(PixelCorner { measured, seen: Vector3::new(seen.x, seen.y, 1.0 / place.z) })
    };
    let line = |y: usize| (0..width).map(move |x| corner(x, y)).collect::<Vec<_>>();
    let mut above = line(0);
    for y in 0..height {
        above.iter().flatten().for_each(|corner| corner.draw(&mut drawn));
        if y + 1 == height {
            break;
        }
        let below = line(y + 1);
        for x in 1..width {
            let [a, b, c, d] = [&above[x - 1], &above[x], &below[x - 1], &below[x]];
            // Two halves, or the one without the corner that was not measured.
            let triangles = match (a, b, c, d) {
                (Some(_), Some(_), Some(_), Some(_)) => [Some([a, b, c]), Some([b, d, c])],
                (None, ..) => [Some([b, d, c]), None],
                (_, None, ..) => [Some([a, d, c]), None],
                (_, _, None, _) => [Some([a, b, d]), None],
                (_, _, _, None) => [Some([a, b, c]), None],
            };
            for [a, b, c] in triangles.into_iter().flatten() {
                if let (Some(a), Some(b), Some(c)) = (a, b, c) {
                    draw_triangle([a, b, c], &mut drawn);
                }
            }
        }
        above = below;
    }
    drawn
}

/// A measured pixel.
struct PixelCorner {
    /// Its depth \[m\].
    measured: f32,
    /// Its column, its row and the inverse of its depth \[1/m\] in the other image.
    seen: Vector3<f64>,
}

impl PixelCorner {
    /// Draws the pixel that it falls on.
    fn draw(&self, image: &mut DepthImage) {
        let (x, y) = (self.seen.x.round(), self.seen.y.round());
        if x >= 0.0 && y >= 0.0 && x < image.width() as f64 && y < image.height() as f64 {
            put(image, x as usize, y as usize, self.seen.z);
        }
    }
}

/// Draws the surface between three corners, if it is one.
fn draw_triangle(corners: [&PixelCorner; 3], image: &mut DepthImage) {
    let depths = corners.map(|corner| corner.measured);
    let nearest = depths.iter().copied().fold(f32::INFINITY, f32::min);
    let farthest = depths.iter().copied().fold(0.0, f32::max);
    if farthest - nearest > JUMP * nearest {
        return;
    }
    let [a, b, c] = corners.map(|corner| corner.seen);
    let span = |values: [f64; 3], size: usize| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min).ceil().max(0.0);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max).floor();
        (low as usize, (high + 1.0).clamp(0.0, size as f64) as usize)
    };
    let (left, right) = span([a.x, b.x, c.x], image.width());
    let (top, bottom) = span([a.y, b.y, c.y], image.height());
    let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    // What is seen from behind was not measured from this side.
    if area <= 0.0 {
        return;
    }
    for y in top..bottom {
        for x in left..right {
            let (dx, dy) = (x as f64 - a.x, y as f64 - a.y);
            let v = (dx * (c.y - a.y) - dy * (c.x - a.x)) / area;
            let w = (dy * (b.x - a.x) - dx * (b.y - a.y)) / area;
            let u = 1.0 - v - w;
            // The inverse of depth is linear in the image.
            if u >= 0.0 && v >= 0.0 && w >= 0.0 {
                put(image, x, y, u * a.z + v * b.z + w * c.z);
            }
        }
    }
}

/// Sets a pixel to the depth whose inverse is given, unless something nearer is there.
fn put(image: &mut DepthImage, x: usize, y: usize, inverse: f64) {
    let width = image.width();
    let pixel = &mut image.pixels_mut()[y * width + x];
    let depth = (1.0 / inverse) as f32;
    if *pixel == 0.0 || depth < *pixel {
        *pixel = depth;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitQuaternion};

    use super::*;

    fn camera() -> Camera {
        Camera { fx: 80.0, fy: 82.0, cx: 40.2, cy: 29.1, width: 80, height: 60 }
    }

    /// Depth at which a ray of `camera` meets the plane of points with n·x = d.
    fn on_plane(camera: &Camera, n: &Vector3<f64>, d: f64, [x, y]: [usize; 2]) -> f64 {
        d / n.dot(&camera.ray(x as f64, y as f64))
    }

    #[test]
    fn a_tilted_plane_is_where_it_is_seen_from_anywhere() {
        let turn = UnitQuaternion::from_euler_angles(0.05, -0.1, 0.2);
        let t_cam_depth = Isometry3::from_parts([0.06, -0.01, 0.02].into(), turn);
        let (n, d) = (Vector3::new(0.3, -0.2, 1.0), 0.8);
        let depth_camera = camera();
        let mut depth = DepthImage::filled(80, 60, 0.0);
        for y in 0..60 {
            for x in 0..80 {
                depth.pixels_mut()[y * 80 + x] = on_plane(&depth_camera, &n, d, [x, y]) as f32;
            }
        }
        let fine = Camera { width: 200, height: 150, ..camera().scaled(2.5) };
        let seen = register_depth(&depth, &depth_camera, &t_cam_depth, &fine);
        // The same plane in the other camera's frame.
        let there = t_cam_depth.rotation * n;
        let offset = d + there.dot(&t_cam_depth.translation.vector);
        let mut count = 0;
        for y in 0..150 {
            for x in 0..200 {
                let z = f64::from(seen.get(x, y).unwrap());
                if z > 0.0 {
                    count += 1;
                    let expected = on_plane(&fine, &there, offset, [x, y]);
                    // Single pixels at the border are drawn where they round to.
                    assert!((z / expected - 1.0).abs() < 5e-3, "{x} {y}: {z} {expected}");
                }
            }
        }
        assert!(count > 15_000, "{count}");
        let exact = on_plane(&fine, &there, offset, [100, 70]);
        assert!((f64::from(seen.get(100, 70).unwrap()) - exact).abs() < 1e-6);
    }

    #[test]
    fn the_same_camera_sees_the_same() {
        let mut depth = DepthImage::filled(80, 60, 0.0);
        for (k, z) in depth.pixels_mut().iter_mut().enumerate() {
            *z = if k.is_multiple_of(7) { 0.0 } else { 1.0 + (k % 80) as f32 * 1e-3 };
        }
        let seen = register_depth(&depth, &camera(), &Isometry3::identity(), &camera());
        let pairs = depth.pixels().iter().zip(seen.pixels()).filter(|(z, _)| **z > 0.0);
        assert!(pairs.clone().count() > 4000);
        pairs.for_each(|(z, seen)| assert!((z - seen).abs() < 1e-6));
    }

    #[test]
    fn what_is_near_hides_what_is_behind_and_nothing_spans_a_jump() {
        let depth_camera = camera();
        let mut depth = DepthImage::filled(80, 60, 2.0);
        for y in 20..40 {
            depth.pixels_mut()[y * 80 + 30..y * 80 + 50].fill(0.5);
        }
        // From 10 cm to the right, the block hides other parts of the wall.
        let t_cam_depth = Isometry3::translation(-0.1, 0.0, 0.0);
        let seen = register_depth(&depth, &depth_camera, &t_cam_depth, &depth_camera);
        let between = |z: &&f32| **z > 0.51 && **z < 1.99;
        assert_eq!(seen.pixels().iter().filter(between).count(), 0);
        let at = |z| depth_camera.project(&(t_cam_depth * depth_camera.unproject(40.0, 30.0, z)));
        let block = at(0.5).unwrap();
        assert_eq!(seen.get(block.x.round() as usize, 30), Some(0.5));
        let right = depth_camera.project(&(t_cam_depth * depth_camera.unproject(49.0, 30.0, 0.5)));
        let shadow = right.unwrap().x as usize + 4;
        assert_eq!(seen.get(shadow, 30), Some(0.0));
        // What is not in front of the camera is not seen.
        let behind = Isometry3::translation(0.0, 0.0, -3.0);
        let nothing = register_depth(&depth, &depth_camera, &behind, &depth_camera);
        assert!(nothing.pixels().iter().all(|z| *z == 0.0));
        assert!(depth_camera.project(&Point3::new(0.0, 0.0, -1.0)).is_none());
    }
}
