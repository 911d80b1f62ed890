//! Boxes and capsules of the hand's links as its URDF gives them, for tests.

use urdf_rs::Geometry;

use super::ALLEGRO_XELA_URDF;

/// A piece of a link \[m\]; all are boxes but the curved fingertips.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    Box {
        size: [f64; 3],
        center: [f64; 3],
    },
    /// Stands along z.
    Capsule {
        low: [f64; 3],
        high: [f64; 3],
        radius: f64,
    },
}

/// Pieces of the link of that name.
pub(super) fn parts(link: &str) -> Vec<Part> {
    let robot = urdf_rs::read_from_string(ALLEGRO_XELA_URDF).unwrap();
    let link = robot.links.into_iter().find(|l| l.name == link).unwrap();
    let part = |shape: &urdf_rs::Collision| {
        let center = shape.origin.xyz.0;
        match shape.geometry {
            Geometry::Box { size } => Some(Part::Box { size: size.0, center }),
            Geometry::Cylinder { radius, length } => {
                let end = |z| [center[0], center[1], center[2] + z];
                Some(Part::Capsule { low: end(-0.5 * length), high: end(0.5 * length), radius })
            }
            // The ends of the capsules.
            _ => None,
        }
    };
    link.collision.iter().filter_map(part).collect()
}
