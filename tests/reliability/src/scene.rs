//! Simulated models.

use std::sync::Arc;

use anyhow::Result;
use nalgebra::{Matrix3, Point3, Vector3};
use prehend_geometry::shapes;
use prehend_sim::fields::HalfSpace;
use prehend_sim::{
    Body, ContactBodies, Coulomb, GapSmoothing, KelvinVoigt, Law, Model, RigidBody, Surface,
};

/// A floor and, as the second body, a box with round edges of so many segments, half of which squared are its contact points.
///
/// # Errors
/// If there is no such box.
pub fn body_over_floor(segments: usize) -> Result<Model> {
    let mesh = shapes::superellipsoid([0.04, 0.03, 0.05], [0.8, 0.8], segments);
    let rigid = RigidBody::new(0.2, Matrix3::identity() * 2e-4, Point3::origin())?;
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let field = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
    let surface = Surface::uniform(&mesh.vertices, mesh.area())?;
    let samples = model.add(Body::dynamic("box", rigid).with_surface(surface));
    let spring = KelvinVoigt { stiffness: 2e6, damping: 1e3 };
    let law = Law::new(spring, Coulomb { friction: 0.4, slip_scale: 5e-2 })?;
    let smoothing = GapSmoothing::Softplus { width: 5e-4 };
    model.add_contact(ContactBodies { samples, field }, Arc::new(law), smoothing)?;
    Ok(model)
}
