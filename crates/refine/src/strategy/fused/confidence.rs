//! How sure a pose is: the posterior around it, and what speaks against it.

use nalgebra::{Isometry3, Matrix6, Point3, Vector3, Vector6};
use prehend_autodiff::lie::{perturb_about, so3_log};
use prehend_geometry::SplitMix64;

use super::Termination;
use super::factor::Factor;
use super::solve::Point;
use crate::problem::Block;

/// A pose that the search came upon.
#[derive(Clone, Debug, PartialEq)]
pub struct Hypothesis {
    /// Object coordinates → camera coordinates \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// Its share of the posterior among the hypotheses found.
    pub weight: f64,
    /// Negative logarithm of the posterior, up to a constant \[nat\].
    pub value: f64,
    /// Covariance of a left twist about the object's center, in the camera frame \[m², m rad, rad²\].
    pub covariance: Matrix6<f64>,
}

/// A direction that the evidence says little of: only the prior holds the pose there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnobservableDirection {
    /// Twist about the object's center, in the camera frame, of unit length where a rotation counts by how far it moves
    /// the surface.
    pub twist: Vector6<f64>,
    /// Standard deviation along it \[m of surface motion\].
    pub deviation: f64,
}

/// A sense that would rather have the pose elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inconsistency {
    /// The evidence's name.
    pub evidence: &'static str,
    /// How much farther from its own optimum the solution is than chance has it, in standard deviations.
    pub distance: f64,
}

/// What is known of how good a pose is.
#[derive(Clone, Debug, PartialEq)]
pub struct Posterior {
    /// The poses found, that of the lowest value first.
    pub hypotheses: Vec<Hypothesis>,
    /// Directions that are hardly observed.
    pub unobserved: Vec<UnobservableDirection>,
    /// Senses that disagree with the pose.
    pub disagreements: Vec<Inconsistency>,
    /// Why the search ended.
    pub ending: Termination,
    /// Whether all calibrations were found to be exact, and believed to be so.
    pub exact: bool,
    /// Cramér and Rao's bound on the covariance, prior included (van Trees, 1968): the inverse of all information, with nothing
    /// added for what the models of sensors and object leave out. Units are those of [`covariance`](Self::covariance).
    pub bound: Matrix6<f64>,
    /// Center of the object, about which twists turn (camera frame) \[m\].
    center: Vector3<f64>,
}

/// What makes posteriors as wide as errors are, besides the information that there is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovarianceInflation {
    /// What covariances are multiplied by.
    pub scale: f64,
    /// Standard deviation that is added to the rotation about each axis, for what no term models \[rad\].
    pub turn: f64,
}

impl Default for CovarianceInflation {
    fn default() -> Self {
        Self { scale: 1.35, turn: 0.39f64.to_radians() }
    }
}

/// Random poses that stand for the posterior.
const SAMPLES: usize = 512;

/// Part of the diagonal that is added before a posterior is inverted.
pub(crate) const RIDGE: f64 = 1e-9;

/// Standard deviation of surface motion from which a direction counts as unobserved \[m\].
const UNOBSERVED: f64 = 8e-3;

/// [`Inconsistency::distance`] from which a sense counts as disagreeing, and from which deviations are widened in proportion: what is wrong
/// with the observation, nobody knows, so this is a rule of thumb.
const DISAGREES: f64 = 5.0;

