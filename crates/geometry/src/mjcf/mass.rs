//! Volumes and inertias of shapes, solid or hollow.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Point3, Vector3};

use super::shape::Shape;
use crate::inertial::Inertial;

/// A shape at 1 kg/m³, or, as a shell, at 1 kg/m², in its own frame; `None` of planes and meshes.
///
/// The area of an ellipsoid is K. Thomsen's approximation with p = 1.6075, off by at most 1.1 %; the inertia of its
/// shell is that of the layer between two ellipsoids of which the outer is wider by the same length everywhere along the
/// axes.
pub(super) fn of_unit_density(shape: &Shape, shell: bool) -> Option<Inertial> {
    let (mass, squares) = match *shape {
        Shape::Plane { .. } | Shape::Mesh(_) => return None,
        // As MuJoCo has it: a box of half the greatest height around the origin.
        Shape::HeightField(ref field) => {
            let [x, y] = field.half_extents;
            let half_extents = Vector3::new(x, y, 0.25 * field.height + 0.5 * field.base);
            return of_unit_density(&Shape::Box { half_extents }, shell);
        }
        Shape::Sphere { radius: r } => ball(r, shell),
        Shape::Capsule { radius: r, half_length: h } => {
            // A tube, and two half balls moved apart by h along z: their centers are 3/8 r beyond, of shells r/2.
            let (ends, inside) = ball(r, shell);
            let (tube, around) = tube(r, h, shell);
            let center = if shell { 0.5 } else { 0.375 } * r;
            let apart = ends * (h * h + 2.0 * h * center);
            (ends + tube, inside + around + Vector3::z() * apart)
        }
        Shape::Cylinder { radius: r, half_length: h } => {
            let (side, around) = tube(r, h, shell);
            if shell {
                let disks = 2.0 * PI * r * r;
                let along = 0.25 * disks * r * r;
                (side + disks, around + Vector3::new(along, along, disks * h * h))
            } else {
                (side, around)
            }
        }
        Shape::Ellipsoid { radii } if shell => ellipsoid_shell(radii),
        Shape::Ellipsoid { radii } => ellipsoid(radii),
        Shape::Box { half_extents: half } if shell => {
            let mut sum = (0.0, Vector3::zeros());
            for k in 0..3 {
                // Two faces across axis k.
                let faces = 8.0 * half[(k + 1) % 3] * half[(k + 2) % 3];
                let mut squares = half.component_mul(&half) / 3.0;
                squares[k] *= 3.0;
                sum = (sum.0 + faces, sum.1 + squares * faces);
            }
            sum
        }
        Shape::Box { half_extents: half } => {
            let volume = 8.0 * half.product();
            (volume, half.component_mul(&half) * (volume / 3.0))
        }
    };
    let inertia = Matrix3::from_diagonal(&squares.map(|s| squares.sum() - s));
    Some(Inertial { mass, com: Point3::origin(), inertia })
}

/// Mass and second moments ∫x², ∫y², ∫z² of a ball.
fn ball(r: f64, shell: bool) -> (f64, Vector3<f64>) {
    if shell {
        let area = 4.0 * PI * r * r;
        return (area, Vector3::repeat(area * r * r / 3.0));
    }
    ellipsoid(Vector3::repeat(r))
}

/// A cylinder, as a shell without its ends.
fn tube(r: f64, h: f64, shell: bool) -> (f64, Vector3<f64>) {
    let (mass, across) = if shell { (4.0 * PI * r * h, 0.5) } else { (2.0 * PI * r * r * h, 0.25) };
    let across = mass * across * r * r;
    (mass, Vector3::new(across, across, mass * h * h / 3.0))
}

fn ellipsoid(radii: Vector3<f64>) -> (f64, Vector3<f64>) {
    let volume = 4.0 / 3.0 * PI * radii.product();
    (volume, radii.component_mul(&radii) * (0.2 * volume))
}

fn ellipsoid_shell(radii: Vector3<f64>) -> (f64, Vector3<f64>) {
    const POWER: f64 = 1.6075;
    let [a, b, c] = [0, 1, 2].map(|k| (radii[(k + 1) % 3] * radii[(k + 2) % 3]).powf(POWER));
    let area = 4.0 * PI * ((a + b + c) / 3.0).powf(1.0 / POWER);
    // Derivatives of volume and second moments by the thickness of the layer.
    let volume = 4.0 / 3.0 * PI * radii.product();
    let slope = volume * radii.map(|r| 1.0 / r).sum();
    let squares = radii.map(|r| 0.2 * (slope * r * r + 2.0 * volume * r));
    (area, squares * (area / slope))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mass::mass_properties;
    use crate::shapes;

    fn solid(shape: &Shape) -> Inertial {
        of_unit_density(shape, false).unwrap()
    }

    #[test]
    fn solids_are_what_their_meshes_are() {
        let half_extents = Vector3::new(0.1, 0.2, 0.3);
        for (shape, mesh) in [
            (Shape::Box { half_extents }, shapes::cuboid(half_extents * 2.0)),
            (Shape::Sphere { radius: 0.3 }, shapes::sphere(0.3, 400)),
            (Shape::Capsule { radius: 0.1, half_length: 0.3 }, shapes::capsule(0.1, 0.3, 400, 100)),
            (Shape::Cylinder { radius: 0.1, half_length: 0.3 }, shapes::cylinder(0.1, 0.6, 400)),
        ] {
            let (found, expected) = (solid(&shape), mass_properties(&mesh.welded(), 1.0).unwrap());
            assert!((found.mass / expected.mass - 1.0).abs() < 3e-4, "{shape:?}");
            assert!(
                (found.inertia - expected.inertia).norm() < 6e-4 * found.inertia.norm(),
                "{shape:?}"
            );
        }
    }

    #[test]
    fn shells_are_thin_layers() {
        // What a layer of thickness t adds to the solid, over t.
        let t = 1e-6;
        let layer = |inner: Shape, outer: Shape| {
            let (inner, outer) = (solid(&inner), solid(&outer));
            ((outer.mass - inner.mass) / t, (outer.inertia - inner.inertia) / t)
        };
        let (r, h) = (0.1, 0.3);
        let half_extents = Vector3::new(0.1, 0.2, 0.3);
        let thick = half_extents.add_scalar(t);
        for (inner, outer) in [
            (Shape::Sphere { radius: r }, Shape::Sphere { radius: r + t }),
            (
                Shape::Capsule { radius: r, half_length: h },
                Shape::Capsule { radius: r + t, half_length: h },
            ),
            (
                Shape::Cylinder { radius: r, half_length: h },
                Shape::Cylinder { radius: r + t, half_length: h + t },
            ),
            (Shape::Box { half_extents }, Shape::Box { half_extents: thick }),
        ] {
            let shell = of_unit_density(&inner, true).unwrap();
            let (mass, inertia) = layer(inner.clone(), outer);
            assert!((shell.mass / mass - 1.0).abs() < 1e-4, "{inner:?}");
            assert!((shell.inertia - inertia).norm() < 1e-4 * inertia.norm(), "{inner:?}");
        }
        // An ellipsoid that is a ball.
        let (ball, round) =
            (Shape::Sphere { radius: r }, Shape::Ellipsoid { radii: Vector3::repeat(r) });
        let [ball, round] = [ball, round].map(|s| of_unit_density(&s, true).unwrap());
        assert!((ball.mass - round.mass).abs() < 1e-12);
        assert!((ball.inertia - round.inertia).norm() < 1e-12);
    }
}
