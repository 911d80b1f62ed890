//! Training samples: a view, seen anew each time.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;
use prehend_refine::network::{CHANNELS, SensedPoint, ViewFrame};

use crate::loss::TrueView;
use crate::views::View;
use prehend_refine::Object;

/// Numbers of points of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleSize {
    /// Points; where there are fewer, some come twice.
    pub points: usize,
    /// Points that vote, the first ones.
    pub voters: usize,
}

/// Points that were felt, at most.
const FELT: usize = 48;

/// A set of points for the network, and the truth.
pub struct Sample {
    /// [`CHANNELS`] numbers a point.
    pub features: Vec<f32>,
    /// The pose in the network's coordinates.
    pub truth: TrueView,
}

impl Sample {
    /// `view` in a random roll, by some of its points, with changes of colors, noise and touch, and without some kinds of them.
    pub fn draw(view: &View, object: &Object, size: SampleSize, random: &mut SplitMix64) -> Self {
        let mut seen = view.points.seen.clone();
        let mut felt = view.points.felt.clone();
        hide(&mut seen, random);
        shuffle(&mut seen, random);
        seen.truncate(size.points);
        disturb_seen(&mut seen, object.radius, random);
        disturb_felt(&mut felt, random);
        shuffle(&mut felt, random);
        felt.truncate(FELT);
        let roll = std::f64::consts::TAU * random.uniform();
        let frame = ViewFrame::new(&seen, object.radius, roll);
        seen.truncate(size.points.saturating_sub(felt.len()).max(1));
        let mut all = felt;
        all.append(&mut seen);
        shuffle(&mut all, random);
        let repeated = all.iter().cycle().take(size.points);
        let features = repeated.flat_map(|p| frame.features(p)).collect();
        let t_view_object: Isometry3<f64> = frame.t_cam_view.inverse() * view.truth;
        let rotation = t_view_object.rotation.to_rotation_matrix().into_inner().cast();
        let position = ((t_view_object * object.center).coords / object.radius).cast();
        Self { features, truth: TrueView { rotation, position } }
    }
}

/// Positions of the first `voters` points of each of the sets of `features`.
pub fn voter_positions(features: &[f32], size: SampleSize) -> Vec<Vector3<f32>> {
    let sets = features.chunks(size.points * CHANNELS);
    let of_set = |set: &[f32]| -> Vec<Vector3<f32>> {
        let points = set.as_chunks::<CHANNELS>().0.iter().take(size.voters);
        points.map(|p| Vector3::new(p[0], p[1], p[2])).collect()
    };
    sets.flat_map(of_set).collect()
}

/// Sometimes hides what lies beyond a plane: something else may be in front of it.
fn hide(seen: &mut Vec<SensedPoint>, random: &mut SplitMix64) {
    if random.uniform() > 0.3 || seen.len() < 40 {
        return;
    }
    let direction = Vector3::new(random.normal(), random.normal(), random.normal());
    let kept = (seen.len() as f64 * (0.5 + 0.5 * random.uniform())) as usize;
    let place = |p: &SensedPoint| p.position.coords.dot(&direction);
    seen.sort_by(|a, b| place(a).total_cmp(&place(b)));
    seen.truncate(kept);
}

/// Noise of depth, points of other things, errors of colors, or none of them.
fn disturb_seen(seen: &mut [SensedPoint], radius: f64, random: &mut SplitMix64) {
    let colored = random.uniform() > 0.15;
    let noise = 1e-3 * random.uniform();
    let outliers = if random.uniform() < 0.3 { 0.04 * random.uniform() } else { 0.0 };
    let mut gains = [0.0_f32; 3].map(|_| 1.0 + 0.08 * random.normal() as f32);
    let brighter = 1.0 + 0.1 * random.normal() as f32;
    gains.iter_mut().for_each(|gain| *gain *= brighter);
    for point in seen {
        let along = noise * random.normal()
            + if random.uniform() < outliers { radius * random.normal() } else { 0.0 };
        let sight = point.position.coords.normalize();
        point.position += sight * along;
        point.color = point.color.filter(|_| colored).map(|color| {
            let mut k = 0;
            color.map(|level| {
                let gain = gains[k];
                k += 1;
                (level * gain + 0.02 * random.normal() as f32).clamp(0.0, 1.0)
            })
        });
    }
}

/// Errors of the hand's calibration and of the skin; sometimes touch without forces, or none at all.
fn disturb_felt(felt: &mut Vec<SensedPoint>, random: &mut SplitMix64) {
    let fate = random.uniform();
    if fate < 0.25 {
        felt.clear();
        return;
    }
    let forced = fate > 0.45;
    let (known, dead) = (random.uniform() > 0.1, 0.2 * random.uniform());
    let mut spread = |scale: f64| Vector3::from_fn(|_, _| scale * random.normal());
    let (shift, turn) = (spread(2e-3), UnitQuaternion::from_scaled_axis(spread(0.01)));
    let middle = felt.iter().fold(Vector3::zeros(), |sum, p| sum + p.position.coords)
        / felt.len().max(1) as f64;
    felt.retain(|_| random.uniform() >= dead);
    for point in felt {
        point.position = (middle + shift + turn * (point.position.coords - middle)).into();
        point.normal = if known { turn * point.normal } else { Vector3::zeros() };
        point.force = point.force.filter(|_| forced);
    }
}

fn shuffle<T>(items: &mut [T], random: &mut SplitMix64) {
    for k in (1..items.len()).rev() {
        items.swap(k, (random.uniform() * (k + 1) as f64) as usize);
    }
}
