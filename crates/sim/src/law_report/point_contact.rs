//! A law at one contact.

use nalgebra::Vector3;

use crate::contact::dynamic::DynContactLaw;
use crate::contact::point::{Contact, Response};

/// Depth at which laws are tried \[m\].
pub(super) const DEPTH: f64 = 5e-4;
/// Area of the contact at which they are \[m²\].
pub(super) const AREA: f64 = 4e-4;

/// A law at one contact.
pub(super) struct PointContact<'a> {
    pub(super) law: &'a dyn DynContactLaw,
}

impl PointContact<'_> {
    /// The force `depth` \[m\] deep, at a normal speed and a slip \[m/s\].
    pub(super) fn response(
        &self,
        depth: f64,
        normal_speed: f64,
        slip: Vector3<f64>,
    ) -> Response<f64> {
        let (gap, normal) = (self.law.reach() - depth, Vector3::z());
        let contact = Contact { gap, normal_speed, slip, normal, area: AREA };
        match depth > 0.0 {
            true => self.law.response(self.law.params(), &contact),
            false => Response::zero(),
        }
    }
}
