//! The ways to write an orientation.

use nalgebra::{Isometry3, Quaternion, Rotation3, Unit, UnitQuaternion, Vector3};

use super::compiler::Compiler;
use super::element::Element;
use super::error::Result;

/// Shorter vectors have no direction.
const SHORTEST: f64 = 1e-14;

const FORMS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// The orientation that `e` gives, in any of its forms; `None` where it gives none.
pub(super) fn read(e: &Element, compiler: &Compiler) -> Result<Option<UnitQuaternion<f64>>> {
    let mut given = FORMS.into_iter().filter(|form| e.has(form));
    let Some(form) = given.next() else { return Ok(None) };
    if let Some(other) = given.next() {
        return Err(e.invalid(other, format!("is given beside {form}: one orientation too many")));
    }
    let direction = |x: &[f64]| {
        let vector = Vector3::new(x[0], x[1], x[2]);
        Unit::try_new(vector, SHORTEST).ok_or_else(|| e.invalid(form, "must not be zero"))
    };
    // Each form is asked for by name, and only the one that is there answers.
    let rotation = if let Some(q) = e.numbers::<4>("quat")? {
        quaternion_wxyz(q).ok_or_else(|| e.invalid("quat", "must not be zero"))?
    } else if let Some(a) = e.numbers::<4>("axisangle")? {
        UnitQuaternion::from_axis_angle(&direction(&a)?, compiler.angle(a[3]))
    } else if let Some(angles) = e.numbers::<3>("euler")? {
        euler(compiler, angles)
    } else if let Some(a) = e.numbers::<6>("xyaxes")? {
        let x = direction(&a)?;
        let y = Vector3::new(a[3], a[4], a[5]);
        let y = Unit::try_new(y - *x * x.dot(&y), SHORTEST)
            .ok_or_else(|| e.invalid("xyaxes", "must not be parallel"))?;
        let basis = Rotation3::from_basis_unchecked(&[*x, *y, x.cross(&y)]);
        UnitQuaternion::from_rotation_matrix(&basis)
    } else if let Some(z) = e.numbers::<3>("zaxis")? {
        from_z(&direction(&z)?)
    } else {
        return Ok(None);
    };
    Ok(Some(rotation))
}

/// The pose of `pos` and whatever orientation `e` gives.
pub(super) fn pose(e: &Element, compiler: &Compiler) -> Result<Isometry3<f64>> {
    let [x, y, z] = e.numbers("pos")?.unwrap_or_default();
    let rotation = read(e, compiler)?.unwrap_or_default();
    Ok(Isometry3::from_parts(Vector3::new(x, y, z).into(), rotation))
}

/// A quaternion of any length; `None` of none.
pub(super) fn quaternion_wxyz([w, x, y, z]: [f64; 4]) -> Option<UnitQuaternion<f64>> {
    UnitQuaternion::try_new(Quaternion::new(w, x, y, z), SHORTEST)
}

/// The shortest rotation that brings the z axis to `direction`; about x where there are many.
pub(super) fn from_z(direction: &Unit<Vector3<f64>>) -> UnitQuaternion<f64> {
    let across = Vector3::z().cross(direction);
    let axis = Unit::try_new(across, 1e-10).unwrap_or(Vector3::x_axis());
    UnitQuaternion::from_axis_angle(&axis, across.norm().atan2(direction.z))
}

/// The frame in the middle between the two points of a `fromto` attribute, whose z axis leads from the second to the
/// first, and half their distance \[m\]; `None` where they are one.
pub(super) fn between([a, b, c, d, e, f]: [f64; 6]) -> Option<(Isometry3<f64>, f64)> {
    let (from, to) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
    let axis = Unit::try_new(from - to, SHORTEST)?;
    let frame = Isometry3::from_parts((0.5 * (from + to)).into(), from_z(&axis));
    Some((frame, 0.5 * (from - to).norm()))
}

