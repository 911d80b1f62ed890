//! The `inertial` element of a body, and what the compiler makes of inertias.

use nalgebra::{Matrix3, Vector3};

use super::compiler::Compiler;
use super::element::Element;
use super::error::Result;
use super::orientation;
use crate::inertial::Inertial;

/// Mass and inertia of the `inertial` element of `body`, in its frame; `None` without one, or where both are zero.
pub(super) fn written(body: &Element, compiler: &Compiler) -> Result<Option<Inertial>> {
    let mut all = body.sections("inertial");
    let Some(e) = all.next() else { return Ok(None) };
    if let Some(other) = all.next() {
        return Err(other.misplaced("a body has one inertial element"));
    }
    if !e.has("pos") {
        return Err(e.missing("pos"));
    }
    let mass = e.magnitude("mass")?.ok_or_else(|| e.missing("mass"))?;
    let t_body_inertial = orientation::pose(e, compiler)?;
    let diagonal = e.numbers::<3>("diaginertia")?;
    let full = e.numbers::<6>("fullinertia")?;
    let rotation = t_body_inertial.rotation.to_rotation_matrix();
    let inertia = match (diagonal, full) {
        (Some(_), Some(_)) => return Err(e.invalid("fullinertia", "is given beside diaginertia")),
        (None, Some([xx, yy, zz, xy, xz, yz])) => {
            if rotation.angle() > 0.0 {
                return Err(e.invalid("fullinertia", "is given beside an orientation"));
            }
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        }
        (diagonal, None) => {
            let diagonal = Matrix3::from_diagonal(&Vector3::from(diagonal.unwrap_or_default()));
            rotation.matrix() * diagonal * rotation.matrix().transpose()
        }
    };
    let field = if full.is_some() { "fullinertia" } else { "diaginertia" };
    let [a, b, c] = principal(&inertia);
    if a < -1e-14 * c {
        return Err(e.invalid(field, "must not be negative"));
    }
    if a + b < c * (1.0 - 1e-9) && !compiler.balance {
        e.refuse_attribute(field, "is no body's: two principal moments are less than the third");
    }
    let com = t_body_inertial.translation.vector.into();
    Ok((mass > 0.0 || c > 0.0).then_some(Inertial { mass, com, inertia }))
}

/// Mass \[kg\] and principal moment \[kg m²\] that count as none.
const LEAST: f64 = 1e-15;

/// True if it has a mass and an inertia about each axis.
pub(super) fn resists(inertial: &Inertial) -> bool {
    inertial.mass >= LEAST && principal(&inertial.inertia)[0] >= LEAST
}

/// The principal moments, the least first.
fn principal(inertia: &Matrix3<f64>) -> [f64; 3] {
    let mut moments: [f64; 3] = inertia.symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    moments
}

/// `inertial` within the bounds that the compiler sets.
pub(super) fn bounded(inertial: Option<Inertial>, compiler: &Compiler) -> Option<Inertial> {
    let [least_mass, least_inertia] = compiler.least;
    if least_mass == 0.0 && least_inertia == 0.0 && !compiler.balance {
        return inertial;
    }
    let nothing = Inertial { mass: 0.0, com: Vector3::zeros().into(), inertia: Matrix3::zeros() };
    let Inertial { mass, com, inertia } = inertial.unwrap_or(nothing);
    let mut eigen = inertia.symmetric_eigen();
    eigen.eigenvalues.iter_mut().for_each(|moment| *moment = moment.max(least_inertia));
    let (sum, most) = (eigen.eigenvalues.sum(), eigen.eigenvalues.max());
    if compiler.balance && sum - most < most {
        eigen.eigenvalues.fill(sum / 3.0);
    }
    let mass = mass.max(least_mass);
    (mass > 0.0).then(|| Inertial { mass, com, inertia: eigen.recompose() })
}
