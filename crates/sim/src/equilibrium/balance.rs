//! Forces within friction cones that balance a load.

use nalgebra::{DMatrix, DVector, Point3, Unit, Vector3, Vector6};

/// A point where a body may be pushed, within a friction cone; world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Where \[m\].
    pub position: Point3<f64>,
    /// Direction of pressure, into the body.
    pub normal: Unit<Vector3<f64>>,
    /// Friction coefficient, zero or more.
    pub friction: f64,
}

/// The forces that come nearest to balancing a load.
#[derive(Clone, Debug, PartialEq)]
pub struct WrenchBalance {
    /// Force on the body at each support \[N\], within its cone. Where more than one choice balances, one of them.
    pub forces: Vec<Vector3<f64>>,
    /// What load and forces add up to: force \[N\], torque about the center \[N m\].
    pub residual: Vector6<f64>,
    /// Length of the residual over that of the load, torques over the supports' mean distance from the center counting
    /// as forces; zero without load.
    pub relative: f64,
}

/// A relative residual that counts as none.
const BALANCED: f64 = 1e-6;

/// Descent left, relative to the load, at which forces count as the best.
const OPTIMAL: f64 = 1e-10;

const MOST_RAYS: usize = 2000;

/// Largest factor on friction coefficients that is tried.
const LARGEST_FACTOR: f64 = 1e4;

impl WrenchBalance {
    /// Of all forces within the cones of `supports`, those that leave the least of `load` (force \[N\] and torque about
    /// `center` \[N m\]), in least squares.
    ///
    /// The active-set method for non-negative least squares (C. L. Lawson, R. J. Hanson, "Solving least squares
    /// problems", 1974, chapter 23) over all rays of the cones, of which at most six are in use: each round adds the
    /// one that reduces the residual fastest, which is known in closed form. Cones are thus true ones, not pyramids.
    pub fn find(supports: &[Support], center: &Point3<f64>, load: &Vector6<f64>) -> Self {
        let problem = Problem::new(supports, center, load);
        let rays = problem.solve();
        let mut forces = vec![Vector3::zeros(); supports.len()];
        for ray in &rays {
            forces[ray.support] += ray.direction * ray.length;
        }
        let sum = |sum: Vector6<f64>, (support, force): (&Support, &Vector3<f64>)| {
            sum + wrench(&(support.position - center), force)
        };
        let residual = supports.iter().zip(&forces).fold(*load, sum);
        let size = problem.load.norm();
        let relative = if size == 0.0 { 0.0 } else { problem.scaled(&residual).norm() / size };
        Self { forces, residual, relative }
    }

    /// Whether the forces balance the load.
    pub fn is_balanced(&self) -> bool {
        self.relative <= BALANCED
    }
}

/// The least factor on all friction coefficients of `supports` with which forces balance `load` about `center`: below
/// one there is a reserve, above one friction is too little. Infinite if friction does not help.
///
/// Two fingers hold a wedge that tapers upwards by 0.3 rad: friction has to be the tangent of that.
///
/// ```
/// use nalgebra::{Point3, Unit, Vector3, Vector6};
/// use prehend_sim::{Support, friction_factor};
///
/// let finger = |side: f64| Support {
///     position: Point3::new(-0.03 * side, 0.0, 0.0),
///     normal: Unit::new_normalize(Vector3::new(side * 0.3_f64.cos(), 0.0, -0.3_f64.sin())),
///     friction: 0.5,
/// };
/// let weight = Vector6::new(0.0, 0.0, -2.0, 0.0, 0.0, 0.0);
/// let factor = friction_factor(&[finger(1.0), finger(-1.0)], &Point3::origin(), &weight);
/// assert!((factor * 0.5 - 0.3_f64.tan()).abs() < 1e-4);
/// ```
pub fn friction_factor(supports: &[Support], center: &Point3<f64>, load: &Vector6<f64>) -> f64 {
    let balanced = |factor: f64| {
        let scaled = |s: &Support| Support { friction: factor * s.friction, ..*s };
        let supports: Vec<Support> = supports.iter().map(scaled).collect();
        WrenchBalance::find(&supports, center, load).is_balanced()
    };
    if balanced(0.0) {
        return 0.0;
    }
    let mut enough = 1.0;
    while !balanced(enough) {
        enough *= 10.0;
        if enough > LARGEST_FACTOR {
            return f64::INFINITY;
        }
    }
    let mut little = if enough > 1.0 { 0.1 * enough } else { 0.0 };
    while enough - little > 1e-6 * enough {
        let middle = 0.5 * (little + enough);
        *(if balanced(middle) { &mut enough } else { &mut little }) = middle;
    }
    enough
}

