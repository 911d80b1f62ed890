//! Meshes that touch meshes.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::shape::Cuboid;
use prehend_geometry::TriMesh;
use prehend_geometry::shapes::{Mug, cuboid};
use prehend_sim::contact::Bounce;
use prehend_sim::{
    Body, BodyId, BodyState, ContactCalibration, Coulomb, GapSmoothing, HuntCrossley, Law, Model,
    Shape, ShapeOptions, State,
};

use super::meshes::{ROD, Thread, bolt, hook, nut};

/// A body that moves, what it touches, and how long it is looked at.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) model: Model,
    pub(crate) start: State,
    /// Meshes of the bodies.
    #[allow(dead_code)] // the example mesh_contacts draws them
    pub(crate) meshes: [TriMesh; 2],
    /// The body that is started.
    pub(crate) moving: BodyId,
    /// A dimension of its shape, if it has any.
    pub(crate) dimension: Option<&'static str>,
    /// How long \[s\].
    pub(crate) time: f64,
    /// A point of the moving body, from its center of mass \[m\]: where it is in the end is looked at.
    pub(crate) mark: Vector3<f64>,
}

/// How finely meshes are sampled \[m\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lengths {
    pub(crate) spacing: f64,
    pub(crate) cell: f64,
}

impl Lengths {
    fn options(self) -> ShapeOptions {
        let Self { spacing, cell } = self;
        ShapeOptions { spacing: Some(spacing), cell: Some(cell), rounding: None }
    }
}

/// The shape of a mesh.
pub(crate) fn shape(mesh: &TriMesh, lengths: Lengths) -> anyhow::Result<Shape> {
    let vertices = mesh.vertices.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let mesh = parry3d_f64::shape::TriMesh::new(vertices, mesh.faces.clone())?;
    Ok(Shape::from_parry_with(&mesh, &lengths.options())?)
}

/// Contact law of all scenes, which carries the body `depth` \[m\] deep on `area` \[m²\].
fn law(
    mass: f64,
    area: f64,
    depth: f64,
    friction: f64,
) -> anyhow::Result<Law<HuntCrossley, Coulomb>> {
    let target = ContactCalibration { mass, gravity: 9.81, penetration: depth, contact_area: area };
    let bounce = Bounce { restitution: 0.4, impact_speed: 0.2 };
    let normal = HuntCrossley::from_target(&target, 1.0, bounce)?;
    Ok(Law::new(normal, Coulomb { friction, slip_scale: 1e-2 })?)
}

/// A fixed mesh, and a shape of a density \[kg/m³\] that moves.
struct Pair {
    fixed: (TriMesh, Lengths, Isometry3<f64>),
    moving: (TriMesh, Shape, Isometry3<f64>),
    dimension: Option<&'static str>,
    density: f64,
    /// Area of a contact \[m²\], how deep it is \[m\], and friction coefficient.
    contact: [f64; 3],
    mark: Point3<f64>,
    time: f64,
}

impl Pair {
    fn scene(self, name: &'static str) -> anyhow::Result<Scene> {
        let mut model = Model::new(Vector3::z() * -9.81);
        let (mesh, lengths, pose) = self.fixed;
        let other = model.add(Body::fixed_from_shape("fixed", &shape(&mesh, lengths)?));
        let fixed = BodyState::at_rest(pose);
        let (moving_mesh, shape, pose) = self.moving;
        let meshes = [mesh, moving_mesh];
        let body = Body::from_shape("moving", &shape, self.density)?;
        let rigid = *body.rigid().ok_or_else(|| anyhow::anyhow!("no mass"))?;
        let start = State::new([fixed, rigid.at_rest(&pose)]);
        let moving = model.add(body);
        let [area, depth, friction] = self.contact;
        let law = Arc::new(law(rigid.mass(), area, depth, friction)?);
        let smoothing = GapSmoothing::Softplus { width: 0.05 * depth };
        model.add_symmetric_contact(moving, other, law, smoothing)?;
        let mark = self.mark - rigid.com();
        let Self { dimension, time, .. } = self;
        Ok(Scene { name, model, start, meshes, moving, dimension, time, mark })
    }
}

