//! Forces within friction cones that balance a load, where supports yield.

use nalgebra::{Matrix3, Matrix6, Matrix6x3, Point3, Unit, Vector3, Vector6};

/// A point where a body may be pushed, within a friction cone, the less, the more it yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Support {
    /// Its position \[m\].
    pub(super) position: Point3<f64>,
    /// Direction of pressure, into the body.
    pub(super) normal: Unit<Vector3<f64>>,
    /// Friction coefficient, zero or more.
    pub(super) friction: f64,
    /// Cost of a squared newton, as a share of the cost of one left unbalanced; positive, and less than 10⁻¹² counts as that.
    pub(super) compliance: f64,
}

/// The least of ½ |load + forces|² + ½ Σ compliance · force² over forces within their cones, torques over a length.
///
/// It has one solution, and a value that is differentiable by all that it is of. Meant for compliances of 1e-4 and more: far below that the problem is too stiff for Newton's method, and what is
/// found may not be the least, though it is what its forces cost.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CompliantBalance {
    /// Force on the body at each support \[N\].
    pub(super) forces: Vec<Vector3<f64>>,
    /// Sum of load and contact forces: force \[N\], torque about the center over the length \[N\]. Also the derivative of the value by
    /// the load, given in the same way.
    pub(super) residual: Vector6<f64>,
    /// The least \[N²\].
    pub(super) value: f64,
    /// Derivative of the residual by the load, given in the same way.
    pub(super) residual_jacobian: Matrix6<f64>,
}

const MOST_STEPS: usize = 100;

/// Relative accuracy of the residual, and the least compliance: below, the dual problem overflows.
const EPSILON: f64 = 1e-12;

impl Support {
    fn cost(&self) -> f64 {
        self.compliance.max(EPSILON)
    }
}

impl CompliantBalance {
    /// Balances `load`, a force \[N\] and a torque about `center` over `length` \[m\], by `supports`. A length that is not positive counts as 1 m.
    ///
    /// The dual problem is smooth and has six unknowns, the residual: least of ½ |y|² − y · load + Σ |Π(−Wᵀy)|² / 2c, where W makes a wrench of
    /// a force, c is a support's compliance and Π projects onto its cone. Newton's method solves it in a few steps; the
    /// forces are Π(−Wᵀy) / c.
    pub(super) fn find(
        supports: &[Support],
        center: &Point3<f64>,
        length: f64,
        load: &Vector6<f64>,
    ) -> Self {
        let length = if length > 0.0 { length } else { 1.0 };
        let dual = Dual { supports, center: *center, length, load: *load };
        let mut residual = *load;
        let mut at = dual.at(&residual);
        for _ in 0..MOST_STEPS {
            if at.gradient.norm() <= EPSILON * load.norm() {
                break;
            }
            let Some(step) = at.hessian.cholesky().map(|factor| factor.solve(&at.gradient)) else {
                break;
            };
            let fall = at.gradient.dot(&step);
            let shorter = std::iter::successors(Some(1.0), |share| Some(0.5 * share)).take(40);
            let better = shorter.map(|share| (share, residual - step * share)).find_map(
                |(share, candidate)| {
                    let next = dual.at(&candidate);
                    // Near the least, values differ by less than their rounding.
                    let enough = next.value <= at.value - 1e-4 * share * fall
                        || next.gradient.norm() <= 0.5 * at.gradient.norm();
                    enough.then_some((candidate, next))
                },
            );
            // No descent but for rounding.
            let Some((candidate, next)) = better else { break };
            (residual, at) = (candidate, next);
        }
        let forces: Vec<Vector3<f64>> = supports
            .iter()
            .map(|s| Projection::new(&dual.pull(s, &residual), s).point / s.cost())
            .collect();
        let residual = supports
            .iter()
            .zip(&forces)
            .fold(*load, |sum, (support, force)| sum + dual.wrench(support, force));
        let cost = supports.iter().zip(&forces).map(|(s, f)| s.cost() * f.norm_squared());
        let value = 0.5 * (residual.norm_squared() + cost.sum::<f64>());
        let residual_jacobian =
            at.hessian.cholesky().map_or_else(Matrix6::zeros, |factor| factor.inverse());
        Self { forces, residual, value, residual_jacobian }
    }
}

