//! Boxes with sharp or rounded edges, flat or bulging faces, textured as an unfolded sheet.

use std::f64::consts::FRAC_PI_4;

use nalgebra::{Point3, Vector3};

use crate::mesh::TriMesh;

/// A face of a box, by its outward normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoxFace {
    /// +x.
    Front,
    /// +y.
    Right,
    /// −x.
    Back,
    /// −y.
    Left,
    /// +z, its picture's lower edge at the front.
    Top,
    /// −z, its picture's lower edge at the front too, mirrored by looking from below.
    Bottom,
}

/// Where a face lies on the unfolded sheet \[m\], from the sheet's lower-left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Panel {
    /// Left edge \[m\].
    pub x: f64,
    /// Lower edge \[m\].
    pub y: f64,
    /// Width \[m\].
    pub width: f64,
    /// Height \[m\].
    pub height: f64,
}

impl BoxFace {
    /// Every face.
    pub const ALL: [Self; 6] =
        [Self::Front, Self::Right, Self::Back, Self::Left, Self::Top, Self::Bottom];

    /// Outward normal, and the directions of the picture's right and up; right × up is the normal.
    pub fn axes(self) -> [Vector3<f64>; 3] {
        let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
        match self {
            Self::Front => [x, y, z],
            Self::Right => [y, -x, z],
            Self::Back => [-x, -y, z],
            Self::Left => [-y, x, z],
            Self::Top => [z, y, -x],
            Self::Bottom => [-z, -y, -x],
        }
    }

    /// Place on the sheet of a box of size `size` \[m\]: front, right, back and left side by side, the top above
    /// the front and the bottom above the back. The sheet measures 2 (x + y) by z + x.
    pub fn panel(self, size: Vector3<f64>) -> Panel {
        let [sx, sy, sz] = size.into();
        let (x, y, width, height) = match self {
            Self::Front => (0.0, 0.0, sy, sz),
            Self::Right => (sy, 0.0, sx, sz),
            Self::Back => (sy + sx, 0.0, sy, sz),
            Self::Left => (2.0 * sy + sx, 0.0, sx, sz),
            Self::Top => (0.0, sz, sy, sx),
            Self::Bottom => (sy + sx, sz, sy, sx),
        };
        Panel { x, y, width, height }
    }
}

/// Dimensions and resolution of [`rounded_box`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundedBox {
    /// Outer size along x, y and z between the edges \[m\].
    pub size: Vector3<f64>,
    /// Radius of edges and corners \[m\], limited to half the smallest size.
    pub radius: f64,
    /// How far the center of the faces across x, y and z stands out beyond `size`/2 \[m\], on each side, falling
    /// parabolically to zero at the edges as on a filled carton.
    pub bulge: Vector3<f64>,
    /// Rows of cells from a face to the middle of an edge's rounding.
    pub arc_steps: usize,
    /// Longest side of a cell on a face \[m\].
    pub cell: f64,
}

/// A box of size `size` \[m\] about the origin: twelve triangles, a picture a face.
pub fn cuboid(size: Vector3<f64>) -> TriMesh {
    let flat = Vector3::zeros();
    rounded_box(&RoundedBox { size, radius: 0.0, bulge: flat, arc_steps: 0, cell: f64::INFINITY })
}

/// A box about the origin with rounded edges; texture coordinates follow [`BoxFace::panel`].
pub fn rounded_box(shape: &RoundedBox) -> TriMesh {
    let half = 0.5 * shape.size;
    let radius = shape.radius.min(half.min()).max(0.0);
    let stops = [0, 1, 2].map(|a| axis_stops(half[a], radius, shape.arc_steps, shape.cell));
    let sheet = [2.0 * (shape.size.x + shape.size.y), shape.size.z + shape.size.x]
        .map(|side| side.max(f64::MIN_POSITIVE));
    let mut mesh = TriMesh::default();
    let mut uvs = Vec::new();
    for face in BoxFace::ALL {
        let [normal, right, up] = face.axes();
        let panel = face.panel(shape.size);
        let along = |d: &Vector3<f64>| &stops[d.iamax()];
        let (columns, rows) = (along(&right), along(&up));
        let first = mesh.vertices.len() as u32;
        for &v in rows {
            for &u in columns {
                let q = normal.component_mul(&half) + u * right + v * up;
                mesh.vertices.push(Point3::from(place(q, half, radius, shape.bulge)));
                uvs.push([
                    ((panel.x + 0.5 * panel.width + u) / sheet[0]) as f32,
                    ((panel.y + 0.5 * panel.height + v) / sheet[1]) as f32,
                ]);
            }
        }
        let stride = columns.len() as u32;
        for j in 0..rows.len() as u32 - 1 {
            for i in 0..stride - 1 {
                let a = first + j * stride + i;
                mesh.faces.push([a, a + 1, a + stride + 1]);
                mesh.faces.push([a, a + stride + 1, a + stride]);
            }
        }
    }
    mesh.uvs = Some(uvs);
    mesh
}