impl Posterior {
    /// Of the solutions `found`, the best first; `radius` turns radians into meters of surface motion. Calibrations are `exact` or as accurate as stated.
    /// `also` disagrees besides, if by enough.
    pub(crate) fn new(
        found: &[(Point, Termination)],
        width: CovarianceInflation,
        radius: f64,
        exact: bool,
        also: Option<Inconsistency>,
    ) -> Self {
        let (best, ending) = &found[0];
        // Where calibrations are exact, as in simulation, so are models.
        let turn = if exact { 0.0 } else { width.turn.powi(2) };
        let more = Matrix6::from_diagonal(&Vector6::new(0.0, 0.0, 0.0, turn, turn, turn));
        let bounds: Vec<(Matrix6<f64>, f64)> =
            found.iter().map(|(point, _)| laplace(point)).collect();
        let mut disagreements = disagreements(best);
        disagreements.extend(also.filter(|also| also.distance > DISAGREES));
        let apart = disagreements.iter().map(|d| d.distance / DISAGREES).fold(1.0, f64::max);
        let scale = width.scale * apart.powi(2);
        let covariance = |k: usize| {
            let (point, ending) = &found[k];
            // What was cut short has some way left to go.
            let left = match ending {
                Termination::Iterations | Termination::Stopped => remaining(point),
                Termination::Converged | Termination::Stuck => Vector6::zeros(),
            };
            bounds[k].0 * scale + more + left * left.transpose()
        };
        // Laplace: the mass of a mode is its height times its volume.
        let logarithm = |k: usize| 0.5 * bounds[k].1 - found[k].0.value;
        let first = (0..found.len()).map(logarithm).fold(f64::NEG_INFINITY, f64::max);
        // A mode whose width is not known counts only where none is.
        let mass = |k: usize| if first.is_finite() { (logarithm(k) - first).exp() } else { 1.0 };
        let masses: Vec<f64> = (0..found.len()).map(mass).collect();
        let total: f64 = masses.iter().sum();
        let hypotheses: Vec<Hypothesis> = (0..found.len())
            .map(|k| Hypothesis {
                t_cam_object: found[k].0.state.t_cam_object,
                weight: masses[k] / total,
                value: found[k].0.value,
                covariance: covariance(k),
            })
            .collect();
        Self {
            unobserved: unobserved(&hypotheses[0].covariance, radius),
            disagreements,
            hypotheses,
            ending: *ending,
            exact,
            bound: bounds[0].0,
            center: best.state.center(),
        }
    }

    /// Covariance of the pose's error: a left twist about the object's center in the camera frame \[m², m rad, rad²\].
    pub fn covariance(&self) -> Matrix6<f64> {
        self.hypotheses[0].covariance
    }

    /// Standard deviation along the direction that is known least \[m of surface motion\]; `radius` turns radians into that.
    pub(crate) fn widest(&self, radius: f64) -> f64 {
        directions(&self.covariance(), radius)[0].1
    }

    /// Probability that the pose is right: within 5 mm and 5° of the true one.
    pub fn probability(&self) -> f64 {
        self.probability_within(5e-3, 5f64.to_radians())
    }

    /// Probability that the true pose is within `distance` \[m\] and `angle` \[rad\] of the best one, all hypotheses
    /// considered. By sampling; always the same for the same posterior.
    pub fn probability_within(&self, distance: f64, angle: f64) -> f64 {
        let place = self.hypotheses[0].t_cam_object.inverse() * Point3::from(self.center);
        let mut random = SplitMix64::new(0);
        let of = |hypothesis: &Hypothesis, random: &mut SplitMix64| {
            let Some(factor) = hypothesis.covariance.cholesky() else { return 0.0 };
            let root = factor.l();
            let inside = (0..SAMPLES).filter(|_| {
                let twist = root * Vector6::from_fn(|_, _| random.normal());
                let center = (hypothesis.t_cam_object * place).coords;
                let pose = perturb_about(&hypothesis.t_cam_object, &center, &twist);
                let (off, turn) = self.deviation(&pose);
                off.norm() <= distance && turn.norm() <= angle
            });
            inside.count() as f64 / SAMPLES as f64
        };
        self.hypotheses.iter().map(|h| h.weight * of(h, &mut random)).sum()
    }

    /// How far `pose` is from the best one: displacement of the object's center \[m\] and rotation vector \[rad\].
    fn deviation(&self, pose: &Isometry3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let best = &self.hypotheses[0].t_cam_object;
        let place = best.inverse() * Point3::from(self.center);
        let turn = so3_log(&(pose.rotation * best.rotation.inverse()));
        ((pose * place).coords - self.center, turn)
    }

    /// How far `pose` is from the best one, in standard deviations: the square is χ² of six degrees of freedom if the
    /// posterior is right.
    pub fn mahalanobis(&self, pose: &Isometry3<f64>) -> f64 {
        let (off, turn) = self.deviation(pose);
        let twist = Vector6::new(off.x, off.y, off.z, turn.x, turn.y, turn.z);
        let factor = self.covariance().cholesky();
        factor.map_or(f64::INFINITY, |factor| twist.dot(&factor.solve(&twist)).max(0.0).sqrt())
    }
}

