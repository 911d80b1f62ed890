//! Which faces of a mesh the mode draws.

use glam::Vec3;
use nalgebra::Point3;

use super::face::Face;
use super::settings::Settings;
use crate::camera::Camera;

/// The faces that are drawn, ready to be compared with pixels.
pub(crate) struct Drawn {
    pub(crate) faces: Vec<Face>,
    /// The mesh's index of each of them.
    pub(crate) ids: Vec<u32>,
}

impl Drawn {
    /// Drawn faces among `corners`, as indices into `screen` (see [`project`]); `closed` says of a face whether its
    /// surface is closed. `facing` receives the lit side of each face that has an image.
    pub(crate) fn new(
        corners: &[[u32; 3]],
        screen: &[[f64; 3]],
        closed: impl Fn(usize) -> bool,
        facing: &mut [i8],
        settings: &Settings,
    ) -> Self {
        let mut drawn = Self { faces: Vec::new(), ids: Vec::new() };
        for (id, corners) in corners.iter().enumerate() {
            let corners = corners.map(|v| screen[v as usize]);
            let in_front = corners.iter().all(|c| c[2] > 0.0);
            let Some(face) = in_front.then(|| Face::new(corners, settings)).flatten() else {
                continue;
            };
            // Seen from outside, the area is negative.
            let outside = face.share[0] < 0.0;
            // A closed surface is lit by its outward normals on both sides: a face that turns over must not jump.
            facing[id] = if outside || closed(id) { 1 } else { -1 };
            if outside || !settings.cull {
                drawn.faces.push(face);
                drawn.ids.push(id as u32);
            }
        }
        drawn
    }
}

/// Column, row \[px\] and Z \[m\] of vertices in the camera frame; zeros where `flat`, their places in f32, has none in
/// front of the camera. In f64, because barycentric coordinates of narrow faces magnify what rounding does to positions.
pub(crate) fn project(
    camera: &Camera,
    vertices: impl Iterator<Item = Point3<f64>>,
    flat: &[Vec3],
) -> Vec<[f64; 3]> {
    let place = |(p, flat): (Point3<f64>, &Vec3)| {
        let seen = if flat.z == 0.0 { None } else { camera.project(&p) };
        seen.map_or([0.0; 3], |uv| [uv.x, uv.y, p.z])
    };
    vertices.zip(flat).map(place).collect()
}
