//! A contact law for any scalar, from its derivatives in forward mode.

use nalgebra::Vector3;
use prehend_autodiff::{Fwd, Scalar};

use super::dynamic::DynContactLaw;
use super::point::{ContactForce, ContactKinematics};

/// Derivatives that one evaluation of the law gives.
const LANES: usize = 6;

/// A law with its parameters.
pub(super) struct BristleLaw<'a, T> {
    law: &'a dyn DynContactLaw,
    p: &'a [T],
    values: Vec<f64>,
    constants: Vec<Fwd<LANES>>,
}

impl<'a, T: Scalar> BristleLaw<'a, T> {
    pub(super) fn new(law: &'a dyn DynContactLaw, p: &'a [T]) -> Self {
        let values: Vec<f64> = p.iter().map(|p| p.value()).collect();
        let constants = values.iter().map(|&p| Fwd::constant(p)).collect();
        Self { law, p, values, constants }
    }

    /// The response at `contact`, with its derivatives.
    pub(super) fn force(&self, contact: &ContactKinematics<T>) -> ContactForce<T> {
        let inputs = inputs_of(contact);
        let at = inputs.map(T::value);
        if T::ORDER == 0 {
            let ContactForce { normal, tangential } = self.law.force(&self.values, &contact_of(at));
            return ContactForce {
                normal: T::constant(normal),
                tangential: tangential.map(T::constant),
            };
        }
        let mut sum: Option<[T; 4]> = None;
        let mut add = |response: ContactForce<Fwd<LANES>>, changes: &[T]| {
            let parts = parts_of(&response);
            let sum = sum.get_or_insert(parts.map(|x| T::constant(x.value)));
            for (sum, part) in sum.iter_mut().zip(parts) {
                for (change, slope) in changes.iter().zip(part.derivative) {
                    *sum += change.times(slope);
                }
            }
        };
        let changes = inputs.map(|x| x.plus(-x.value()));
        for from in [0, LANES] {
            let seeded = std::array::from_fn(|i| seed(at[i], i.wrapping_sub(from)));
            let response = self.law.force_with_derivative(&self.constants, &contact_of(seeded));
            add(response, &changes[from..]);
        }
        for from in (0..self.p.len()).step_by(LANES) {
            let changes: Vec<T> = self.p[from..].iter().map(|p| p.plus(-p.value())).collect();
            if changes.iter().take(LANES).all(|x| x.is_constant_zero()) {
                continue;
            }
            let seeded = |(i, &p): (usize, &f64)| seed(p, i.wrapping_sub(from));
            let p: Vec<Fwd<LANES>> = self.values.iter().enumerate().map(seeded).collect();
            let contact = contact_of(at.map(Fwd::constant));
            add(self.law.force_with_derivative(&p, &contact), &changes);
        }
        let [normal, x, y, z] = sum.unwrap_or_default();
        ContactForce { normal, tangential: Vector3::new(x, y, z) }
    }
}

/// A variable in `lane`, or a constant if there is no such lane.
fn seed(value: f64, lane: usize) -> Fwd<LANES> {
    if lane < LANES { Fwd::variable(value, lane) } else { Fwd::constant(value) }
}

fn inputs_of<T: Scalar>(contact: &ContactKinematics<T>) -> [T; 9] {
    let ContactKinematics { gap, normal_speed, slip: s, normal: n, area } = *contact;
    [gap, normal_speed, s.x, s.y, s.z, n.x, n.y, n.z, area]
}

fn contact_of<T: Scalar>(inputs: [T; 9]) -> ContactKinematics<T> {
    let [gap, normal_speed, sx, sy, sz, nx, ny, nz, area] = inputs;
    let (slip, normal) = (Vector3::new(sx, sy, sz), Vector3::new(nx, ny, nz));
    ContactKinematics { gap, normal_speed, slip, normal, area }
}

fn parts_of<T: Scalar>(response: &ContactForce<T>) -> [T; 4] {
    let ContactForce { normal, tangential: t } = *response;
    [normal, t.x, t.y, t.z]
}
