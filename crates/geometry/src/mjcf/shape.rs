//! The shapes of geoms.

use std::sync::Arc;

use nalgebra::Vector3;

use super::height_field::HeightField;
use crate::mesh::TriMesh;

/// A shape in its own frame; round ones are about the z axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// The half space below z = 0.
    Plane {
        /// Half of what is drawn of it along x and y \[m\]; zero is without end. As an obstacle it has none.
        half_extents: [f64; 2],
    },
    /// A ball.
    Sphere {
        /// \[m\]
        radius: f64,
    },
    /// A cylinder between two half balls.
    Capsule {
        /// \[m\]
        radius: f64,
        /// Half the distance between the centers of the half balls \[m\].
        half_length: f64,
    },
    /// A cylinder.
    Cylinder {
        /// \[m\]
        radius: f64,
        /// \[m\]
        half_length: f64,
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Half of its extents along x, y and z \[m\].
        radii: Vector3<f64>,
    },
    /// A box.
    Box {
        /// Half of its extents along x, y and z \[m\].
        half_extents: Vector3<f64>,
    },
    /// A mesh, scaled to meters, of positions and faces alone. The geoms that show it share it.
    Mesh(Arc<TriMesh>),
    /// Terrain.
    HeightField(Arc<HeightField>),
}

/// Kind of a shape: the `type` of a geom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Plane,
    Sphere,
    Capsule,
    Cylinder,
    Ellipsoid,
    Box,
    Mesh,
    HeightField,
}

impl Kind {
    pub(super) const WORDS: [(&str, Self); 9] = [
        ("plane", Self::Plane),
        ("sphere", Self::Sphere),
        ("capsule", Self::Capsule),
        ("cylinder", Self::Cylinder),
        ("ellipsoid", Self::Ellipsoid),
        ("box", Self::Box),
        ("mesh", Self::Mesh),
        ("hfield", Self::HeightField),
        // The distance field of a mesh.
        ("sdf", Self::Mesh),
    ];

    /// The shape of these sizes, which has no mesh; `None` where one of the sizes that it needs is not positive.
    pub(super) fn of_size(self, [a, b, c]: [f64; 3]) -> Option<Shape> {
        let (needed, shape) = match self {
            Self::Plane => (0, Shape::Plane { half_extents: [a.max(0.0), b.max(0.0)] }),
            Self::Sphere => (1, Shape::Sphere { radius: a }),
            Self::Capsule => (2, Shape::Capsule { radius: a, half_length: b }),
            Self::Cylinder => (2, Shape::Cylinder { radius: a, half_length: b }),
            Self::Ellipsoid => (3, Shape::Ellipsoid { radii: Vector3::new(a, b, c) }),
            Self::Box => (3, Shape::Box { half_extents: Vector3::new(a, b, c) }),
            Self::Mesh | Self::HeightField => return None,
        };
        [a, b, c].iter().take(needed).all(|&x| x > 0.0).then_some(shape)
    }

    /// Whether two ends can say where it is.
    pub(super) fn has_ends(self) -> bool {
        matches!(self, Self::Capsule | Self::Cylinder | Self::Ellipsoid | Self::Box)
    }
}
