//! Several shapes as one.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::lift;
use prehend_geometry::{DistanceField, FieldSample, Moments};

use super::kind::ShapeKind;
use super::lifted::LiftedField;
use super::solid::RoundSample;

/// Shapes that move together and do not overlap. The distance is the least of theirs, and has kinks where two are as near.
pub(crate) struct Compound {
    pub(crate) parts: Vec<CompoundPart>,
}

/// A part of a compound.
pub(crate) struct CompoundPart {
    /// Its pose.
    pub(crate) pose: Isometry3<f64>,
    pub(crate) kind: ShapeKind,
    /// Number of its dimensions.
    pub(crate) dimensions: usize,
}

impl Compound {
    /// The parts with their own of the `dimensions`.
    pub(super) fn parts<'a, T>(
        &'a self,
        dimensions: &'a [T],
    ) -> impl Iterator<Item = (&'a CompoundPart, &'a [T])> {
        let mut rest = dimensions;
        self.parts.iter().map(move |part| {
            let (own, others) = rest.split_at(part.dimensions);
            rest = others;
            (part, own)
        })
    }

    pub(super) fn names(&self) -> Vec<String> {
        let names = |(i, part): (usize, &CompoundPart)| -> Vec<String> {
            part.kind.names().iter().map(|name| format!("part_{i}_{name}")).collect()
        };
        self.parts.iter().enumerate().flat_map(names).collect()
    }

    pub(super) fn moments<T: Scalar>(&self, dimensions: &[T]) -> Option<Moments<T>> {
        let moments = |(part, own): (&CompoundPart, &[T])| {
            Some(part.kind.moments(own)?.moved(&lift(&part.pose)))
        };
        self.parts(dimensions).map(moments).sum()
    }

    pub(super) fn samples<T: Scalar>(&self, dimensions: &[T]) -> Vec<RoundSample<T>> {
        let samples = |(part, own): (&CompoundPart, &[T])| {
            let pose = lift::<T>(&part.pose);
            let moved = |s: RoundSample<T>| RoundSample { center: pose * s.center, ..s };
            part.kind.samples(own).into_iter().map(moved).collect::<Vec<_>>()
        };
        self.parts(dimensions).flat_map(samples).collect()
    }

    pub(super) fn lifted_parts<T: Scalar>(
        &self,
        dimensions: &[T],
    ) -> Vec<(Isometry3<f64>, LiftedField<T>)> {
        let part = |(part, own): (&CompoundPart, &[T])| (part.pose, part.kind.lifted_field(own));
        self.parts(dimensions).map(part).collect()
    }

    pub(super) fn field(&self, dimensions: &[f64]) -> Arc<dyn DistanceField> {
        let field = |(part, own): (&CompoundPart, &[f64])| (part.pose, part.kind.field(own));
        Arc::new(NearestField(self.parts(dimensions).map(field).collect()))
    }
}

/// The nearest of several fields, each where it is.
struct NearestField(Vec<(Isometry3<f64>, Arc<dyn DistanceField>)>);

impl DistanceField for NearestField {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let mut nearest: Option<FieldSample> = None;
        for (pose, field) in &self.0 {
            let within = nearest.map_or(reach, |sample| sample.distance);
            if let Some(sample) = field.sample(&pose.inverse_transform_point(point), within)
                && nearest.is_none_or(|nearest| sample.distance < nearest.distance)
            {
                let rotation = pose.rotation.to_rotation_matrix();
                nearest = Some(FieldSample {
                    gradient: rotation * sample.gradient,
                    hessian: rotation.matrix() * sample.hessian * rotation.matrix().transpose(),
                    ..sample
                });
            }
        }
        nearest
    }

    fn distance(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        self.0.iter().fold(None, |nearest: Option<f64>, (pose, field)| {
            let within = nearest.unwrap_or(reach);
            let found = field.distance(&pose.inverse_transform_point(point), within);
            match (nearest, found) {
                (Some(nearest), Some(found)) if found >= nearest => Some(nearest),
                (_, Some(found)) => Some(found),
                _ => nearest,
            }
        })
    }

    fn lipschitz_bound(&self) -> f64 {
        self.0.iter().map(|(_, field)| field.lipschitz_bound()).fold(1.0, f64::max)
    }

    fn thickness(&self) -> f64 {
        self.0.iter().map(|(_, field)| field.thickness()).fold(f64::INFINITY, f64::min)
    }

    fn bounding_ball(&self) -> Option<(Point3<f64>, f64)> {
        let ball = |(pose, field): &(Isometry3<f64>, Arc<dyn DistanceField>)| {
            let (center, radius) = field.bounding_ball()?;
            Some((pose * center, radius))
        };
        let balls: Vec<_> = self.0.iter().map(ball).collect::<Option<_>>()?;
        let sum = balls.iter().fold(Vector3::zeros(), |sum, (center, _)| sum + center.coords);
        let center = Point3::from(sum / balls.len() as f64);
        let radii = balls.iter().map(|(other, radius)| (other - center).norm() + radius);
        Some((center, radii.fold(0.0, f64::max)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::Sphere;

    #[test]
    fn a_compound_is_as_thick_as_its_thinnest_part() {
        let ball = |radius: f64| -> (Isometry3<f64>, Arc<dyn DistanceField>) {
            (
                Isometry3::translation(radius, 0.0, 0.0),
                Arc::new(Sphere { center: Point3::origin(), radius }),
            )
        };
        let alone = ball(0.02).1.thickness();
        assert!(alone > 0.0 && alone.is_finite());
        assert_eq!(NearestField(vec![ball(0.1), ball(0.02), ball(0.05)]).thickness(), alone);
    }
}
