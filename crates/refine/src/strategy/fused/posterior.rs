//! How sure a pose is: the posterior around it, and what speaks against it.

use nalgebra::{Isometry3, Matrix6, Point3, Vector3, Vector6};
use prehend_autodiff::lie::{perturb_about, so3_log};
use prehend_geometry::SplitMix64;
use rayon::prelude::*;

use super::fit::Fit;
use super::model_scale::ModelScale;
use crate::defaults::settings;
use crate::factor::Scales;
use crate::problem::{
    Block, Contribution, Linearization, NormalEquations, RIDGE, ScaledCholesky, Solution,
    Termination,
};

/// A pose that the search came upon.
#[derive(Clone, Debug, PartialEq)]
pub struct PosteriorMode {
    /// Object coordinates → camera coordinates \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// Its share of the posterior among the hypotheses found.
    pub weight: f64,
    /// Negative logarithm of the posterior, up to a constant \[nat\].
    pub cost: f64,
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
    /// The factor's name.
    pub factor: &'static str,
    /// How much farther from its own optimum the solution is than chance has it, in standard deviations.
    pub distance: f64,
}

settings! {
    /// Settings of what is said of a posterior.
    #[derive(Copy)]
    pub struct PosteriorSettings {
        /// Distance of the object's center from the true one within which a pose is right \[m\]: what a grasp forgives.
        pub right_distance: f64 = 5e-3,
        /// Angle of its rotation from the true one within which a pose is right \[rad\].
        pub right_angle: f64 = 5f64.to_radians(),
        /// Number of random poses of each mode that the probability of a right pose is the share of: its standard error is 2.2 % at most.
        pub samples: usize = 512,
        /// Standard deviation of surface motion from which a direction is reported as hardly observable \[m\].
        pub unobservable_sigma: f64 = 8e-3,
        /// Threshold of [`Inconsistency::distance`] from which a factor is reported, in standard deviations: a rule of thumb. EXPERIMENTS: Widening by
        /// inconsistent factors.
        pub inconsistent: f64 = 5.0,
    }
}

/// Posterior of a pose: its modes, and evidence for and against them.
#[derive(Clone, Debug, PartialEq)]
pub struct Posterior {
    /// Modes, that of the largest weight first.
    pub modes: Vec<PosteriorMode>,
    /// Directions that are hardly observed.
    pub unobservable: Vec<UnobservableDirection>,
    /// Factors whose own optimum is far from the pose.
    pub inconsistencies: Vec<Inconsistency>,
    /// The test of fit of the best pose, where that was asked.
    pub fit: Option<Fit>,
    /// Scales of errors that the frame tells of.
    pub scales: Scales,
    /// Size of the object by that of its model, where that was estimated.
    pub model_scale: Option<ModelScale>,
    /// Why the search ended.
    pub termination: Termination,
    /// Cramér and Rao's bound on the covariance, prior included (van Trees, 1968): the inverse of all information, with nothing
    /// added for what the models of sensors and object leave out. Units are those of [`covariance`](Self::covariance).
    pub cramer_rao_bound: Matrix6<f64>,
    /// Center of the object, about which twists turn (camera frame) \[m\].
    center: Vector3<f64>,
    /// Uncertainty of scales in each mode's density.
    mixture: ScaleMixture,
    settings: PosteriorSettings,
}

/// Density of a mode as a mixture over scales of errors in place of a normal density.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ScaleMixture {
    /// Components of the same weight: displacements from the mode, and covariance less that of the mode. A mode is normal if there are none.
    components: Vec<(Vector6<f64>, Matrix6<f64>)>,
    /// Covariance of the mixture less that of the normal density.
    excess: Matrix6<f64>,
}

