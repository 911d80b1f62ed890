//! A law at one contact.

use prehend::nalgebra::Vector3;
use prehend::sim::{ContactForce, ContactKinematics, DynContactLaw};

/// Depth at which laws are tried \[m\].
pub(crate) const DEPTH: f64 = 5e-4;
/// Area of the contact at which they are \[m²\].
pub(crate) const AREA: f64 = 4e-4;

/// A law at one contact.
pub(crate) struct PointContact<'a> {
    pub(crate) law: &'a dyn DynContactLaw,
}

impl PointContact<'_> {
    /// The force `depth` \[m\] deep, at a normal speed and a slip \[m/s\].
    pub(crate) fn force(
        &self,
        depth: f64,
        normal_speed: f64,
        slip: Vector3<f64>,
    ) -> ContactForce<f64> {
        let (gap, normal) = (self.law.cutoff() - depth, Vector3::z());
        let contact = ContactKinematics { gap, normal_speed, slip, normal, area: AREA };
        match depth > 0.0 {
            true => self.law.force(self.law.params(), &contact),
            false => ContactForce::zero(),
        }
    }
}