/// A ray of a support's friction cone, and how far along it the force reaches.
struct Ray {
    support: usize,
    direction: Vector3<f64>,
    /// Its scaled wrench.
    wrench: Vector6<f64>,
    length: f64,
}

/// The load and the supports, torques over a length.
struct Problem<'a> {
    supports: &'a [Support],
    arms: Vec<Vector3<f64>>,
    length: f64,
    load: Vector6<f64>,
}

impl<'a> Problem<'a> {
    fn new(supports: &'a [Support], center: &Point3<f64>, load: &Vector6<f64>) -> Self {
        let arms: Vec<Vector3<f64>> = supports.iter().map(|s| s.position - center).collect();
        let mean = arms.iter().map(Vector3::norm).sum::<f64>() / arms.len().max(1) as f64;
        let length = if mean > 0.0 { mean } else { 1.0 };
        let mut problem = Self { supports, arms, length, load: Vector6::zeros() };
        problem.load = problem.scaled(load);
        problem
    }

    fn scaled(&self, wrench: &Vector6<f64>) -> Vector6<f64> {
        let mut scaled = *wrench;
        scaled.fixed_rows_mut::<3>(3).unscale_mut(self.length);
        scaled
    }

    fn solve(&self) -> Vec<Ray> {
        let mut rays: Vec<Ray> = Vec::new();
        let mut residual = self.load;
        let small = OPTIMAL * self.load.norm();
        for _ in 0..MOST_RAYS {
            let Some(best) = self
                .steepest_ray(&residual)
                .filter(|ray| -ray.wrench.dot(&residual) > small * ray.wrench.norm())
            else {
                break;
            };
            rays.push(best);
            if !self.fit(&mut rays) {
                break;
            }
            let before = residual.norm();
            residual = rays.iter().fold(self.load, |sum, ray| sum + ray.wrench * ray.length);
            // No progress but for rounding.
            if residual.norm() >= before * (1.0 - 1e-15) {
                break;
            }
        }
        rays
    }

    /// The ray of all cones along which the residual falls fastest, by unit length of its wrench.
    fn steepest_ray(&self, residual: &Vector6<f64>) -> Option<Ray> {
        let (force, torque) = (residual.fixed_rows::<3>(0), residual.fixed_rows::<3>(3));
        let ray = |(index, (support, arm)): (usize, (&Support, &Vector3<f64>))| {
            // −∂(|residual|²/2)/∂(force at the support).
            let descent = -(force + torque.cross(arm) / self.length);
            let normal = support.normal.into_inner();
            let across = descent - normal * normal.dot(&descent);
            let tangent = across.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
            let direction = normal + tangent * support.friction;
            let wrench = self.scaled(&wrench(arm, &direction));
            Ray { support: index, direction, wrench, length: 0.0 }
        };
        let fall = |ray: &Ray| -ray.wrench.dot(residual) / ray.wrench.norm();
        let rays = self.supports.iter().zip(&self.arms).enumerate().map(ray);
        rays.max_by(|a, b| fall(a).total_cmp(&fall(b)))
    }

    /// The best lengths, none negative: rays that would be are left out. False if they cannot be told apart.
    fn fit(&self, rays: &mut Vec<Ray>) -> bool {
        loop {
            // More rays than a wrench has components cannot be told apart.
            if rays.len() > 6 {
                rays.pop();
                return false;
            }
            let matrix = DMatrix::from_fn(6, rays.len(), |i, j| rays[j].wrench[i]);
            let target = DVector::from_iterator(6, self.load.iter().map(|x| -x));
            let qr = matrix.qr();
            let Some(best) = qr.r().solve_upper_triangular(&(qr.q().transpose() * target)) else {
                rays.pop();
                return false;
            };
            // How far towards the best all lengths remain positive.
            let share = rays.iter().zip(&best).filter(|(_, best)| **best <= 0.0);
            let share = share.map(|(ray, best)| ray.length / (ray.length - best));
            let share = share.fold(1.0, f64::min);
            for (ray, best) in rays.iter_mut().zip(&best) {
                ray.length += share * (best - ray.length);
            }
            let all = rays.len();
            let largest = rays.iter().map(|ray| ray.length).fold(0.0, f64::max);
            rays.retain(|ray| ray.length > 1e-14 * largest);
            if rays.len() == all || rays.is_empty() {
                return true;
            }
        }
    }
}