impl Posterior {
    /// Posterior of the solutions `found`, the best first; `radius` \[m\] turns radians into meters of surface motion.
    pub(crate) fn new(found: &[Solution], radius: f64, settings: &PosteriorSettings) -> Self {
        let best = &found[0];
        let bounds: Vec<(Matrix6<f64>, f64)> =
            found.iter().map(|solution| laplace(&solution.at)).collect();
        let covariance = |k: usize| {
            // What was cut short has some way left to go.
            let left = match found[k].termination {
                Termination::Iterations | Termination::Aborted => remaining(&found[k].at),
                Termination::Converged | Termination::Stalled => Vector6::zeros(),
            };
            bounds[k].0 + left * left.transpose()
        };
        let first = bounds.iter().map(|bound| bound.1).fold(f64::NEG_INFINITY, f64::max);
        // A mode whose width is not known counts only where none is.
        let mass = |k: usize| if first.is_finite() { (bounds[k].1 - first).exp() } else { 1.0 };
        let masses: Vec<f64> = (0..found.len()).map(mass).collect();
        let total: f64 = masses.iter().sum();
        let modes: Vec<PosteriorMode> = (0..found.len())
            .map(|k| PosteriorMode {
                t_cam_object: found[k].at.state.t_cam_object,
                weight: masses[k] / total,
                cost: found[k].at.cost,
                covariance: covariance(k),
            })
            .collect();
        Self {
            unobservable: unobservable(&modes[0].covariance, radius, settings),
            inconsistencies: inconsistencies(&best.at, settings.inconsistent),
            fit: None,
            scales: Scales::default(),
            model_scale: None,
            modes,
            termination: best.termination,
            cramer_rao_bound: bounds[0].0,
            center: best.at.state.center(),
            mixture: ScaleMixture::default(),
            settings: *settings,
        }
    }

    /// With a mixture over scales of errors in place of the best pose's normal density: mean and covariance of each component, as
    /// [`ScaleEvidence::pose_moments`](super::scales::ScaleEvidence::pose_moments) has them. The other modes change by as much.
    pub(super) fn mix(&mut self, moments: &[(Vector6<f64>, Matrix6<f64>)], radius: f64) {
        let count = moments.len() as f64;
        let mean = moments.iter().map(|component| component.0).sum::<Vector6<f64>>() / count;
        let components: Vec<_> = moments
            .iter()
            .map(|(at, covariance)| (at - mean, covariance - self.cramer_rao_bound))
            .collect();
        let spread = |(off, more): &(Vector6<f64>, Matrix6<f64>)| more + off * off.transpose();
        let excess = components.iter().map(spread).sum::<Matrix6<f64>>() / count;
        let components = components.iter().map(|(off, own)| (*off, own - excess)).collect();
        self.widen(&ScaleMixture { components, excess }, radius);
    }

    /// With the uncertainty of scales that another posterior of the same object in the same hand has.
    pub(crate) fn widen(&mut self, mixture: &ScaleMixture, radius: f64) {
        let excess = mixture.excess;
        if self.modes.iter().all(|h| (h.covariance + excess).cholesky().is_some()) {
            self.modes.iter_mut().for_each(|h| h.covariance += excess);
            self.mixture = mixture.clone();
        }
        self.unobservable = unobservable(&self.modes[0].covariance, radius, &self.settings);
    }

    /// Uncertainty of scales.
    pub(crate) fn mixture(&self) -> &ScaleMixture {
        &self.mixture
    }

    /// Adds poses that fit, too: each by the motion in object coordinates that takes the best pose there, and by the logarithm of its odds.
    pub(crate) fn add_modes(&mut self, modes: impl Iterator<Item = (Isometry3<f64>, f64)>) {
        let best = self.modes[0].clone();
        self.modes.extend(modes.map(|(motion, log_odds)| PosteriorMode {
            t_cam_object: best.t_cam_object * motion,
            weight: best.weight * log_odds.exp(),
            cost: best.cost - log_odds,
            covariance: best.covariance,
        }));
        let total: f64 = self.modes.iter().map(|h| h.weight).sum();
        self.modes.iter_mut().for_each(|h| h.weight /= total);
    }

