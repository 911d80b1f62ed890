//! Why there is no such shape, or no such body of it.

use prehend_geometry::closest::ClosestError;
use prehend_geometry::sdf::SdfError;
use thiserror::Error;

use crate::body::error::BodyError;

/// Why there is no such shape, or no such body of it.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ShapeError {
    /// A kind of shape that has no inside, or is not known.
    #[error("no bodies are made of a {kind}")]
    Kind {
        /// Its kind.
        kind: String,
    },
    /// A dimension is not a positive, finite number, or beyond all measure.
    #[error("{name} of a shape must be from 1e-60 to 1e60 m, is {value} m")]
    Dimension {
        /// Its name.
        name: String,
        /// Its value \[m\].
        value: f64,
    },
    /// Edges are not round, or their rounding leaves nothing of the shape.
    #[error(
        "edges must be round with a radius of less than {limit} m, which leaves something of the shape; it is {radius} m"
    )]
    Rounding {
        /// Its value \[m\].
        radius: f64,
        /// Bound that it has to be less than \[m\].
        limit: f64,
    },
    /// A length among the options is not positive and finite.
    #[error("{name} must be positive and finite, is {value} m")]
    Option {
        /// `rounding`, `spacing` or `cell`.
        name: &'static str,
        /// Its value \[m\].
        value: f64,
    },
    /// A half-space whose normal has no direction.
    #[error("the normal of a half-space must have a direction")]
    Normal,
    /// Corners that are not those of a convex solid.
    #[error("the corners are not those of a convex polyhedron")]
    NotConvex,
    /// Heights that are not finite, or a field without extent.
    #[error("heights must be finite, and the field must extend along both axes")]
    Heights,
    /// Something without a mass can only be a fixed body.
    #[error("a {kind} has no mass: it makes fixed bodies only (Body::fixed_from_shape)")]
    FixedOnly {
        /// Its kind.
        kind: &'static str,
    },
    /// No dimension has this name.
    #[error("the shape has no dimension called \"{name}\": one of {known}")]
    NoDimension {
        /// The name.
        name: String,
        /// Those that there are.
        known: String,
    },
    /// The body is not made of a shape.
    #[error("body '{body}' is not made of a shape")]
    NoShape {
        /// Its name.
        body: String,
    },
    /// A mesh has no closest points.
    #[error(transparent)]
    Mesh(#[from] ClosestError),
    /// A mesh has no distance grid.
    #[error(transparent)]
    Grid(#[from] SdfError),
    /// Mass properties or samples are not those of a body.
    #[error(transparent)]
    Body(#[from] BodyError),
}
