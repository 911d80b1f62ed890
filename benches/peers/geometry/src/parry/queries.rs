//! Closest points, contact and signed distances in the precision of the parent.

use nalgebra::Point3;
use prehend_geometry::TriMesh;

use super::parry::math::Vector;
use super::parry::query::{PointProjection, PointQuery};
use super::parry::shape::{self, TriMeshFlags};
use super::{NAME, Real, UNORIENTED};
use crate::workloads::closest::few;
use crate::workloads::contact::REACH;
use crate::workloads::{Comparisons, Scenes};

pub(crate) fn add<'a>(to: &mut Comparisons<'a>, scenes: &'a Scenes) {
    let points = few(&scenes.sets[1]);
    to.tree.add(NAME, || surface(&scenes.body), |own| distances(points, &project(&own, points)));
    for (job, set) in to.closest.iter_mut().zip(&scenes.sets) {
        let (own, points) = (surface(&scenes.body), &set.points);
        job.add(NAME, move || project(&own, points), |found| distances(points, &found));
    }
    let (own, samples) = (surface(&scenes.hand), &scenes.samples);
    let within = move || project_within(&own, samples, REACH);
    to.contact.add(NAME, within, |found| distances_within(samples, &found, REACH));

    let tetrahedron = &scenes.tetrahedron;
    for (name, own) in [(NAME, solid(&tetrahedron.mesh)), (UNORIENTED, surface(&tetrahedron.mesh))]
    {
        let signs = |found: Vec<PointProjection>| {
            found.iter().map(|found| if found.is_inside { -1.0 } else { 1.0 }).collect()
        };
        to.sign.add(name, move || project(&own, &tetrahedron.points), signs);
    }

    let points = &scenes.lattice.points;
    let own = solid(&scenes.body);
    to.grid.add(NAME, move || project(&own, points), |found| distances(points, &found));
}

/// For distances without a sign.
fn surface(mesh: &TriMesh) -> shape::TriMesh {
    with_flags(mesh, TriMeshFlags::empty())
}

/// For distances with a sign.
fn solid(mesh: &TriMesh) -> shape::TriMesh {
    with_flags(mesh, TriMeshFlags::ORIENTED)
}

pub(super) fn with_flags(mesh: &TriMesh, flags: TriMeshFlags) -> shape::TriMesh {
    let vertices = mesh.vertices.iter().map(vector).collect();
    shape::TriMesh::with_flags(vertices, mesh.faces.clone(), flags).expect("a sound mesh")
}

#[allow(clippy::unnecessary_cast)] // Not in single precision.
fn vector(point: &Point3<f64>) -> Vector {
    Vector::new(point.x as Real, point.y as Real, point.z as Real)
}

fn project(own: &shape::TriMesh, points: &[Point3<f64>]) -> Vec<PointProjection> {
    points.iter().map(|p| own.project_local_point(vector(p), false)).collect()
}

#[allow(clippy::unnecessary_cast)] // Not in single precision.
fn project_within(
    own: &shape::TriMesh,
    points: &[Point3<f64>],
    reach: f64,
) -> Vec<Option<PointProjection>> {
    let within = |p| own.project_local_point_with_max_dist(vector(p), false, reach as Real);
    points.iter().map(within).collect()
}

#[allow(clippy::unnecessary_cast)] // Not in single precision.
fn distance(point: &Point3<f64>, found: &PointProjection) -> f64 {
    let [x, y, z] = found.point.to_array().map(|x| x as f64);
    let distance = nalgebra::distance(point, &Point3::new(x, y, z));
    if found.is_inside { -distance } else { distance }
}

fn distances(points: &[Point3<f64>], found: &[PointProjection]) -> Vec<f64> {
    points.iter().zip(found).map(|(p, found)| distance(p, found)).collect()
}

fn distances_within(
    points: &[Point3<f64>],
    found: &[Option<PointProjection>],
    reach: f64,
) -> Vec<f64> {
    let within = |(p, found): (_, &Option<_>)| found.as_ref().map_or(reach, |f| distance(p, f));
    points.iter().zip(found).map(within).collect()
}