/// The dual function.
struct Dual<'a> {
    supports: &'a [Support],
    center: Point3<f64>,
    length: f64,
    load: Vector6<f64>,
}

/// Value and derivatives of the dual function.
struct DualAt {
    value: f64,
    gradient: Vector6<f64>,
    hessian: Matrix6<f64>,
}

impl Dual<'_> {
    /// Where a residual pulls the force of `support`: −Wᵀy.
    fn pull(&self, support: &Support, residual: &Vector6<f64>) -> Vector3<f64> {
        let arm = (support.position - self.center) / self.length;
        let (force, torque) = (residual.fixed_rows::<3>(0), residual.fixed_rows::<3>(3));
        -(force + torque.cross(&arm))
    }

    /// Wrench of `force` at `support`.
    fn wrench(&self, support: &Support, force: &Vector3<f64>) -> Vector6<f64> {
        let torque = (support.position - self.center).cross(force) / self.length;
        Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
    }

    fn at(&self, residual: &Vector6<f64>) -> DualAt {
        let mut value = 0.5 * residual.norm_squared() - residual.dot(&self.load);
        let mut gradient = residual - self.load;
        let mut hessian = Matrix6::identity();
        for support in self.supports {
            let projection = Projection::new(&self.pull(support, residual), support);
            if projection.point == Vector3::zeros() {
                continue;
            }
            let mut wrench = Matrix6x3::zeros();
            let arm = (support.position - self.center) / self.length;
            wrench.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
            wrench.fixed_view_mut::<3, 3>(3, 0).copy_from(&arm.cross_matrix());
            value += 0.5 * projection.point.norm_squared() / support.cost();
            gradient -= wrench * projection.point / support.cost();
            hessian += wrench * (projection.jacobian / support.cost()) * wrench.transpose();
        }
        DualAt { value, gradient, hessian }
    }
}

/// The nearest point of a friction cone.
struct Projection {
    point: Vector3<f64>,
    /// Its derivative: symmetric, positive semi-definite.
    jacobian: Matrix3<f64>,
}

impl Projection {
    fn new(pull: &Vector3<f64>, support: &Support) -> Self {
        let (normal, friction) = (support.normal.into_inner(), support.friction);
        let pressure = pull.dot(&normal);
        let across = pull - normal * pressure;
        let slip = across.norm();
        if pressure >= 0.0 && slip <= friction * pressure {
            return Self { point: *pull, jacobian: Matrix3::identity() };
        }
        if friction * slip <= -pressure {
            return Self { point: Vector3::zeros(), jacobian: Matrix3::zeros() };
        }
        let tangent = across / slip;
        let edge = normal + tangent * friction;
        let length = (pressure + friction * slip) / edge.norm_squared();
        let sideways =
            Matrix3::identity() - normal * normal.transpose() - tangent * tangent.transpose();
        let jacobian =
            edge * edge.transpose() / edge.norm_squared() + sideways * (length * friction / slip);
        Self { point: edge * length, jacobian }
    }
}

#[cfg(test)]
mod tests {
    use prehend_geometry::SplitMix64;

    use super::*;

    const LENGTH: f64 = 0.7;

    /// Supports about the origin and a load, at random.
    fn problem(random: &mut SplitMix64, compliance: f64) -> (Vec<Support>, Vector6<f64>) {
        let mut unit = || 2.0 * random.uniform() - 1.0;
        let count = 2 + (4.0 * (1.0 + unit())) as usize;
        let supports = (0..count).map(|_| {
            let normal = Unit::new_normalize(Vector3::new(unit(), unit(), 0.7 + unit()));
            let position = Point3::new(unit(), unit(), unit());
            let (friction, compliance) = (0.5 + 0.4 * unit(), compliance * (1.5 + unit()));
            Support { position, normal, friction, compliance }
        });
        let supports = supports.collect();
        (supports, Vector6::from_fn(|i, _| if i == 2 { -2.0 } else { 0.5 * unit() }))
    }

