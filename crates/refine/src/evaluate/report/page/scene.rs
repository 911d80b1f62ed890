//! Hand and object for the page's three-dimensional view.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_geometry::TriMesh;
use prehend_geometry::hand::Taxel;
use prehend_geometry::robot::RobotError;
use serde::Serialize;

use super::frame::FrameDrawing;
use crate::scene::{Hand, HandMeasurement};

/// Vertices of an object, and of all links of a hand, at most.
const OBJECT_VERTICES: usize = 6000;
const HAND_VERTICES: usize = 12_000;

/// Unit of encoded distances \[m\]; a byte reaches 127 of them.
const DISTANCE_UNIT: f64 = 1e-4;

/// A mesh with numbers as base64: positions in 32 bits \[m\], colors as bytes, vertices of faces in 16 bits, all little-endian.
#[derive(Serialize)]
pub(super) struct EncodedMesh {
    positions: String,
    colors: String,
    faces: String,
}

impl EncodedMesh {
    /// Encoding of `mesh`, which has fewer than 65 536 vertices, with colors.
    fn new(mesh: &TriMesh) -> Self {
        let positions = mesh.vertices.iter().flat_map(|v| [v.x, v.y, v.z].map(|c| c as f32));
        let colors = mesh.colors.iter().flatten().flatten().map(|c| (c * 255.0).round() as u8);
        let faces = mesh.faces.iter().flatten().map(|v| *v as u16);
        Self {
            positions: STANDARD.encode(positions.flat_map(f32::to_le_bytes).collect::<Vec<_>>()),
            colors: STANDARD.encode(colors.collect::<Vec<_>>()),
            faces: STANDARD.encode(faces.flat_map(u16::to_le_bytes).collect::<Vec<_>>()),
        }
    }
}

/// A hand: the mesh of each link that has one, and its skin.
#[derive(Serialize)]
pub(super) struct EncodedHand {
    /// Link and mesh.
    parts: Vec<(usize, usize)>,
    taxels: Vec<EncodedTaxel>,
}

/// A taxel in its link's frame.
#[derive(Serialize)]
struct EncodedTaxel {
    link: usize,
    /// Name of its link and its patch.
    patch: String,
    /// \[m\]
    position: [f32; 3],
    normal: [f32; 3],
}

/// Where all is in a frame, in camera coordinates.
#[derive(Serialize)]
pub(super) struct EncodedScene {
    /// Numbers of mesh and hand.
    object: usize,
    hand: Option<usize>,
    /// Rotation and translation, three rows of four \[m\].
    pose: [f32; 12],
    initial: Option<[f32; 12]>,
    links: Vec<[f32; 12]>,
    /// Center of the view's rotation: the object's center \[m\].
    center: [f32; 3],
    /// Against gravity, or the camera's up.
    up: [f32; 3],
    /// How far each vertex of the object is from the hand, as a signed byte each, negative within; the largest where it is farther.
    distances: Option<String>,
    distance_unit: f64,
    /// Half axes of the ellipsoid of one standard deviation of the center \[m\], as columns.
    ellipsoid: Option<[f32; 9]>,
    /// On each taxel, in its link's frame \[N\]; none where it is not known.
    forces: Vec<Option<[f32; 3]>>,
}

/// The mesh of an object as it is drawn.
pub(super) fn object_mesh(mesh: &TriMesh) -> (TriMesh, EncodedMesh) {
    let simple = mesh.simplified(OBJECT_VERTICES);
    let encoded = EncodedMesh::new(&simple);
    (simple, encoded)
}

/// A hand, its meshes added to `meshes`.
pub(super) fn encoded_hand(hand: &Hand, meshes: &mut Vec<EncodedMesh>) -> EncodedHand {
    let links = hand.tree.links();
    let drawn = links.iter().filter(|link| !link.parts.is_empty()).count();
    let mut parts = Vec::new();
    for (index, link) in links.iter().enumerate() {
        let mut parts_of_link = link.parts.iter();
        let Some(first) = parts_of_link.next() else { continue };
        let mut whole = TriMesh::new(first.vertices.clone(), first.faces.clone());
        parts_of_link.for_each(|part| whole.append(part));
        parts.push((index, meshes.len()));
        meshes.push(EncodedMesh::new(&whole.simplified(HAND_VERTICES / drawn.max(1))));
    }
    let taxel = |taxel: &Taxel| {
        Some(EncodedTaxel {
            link: hand.tree.link_index(&taxel.link)?,
            patch: format!("{} {}", taxel.link, taxel.patch),
            position: taxel.position.coords.cast().into(),
            normal: taxel.normal.cast().into(),
        })
    };
    EncodedHand { parts, taxels: hand.taxels.iter().filter_map(taxel).collect() }
}