fn wrench(arm: &Vector3<f64>, force: &Vector3<f64>) -> Vector6<f64> {
    let torque = arm.cross(force);
    Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
}

#[cfg(test)]
mod tests {
    use prehend_geometry::SplitMix64;

    use super::*;

    fn support(position: [f64; 3], normal: [f64; 3], friction: f64) -> Support {
        let normal = Unit::new_normalize(Vector3::from(normal));
        Support { position: Point3::from(position), normal, friction }
    }

    /// Two fingers on faces that taper by `angle` upwards: the wedge is squeezed out of them.
    fn wedge(angle: f64, friction: f64) -> [Support; 2] {
        let (sin, cos) = angle.sin_cos();
        [
            support([-0.03, 0.0, 0.0], [cos, 0.0, -sin], friction),
            support([0.03, 0.0, 0.0], [-cos, 0.0, -sin], friction),
        ]
    }

    #[test]
    fn a_wedge_needs_the_tangent_of_its_angle() {
        let weight = Vector6::new(0.0, 0.0, -2.0, 0.0, 0.0, 0.0);
        for angle in [0.1, 0.3, 0.7_f64] {
            let factor = friction_factor(&wedge(angle, 0.5), &Point3::origin(), &weight);
            assert!((factor * 0.5 / angle.tan() - 1.0).abs() < 1e-4, "{angle}: {factor}");
            let enough = wedge(angle, 1.05 * angle.tan());
            let balance = WrenchBalance::find(&enough, &Point3::origin(), &weight);
            assert!(balance.is_balanced(), "{balance:?}");
            assert!((balance.forces[0].z - 1.0).abs() < 1e-6);
            let little = wedge(angle, 0.95 * angle.tan());
            assert!(!WrenchBalance::find(&little, &Point3::origin(), &weight).is_balanced());
        }
    }

    #[test]
    fn what_is_found_is_best() {
        let mut random = SplitMix64::new(7);
        let mut unit = || 2.0 * random.uniform() - 1.0;
        let (mut balanced, mut unbalanced) = (0, 0);
        for count in (2..10).cycle().take(200) {
            let supports: Vec<Support> = (0..count)
                .map(|_| {
                    let normal = [unit(), unit(), 1.5 + unit()];
                    support([unit(), unit(), unit()], normal, 0.5 + 0.4 * unit())
                })
                .collect();
            let load = Vector6::from_fn(|i, _| if i == 2 { -2.0 } else { 0.5 * unit() });
            let found = WrenchBalance::find(&supports, &Point3::origin(), &load);
            if found.is_balanced() {
                balanced += 1
            } else {
                unbalanced += 1
            }
            let problem = Problem::new(&supports, &Point3::origin(), &load);
            let residual = problem.scaled(&found.residual);
            // Optimal: the residual is orthogonal to the forces, and no ray of a cone reduces it.
            let used = residual - problem.load;
            assert!(used.dot(&residual).abs() < 1e-8 * problem.load.norm_squared());
            let ray = problem.steepest_ray(&residual).unwrap();
            let left = -ray.wrench.dot(&residual) / ray.wrench.norm();
            assert!(left < 1e-7 * problem.load.norm(), "{count}: {left:e}");
            for (support, force) in supports.iter().zip(&found.forces) {
                let pressure = support.normal.dot(force);
                let across = (force - support.normal.into_inner() * pressure).norm();
                assert!(pressure >= 0.0 && across <= support.friction * pressure * (1.0 + 1e-9));
            }
        }
        assert!(balanced > 20 && unbalanced > 20, "{balanced} {unbalanced}");
    }

    #[test]
    fn nothing_balances_without_supports_and_no_load_needs_none() {
        let weight = Vector6::new(0.0, 0.0, -2.0, 0.0, 0.0, 0.0);
        let alone = WrenchBalance::find(&[], &Point3::origin(), &weight);
        assert_eq!((alone.residual, alone.relative, alone.is_balanced()), (weight, 1.0, false));
        assert_eq!(friction_factor(&[], &Point3::origin(), &weight), f64::INFINITY);
        let lost = WrenchBalance::find(&wedge(0.3, 0.1), &Point3::origin(), &(weight * f64::NAN));
        assert!(!lost.is_balanced());
        let still = WrenchBalance::find(&wedge(0.3, 0.1), &Point3::origin(), &Vector6::zeros());
        assert!(still.is_balanced() && still.forces == [Vector3::zeros(); 2]);
    }
}