    fn solve(supports: &[Support], load: &Vector6<f64>) -> CompliantBalance {
        CompliantBalance::find(supports, &Point3::origin(), LENGTH, load)
    }

    #[test]
    fn a_yielding_support_bears_its_share() {
        let (position, normal) = (Point3::origin(), Vector3::z_axis());
        let support = Support { position, normal, friction: 0.5, compliance: 0.5 };
        let load = Vector6::new(0.0, 0.0, -3.0, 0.0, 0.0, 0.0);
        let found = solve(&[support], &load);
        assert!((found.forces[0] - Vector3::new(0.0, 0.0, 2.0)).norm() < 1e-12);
        assert!((found.residual[2] + 1.0).abs() < 1e-12 && (found.value - 1.5).abs() < 1e-12);
        // It cannot pull, and least of all without friction.
        for friction in [0.5, 0.0] {
            let support = Support { friction, ..support };
            let pulled = solve(&[support], &-load);
            assert_eq!((pulled.forces[0], pulled.value), (Vector3::zeros(), 4.5));
        }
    }

    /// `force` with no more friction than the support can give, and no pull.
    fn within_cone(force: &Vector3<f64>, support: &Support) -> Vector3<f64> {
        let push = support.normal.dot(force).max(0.0);
        let sideways = force - support.normal.into_inner() * support.normal.dot(force);
        let most = (support.friction * push / sideways.norm()).min(1.0);
        support.normal.into_inner() * push + sideways * most
    }

    #[test]
    fn no_other_forces_cost_less() {
        let mut random = SplitMix64::new(5);
        for _ in 0..100 {
            let (supports, load) = problem(&mut random, 0.1);
            let found = solve(&supports, &load);
            let cost = |forces: &[Vector3<f64>]| {
                let mut left = load;
                let mut cost = 0.0;
                for (s, f) in supports.iter().zip(forces) {
                    let torque = s.position.coords.cross(f) / LENGTH;
                    left += Vector6::new(f.x, f.y, f.z, torque.x, torque.y, torque.z);
                    cost += s.compliance * f.norm_squared();
                }
                (0.5 * (left.norm_squared() + cost), left)
            };
            let (value, left) = cost(&found.forces);
            assert!((value - found.value).abs() < 1e-9 && (left - found.residual).norm() < 1e-9);
            for _ in 0..50 {
                let nudged = |(s, f): (&Support, &Vector3<f64>)| {
                    let nudge = Vector3::from_fn(|_, _| 0.2 * (random.uniform() - 0.5));
                    within_cone(&(f + nudge), s)
                };
                let other: Vec<_> = supports.iter().zip(&found.forces).map(nudged).collect();
                assert!(cost(&other).0 >= found.value - 1e-12);
            }
        }
    }

    #[test]
    fn derivatives_by_the_load_match_differences() {
        let mut random = SplitMix64::new(6);
        for _ in 0..50 {
            let (supports, load) = problem(&mut random, 0.1);
            let found = solve(&supports, &load);
            let step = 1e-6;
            for k in 0..6 {
                let at = |sign: f64| solve(&supports, &(load + Vector6::ith(k, sign * step)));
                let (plus, minus) = (at(1.0), at(-1.0));
                let slope = (plus.value - minus.value) / (2.0 * step);
                assert!((slope - found.residual[k]).abs() < 1e-6);
                let bend = (plus.residual - minus.residual) / (2.0 * step);
                assert!((bend - found.residual_jacobian.column(k)).norm() < 1e-4, "{bend}");
            }
        }
    }

    #[test]
    fn nothing_holds_without_supports() {
        let load = Vector6::new(0.0, 0.0, -2.0, 0.1, 0.0, 0.0);
        let found = solve(&[], &load);
        assert_eq!((found.residual, found.residual_jacobian), (load, Matrix6::identity()));
    }
}
