//! Shapes of parry.

use nalgebra::{Isometry3, Point3, Quaternion, Unit, UnitQuaternion, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::shape::{self, HeightFieldCellStatus, TypedShape};
use prehend_geometry::TriMesh;
use prehend_geometry::sdf::HeightSpline;

use super::ball::Ball;
use super::border::Edges;
use super::capsule::Capsule;
use super::compound::{Compound, CompoundPart};
use super::cuboid::RoundCuboid;
use super::error::ShapeError;
use super::ground::Ground;
use super::height_field::HeightField;
use super::kind::ShapeKind;
use super::options::ShapeOptions;
use super::polyhedron::{Polyhedron, flat_faces};
use super::revolved::{Outline, Revolved};
use crate::fields::HalfSpace;

/// Kind and dimensions of a shape.
pub(super) fn read(
    shape: &dyn shape::Shape,
    options: &ShapeOptions,
) -> Result<(ShapeKind, Vec<f64>), ShapeError> {
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => Ok((ShapeKind::Ball(Ball), vec![ball.radius])),
        TypedShape::Cuboid(cuboid) => self::cuboid(cuboid, None, options),
        TypedShape::RoundCuboid(round) => {
            self::cuboid(&round.inner_shape, Some(round.border_radius), options)
        }
        TypedShape::Capsule(capsule) => self::capsule(capsule, options),
        TypedShape::Cylinder(shape::Cylinder { half_height, radius }) => {
            revolved(Outline::Cylinder, [*half_height, *radius], None, options)
        }
        TypedShape::RoundCylinder(round) => {
            let shape::Cylinder { half_height, radius } = round.inner_shape;
            revolved(Outline::Cylinder, [half_height, radius], Some(round.border_radius), options)
        }
        TypedShape::Cone(shape::Cone { half_height, radius }) => {
            revolved(Outline::Cone, [*half_height, *radius], None, options)
        }
        TypedShape::RoundCone(round) => {
            let shape::Cone { half_height, radius } = round.inner_shape;
            revolved(Outline::Cone, [half_height, radius], Some(round.border_radius), options)
        }
        TypedShape::HalfSpace(half_space) => {
            let normal = Unit::try_new(vector(half_space.normal), f64::MIN_POSITIVE)
                .ok_or(ShapeError::Normal)?;
            let field = HalfSpace { normal, height: 0.0 };
            Ok((ShapeKind::Ground(Ground::endless("half-space", field)), Vec::new()))
        }
        TypedShape::HeightField(heights) => height_field(heights),
        TypedShape::ConvexPolyhedron(hull) => polyhedron(hull, None, options),
        TypedShape::RoundConvexPolyhedron(round) => {
            polyhedron(&round.inner_shape, Some(round.border_radius), options)
        }
        TypedShape::TriMesh(mesh) => self::mesh(mesh, options),
        TypedShape::Compound(compound) => self::compound(compound, options),
        _ => Err(ShapeError::Kind { kind: format!("{:?}", shape.shape_type()) }),
    }
}

fn cuboid(
    cuboid: &shape::Cuboid,
    border: Option<f64>,
    options: &ShapeOptions,
) -> Result<(ShapeKind, Vec<f64>), ShapeError> {
    let half = vector(cuboid.half_extents);
    let mut dimensions: Vec<f64> = half.iter().copied().collect();
    let extents = half.map(|half| 2.0 * (half + border.unwrap_or(0.0)));
    let lengths = options.lengths(extents.as_slice())?;
    dimensions.extend(border);
    let border = border.map_or(Edges::Within(lengths.rounding), |_| Edges::Around);
    Ok((ShapeKind::Cuboid(RoundCuboid::new(border, lengths.spacing, &dimensions)), dimensions))
}

fn capsule(
    capsule: &shape::Capsule,
    options: &ShapeOptions,
) -> Result<(ShapeKind, Vec<f64>), ShapeError> {
    let [a, b] = [capsule.segment.a, capsule.segment.b].map(vector);
    let (length, width) = ((b - a).norm(), 2.0 * capsule.radius);
    let lengths = options.lengths(&[length + width, width])?;
    let axis = Unit::try_new(b - a, 0.0).unwrap_or_else(Vector3::y_axis);
    let center = Point3::from((a + b) * 0.5);
    let capsule = Capsule { center, axis, spacing: lengths.spacing };
    Ok((ShapeKind::Capsule(capsule), vec![0.5 * length, 0.5 * width]))
}

