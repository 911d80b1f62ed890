//! Shapes of a model's geoms.

use std::sync::Arc;

use nalgebra::Isometry3;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::shape::{
    Ball, Capsule, Compound, ConvexPolyhedron, Cuboid, Cylinder, HalfSpace, SharedShape,
};
use prehend_geometry::mjcf::{
    Geom, HeightField as Terrain, Model as MjcfModel, Shape as MjcfShape,
};
use prehend_geometry::sdf::HeightSpline;

use super::{MjcfError, MjcfOptions, MjcfRobot};
use crate::fields::{HalfSpace as Below, Placed};
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::body::Body;
use crate::shape::Shape;
use crate::shape::error::ShapeError;
use crate::shape::height_field::HeightField;
use crate::shape::options::ShapeOptions;

/// Corners of an ellipsoid's hull along each angle.
const ELLIPSOID: usize = 12;

impl Model {
    /// Gives the robot's bodies the shapes of their geoms that collide, and adds the fixed ones of the file's world, which it returns.
    pub(super) fn add_shapes(
        &mut self,
        mjcf: &MjcfModel,
        robot: &MjcfRobot,
        options: &MjcfOptions,
    ) -> Result<Vec<BodyId>, MjcfError> {
        // Bodies of the same geoms share their shape.
        let mut made: Vec<(&[Geom], Option<Shape>)> = Vec::new();
        for (body, id) in mjcf.bodies.iter().zip(&robot.bodies) {
            let wrong = |error| MjcfError::Shape { body: body.name.clone(), error };
            let known = made.iter().find(|(geoms, _)| same(geoms, &body.geoms));
            let shape = match known {
                Some((_, shape)) => shape.clone(),
                None => {
                    let new = shape(&body.geoms, &options.shape_options).map_err(wrong)?;
                    made.push((&body.geoms, new.clone()));
                    new
                }
            };
            if let Some(shape) = shape {
                let own = &mut self.bodies[*id];
                own.surface = shape.surface().cloned();
                own.field = Some(shape.field().clone());
            }
        }
        let mut fixed = Vec::new();
        for geom in mjcf.world_geoms.iter().filter(|geom| geom.collides()) {
            let wrong = |error| MjcfError::Shape { body: geom.name.clone(), error };
            let shape = match geom.shape {
                MjcfShape::Plane { .. } => {
                    let turned = options.t_world_mjcf.rotation * geom.t_body_geom.rotation;
                    let normal = turned * nalgebra::Vector3::z();
                    let place = options.t_world_mjcf * geom.t_body_geom.translation.vector;
                    let field = Below {
                        normal: nalgebra::Unit::new_normalize(normal),
                        height: normal.dot(&place),
                    };
                    let body = Body::fixed(&geom.name);
                    fixed.push(self.add(body.with_field(Arc::new(field))));
                    continue;
                }
                MjcfShape::HeightField(ref terrain) => {
                    let field = ground(terrain).ok_or(ShapeError::Heights).map_err(wrong)?;
                    let pose = options.t_world_mjcf * geom.t_body_geom * field.pose;
                    let body = Body::fixed(&geom.name);
                    fixed.push(self.add(body.with_field(Arc::new(Placed { pose, ..field }))));
                    continue;
                }
                _ => {
                    let t_body_geom = options.t_world_mjcf * geom.t_body_geom;
                    let placed = Geom { t_body_geom, ..geom.clone() };
                    shape(std::slice::from_ref(&placed), &options.shape_options).map_err(wrong)?
                }
            };
            if let Some(shape) = shape {
                fixed.push(self.add(Body::fixed_from_shape(&geom.name, &shape)));
            }
        }
        Ok(fixed)
    }
}

/// Shape of the colliding geoms of a body; `None` if there are none.
fn shape(geoms: &[Geom], options: &ShapeOptions) -> Result<Option<Shape>, ShapeError> {
    let mut parts = Vec::new();
    for geom in geoms.iter().filter(|geom| touches(geom)) {
        let (shape, t_geom_shape) = part(&geom.shape)?;
        parts.push((pose(&(geom.t_body_geom * t_geom_shape)), shape));
    }
    if parts.is_empty() {
        return Ok(None);
    }
    Ok(Some(Shape::from_parry_with(&Compound::new(parts), options)?))
}