    /// Covariance of the pose's error: a left twist about the object's center in the camera frame \[m², m rad, rad²\].
    pub fn covariance(&self) -> Matrix6<f64> {
        self.modes[0].covariance
    }

    /// Covariance of a left twist about `point` (camera frame) \[m\] instead of the center.
    pub fn covariance_at(&self, point: &Point3<f64>) -> Matrix6<f64> {
        let moves = about(&(point.coords - self.center));
        moves * self.covariance() * moves.transpose()
    }

    /// The center of the object, about which twists turn (camera frame) \[m\].
    pub fn center(&self) -> Vector3<f64> {
        self.center
    }

    /// Standard deviation along the direction that is known least \[m of surface motion\]; `radius` turns radians into that.
    pub(crate) fn widest(&self, radius: f64) -> f64 {
        directions(&self.covariance(), radius)[0].1
    }

    /// Probability that model, data and pose are right, the last within 5 mm and 5° of the true one
    /// ([`PosteriorSettings::right_distance`], [`PosteriorSettings::right_angle`]).
    pub fn probability(&self) -> f64 {
        let fit = self.fit.as_ref().map_or(1.0, |fit| fit.probability);
        fit * self.probability_within(self.settings.right_distance, self.settings.right_angle)
    }

    /// Probability that the true pose is within `distance` \[m\] and `angle` \[rad\] of the best one, if model and data are right; all
    /// hypotheses considered. By sampling; always the same for the same posterior.
    pub fn probability_within(&self, distance: f64, angle: f64) -> f64 {
        let place = self.modes[0].t_cam_object.inverse() * Point3::from(self.center);
        let mut random = SplitMix64::new(0);
        let normal = [(Vector6::zeros(), Matrix6::zeros())];
        let mixture = &self.mixture.components[..];
        let components = if mixture.is_empty() { &normal } else { mixture };
        let of = |hypothesis: &PosteriorMode, random: &mut SplitMix64| {
            let roots: Vec<_> = components
                .iter()
                .filter_map(|(off, more)| {
                    Some((*off, (hypothesis.covariance + more).cholesky()?.l()))
                })
                .collect();
            let samples = self.settings.samples.max(1);
            let inside = (0..samples).filter(|k| {
                let Some((off, root)) = roots.get(k % roots.len().max(1)) else { return false };
                let twist = off + root * Vector6::from_fn(|_, _| random.normal());
                let center = (hypothesis.t_cam_object * place).coords;
                let pose = perturb_about(&hypothesis.t_cam_object, &center, &twist);
                let (off, turn) = self.deviation(&pose);
                off.norm() <= distance && turn.norm() <= angle
            });
            inside.count() as f64 / samples as f64
        };
        self.modes.iter().map(|h| h.weight * of(h, &mut random)).sum()
    }

