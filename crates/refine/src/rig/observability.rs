//! What frames leave open about a rig, and which motion of the hand would tell.

use std::fmt;

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::parameters::Rig;
use crate::scene::{Hand, Object, Observation, View};

/// A combination of a rig's parameters that frames have hardly determined.
#[derive(Clone, Debug)]
pub struct UnobservedDirection {
    /// Parameters and their shares, the largest first: a unit vector where each parameter counts by its standard deviation beforehand. The depth
    /// bias is that in the middle of the image, the field of depth included.
    pub shares: Vec<(String, f64)>,
    /// Its standard deviation, as a share of that beforehand.
    pub deviation: f64,
    /// The motion of the hand that would tell most, and the deviation after [`FRAMES`](Self::FRAMES) such frames; `None` if no motion that was
    /// tried would tell much.
    pub motion: Option<(HandMotion, f64)>,
}

impl UnobservedDirection {
    /// Frames after a motion that [`motion`](Self::motion) is about.
    pub const FRAMES: usize = 5;
}

/// A motion of the hand, and of the object in it, before a camera at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandMotion {
    /// Displacement (camera frame) \[m\].
    pub translation: Vector3<f64>,
    /// Rotation vector about the object's center (camera frame) \[rad\].
    pub rotation: Vector3<f64>,
}

/// Displacements that are tried, in distances of the object from the camera.
const SHIFT: f64 = 0.25;

/// Turns that are tried \[rad\].
const TURN: f64 = std::f64::consts::FRAC_PI_4;

/// What counts as hardly determined: so much of the deviation beforehand is left.
const OPEN: f64 = 0.5;

/// A motion tells if it leaves at most so much of a deviation.
const TELLS: f64 = 0.8;

/// Shares below are not worth their names.
const SMALL: f64 = 0.25;

/// Part of the object that must be seen after a motion.
const SEEN: f64 = 0.5;

impl HandMotion {
    /// Those that are tried, of an object that is at `center` (camera frame) \[m\].
    pub(super) fn all(center: &Point3<f64>) -> Vec<Self> {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let both = axes.iter().flat_map(|axis| [*axis, -axis]);
        let shifts = both
            .clone()
            .map(|axis| Self { translation: axis * SHIFT * center.z, rotation: Vector3::zeros() });
        let turns = both.map(|axis| Self { translation: Vector3::zeros(), rotation: axis * TURN });
        shifts.chain(turns).collect()
    }

    /// What `observation` would show of `object`, which is at `pose` and of which so many pixels are `visible`, and of `hand` after the motion,
    /// without noise and colors, and the pose then; `None` if too little would be seen of the object.
    pub(super) fn predict(
        &self,
        observation: &Observation,
        object: &Object,
        hand: &Hand,
        pose: &Isometry3<f64>,
        visible: f64,
    ) -> Option<(Observation, Isometry3<f64>)> {
        let center = (pose * object.center).coords;
        let motion = Translation3::from(center + self.translation)
            * UnitQuaternion::from_scaled_axis(self.rotation)
            * Translation3::from(-center);
        let mut moved = observation.clone();
        if let Some(hand) = &mut moved.hand {
            hand.t_cam_hand = motion * hand.t_cam_hand;
        }
        let pose = motion * pose;
        let (depth, mask) = View::of_observation(&moved, object, hand, &pose).ok()?.expected();
        // The object's image is larger when it is nearer.
        let scale = (center.z / (center.z + self.translation.z)).powi(2);
        let least = SEEN * scale * visible;
        (mask.count() as f64 > least && mask.count() > 0)
            .then_some((Observation { depth, mask, ..moved }, pose))
    }
}

impl fmt::Display for HandMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |v: &Vector3<f64>| (v.iamax(), v[v.iamax()]);
        if self.rotation == Vector3::zeros() {
            let (axis, amount) = axis(&self.translation);
            let to = [["right", "left"], ["down", "up"], ["away from the camera", "to the camera"]];
            return write!(
                f,
                "{:.0} cm {}",
                amount.abs() * 1e2,
                to[axis][usize::from(amount < 0.0)]
            );
        }
        let (axis, angle) = axis(&self.rotation);
        let about =
            ["the image's horizontal axis", "the image's vertical axis", "the line of sight"];
        write!(f, "turned by {:.0}° about {}", angle.to_degrees(), about[axis])
    }
}