/// A mug that swings on a hook by its handle.
pub(crate) fn mug_on_hook() -> anyhow::Result<Scene> {
    let mug = Mug::default();
    let mesh = mug.mesh();
    // Mug's x (towards the handle) to +z, its z along y.
    let rotation =
        UnitQuaternion::from_basis_unchecked(&[Vector3::z(), Vector3::x(), Vector3::y()]);
    let rotation = UnitQuaternion::from_euler_angles(0.25, 0.1, 0.1) * rotation;
    let inside = mug.radius + mug.reach - mug.handle;
    let handle = Point3::new(inside, 0.0, 0.5 * mug.height);
    let place = Point3::new(0.03, 0.0, ROD + 1e-3) - rotation * handle.coords;
    Pair {
        fixed: (hook(), Lengths { spacing: 1.5e-3, cell: 1e-3 }, Isometry3::identity()),
        moving: (
            mesh.clone(),
            shape(&mesh, Lengths { spacing: 2e-3, cell: 1.5e-3 })?,
            Isometry3::from_parts(Translation3::from(place.coords), rotation),
        ),
        dimension: None,
        density: 2400.0,
        contact: [1e-5, 2e-4, 0.3],
        mark: Point3::new(-mug.radius, 0.0, 0.5 * mug.height),
        time: 0.1,
    }
    .scene("mug on a hook")
}

/// A bar that falls across another, edge on edge.
pub(crate) fn crossed_bars() -> anyhow::Result<Scene> {
    let half = Vector3::new(0.06, 6e-3, 6e-3);
    let edge_up = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::FRAC_PI_4);
    let across = UnitQuaternion::from_scaled_axis(Vector3::z() * 1.3);
    let lengths = Lengths { spacing: 1.5e-3, cell: 1e-3 };
    let apart = 2.0 * half.y * std::f64::consts::SQRT_2 + 5e-4;
    let tilt = UnitQuaternion::from_euler_angles(0.0, 0.03, 0.0);
    Pair {
        fixed: (cuboid(half), lengths, Isometry3::from_parts(Translation3::identity(), edge_up)),
        moving: (
            cuboid(half),
            Shape::from_parry_with(
                &Cuboid::new(Vector::new(half.x, half.y, half.z)),
                &lengths.options(),
            )?,
            Isometry3::from_parts(Translation3::new(0.004, 0.002, apart), tilt * across * edge_up),
        ),
        dimension: Some("half_extent_z"),
        density: 2700.0,
        contact: [4e-6, 2e-4, 0.3],
        mark: Point3::new(half.x, 0.0, 0.0),
        time: 0.06,
    }
    .scene("crossed bars")
}

/// A nut that turns down a bolt by its weight.
pub(crate) fn nut_on_bolt() -> anyhow::Result<Scene> {
    let thread = Thread { radius: 6e-3, amplitude: 6e-4, pitch: 3e-3, columns: 24, rows: 8 };
    let wide = Thread { radius: thread.radius + 3.5e-4, ..thread };
    let nut = nut(&wide, [-3e-3, 3e-3], 0.022);
    let lengths = Lengths { spacing: 1e-3, cell: 4e-4 };
    Pair {
        fixed: (bolt(&thread, [-0.012, 0.012]), lengths, Isometry3::identity()),
        moving: (nut.clone(), shape(&nut, lengths)?, Isometry3::translation(2e-5, -1e-5, -1e-4)),
        dimension: None,
        density: 7800.0,
        contact: [5e-5, 2e-5, 0.05],
        mark: Point3::new(0.01, 0.0, 0.0),
        time: 0.015,
    }
    .scene("nut on a bolt")
}

/// A scanned object that falls on another one.
pub(crate) fn scans(fixed: &TriMesh, moving: &TriMesh) -> anyhow::Result<Scene> {
    let lengths = Lengths { spacing: 4e-3, cell: 2.5e-3 };
    let top = |mesh: &TriMesh| mesh.vertices.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    let low = |mesh: &TriMesh| mesh.vertices.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let middle = |mesh: &TriMesh| {
        let sum: Vector3<f64> = mesh.vertices.iter().map(|p| p.coords).sum();
        sum / mesh.vertices.len() as f64
    };
    let mut place = middle(fixed) - middle(moving);
    place.z = top(fixed) - low(moving) + 1e-3;
    Pair {
        fixed: (fixed.clone(), lengths, Isometry3::identity()),
        moving: (moving.clone(), shape(moving, lengths)?, Isometry3::from(place)),
        dimension: None,
        density: 500.0,
        contact: [2e-5, 2e-4, 0.3],
        mark: middle(moving).into(),
        time: 0.06,
    }
    .scene("scans")
}