    /// How far `pose` is from the best one: displacement of the object's center \[m\] and rotation vector \[rad\].
    fn deviation(&self, pose: &Isometry3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let best = &self.modes[0].t_cam_object;
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

/// Matrix from a left twist (t, ω) about a center to that about a point which is `arm` away from it \[m\]: (t + ω × arm, ω).
fn about(arm: &Vector3<f64>) -> Matrix6<f64> {
    let mut moves = Matrix6::identity();
    moves.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
    moves
}

/// Laplace's approximation of the mode at `point`: covariance of the object's pose with all else integrated out, and the logarithm of its mass, which
/// is its height times its volume, up to a constant.
fn laplace(point: &Linearization) -> (Matrix6<f64>, f64) {
    // What nothing is known of, not even beforehand, must not be infinite.
    let Some(factor) = ScaledCholesky::new(point.equations.hessian(), RIDGE) else {
        return (Matrix6::identity(), f64::NEG_INFINITY);
    };
    let all = factor.inverse();
    let at = point.equations.offset(Block::ObjectPose).unwrap_or(0);
    let covariance = Matrix6::from_fn(|r, c| all[(at + r, at + c)]);
    let eliminated = point.marginal.as_ref().map_or(0.0, |marginal| marginal.log_determinant);
    let log_determinant = -factor.log_determinant() - eliminated;
    (covariance, 0.5 * log_determinant - point.cost)
}

/// Logarithm of the mass of the mode at `point`, up to a constant.
pub(super) fn log_mass(point: &Linearization) -> f64 {
    laplace(point).1
}

/// The object's part of the step to where the quadratic model about `point` is least: a left twist about its center \[m, rad\].
fn remaining(point: &Linearization) -> Vector6<f64> {
    let at = point.equations.offset(Block::ObjectPose).unwrap_or(0);
    let step = point.gauss_newton_step().map(|step| step.fixed_rows::<6>(at).into_owned());
    step.filter(|step| step.iter().all(|v| v.is_finite())).unwrap_or_else(Vector6::zeros)
}

/// Directions in which the pose of `point` is uncertain, the most uncertain first: twists about the object's center that move
/// its surface by a meter, with the standard deviation of that motion \[m\].
pub(super) fn principal_directions(point: &Linearization, radius: f64) -> Vec<(Vector6<f64>, f64)> {
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

fn unobservable(
    covariance: &Matrix6<f64>,
    radius: f64,
    settings: &PosteriorSettings,
) -> Vec<UnobservableDirection> {
    directions(covariance, radius)
        .into_iter()
        .filter(|(_, deviation)| *deviation > settings.unobservable_sigma)
        .map(|(twist, deviation)| UnobservableDirection { twist, deviation })
        .collect()
}

/// By how many standard deviations `squared`, a χ² of so many `degrees` of freedom if nothing is wrong, is larger than usual (Fisher, 1922).
pub(crate) fn chi_square_z(squared: f64, degrees: usize) -> f64 {
    (2.0 * squared.max(0.0)).sqrt() - (2.0 * degrees as f64 - 1.0).max(0.0).sqrt()
}

/// Which evidence, the prior included, has its own optimum farther away than `least` standard deviations.
fn inconsistencies(point: &Linearization, least: f64) -> Vec<Inconsistency> {
    let distance = |equations: &NormalEquations| {
        let factor = ScaledCholesky::new(equations.hessian(), 1e-3)?;
        // As many degrees of freedom as the modality says something of, at most.
        let degrees = equations.hessian().diagonal().iter().filter(|d| **d > 0.0).count();
        Some(chi_square_z(factor.mahalanobis_squared(equations.gradient()), degrees))
    };
    // A modality is not to blame for what the model is off by.
    let marginalized = |part: &Contribution| {
        let patches = &point.marginal.as_ref().filter(|_| part.equations.has_auxiliary())?.patches;
        Some(part.equations.marginalize(patches.precision())?.rest)
    };
    let of = |part: &Contribution| {
        let distance = distance(marginalized(part).as_ref().unwrap_or(&part.equations))?;
        Some(Inconsistency { factor: part.name, distance }).filter(|found| found.distance > least)
    };
    let parts: Vec<&Contribution> = point.prior.iter().chain(&point.factors).collect();
    parts.into_par_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_twist_about_another_point_is_the_same_motion() {
        let pose = Isometry3::new(Vector3::new(0.1, -0.2, 0.5), Vector3::new(0.3, 1.0, -0.4));
        let (center, point) = (Vector3::new(0.12, -0.1, 0.55), Vector3::new(0.1, -0.2, 0.5));
        let twist = Vector6::new(2.0, -1.0, 3.0, 0.5, -0.7, 1.1) * 1e-6;
        let elsewhere = about(&(point - center)) * twist;
        let [a, b] = [(center, twist), (point, elsewhere)]
            .map(|(center, twist)| perturb_about(&pose, &center, &twist));
        assert!((a.to_homogeneous() - b.to_homogeneous()).norm() < 1e-11);
    }
}
