//! Mass and inertia of meshes, by MuJoCo's rules.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::inertial::Inertial;
use crate::mesh::TriMesh;
use crate::moments::Moments;

/// How volume and inertia of a mesh are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MeshInertia {
    /// The sum of the pyramids from a point inside to the faces, each counted as positive: right for star-shaped bodies, and
    /// defined for meshes that do not close.
    Legacy,
    /// The volume that a closed surface encloses.
    Exact,
    /// That of the convex hull.
    Convex,
    /// The surface itself.
    Shell,
}

impl MeshInertia {
    pub(super) const WORDS: [(&str, Self); 4] = [
        ("legacy", Self::Legacy),
        ("exact", Self::Exact),
        ("convex", Self::Convex),
        ("shell", Self::Shell),
    ];
}

/// The mesh at 1 kg/m³, or at 1 kg/m² as a shell; `None` where that is nothing.
pub(super) fn of_unit_density(mesh: &TriMesh, inertia: MeshInertia) -> Option<Inertial> {
    match inertia {
        MeshInertia::Exact => exact(mesh),
        MeshInertia::Shell => shell(mesh),
        MeshInertia::Convex => exact(&mesh.convex_hull()?),
        MeshInertia::Legacy => legacy(mesh),
    }
}

/// Center and twice the area of each face.
fn faces(mesh: &TriMesh) -> impl Iterator<Item = (Vector3<f64>, f64)> {
    (0..mesh.faces.len()).map(|f| {
        let [a, b, c] = mesh.triangle(f).map(|p| p.coords);
        ((a + b + c) / 3.0, mesh.area_vector(f).norm())
    })
}

/// The center of the surface and twice its area.
fn surface(mesh: &TriMesh) -> Option<(Vector3<f64>, f64)> {
    let double: f64 = faces(mesh).map(|(_, area)| area).sum();
    let first: Vector3<f64> = faces(mesh).map(|(center, area)| center * area).sum();
    (double > 0.0).then(|| (first / double, double))
}

fn exact(mesh: &TriMesh) -> Option<Inertial> {
    // Near the mesh, for accuracy.
    let (origin, _) = surface(mesh)?;
    let corners = (0..mesh.faces.len()).map(|f| mesh.triangle(f).map(|p| p - origin));
    let moments = Moments::enclosed(corners);
    if moments.volume <= 0.0 {
        return None;
    }
    let (mass, com, inertia) = moments.of_density(1.0);
    Some(Inertial { mass, com: com + origin, inertia })
}

/// The pyramids' common tip is the center of the surface while the center of mass is looked for, and the center of mass
/// then. So the mass is that of the second round.
fn legacy(mesh: &TriMesh) -> Option<Inertial> {
    let pyramids = |tip: Vector3<f64>| {
        (0..mesh.faces.len()).map(move |f| {
            let corners = mesh.triangle(f).map(|p| p.coords - tip);
            let volume = (corners[0].dot(&corners[1].cross(&corners[2])) / 6.0).abs();
            (corners, volume)
        })
    };
    let (tip, _) = surface(mesh)?;
    let (mut volume, mut first) = (0.0, Vector3::zeros());
    for ([a, b, c], v) in pyramids(tip) {
        volume += v;
        first += (a + b + c) * (0.25 * v);
    }
    if volume <= 0.0 {
        return None;
    }
    let com = tip + first / volume;
    let (mut mass, mut squares) = (0.0, Matrix3::zeros());
    for ([a, b, c], v) in pyramids(com) {
        mass += v;
        squares += second_moment([a, b, c]) * (v / 20.0);
    }
    (mass > 0.0).then(|| inertial(mass, com, squares))
}

fn shell(mesh: &TriMesh) -> Option<Inertial> {
    let (com, double) = surface(mesh)?;
    let squares = (0..mesh.faces.len()).map(|f| {
        let corners = mesh.triangle(f).map(|p| p.coords - com);
        second_moment(corners) * (mesh.area_vector(f).norm() / 24.0)
    });
    Some(inertial(0.5 * double, com, squares.sum()))
}

/// (Σvᵢ)(Σvᵢ)ᵀ + Σ vᵢvᵢᵀ, to which second moments of a triangle, or of its pyramid from the origin, are proportional.
fn second_moment([a, b, c]: [Vector3<f64>; 3]) -> Matrix3<f64> {
    let sum = a + b + c;
    [sum, a, b, c].iter().map(|v| v * v.transpose()).sum()
}

fn inertial(mass: f64, com: Vector3<f64>, squares: Matrix3<f64>) -> Inertial {
    let inertia = Matrix3::from_diagonal_element(squares.trace()) - squares;
    Inertial { mass, com: Point3::from(com), inertia }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    fn same(a: &Inertial, b: &Inertial) -> bool {
        (a.mass - b.mass).abs() < 1e-12
            && (a.com - b.com).norm() < 1e-12
            && (a.inertia - b.inertia).norm() < 1e-12
    }

    #[test]
    fn a_convex_body_is_the_same_by_all_rules_for_solids() {
        let mut mesh = shapes::cuboid(Vector3::new(0.2, 0.4, 0.6));
        mesh.vertices.iter_mut().for_each(|v| v.coords += Vector3::new(3.0, -1.0, 0.5));
        let [legacy, exact, shell] = [MeshInertia::Legacy, MeshInertia::Exact, MeshInertia::Shell]
            .map(|rule| of_unit_density(&mesh, rule).unwrap());
        assert!(same(&legacy, &exact), "{legacy:?} {exact:?}");
        assert!((exact.mass - 0.048).abs() < 1e-12);
        assert!((exact.inertia[(0, 0)] - 0.048 * (0.16 + 0.36) / 12.0).abs() < 1e-12);
        let hollow = super::super::shape::Shape::Box { half_extents: Vector3::new(0.1, 0.2, 0.3) };
        let hollow = super::super::mass::of_unit_density(&hollow, true).unwrap();
        assert!(same(&Inertial { com: shell.com, ..hollow }, &shell));
    }

    #[test]
    fn what_is_flat_weighs_nothing() {
        let p = Point3::new;
        let flat = TriMesh::new(vec![p(0., 0., 0.), p(1., 0., 0.), p(0., 1., 0.)], vec![[0, 1, 2]]);
        assert!(of_unit_density(&flat, MeshInertia::Legacy).is_none());
        assert!(of_unit_density(&flat, MeshInertia::Exact).is_none());
        assert!((of_unit_density(&flat, MeshInertia::Shell).unwrap().mass - 0.5).abs() < 1e-15);
        let point = TriMesh::new(vec![Point3::origin(); 3], vec![[0, 1, 2]]);
        assert!(of_unit_density(&point, MeshInertia::Shell).is_none());
    }
}
