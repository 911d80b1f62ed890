//! Contacts between all bodies, by the material of their surfaces.

use std::sync::Arc;

use super::Model;
use crate::contact::calibration::ContactCalibration;
use crate::contact::composite::Law;
use crate::contact::dynamic::DynContactLaw;
use crate::contact::friction::bristle::BristleFriction;
use crate::contact::friction::coulomb::Coulomb;
use crate::contact::gap_smoothing::GapSmoothing;
use crate::contact::normal::kelvin_voigt::KelvinVoigt;
use crate::error::BuildError;
use crate::handle::{BodyId, ContactId};
use crate::surface::Surface;

/// Gravity that stiffness is chosen by where the model has none \[m/s²\].
const GRAVITY: f64 = 9.81;
/// Depth at rest in radii of gyration.
const DEPTH: f64 = 1e-3;
/// Slip speed above which friction is full, in √(g r), r being the radius of gyration.
const SLIP: f64 = 0.015;
/// Deflection of what holds at rest, in depths.
const DEFLECTION: f64 = 5.0;
/// Width over which contact begins, in depths.
const WIDTH: f64 = 0.1;

/// Material of the surfaces of all bodies of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Coefficient of friction.
    pub friction: f64,
    /// Coefficient of restitution, above 0 and at most 1, of impacts that are fast beside √(g δ) for the depth at rest δ.
    pub restitution: f64,
}

impl Default for Material {
    fn default() -> Self {
        Self { friction: 0.5, restitution: 0.2 }
    }
}

impl Model {
    /// Lets all bodies with samples and fields touch each other: with [`KelvinVoigt`] pressure and [`BristleFriction`], which holds what
    /// rests.
    ///
    /// The body with the most weight on its area rests a thousandth of the smallest radius of gyration deep. For other laws see
    /// [`Model::add_contacts_between`].
    ///
    /// ```
    /// use nalgebra::Vector3;
    /// use prehend_autodiff::{Fwd, Scalar};
    /// use prehend_sim::prelude::*;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    /// model.add(Body::fixed_from_shape("floor", &Shape::half_space(Vector3::z_axis())?));
    /// let cube = model.add(Body::from_shape("cube", &Shape::cuboid([0.03; 3])?, 500.0)?); // half extents [m], density [kg/m³]
    /// model.add_contacts(Material::default())?;
    /// let mut start = model.cast::<Fwd<1>>().neutral_state();
    /// start[cube].pose.translation.z = Fwd::constant(0.03);
    /// start[cube].linear.x = Fwd::variable(1.0, 0); // thrown with 1 m/s
    /// let end = model.cast().simulate(&start, 0.5)?[cube].pose.translation.x;
    /// // It slides by v²/2µg, to its derivative v/µg.
    /// assert!((end.value - 0.102).abs() < 2e-3 && (end.derivative[0] - 0.204).abs() < 4e-3, "{end:?}");
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// If no two bodies can touch, or a coefficient is out of its range.
    pub fn add_contacts(&mut self, material: Material) -> Result<ContactId, BuildError> {
        let touches = |id: &BodyId| {
            let body = &self.bodies[*id];
            body.surface.is_some() || body.field.is_some()
        };
        let bodies: Vec<BodyId> = self.body_ids().filter(touches).collect();
        let (law, smoothing) = self.material_law(&bodies, material)?;
        self.add_contacts_between(&bodies, &bodies, law, smoothing)
    }

    /// Law of a material between bodies, by the heaviest beside the area that it rests on and the smallest.
    pub(crate) fn material_law(
        &self,
        bodies: &[BodyId],
        material: Material,
    ) -> Result<(Arc<dyn DynContactLaw>, GapSmoothing), BuildError> {
        let gravity = Some(self.gravity.norm()).filter(|g| *g > 0.0).unwrap_or(GRAVITY);
        let mut target: Option<ContactCalibration> = None;
        let mut size = f64::INFINITY;
        for &id in bodies.iter().filter(|id| self.bodies[**id].feels_forces()) {
            let (mass, radius) = (self.mass(id), self.gyration_radius(id));
            let Some(surface) = &self.bodies[id].surface else { continue };
            if !(mass > 0.0 && mass.is_finite() && radius > 0.0) {
                continue;
            }
            size = size.min(radius);
            let contact_area = bearing_area(surface);
            let own = ContactCalibration { mass, gravity, penetration: DEPTH, contact_area };
            let load = |target: &ContactCalibration| target.mass / target.contact_area;
            if target.is_none_or(|other| load(&other) < load(&own)) {
                target = Some(own);
            }
        }
        let target = target.ok_or(BuildError::NoContacts)?;
        let penetration = DEPTH * size;
        let target = ContactCalibration { penetration, ..target };
        let normal = KelvinVoigt::from_target(&target, material.restitution)?;
        let friction =
            Coulomb { friction: material.friction, slip_scale: SLIP * (gravity * size).sqrt() };
        let friction = BristleFriction { friction, deflection: DEFLECTION * penetration };
        let smoothing = GapSmoothing::Softplus { width: WIDTH * penetration };
        Ok((Arc::new(Law::new(normal, friction)?), smoothing))
    }
}

/// Area that a body rests on \[m²\]: all of a single round sample, else the mean of six faces.
fn bearing_area(surface: &Surface) -> f64 {
    if surface.points().len() == 1 { surface.area() } else { surface.area() / 6.0 }
}
