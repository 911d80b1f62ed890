//! Signed distances at many points, each near those before: what is known of them is used again.

use nalgebra::{Point3, Vector3};

use super::{ClosestPoints, Sign};

/// Balls that are remembered: those of a line of samples or two.
const BALLS: usize = 64;

/// A ball that is wholly inside of a mesh, or wholly outside.
struct Ball {
    center: Vector3<f64>,
    squared_radius: f64,
    inside: bool,
}

/// A walk from point to point near a mesh.
pub(crate) struct Walk<'a> {
    mesh: &'a ClosestPoints,
    /// Face of the last answer.
    face: Option<u32>,
    /// Last point.
    last: Option<Vector3<f64>>,
    balls: Vec<Ball>,
    oldest: usize,
}

impl<'a> Walk<'a> {
    pub(crate) fn new(mesh: &'a ClosestPoints) -> Self {
        Self { mesh, face: None, last: None, balls: Vec::new(), oldest: 0 }
    }

    /// As [`ClosestPoints::signed_distance_within`], the distance alone.
    pub(crate) fn signed_distance_within(&mut self, point: &Point3<f64>, most: f64) -> Option<f64> {
        let last = self.last.replace(point.coords);
        let closest = self.mesh.search(point, most, self.face)?;
        self.face = Some(closest.face);
        let Sign::Winding(winding) = &self.mesh.sign else {
            return Some(self.mesh.signed(point, Some(closest)).0);
        };
        let within = |b: &&Ball| (point.coords - b.center).norm_squared() < b.squared_radius;
        let known = self.balls.iter().find(within).map(|ball| ball.inside);
        let inside = known.unwrap_or_else(|| {
            let (bvh, center, distance) = (&self.mesh.bvh, point.coords, closest.distance);
            if last.is_some_and(|last| distance < (center - last).norm()) {
                // No other point would lie in its ball.
                return winding.is_inside(bvh, &center);
            }
            let (inside, radius) = winding.around(bvh, &center, distance);
            if radius > 0.0 {
                let ball = Ball { center, squared_radius: radius * radius, inside };
                match self.balls.len() {
                    BALLS => self.balls[self.oldest] = ball,
                    _ => self.balls.push(ball),
                }
                self.oldest = (self.oldest + 1) % BALLS;
            }
            inside
        });
        Some(if inside { -closest.distance } else { closest.distance })
    }
}