/// Covariance of the object's pose with all else integrated out, and the logarithm of the determinant of that of everything.
fn laplace(point: &Point) -> (Matrix6<f64>, f64) {
    // What nothing is known of, not even beforehand, must not be infinite.
    let Some(factor) = Factor::new(point.normal.hessian(), RIDGE) else {
        return (Matrix6::identity(), f64::NEG_INFINITY);
    };
    let all = factor.inverse();
    let at = point.normal.offset(Block::ObjectPose).unwrap_or(0);
    let covariance = Matrix6::from_fn(|r, c| all[(at + r, at + c)]);
    let displaced = point.displaced.as_ref().map_or(0.0, |displaced| displaced.log_determinant);
    (covariance, -factor.log_determinant() - displaced)
}

/// The object's part of the step to where the quadratic model about `point` is least: a left twist about its center \[m, rad\].
fn remaining(point: &Point) -> Vector6<f64> {
    let at = point.normal.offset(Block::ObjectPose).unwrap_or(0);
    let step = point.gauss_newton_step().map(|step| step.fixed_rows::<6>(at).into_owned());
    step.filter(|step| step.iter().all(|v| v.is_finite())).unwrap_or_else(Vector6::zeros)
}

/// Directions in which the pose of `point` is uncertain, the most uncertain first: twists about the object's center that move
/// its surface by a meter, with the standard deviation of that motion \[m\].
pub(super) fn principal_directions(point: &Point, radius: f64) -> Vec<(Vector6<f64>, f64)> {
    directions(&laplace(point).0, radius)
}

fn directions(covariance: &Matrix6<f64>, radius: f64) -> Vec<(Vector6<f64>, f64)> {
    let scale = Vector6::new(1.0, 1.0, 1.0, radius, radius, radius);
    let meters = Matrix6::from_fn(|r, c| covariance[(r, c)] * scale[r] * scale[c]);
    let eigen = meters.symmetric_eigen();
    let mut found: Vec<_> = (0..6)
        .map(|k| {
            let twist: Vector6<f64> = eigen.eigenvectors.column(k).component_div(&scale);
            (twist, eigen.eigenvalues[k].max(0.0).sqrt())
        })
        .collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found
}

fn unobserved(covariance: &Matrix6<f64>, radius: f64) -> Vec<UnobservableDirection> {
    directions(covariance, radius)
        .into_iter()
        .filter(|(_, deviation)| *deviation > UNOBSERVED)
        .map(|(twist, deviation)| UnobservableDirection { twist, deviation })
        .collect()
}

/// By how many standard deviations `squared`, a χ² of so many `degrees` of freedom if nothing is wrong, is larger than usual (Fisher, 1922).
pub(crate) fn chi_square_z(squared: f64, degrees: usize) -> f64 {
    (2.0 * squared.max(0.0)).sqrt() - (2.0 * degrees as f64 - 1.0).max(0.0).sqrt()
}

/// Which evidence, the prior included, has its own optimum far away.
fn disagreements(point: &Point) -> Vec<Inconsistency> {
    let distance = |part: &crate::problem::Normal| {
        let factor = Factor::new(part.hessian(), 1e-3)?;
        // As many degrees of freedom as the sense says something of, at most.
        let degrees = part.hessian().diagonal().iter().filter(|d| **d > 0.0).count();
        Some(chi_square_z(factor.mahalanobis_squared(part.gradient()), degrees))
    };
    // A sense is not to blame for what the model is off by.
    let alone = |part: &super::solve::Part| {
        let patches = &point.displaced.as_ref()?.patches;
        part.normal.offset(Block::SurfacePatches(patches.count()))?;
        Some(part.normal.clone().marginalize(patches.precision())?.rest)
    };
    let of = |part: &super::solve::Part| {
        let distance = distance(alone(part).as_ref().unwrap_or(&part.normal))?;
        (distance > DISAGREES).then_some(Inconsistency { evidence: part.name, distance })
    };
    point.parts.iter().filter_map(of).collect()
}
