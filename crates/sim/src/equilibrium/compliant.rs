//! Forces within friction cones that balance a load, where supports yield.

use nalgebra::{Matrix3, Matrix6, Matrix6x3, Point3, Vector3, Vector6};

use super::balance::Support;

/// A support that bears the less, the more it yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompliantSupport {
    /// Where it is, and its friction cone.
    pub support: Support,
    /// What a squared newton costs, as a share of what one left unbalanced costs; positive, and less than 10⁻¹² counts as that.
    pub compliance: f64,
}

/// The least of ½ |load + forces|² + ½ Σ compliance · force² over forces within their cones, torques over a length.
///
/// Unlike [`WrenchBalance`](super::WrenchBalance), towards which it goes with less and less compliance, it has one solution, and a value that is
/// differentiable by all that it is of. Meant for compliances of 1e-4 and more: far below that the problem is too stiff for Newton's method, and what is
/// found may not be the least, though it is what its forces cost.
#[derive(Clone, Debug, PartialEq)]
pub struct CompliantBalance {
    /// Force on the body at each support \[N\].
    pub forces: Vec<Vector3<f64>>,
    /// What load and forces add up to: force \[N\], torque about the center over the length \[N\]. Also the derivative of the value by
    /// the load, given in the same way.
    pub residual: Vector6<f64>,
    /// The least \[N²\].
    pub value: f64,
    /// Derivative of the residual by the load, given in the same way.
    pub residual_jacobian: Matrix6<f64>,
}

const MOST_STEPS: usize = 100;

/// Below this the dual problem overflows.
const LEAST_COMPLIANCE: f64 = 1e-12;

impl CompliantSupport {
    fn cost(&self) -> f64 {
        self.compliance.max(LEAST_COMPLIANCE)
    }
}

/// A residual is right to this share of the load.
const TOLERANCE: f64 = 1e-12;

impl CompliantBalance {
    /// Balances `load`, a force \[N\] and a torque about `center` over `length` \[m\], by `supports`. A length that is not positive counts as 1 m.
    ///
    /// The dual problem is smooth and has six unknowns, the residual: least of ½ |y|² − y · load + Σ |Π(−Wᵀy)|² / 2c, where W makes a wrench of
    /// a force, c is a support's compliance and Π projects onto its cone. Newton's method solves it in a few steps; the
    /// forces are Π(−Wᵀy) / c.
    pub fn find(
        supports: &[CompliantSupport],
        center: &Point3<f64>,
        length: f64,
        load: &Vector6<f64>,
    ) -> Self {
        let length = if length > 0.0 { length } else { 1.0 };
        let dual = Dual { supports, center: *center, length, load: *load };
        let mut residual = *load;
        let mut at = dual.at(&residual);
        for _ in 0..MOST_STEPS {
            if at.gradient.norm() <= TOLERANCE * load.norm() {
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
            .map(|s| Projection::new(&dual.pull(s, &residual), &s.support).point / s.cost())
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
    supports: &'a [CompliantSupport],
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
    fn pull(&self, support: &CompliantSupport, residual: &Vector6<f64>) -> Vector3<f64> {
        let arm = (support.support.position - self.center) / self.length;
        let (force, torque) = (residual.fixed_rows::<3>(0), residual.fixed_rows::<3>(3));
        -(force + torque.cross(&arm))
    }

    /// Of `force` at `support`.
    fn wrench(&self, support: &CompliantSupport, force: &Vector3<f64>) -> Vector6<f64> {
        let torque = (support.support.position - self.center).cross(force) / self.length;
        Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z)
    }

    fn at(&self, residual: &Vector6<f64>) -> DualAt {
        let mut value = 0.5 * residual.norm_squared() - residual.dot(&self.load);
        let mut gradient = residual - self.load;
        let mut hessian = Matrix6::identity();
        for support in self.supports {
            let projection = Projection::new(&self.pull(support, residual), &support.support);
            if projection.point == Vector3::zeros() {
                continue;
            }
            let mut wrench = Matrix6x3::zeros();
            let arm = (support.support.position - self.center) / self.length;
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
