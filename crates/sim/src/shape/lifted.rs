//! Samples and field of a shape with derivatives by its dimensions.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::lift;
use prehend_geometry::{DistanceField, FieldSample};

use super::nearest::Nearest;
use super::round::Round;

/// A distance field over numbers that carry derivatives.
pub(crate) enum LiftedField<T: Scalar> {
    /// Field of a solid whose dimensions carry derivatives.
    Round(Round<T>),
    /// Nearest of several fields, each with its pose.
    Parts(Vec<(Isometry3<f64>, Self)>),
    /// Field without variable dimensions.
    Constant(Arc<dyn DistanceField>),
}

impl<T: Scalar> LiftedField<T> {
    /// Distance \[m\] and gradient at a point.
    pub(crate) fn at(&self, point: &Point3<T>) -> Option<(T, Vector3<T>)> {
        match self {
            Self::Round(round) => {
                let Nearest { distance, gradient, .. } = round.nearest(point);
                Some((distance, gradient))
            }
            Self::Parts(parts) => {
                let at = |(pose, part): &(Isometry3<f64>, Self)| {
                    let pose = lift::<T>(pose);
                    let (distance, gradient) = part.at(&pose.inverse_transform_point(point))?;
                    Some((distance, pose.rotation * gradient))
                };
                let by_distance =
                    |(a, _): &(T, _), (b, _): &(T, _)| a.value().total_cmp(&b.value());
                parts.iter().filter_map(at).min_by(by_distance)
            }
            Self::Constant(field) => {
                let place = point.map(T::value);
                let FieldSample { distance, gradient, hessian } =
                    field.sample(&place, f64::INFINITY)?;
                let change: Vector3<T> = point.coords.map(|x| x.plus(-x.value()));
                let slope = |row: [f64; 3]| {
                    let terms = row.iter().zip(change.iter());
                    terms.fold(T::zero(), |sum, (slope, x)| sum + x.times(*slope))
                };
                let turned = |i: usize| slope([0, 1, 2].map(|j| hessian[(i, j)]));
                let gradient_there = Vector3::from_fn(|i, _| turned(i).plus(gradient[i]));
                Some((slope(gradient.into()).plus(distance), gradient_there))
            }
        }
    }
}
