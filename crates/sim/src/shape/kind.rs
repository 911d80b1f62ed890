//! The kinds of shapes.

use std::sync::Arc;

use prehend_autodiff::Scalar;
use prehend_geometry::{DistanceField, Moments};

use super::ball::Ball;
use super::border::Edges;
use super::capsule::Capsule;
use super::compound::Compound;
use super::cuboid::RoundCuboid;
use super::error::ShapeError;
use super::ground::Ground;
use super::lifted::LiftedField;
use super::polyhedron::Polyhedron;
use super::revolved::Revolved;
use super::solid::{Convex, RoundSample};
use crate::fields::INSET;
use crate::magnitude::LARGEST;
use crate::surface::check_spacing;

/// Kind of a shape, without the values of its dimensions.
pub(crate) enum ShapeKind {
    Ball(Ball),
    Cuboid(RoundCuboid),
    Capsule(Capsule),
    Revolved(Revolved),
    Polyhedron(Polyhedron),
    Ground(Ground),
    Compound(Compound),
}

/// Calls a method of the convex solid within, or of what else it is.
macro_rules! each {
    ($kind:expr, $solid:ident => $call:expr, $ground:ident => $other:expr, $all:ident => $parts:expr) => {
        match $kind {
            ShapeKind::Ball($solid) => $call,
            ShapeKind::Cuboid($solid) => $call,
            ShapeKind::Capsule($solid) => $call,
            ShapeKind::Revolved($solid) => $call,
            ShapeKind::Polyhedron($solid) => $call,
            ShapeKind::Ground($ground) => $other,
            ShapeKind::Compound($all) => $parts,
        }
    };
}

impl ShapeKind {
    /// The names of its dimensions.
    pub(super) fn names(&self) -> Vec<String> {
        each!(self, solid => solid.names(), _ground => Vec::new(), all => all.names())
    }

    /// Why it has no mass, if it has none.
    pub(super) fn fixed_only(&self) -> Option<&'static str> {
        each!(self, _solid => None, ground => match ground.moments {
            Some(_) => None,
            None => Some(ground.kind),
        }, all => all.parts.iter().find_map(|part| part.kind.fixed_only()))
    }

    pub(super) fn moments<T: Scalar>(&self, dimensions: &[T]) -> Option<Moments<T>> {
        each!(self, solid => Some(solid.moments(dimensions)), ground => {
            ground.moments.map(|moments| Moments {
                volume: T::constant(moments.volume),
                first: moments.first.map(T::constant),
                second: moments.second.map(T::constant),
            })
        }, all => all.moments(dimensions))
    }

    pub(super) fn samples<T: Scalar>(&self, dimensions: &[T]) -> Vec<RoundSample<T>> {
        each!(self, solid => solid.samples(dimensions), ground => {
            let lift = |s: &RoundSample<f64>| RoundSample {
                center: s.center.map(T::constant),
                radius: T::constant(s.radius),
                area: T::constant(s.area),
            };
            ground.samples.iter().map(lift).collect()
        }, all => all.samples(dimensions))
    }

    pub(super) fn field(&self, dimensions: &[f64]) -> Arc<dyn DistanceField> {
        each!(self, solid => Arc::new(solid.round(dimensions)), ground => {
            Arc::clone(&ground.field)
        }, all => all.field(dimensions))
    }

    pub(super) fn lifted_field<T: Scalar>(&self, dimensions: &[T]) -> LiftedField<T> {
        each!(self, solid => LiftedField::Round(solid.round(dimensions)), ground => {
            LiftedField::Constant(Arc::clone(&ground.field))
        }, all => LiftedField::Parts(all.lifted_parts(dimensions)))
    }

    /// Checks that there is such a shape.
    pub(super) fn check(&self, dimensions: &[f64]) -> Result<(), ShapeError> {
        each!(self, solid => check_solid(solid, dimensions), _ground => Ok(()), all => {
            all.parts(dimensions).try_for_each(|(part, own)| part.kind.check(own))
        })
    }
}

fn check_solid(solid: &impl Convex, dimensions: &[f64]) -> Result<(), ShapeError> {
    for (name, &value) in solid.names().into_iter().zip(dimensions) {
        if !(solid.least(&name)..=LARGEST).contains(&value) {
            return Err(ShapeError::Dimension { name, value });
        }
    }
    if let Some((half_extents, spacing)) = solid.lattice(dimensions) {
        check_spacing(half_extents, spacing)?;
    }
    let Some(border) = solid.border() else { return Ok(()) };
    let deepest = solid.deepest(dimensions).ok_or(ShapeError::NotConvex)?;
    check_rounding(border, dimensions, deepest)
}

/// Checks that samples leave something of a solid that an inset of `deepest` \[m\] makes nothing of.
fn check_rounding(border: Edges, dimensions: &[f64], deepest: f64) -> Result<(), ShapeError> {
    let rounding = border.rounding(dimensions);
    let limit = (deepest + rounding.outward()) / INSET;
    match rounding.border() {
        radius if radius > 0.0 && rounding.inset() < deepest => Ok(()),
        radius => Err(ShapeError::Rounding { radius, limit }),
    }
}
