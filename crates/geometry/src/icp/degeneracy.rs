//! Which motions the matches determine, and a step that leaves the others alone.

use nalgebra::{Matrix6, Point3, Vector6};

use super::NormalEquations;

/// The eigenvalues and eigenvectors of the 6×6 normal matrix: how firmly the matches hold each motion.
///
/// Rotations count by the arc at `length` from the center, and the matrix is divided by the sum of weights. So an
/// eigenvalue is a number, about the mean squared change of the residuals \[m²\] for each squared meter of motion:
/// at most about two, ⅓ for a translation of a ball by point-to-plane, zero for a motion along which the surface
/// slides on itself. (Gelfand et al., "Geometrically stable sampling for the ICP algorithm", 2003.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Degeneracy {
    /// The center that twists turn about \[m\], in the target's frame.
    pub center: Point3<f64>,
    /// Root mean square distance of the source points from their center \[m\].
    pub length: f64,
    /// Eigenvalues \[1\], ascending.
    pub eigenvalues: [f64; 6],
    /// The twist of each eigenvalue, translation \[m\] first, rotation \[rad\] last: a motion of unit size, where
    /// rotation counts by `length`. The larger of the two parts has its largest entry positive.
    pub directions: [Vector6<f64>; 6],
}

impl Degeneracy {
    /// Of `equations` about `center`, for a source of root mean square radius `length` \[m\].
    pub fn new(equations: &NormalEquations, center: Point3<f64>, length: f64) -> Self {
        let scale = scaling(length);
        let weight = if equations.weight > 0.0 { equations.weight } else { 1.0 };
        let scaled = Matrix6::from_fn(|i, j| {
            equations.quadratic.hessian[(i, j)] * scale[i] * scale[j] / weight
        });
        // Rounding may have left the two triangles apart.
        let eigen = ((scaled + scaled.transpose()) * 0.5).symmetric_eigen();
        let mut order = [0, 1, 2, 3, 4, 5];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        Self {
            center,
            length,
            eigenvalues: order.map(|i| eigen.eigenvalues[i].max(0.0)),
            directions: order.map(|i| {
                let v = eigen.eigenvectors.column(i);
                let sign = if v[v.iamax()] < 0.0 { -1.0 } else { 1.0 };
                v.component_mul(&scale) * sign
            }),
        }
    }

    /// The directions whose eigenvalue is below `least`: nothing is known about motions along them.
    pub fn unconstrained(&self, least: f64) -> &[Vector6<f64>] {
        &self.directions[..self.eigenvalues.partition_point(|e| *e < least)]
    }

    /// The Gauss–Newton step of `equations`, those this is the report of, along the directions of eigenvalue
    /// `least` at least (solution remapping: Zhang, Kaess and Singh, "On degeneracy of optimization-based state
    /// estimation problems", 2016).
    pub(super) fn step(&self, equations: &NormalEquations, least: f64) -> Vector6<f64> {
        let least = least.max(1e-14);
        let held = self.directions.iter().zip(&self.eigenvalues).filter(|(_, e)| **e >= least);
        held.fold(Vector6::zeros(), |step, (v, e)| {
            step - v * (v.dot(&equations.quadratic.gradient) / (e * equations.weight))
        })
    }
}

/// What brings the columns of a twist to meters of motion.
fn scaling(length: f64) -> Vector6<f64> {
    // What is smaller cannot be turned, and squares of its reciprocal leave the range of numbers.
    let turn = if length > 1e-60 { 1.0 / length } else { 1.0 };
    Vector6::new(1.0, 1.0, 1.0, turn, turn, turn)
}

#[cfg(test)]
mod tests {
    use super::super::{Match, Metric};
    use super::*;
    use crate::random::SplitMix64;
    use crate::robust::RobustKernel;
    use nalgebra::Vector3;

    /// Point-to-plane matches of `points` with themselves, shifted by `shift`.
    fn equations(points: &[(Vector3<f64>, Vector3<f64>)], shift: &Vector3<f64>) -> NormalEquations {
        let mut sums = NormalEquations::new();
        for (p, normal) in points {
            let target = Match { point: Point3::from(p - shift), normal: *normal };
            let (p, center) = (Point3::from(*p), Point3::origin());
            sums.add(Metric::PointToPlane, RobustKernel::Squared, &p, &target, &center);
        }
        sums
    }

    #[test]
    fn a_sphere_may_turn_and_a_plane_may_slide() {
        let mut random = SplitMix64::new(2);
        let sphere: Vec<_> = (0..4000)
            .map(|_| Vector3::from_fn(|_, _| random.normal()).normalize())
            .map(|n| (n * 0.05, n))
            .collect();
        let shift = Vector3::new(1e-3, -2e-3, 5e-4);
        let sums = equations(&sphere, &shift);
        let report = Degeneracy::new(&sums, Point3::origin(), 0.05);
        let free = report.unconstrained(1e-6);
        assert_eq!(free.len(), 3);
        assert!(free.iter().all(|v| v.fixed_rows::<3>(0).norm() < 1e-9));
        // Unit size: one radian at 5 cm is 5 cm, so a meter is 20 radians.
        assert!(free.iter().all(|v| (v.fixed_rows::<3>(3).norm() - 20.0).abs() < 1e-9));
        for e in &report.eigenvalues[3..] {
            assert!((e - 1.0 / 3.0).abs() < 0.02, "{e}");
        }
        let step = report.step(&sums, 1e-6);
        assert!((step.fixed_rows::<3>(0) + shift).norm() < 1e-12, "{step}");
        assert!(step.fixed_rows::<3>(3).norm() < 1e-9);

        let plane: Vec<_> = (0..100)
            .map(|i| {
                (
                    Vector3::new(f64::from(i % 10), f64::from(i / 10), 0.0).add_scalar(-4.5),
                    Vector3::z(),
                )
            })
            .collect();
        let report = Degeneracy::new(&equations(&plane, &shift), Point3::origin(), 4.0);
        let free = report.unconstrained(1e-9);
        assert_eq!(free.len(), 3);
        // Along x and y, and about z.
        assert!(free.iter().all(|v| v[2].abs() + v[3].abs() + v[4].abs() < 1e-9));
    }

    #[test]
    fn eigenvalues_do_not_depend_on_units_weights_or_counts() {
        let mut random = SplitMix64::new(4);
        let mut unit = || Vector3::from_fn(|_, _| random.normal());
        let points: Vec<_> = (0..50).map(|_| (unit() * 0.1, unit().normalize())).collect();
        let small: Vec<_> = points.iter().map(|(p, n)| (p * 1e-3, *n)).collect();
        let twice: Vec<_> = points.iter().chain(&points).copied().collect();
        let report = |points: &[_], length| {
            Degeneracy::new(&equations(points, &Vector3::zeros()), Point3::origin(), length)
                .eigenvalues
        };
        let reference = report(&points, 0.1);
        for other in [report(&small, 1e-4), report(&twice, 0.1)] {
            assert!(reference.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn nothing_is_known_from_nothing() {
        let report = Degeneracy::new(&NormalEquations::new(), Point3::origin(), 0.0);
        assert_eq!(report.eigenvalues, [0.0; 6]);
        assert_eq!(report.unconstrained(1e-9).len(), 6);
        assert_eq!(report.step(&NormalEquations::new(), 0.0), Vector6::zeros());
    }
}