/// The directions of `rig`, the inverse variances of its parameters being `prior` beforehand, that are hardly determined, the least known first, and
/// what `motions` would tell: of each the information that a frame after it has of the parameters. `None` if that is not finite.
pub(super) fn unobserved_directions(
    rig: &Rig,
    prior: &DVector<f64>,
    motions: &[(HandMotion, DMatrix<f64>)],
) -> Option<Vec<UnobservedDirection>> {
    let (whitening, names) = (whitening(rig, prior), rig.parameters());
    let spread = |covariance: &DMatrix<f64>| &whitening * covariance * whitening.transpose();
    let known = rig.covariance.clone().cholesky()?.inverse();
    let after = |(motion, information): &(HandMotion, DMatrix<f64>)| {
        let all = &known + information * UnobservedDirection::FRAMES as f64;
        Some((*motion, spread(&all.cholesky()?.inverse())))
    };
    let after: Vec<_> = motions.iter().map(after).collect::<Option<_>>()?;
    let eigen = spread(&rig.covariance).symmetric_eigen();
    let mut directions: Vec<UnobservedDirection> = (0..names.len())
        .filter(|&k| eigen.eigenvalues[k] > OPEN * OPEN)
        .map(|k| {
            let direction = eigen.eigenvectors.column(k);
            let left = |covariance: &DMatrix<f64>| {
                (direction.transpose() * covariance * direction)[0].max(0.0).sqrt()
            };
            let deviation = eigen.eigenvalues[k].sqrt();
            let best = after.iter().map(|(motion, covariance)| (*motion, left(covariance)));
            let best = best.min_by(|a, b| a.1.total_cmp(&b.1));
            let least = SMALL.min(direction.amax());
            let shares =
                names.iter().zip(direction.iter()).filter(|(_, share)| share.abs() >= least);
            let mut shares: Vec<_> =
                shares.map(|((name, _), share)| (name.clone(), *share)).collect();
            shares.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            let motion = best.filter(|(_, left)| *left < TELLS * deviation);
            UnobservedDirection { shares, deviation, motion }
        })
        .collect();
    directions.sort_by(|a, b| b.deviation.total_cmp(&a.deviation));
    Some(directions)
}

/// What brings changes of all parameters to those of the named ones in their deviations beforehand, with the field of depth in the middle of the
/// image counted to the bias: of the two, frames can only tell the sum.
fn whitening(rig: &Rig, prior: &DVector<f64>) -> DMatrix<f64> {
    let mut named = DMatrix::zeros(rig.first_offset(), rig.len());
    named.fill_with_identity();
    let [width, height] = rig.warp.depth.size();
    let bias = rig.depth_bias();
    for (k, weight) in rig.warp.depth.weights(width as f64 / 2.0, height as f64 / 2.0) {
        named[(bias, rig.first_offset() + k)] += weight;
    }
    for mut row in named.row_iter_mut() {
        let variance: f64 = row.iter().zip(prior).map(|(part, prior)| part * part / prior).sum();
        row /= variance.sqrt();
    }
    named
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{DepthField, ImageWarp};
    use crate::rig::Play;

    /// A rig of which one sum of two parameters is known, and a motion that tells their difference.
    #[test]
    fn what_is_open_is_found_and_what_would_tell_it() {
        let warp = ImageWarp { depth: DepthField::new(640, 480, 4) };
        let play = Play { hand_translation: 1e-3, hand_rotation: 1e-3, joints: 1e-3 };
        let sigmas = DVector::repeat(12 + 6 + warp.len(), 2e-3);
        let mut rig = Rig::nominal(0, warp, &sigmas, play);
        let prior = sigmas.map(|sigma| sigma.powi(-2));
        let n = rig.len();
        let told = |parts: &[(usize, f64)], weight: f64| {
            let mut row = DVector::zeros(n);
            parts.iter().for_each(|(k, part)| row[*k] = *part);
            &row * row.transpose() * weight
        };
        // Everything is known but the difference of the first and the third.
        let mut information = DMatrix::from_diagonal(&(prior.map(|prior| 99.0 * prior)));
        information -= told(&[(0, 1.0), (2, -1.0)], 0.5 * 99.0 * prior[0]);
        let all = information + DMatrix::from_diagonal(&prior);
        rig.covariance = all.cholesky().unwrap().inverse();
        let motion = HandMotion { translation: Vector3::z(), rotation: Vector3::zeros() };
        let useless = HandMotion { translation: Vector3::x(), rotation: Vector3::zeros() };
        let motions = [
            (useless, told(&[(0, 1.0), (2, 1.0)], 1e9)),
            (motion, told(&[(0, 1.0), (2, -1.0)], prior[0])),
        ];
        let found = unobserved_directions(&rig, &prior, &motions).unwrap();
        let [direction] = &found[..] else { panic!("{found:?}") };
        assert!((direction.deviation - 1.0).abs() < 1e-9, "{direction:?}");
        let names: Vec<&str> = direction.shares.iter().map(|(name, _)| name.as_str()).collect();
        assert!(names.contains(&"translation x, hand axes"), "{names:?}");
        assert!(names.contains(&"translation z, hand axes") && names.len() == 2, "{names:?}");
        assert!((direction.shares[0].1 + direction.shares[1].1).abs() < 1e-9);
        // Five frames, each of which says twice as much as was known: variance 1 / (1 + 10).
        let (best, left) = direction.motion.unwrap();
        assert_eq!(best, motion);
        assert!((left - (1.0f64 / 11.0).sqrt()).abs() < 1e-9, "{left}");
        assert_eq!(motion.to_string(), "100 cm away from the camera");
    }
}