/// Coordinates of the grid lines on one axis, symmetric about zero.
fn axis_stops(half: f64, radius: f64, arc_steps: usize, cell: f64) -> Vec<f64> {
    let inner = half - radius;
    let cells = ((2.0 * inner / cell).ceil() as usize).clamp(1, 10_000);
    let steps = if radius > 0.0 { arc_steps.max(1) } else { 0 };
    // Equal angles across the rounding: a point at tan(a)·radius beyond the flat part is bent to angle a.
    let bend = |k: usize| match k {
        k if k == steps => half,
        k => inner + radius * (FRAC_PI_4 * k as f64 / steps as f64).tan(),
    };
    let flat = (0..=cells).map(|i| inner * (2.0 * i as f64 - cells as f64) / cells as f64);
    let mut stops: Vec<f64> = (1..=steps).rev().map(|k| -bend(k)).collect();
    if inner > 0.0 {
        stops.extend(flat);
    } else {
        stops.push(0.0);
    }
    stops.extend((1..=steps).map(bend));
    stops
}

/// Moves a point of the sharp box's surface onto the rounded and bulging one.
fn place(q: Vector3<f64>, half: Vector3<f64>, radius: f64, bulge: Vector3<f64>) -> Vector3<f64> {
    let core = half.add_scalar(-radius);
    let inner = q.zip_map(&core, |c, h| c.max(-h).min(h));
    let rounded = (q - inner).try_normalize(0.0).map_or(q, |n| inner + radius * n);
    let s = q.zip_map(&half, |q, half| if half > 0.0 { q / half } else { 0.0 });
    let fall = s.map(|c| 1.0 - c * c);
    let weight = Vector3::new(s.x * fall.y * fall.z, s.y * fall.z * fall.x, s.z * fall.x * fall.y);
    rounded + bulge.component_mul(&weight)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::closed::closed_volume;
    use std::f64::consts::PI;

    const SIZE: Vector3<f64> = Vector3::new(0.04, 0.09, 0.17);

    #[test]
    fn cuboid_is_exact() {
        let mesh = cuboid(SIZE);
        assert_eq!((mesh.faces.len(), mesh.vertices.len()), (12, 24));
        assert!((closed_volume(&mesh) / SIZE.product() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn rounded_volume_converges() {
        // Core, slabs, quarter cylinders and eighths of a sphere.
        let (r, c) = (0.01, SIZE.add_scalar(-0.02));
        let slabs = 2.0 * r * (c.x * c.y + c.y * c.z + c.z * c.x);
        let exact = c.product() + slabs + PI * r * r * c.sum() + 4.0 / 3.0 * PI * r * r * r;
        let errors = [2, 4, 8, 16].map(|arc_steps| {
            let shape = RoundedBox {
                size: SIZE,
                radius: r,
                bulge: Vector3::zeros(),
                arc_steps,
                cell: 0.02,
            };
            (closed_volume(&rounded_box(&shape)) / exact - 1.0).abs()
        });
        assert!(errors.windows(2).all(|e| e[1] < 0.3 * e[0]) && errors[3] < 2e-4, "{errors:?}");
    }

    #[test]
    fn bulging_adds_four_ninths_of_its_prism() {
        let bulge = Vector3::new(0.003, 0.001, 0.0);
        let faces = 2.0 * (bulge.x * SIZE.y * SIZE.z + bulge.y * SIZE.z * SIZE.x);
        let exact = SIZE.product() + 4.0 / 9.0 * faces;
        let errors = [0.02, 0.01, 0.005].map(|cell| {
            let shape = RoundedBox { size: SIZE, radius: 0.0, bulge, arc_steps: 0, cell };
            (closed_volume(&rounded_box(&shape)) / exact - 1.0).abs()
        });
        assert!(
            errors[2] < 1e-3 && errors[1] < 0.4 * errors[0] && errors[2] < 0.4 * errors[1],
            "{errors:?}"
        );
    }

    #[test]
    fn a_fully_round_box_is_a_sphere() {
        let size = Vector3::repeat(0.02);
        let shape =
            RoundedBox { size, radius: 1.0, bulge: Vector3::zeros(), arc_steps: 12, cell: 0.01 };
        let mesh = rounded_box(&shape);
        assert!(mesh.vertices.iter().all(|p| (p.coords.norm() - 0.01).abs() < 1e-15));
        assert!((closed_volume(&mesh) / (4.0 / 3.0 * PI * 1e-6) - 1.0).abs() < 0.01);
    }

    #[test]
    fn pictures_are_not_mirrored_and_do_not_overlap() {
        let panels = BoxFace::ALL.map(|f| f.panel(SIZE));
        for (i, a) in panels.iter().enumerate() {
            let [normal, right, up] = BoxFace::ALL[i].axes();
            assert_eq!(right.cross(&up), normal);
            for b in &panels[i + 1..] {
                let apart = a.x + a.width <= b.x + 1e-12
                    || b.x + b.width <= a.x + 1e-12
                    || a.y + a.height <= b.y + 1e-12
                    || b.y + b.height <= a.y + 1e-12;
                assert!(apart, "{a:?} {b:?}");
            }
        }
    }
}
