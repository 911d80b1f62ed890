//! The built-in hand against the reference description beside the project.

use std::path::PathBuf;

use prehend_geometry::hand::{ALLEGRO_XELA_URDF, JOINT_NAMES, Taxel, load_taxels, taxels};
use urdf_rs::{Geometry, Robot as Urdf};

fn hands() -> PathBuf {
    let fallback = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    PathBuf::from(std::env::var("PREHEND_DATA").unwrap_or_else(|_| fallback.into())).join("hands")
}

fn robots() -> (Urdf, Urdf) {
    let ours = urdf_rs::read_from_string(ALLEGRO_XELA_URDF).expect("own URDF");
    (ours, urdf_rs::read_file(hands().join("allegro_xela_right.urdf")).expect("reference URDF"))
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn joints_agree_exactly() {
    let (ours, reference) = robots();
    assert_eq!(ours.joints.len(), reference.joints.len());
    for name in JOINT_NAMES {
        let find =
            |robot: &Urdf| robot.joints.iter().find(|j| j.name == name).cloned().expect(name);
        let (a, b) = (find(&ours), find(&reference));
        assert_eq!((a.parent.link, a.child.link), (b.parent.link, b.child.link), "{name}");
        assert_eq!(
            (a.origin.xyz.0, a.origin.rpy.0, a.axis.xyz.0),
            (b.origin.xyz.0, b.origin.rpy.0, b.axis.xyz.0)
        );
        assert_eq!((a.limit.lower, a.limit.upper), (b.limit.lower, b.limit.upper), "{name}");
    }
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn links_agree_in_mass_and_shape() {
    let numbers = |geometry: &Geometry| match geometry {
        Geometry::Box { size } => size.to_vec(),
        Geometry::Cylinder { radius, length } => vec![*radius, *length],
        Geometry::Sphere { radius } => vec![*radius],
        other => panic!("unexpected {other:?}"),
    };
    let (ours, reference) = robots();
    for (a, b) in ours.links.iter().zip(&reference.links) {
        assert_eq!((&a.name, a.inertial.mass.value), (&b.name, b.inertial.mass.value));
        assert_eq!(a.collision.len(), b.collision.len(), "{}", a.name);
        // The same primitives, in any order.
        for part in &a.collision {
            let same = b.collision.iter().any(|other| {
                let (x, y) = (numbers(&part.geometry), numbers(&other.geometry));
                let centers = part.origin.xyz.iter().zip(other.origin.xyz.iter());
                let sizes = x.iter().zip(&y);
                x.len() == y.len() && centers.chain(sizes).all(|(p, q)| (p - q).abs() < 1e-9)
            });
            assert!(same, "{}: {part:?}", a.name);
        }
        // The reference counts overlaps of box and fingertip once, which matters most in the thumb's last link.
        let close = |x: f64, y: f64| (x - y).abs() < 0.1 * y.abs();
        let (i, j) = (&a.inertial.inertia, &b.inertial.inertia);
        assert!(
            close(i.ixx, j.ixx) && close(i.iyy, j.iyy) && close(i.izz, j.izz),
            "{}: {i:?} {j:?}",
            a.name
        );
    }
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn taxels_agree() {
    let (ours, reference) =
        (taxels(), load_taxels(&hands().join("taxels_368.csv")).expect("reference taxels"));
    assert_eq!(ours.len(), reference.len());
    let is_tip = |t: &Taxel| ["03", "13", "23", "33"].contains(&t.patch.as_str());
    let (mut flat, mut tip, mut angle) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (a, b) in ours.iter().zip(&reference) {
        assert_eq!((a.index, &a.patch, &a.link), (b.index, &b.patch, &b.link));
        let distance = (a.position - b.position).norm();
        if is_tip(a) {
            tip = tip.max(distance);
            angle = angle.max(a.normal.angle(&b.normal).to_degrees());
        } else {
            flat = flat.max(distance);
            assert!((a.normal - b.normal).norm() < 1e-9, "{a:?} {b:?}");
        }
    }
    println!("largest distance: flat {:.4} mm, tips {:.2} mm, {angle:.1}°", 1e3 * flat, 1e3 * tip);
    assert!(flat < 2e-6 && tip < 4.5e-3 && angle < 11.0, "flat {flat} m, tips {tip} m, {angle}°");
}
