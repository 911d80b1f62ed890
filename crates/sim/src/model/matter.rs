//! Mass and size of bodies that forces move, alone or as links.

use prehend_autodiff::Scalar;

use super::Model;
use crate::handle::BodyId;

impl<S: Scalar> Model<S> {
    /// Radius of gyration about its own center of mass of a body that forces move, 0 of others \[m\].
    pub(crate) fn gyration_radius(&self, body: BodyId) -> f64 {
        if let Some(rigid) = self.bodies[body].rigid() {
            return rigid.gyration_radius();
        }
        let Ok(link) = self.link(body) else { return 0.0 };
        let square = link.inertia.trace().value() / (2.0 * link.mass.value());
        if square.is_finite() { square.sqrt() } else { 0.0 }
    }

    /// Mass of a body that forces move, without end of others \[kg\].
    pub(crate) fn mass(&self, body: BodyId) -> f64 {
        if let Some(rigid) = self.bodies[body].rigid() {
            return rigid.mass().value();
        }
        self.link(body).map_or(f64::INFINITY, |link| link.mass.value())
    }
}