/// True if geoms that collide are of the same shapes at the same places.
fn same(a: &[Geom], b: &[Geom]) -> bool {
    let touching = |geoms: &[Geom]| geoms.iter().filter(|geom| touches(geom)).count();
    let pairs = || a.iter().filter(|g| touches(g)).zip(b.iter().filter(|g| touches(g)));
    let is_same = |(a, b): (&Geom, &Geom)| a.t_body_geom == b.t_body_geom && a.shape == b.shape;
    touching(a) == touching(b) && pairs().all(is_same)
}

/// Terrain in the frame of its geom: it goes on beyond its border, and has no end below.
fn ground(terrain: &Terrain) -> Option<Placed<HeightField>> {
    let ([columns, rows], [x, y]) = (terrain.counts, terrain.half_extents);
    // The field is above x and z: z is against y.
    let column = |i| (0..rows).rev().map(move |row| terrain.heights[row * columns + i]);
    let heights: Vec<f64> = (0..columns).flat_map(column).collect();
    let spacing = [2.0 * x / (columns - 1) as f64, 2.0 * y / (rows - 1) as f64];
    let spline = HeightSpline::new(&heights, [columns, rows], [-x, -y], spacing)?;
    Some(Placed { field: HeightField::new(spline), pose: upright() })
}

/// The frame of shapes about the y axis, in one of shapes about z.
fn upright() -> Isometry3<f64> {
    Isometry3::rotation(nalgebra::Vector3::x() * std::f64::consts::FRAC_PI_2)
}

/// True if a geom of a body collides and has a shape there: terrain has none.
fn touches(geom: &Geom) -> bool {
    geom.collides() && !is_terrain(geom)
}

pub(super) fn is_terrain(geom: &Geom) -> bool {
    matches!(geom.shape, MjcfShape::HeightField(_))
}

/// The shape of parry, whose round ones are about y, and where it is in the geom's frame.
fn part(shape: &MjcfShape) -> Result<(SharedShape, Isometry3<f64>), ShapeError> {
    let vector = |v: &nalgebra::Vector3<f64>| Vector::new(v.x, v.y, v.z);
    let hull =
        |points: &[Vector]| ConvexPolyhedron::from_convex_hull(points).ok_or(ShapeError::NotConvex);
    let own = Isometry3::identity();
    Ok(match shape {
        MjcfShape::Plane { .. } => {
            (SharedShape::new(HalfSpace::new(Vector::new(0.0, 0.0, 1.0))), own)
        }
        MjcfShape::Sphere { radius } => (SharedShape::new(Ball::new(*radius)), own),
        MjcfShape::Capsule { radius, half_length } => {
            (SharedShape::new(Capsule::new_y(*half_length, *radius)), upright())
        }
        MjcfShape::Cylinder { radius, half_length } => {
            (SharedShape::new(Cylinder::new(*half_length, *radius)), upright())
        }
        MjcfShape::Ellipsoid { radii } => (SharedShape::new(hull(&ellipsoid(radii))?), own),
        MjcfShape::Box { half_extents } => {
            (SharedShape::new(Cuboid::new(vector(half_extents))), own)
        }
        // Refused before.
        MjcfShape::HeightField(_) => return Err(ShapeError::NotConvex),
        MjcfShape::Mesh(mesh) => {
            let points: Vec<Vector> = mesh.vertices.iter().map(|p| vector(&p.coords)).collect();
            (SharedShape::new(hull(&points)?), own)
        }
    })
}

fn ellipsoid(radii: &nalgebra::Vector3<f64>) -> Vec<Vector> {
    let mut points = Vec::new();
    for i in 0..=ELLIPSOID {
        let polar = std::f64::consts::PI * i as f64 / ELLIPSOID as f64;
        for j in 0..2 * ELLIPSOID {
            let around = std::f64::consts::PI * j as f64 / ELLIPSOID as f64;
            let (ring, height) = polar.sin_cos();
            let (y, x) = around.sin_cos();
            points.push(Vector::new(radii.x * ring * x, radii.y * ring * y, radii.z * height));
        }
    }
    points
}

fn pose(pose: &Isometry3<f64>) -> Pose {
    let (t, r) = (pose.translation.vector, pose.rotation);
    Pose::from_parts(
        Vector::new(t.x, t.y, t.z),
        parry3d_f64::math::Rotation::from_xyzw(r.i, r.j, r.k, r.w),
    )
}
