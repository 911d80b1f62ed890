//! Simple shapes in the place of meshes.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::mesh::Mesh;
use super::shape::{Kind, Shape};

/// The shape of `kind`, and its frame in the mesh's, that stands for `mesh`; `None` where it holds no volume.
///
/// Its axes are those of the mesh's inertia, the longest along z. It is made for the box with the inertia of the mesh, or
/// with `by_bounds` for the box around it.
pub(super) fn shape(
    kind: Kind,
    mesh: &Mesh,
    scale: f64,
    by_bounds: bool,
) -> Option<(Shape, Isometry3<f64>)> {
    let (mut frame, mut half) = inertia_box(mesh)?;
    if by_bounds {
        let (low, high) = mesh.mesh.transformed(&frame.inverse()).bounds()?;
        frame *= Translation3::from(nalgebra::center(&low, &high));
        half = 0.5 * (high - low);
    }
    let half = half * scale;
    let across = 0.5 * (half.x + half.y);
    let size = match kind {
        Kind::Sphere if by_bounds => [half.max(), 0.0, 0.0],
        Kind::Sphere => [half.mean(), 0.0, 0.0],
        Kind::Capsule | Kind::Cylinder if by_bounds => {
            let radius = half.x.max(half.y);
            let length = if kind == Kind::Capsule { half.z - radius } else { half.z };
            [radius, length.max(0.0), 0.0]
        }
        Kind::Capsule => [across, (half.z - 0.5 * across).max(0.0), 0.0],
        Kind::Cylinder => [across, half.z, 0.0],
        _ => [half.x, half.y, half.z],
    };
    Some((kind.of_size(size)?, frame))
}

/// The box of uniform density with the mass and the inertia of the mesh.
fn inertia_box(mesh: &Mesh) -> Option<(Isometry3<f64>, Vector3<f64>)> {
    let solid = mesh.of_unit_density().filter(|s| s.inertia.iter().all(|x| x.is_finite()))?;
    let eigen = solid.inertia.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let moments = Vector3::from(order.map(|k| eigen.eigenvalues[k]));
    let [x, y] = [order[0], order[1]].map(|k| eigen.eigenvectors.column(k).into_owned());
    let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    // ∫x² of a box is m h²/3, and half the sum of the moments less the one about x.
    let half = moments.map(|i| (1.5 * (moments.sum() - 2.0 * i).max(0.0) / solid.mass).sqrt());
    Some((Isometry3::from_parts(solid.com.into(), rotation), half))
}

#[cfg(test)]
mod tests {
    use super::super::{Model, Shape};

    fn fitted(compiler: &str, kind: &str) -> Vec<f64> {
        let model = Model::from_str(
            &format!(
                "<mujoco><compiler {compiler}/><asset><mesh name=\"t\" vertex=\"0 0 0 1 0 0 0 1 0 0 0 1\" \
                face=\"0 2 1 0 1 3 1 2 3 0 3 2\" scale=\"1 2 3\"/></asset><worldbody><geom type=\"{kind}\" mesh=\"t\"/>\
                </worldbody></mujoco>"
            ),
            None,
        );
        match model.unwrap().world_geoms[0].shape {
            Shape::Sphere { radius } => vec![radius],
            Shape::Capsule { radius, half_length } => vec![radius, half_length],
            Shape::Cylinder { radius, half_length } => vec![radius, half_length],
            Shape::Box { half_extents } => half_extents.as_slice().to_vec(),
            ref other => panic!("{other:?}"),
        }
    }

    #[test]
    fn boxes_and_what_is_made_for_them_are_as_mujoco_has_them() {
        for (compiler, kind, expected) in [
            ("", "box", &[0.259994, 0.639653, 1.047973][..]),
            ("", "capsule", &[0.449823, 0.823061]),
            ("", "cylinder", &[0.449823, 1.047973]),
            ("", "sphere", &[0.649207]),
            ("fitaabb=\"true\"", "box", &[0.469741, 1.068472, 1.734654]),
            ("fitaabb=\"true\"", "capsule", &[1.068472, 0.666182]),
            ("fitaabb=\"true\"", "cylinder", &[1.068472, 1.734654]),
            ("fitaabb=\"true\"", "sphere", &[1.734654]),
        ] {
            let found = fitted(compiler, kind);
            let same = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(same && found.len() == expected.len(), "{compiler} {kind}: {found:?}");
        }
    }
}