/// The scene of a frame, whose object is drawn as `mesh`; `object` and `hand` are the numbers of these.
pub(super) fn encoded_scene(
    drawing: &FrameDrawing<'_>,
    mesh: &TriMesh,
    object: usize,
    hand: Option<usize>,
) -> Result<EncodedScene, RobotError> {
    let FrameDrawing { input, initial, t_cam_object, covariance, .. } = drawing;
    let known = input.frame.hand.as_ref();
    let posed = known.map(|at| at.hand.posed(&at.t_cam_hand, &at.joints)).transpose()?;
    let distances = posed.as_ref().map(|posed| {
        let distance = |v: &Point3<f64>| {
            let farthest = f64::from(i8::MAX) * DISTANCE_UNIT;
            let distance = posed.signed_distance(&(*t_cam_object * v), farthest);
            (distance.unwrap_or(farthest) / DISTANCE_UNIT).round() as i8 as u8
        };
        STANDARD.encode(mesh.vertices.iter().map(distance).collect::<Vec<_>>())
    });
    let forces = known.map_or_else(Vec::new, |hand| {
        let force = |f: &Vector3<f64>| (!HandMeasurement::is_unknown(f)).then(|| f.cast().into());
        hand.forces.iter().map(force).collect()
    });
    let up = match &input.frame.gravity {
        Some(gravity) if gravity.norm() > 0.0 => -gravity.normalize(),
        _ => -Vector3::y(),
    };
    Ok(EncodedScene {
        object,
        hand,
        pose: matrix(t_cam_object),
        initial: initial.map(matrix),
        links: posed.iter().flat_map(|posed| posed.t_world_links()).map(matrix).collect(),
        center: (*t_cam_object * input.object.center).coords.cast().into(),
        up: up.cast().into(),
        distances,
        distance_unit: DISTANCE_UNIT,
        ellipsoid: covariance.map(|all| half_axes(&Matrix3::from_fn(|r, c| all[r][c]))),
        forces,
    })
}

/// Three rows of four.
fn matrix(pose: &Isometry3<f64>) -> [f32; 12] {
    let matrix = pose.to_matrix();
    std::array::from_fn(|k| matrix[(k / 4, k % 4)] as f32)
}

/// Half axes of the ellipsoid of a covariance, column by column.
fn half_axes(covariance: &Matrix3<f64>) -> [f32; 9] {
    let eigen = covariance.symmetric_eigen();
    let axis = |k: usize| eigen.eigenvectors.column(k) * eigen.eigenvalues[k].max(0.0).sqrt();
    std::array::from_fn(|k| axis(k / 3)[k % 3] as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    #[test]
    fn half_axes_are_those_of_the_covariance() {
        let turn = Rotation3::from_euler_angles(0.3, -0.8, 1.1);
        let sigmas = Vector3::new(3e-3, 1e-3, 2e-4);
        let squares = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
        let axes = half_axes(&(turn * squares * turn.transpose()));
        // The sum of the axes' outer products is the covariance again.
        let axes = Matrix3::from_column_slice(&axes).cast::<f64>();
        let again = axes * axes.transpose();
        assert!((again - turn * squares * turn.transpose()).norm() < 1e-11);
    }

    #[test]
    fn meshes_are_encoded_as_the_scripts_read_them() {
        let (vertices, faces) = (vec![Point3::new(-1.0, 0.0, 2.0); 3], vec![[0, 1, 2]]);
        let colors = Some(vec![[0.0, 1.0, 0.5]; 3]);
        let encoded = EncodedMesh::new(&TriMesh { colors, ..TriMesh::new(vertices, faces) });
        let bytes = STANDARD.decode(encoded.positions).unwrap();
        assert_eq!((bytes.len(), &bytes[8..12]), (36, &2f32.to_le_bytes()[..]));
        assert_eq!(STANDARD.decode(encoded.colors).unwrap()[..3], [0, 255, 128]);
        assert_eq!(STANDARD.decode(encoded.faces).unwrap(), [0, 0, 1, 0, 2, 0]);
    }
}