fn revolved(
    outline: Outline,
    [half_height, radius]: [f64; 2],
    border: Option<f64>,
    options: &ShapeOptions,
) -> Result<(ShapeKind, Vec<f64>), ShapeError> {
    let extents = [half_height, radius].map(|half| 2.0 * (half + border.unwrap_or(0.0)));
    let lengths = options.lengths(&extents)?;
    let mut dimensions = vec![half_height, radius];
    dimensions.extend(border);
    let border = border.map_or(Edges::Within(lengths.rounding), |_| Edges::Around);
    let solid = Revolved::new(outline, border, lengths.spacing, &dimensions);
    Ok((ShapeKind::Revolved(solid), dimensions))
}

fn height_field(field: &shape::HeightField) -> Result<(ShapeKind, Vec<f64>), ShapeError> {
    let (heights, scale) = (field.heights(), field.scale());
    let removed = HeightFieldCellStatus::LEFT_TRIANGLE_REMOVED
        | HeightFieldCellStatus::RIGHT_TRIANGLE_REMOVED;
    if field.cells_statuses().data().iter().any(|status| status.intersects(removed)) {
        return Err(ShapeError::Kind { kind: "HeightField with holes".to_owned() });
    }
    // Rows along z, columns along x; parry keeps columns together.
    let dims = [heights.ncols(), heights.nrows()];
    let origin = [-0.5 * scale.x, -0.5 * scale.z];
    let spacing = [scale.x / (dims[0] - 1) as f64, scale.z / (dims[1] - 1) as f64];
    let column = |j| (0..dims[1]).map(move |i| heights[(i, j)] * scale.y);
    let all: Vec<f64> = (0..dims[0]).flat_map(column).collect();
    let spline = HeightSpline::new(&all, dims, origin, spacing).ok_or(ShapeError::Heights)?;
    let ground = Ground::endless("height field", HeightField::new(spline));
    Ok((ShapeKind::Ground(ground), Vec::new()))
}

fn polyhedron(
    hull: &shape::ConvexPolyhedron,
    border: Option<f64>,
    options: &ShapeOptions,
) -> Result<(ShapeKind, Vec<f64>), ShapeError> {
    let vertices: Vec<Point3<f64>> = hull.points().iter().map(|p| vector(*p).into()).collect();
    let faces = flat_faces(&vertices).ok_or(ShapeError::NotConvex)?;
    let lengths = options.lengths(extents(&vertices, border.unwrap_or(0.0)).as_slice())?;
    let mut dimensions: Vec<f64> = vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    dimensions.extend(border);
    let border = border.map_or(Edges::Within(lengths.rounding), |_| Edges::Around);
    let vertices = vertices.len();
    let solid = Polyhedron { border, spacing: lengths.spacing, faces, vertices };
    Ok((ShapeKind::Polyhedron(solid), dimensions))
}

fn mesh(
    mesh: &shape::TriMesh,
    options: &ShapeOptions,
) -> Result<(ShapeKind, Vec<f64>), ShapeError> {
    let vertices: Vec<Point3<f64>> = mesh.vertices().iter().map(|p| vector(*p).into()).collect();
    let mesh = TriMesh::new(vertices, mesh.indices().to_vec());
    Ok((ShapeKind::Ground(Ground::mesh(&mesh, options)?), Vec::new()))
}

fn compound(
    compound: &shape::Compound,
    options: &ShapeOptions,
) -> Result<(ShapeKind, Vec<f64>), ShapeError> {
    let (mut parts, mut dimensions) = (Vec::new(), Vec::new());
    for (pose, part) in compound.shapes() {
        let (kind, own) = read(part.as_ref(), options)?;
        let [x, y, z, w] = pose.rotation.to_array();
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let pose = Isometry3::from_parts(vector(pose.translation).into(), rotation);
        parts.push(CompoundPart { pose, kind, dimensions: own.len() });
        dimensions.extend(own);
    }
    Ok((ShapeKind::Compound(Compound { parts }), dimensions))
}

/// Edges of the box around `points`, with a border.
pub(super) fn extents(points: &[Point3<f64>], border: f64) -> Vector3<f64> {
    let [low, high] = points.iter().fold(
        [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)],
        |[low, high], p| [low.inf(&p.coords), high.sup(&p.coords)],
    );
    (high - low).add_scalar(2.0 * border)
}

pub(super) fn vector(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}
