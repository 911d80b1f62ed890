//! Balls.

use std::f64::consts::PI;

use nalgebra::Point3;
use prehend_autodiff::Scalar;
use prehend_geometry::Moments;

use super::round::{Core, Round};
use super::solid::{Convex, RoundSample};

/// A ball around the origin, by its radius. It is one sample that stands for the area of its cross-section, as
/// [`Surface::ball`](crate::Surface::ball) does.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball;

impl Convex for Ball {
    fn names(&self) -> Vec<String> {
        vec!["radius".to_owned()]
    }

    fn moments<T: Scalar>(&self, dimensions: &[T]) -> Moments<T> {
        Moments::ball(dimensions[0])
    }

    fn round<T: Scalar>(&self, dimensions: &[T]) -> Round<T> {
        Round { core: Core::Point, border: dimensions[0] }
    }

    fn samples<T: Scalar>(&self, dimensions: &[T]) -> Vec<RoundSample<T>> {
        let radius = dimensions[0];
        vec![RoundSample { center: Point3::origin(), radius, area: (radius * radius).times(PI) }]
    }
}
