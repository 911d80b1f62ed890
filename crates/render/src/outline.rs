//! The outline of a posed model, point by point.

use nalgebra::{Isometry3, Point3, Vector2};

use crate::camera::Camera;
use crate::contour::{Piece, outline};
use crate::model::RenderModel;
use crate::posed::Posed;

/// A piece of the outline of a posed model in the image, at most four pixels long, given by its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlinePoint {
    /// Column and row \[px\].
    pub pixel: Vector2<f64>,
    /// Unit normal in the image, away from the object.
    pub outward: Vector2<f64>,
    /// Length of the piece \[px\].
    pub length: f64,
    /// Point of the surface, camera frame \[m\].
    pub point: Point3<f64>,
}

/// The outline of `model` at `t_cam_object` \[m\] in the image of `camera`: where the model borders on what is behind it. Its own parts in front of each
/// other make no outline.
pub fn outline_points(
    camera: &Camera,
    model: &RenderModel,
    t_cam_object: &Isometry3<f64>,
) -> Vec<OutlinePoint> {
    let posed = Posed::new(model, camera, t_cam_object, 0.0);
    let projected = &posed.projected;
    // Edges lie between the centers of pixels that are covered and others.
    let pieces = outline(projected, &projected.region, 1.0).outline;
    let point = |piece: &Piece| {
        let [from, to] = piece.range;
        let middle = 0.5 * (from + to);
        let pixel = piece.at(middle);
        let face = projected.faces[piece.face as usize];
        // 1/Z is linear in the image.
        let [a, b] = piece.corners.map(|k| projected.screen[face[usize::from(k)] as usize].z);
        let z = f64::from(1.0 / (a + middle * (b - a)));
        let [x, y] = [pixel.x, pixel.y].map(f64::from);
        OutlinePoint {
            pixel: Vector2::new(x, y),
            outward: Vector2::new(f64::from(piece.outward.x), f64::from(piece.outward.y)),
            length: f64::from((to - from) * piece.a.distance(piece.b)),
            point: camera.unproject(x, y, z),
        }
    };
    pieces.iter().map(point).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use prehend_geometry::shapes::cuboid;

    use super::*;

    #[test]
    fn outline_of_a_cube_is_its_square() {
        let mesh = cuboid(Vector3::repeat(0.1));
        let model = RenderModel::new(&mesh).unwrap();
        let camera = Camera { fx: 500.0, fy: 400.0, cx: 99.5, cy: 79.5, width: 200, height: 160 };
        let points = outline_points(&camera, &model, &Isometry3::translation(0.01, 0.0, 0.55));
        // The front face, 0.5 m away.
        let length: f64 = points.iter().map(|point| point.length).sum();
        assert!((length - 2.0 * (100.0 + 80.0)).abs() < 0.1, "{length}");
        for OutlinePoint { pixel, outward, point, .. } in &points {
            assert!((point.z - 0.5).abs() < 1e-5);
            let seen = camera.project(point).unwrap();
            assert!((seen - pixel).norm() < 1e-3);
            let side = Vector2::new((point.x - 0.01) / 0.05, point.y / 0.05);
            assert!((side.dot(outward) - 1.0).abs() < 1e-3, "{side} {outward}");
        }
    }
}