fn euler(compiler: &Compiler, angles: [f64; 3]) -> UnitQuaternion<f64> {
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let turns = compiler.euler.iter().zip(angles);
    turns.fold(UnitQuaternion::identity(), |q, (&(axis, fixed), angle)| {
        let turn = UnitQuaternion::from_axis_angle(&axes[axis], compiler.angle(angle));
        if fixed { turn * q } else { q * turn }
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

    use super::super::source;
    use super::*;

    fn orientation(compiler: &str, attributes: &str) -> Result<UnitQuaternion<f64>, String> {
        let xml = format!("<mujoco><compiler {compiler}/><body name=\"b\" {attributes}/></mujoco>");
        let root = source::parse(&xml, None, None).unwrap();
        let compiler = Compiler::read(&root).unwrap();
        let body = root.sections("body").next().unwrap();
        read(body, &compiler).map(|q| q.unwrap_or_default()).map_err(|e| e.to_string())
    }

    fn same(attributes: &str, expected: UnitQuaternion<f64>) {
        for (compiler, attributes) in [
            ("", attributes.to_owned()),
            ("angle=\"radian\"", attributes.replace("90", "1.5707963267948966")),
        ] {
            let found = orientation(compiler, &attributes).unwrap();
            assert!(found.angle_to(&expected) < 1e-12, "{attributes}: {found} {expected}");
        }
    }

    #[test]
    fn every_form_against_its_closed_form() {
        let about = |axis: Vector3<f64>, angle: f64| UnitQuaternion::new(axis.normalize() * angle);
        same("", UnitQuaternion::identity());
        same("quat=\"2 0 0 2\"", about(Vector3::z(), FRAC_PI_2));
        same("axisangle=\"0 -3 0 90\"", about(Vector3::y(), -FRAC_PI_2));
        same("xyaxes=\"0 2 0 -1 7 0\"", about(Vector3::z(), FRAC_PI_2));
        same("zaxis=\"1 0 0\"", about(Vector3::y(), FRAC_PI_2));
        same("zaxis=\"1 0 1\"", about(Vector3::y(), 0.5 * FRAC_PI_2));
        same("zaxis=\"0 0 2\"", UnitQuaternion::identity());
        same("zaxis=\"0 0 -1\"", about(Vector3::x(), 2.0 * FRAC_PI_2));
        // First about x, then about the y that has turned with it: x goes to -z, and that is turned to y.
        same("euler=\"90 90 0\"", about(Vector3::x(), FRAC_PI_2) * about(Vector3::y(), FRAC_PI_2));
    }

    #[test]
    fn capital_letters_are_axes_that_stay() {
        let about =
            |axis: Vector3<f64>, degrees: f64| UnitQuaternion::new(axis * degrees.to_radians());
        let (x, y) = (about(Vector3::x(), 20.0), about(Vector3::y(), 30.0));
        let z = about(Vector3::z(), 10.0);
        let check = |sequence: &str, expected: UnitQuaternion<f64>| {
            let found = orientation(&format!("eulerseq=\"{sequence}\""), "euler=\"10 20 30\"");
            assert!(found.unwrap().angle_to(&expected) < 1e-12, "{sequence}");
        };
        check("zxy", z * x * y);
        check("ZXY", y * x * z);
        check("ZxY", y * (z * x));
        let q = orientation("eulerseq=\"xyz\"", "euler=\"0 0 90\"").unwrap();
        assert!((q.k - FRAC_1_SQRT_2).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_orientation_is_named() {
        for (attributes, part) in [
            ("quat=\"0 0 0 0\"", "line 1: body 'b': quat must not be zero"),
            ("quat=\"1 0 0\"", "body 'b': quat must have 4 numbers, not 3"),
            ("axisangle=\"0 0 0 1\"", "axisangle must not be zero"),
            ("xyaxes=\"1 0 0 2 0 0\"", "xyaxes must not be parallel"),
            ("zaxis=\"0 0 0\"", "zaxis must not be zero"),
            ("euler=\"0 nan 0\"", "euler has 'nan', which is no number"),
            ("euler=\"0 0 0 1\"", "euler has more than 3 numbers"),
            ("quat=\"1 0 0 0\" zaxis=\"0 0 1\"", "zaxis is given beside quat"),
        ] {
            let error = orientation("", attributes).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
