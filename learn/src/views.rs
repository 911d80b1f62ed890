//! Views of an object in a hand, made by simulated grasps and sensors.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context, bail};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;
use prehend_refine::network::{
    SensedPoint, SensedPoints, Tensor, Tensors, read_tensors, write_tensors,
};
use prehend_refine::synth::{
    GraspSettings, GraspSnapshot, Grasper, SensorSettings, SynthSettings, simulate_frame,
};
use prehend_refine::{Hand, Object, PreparedFrame};
use rayon::prelude::*;

/// Points of the object from images and touch, and its true pose.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Points in the camera frame.
    pub points: SensedPoints,
    /// True pose, object → camera \[m\].
    pub truth: Isometry3<f64>,
    /// Number of the grasp.
    pub grasp: u32,
}

/// Numbers of grasps and of views.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewSettings {
    /// Grasps.
    pub grasps: u32,
    /// Views of each of them.
    pub views_per_grasp: u32,
    /// Seed of all that is random.
    pub seed: u64,
}

/// Grasps tried until one holds.
const TRIES: u64 = 60;
/// Moments of a grasp: the hand turns between them.
const MOMENTS: usize = 4;
/// Focal length \[px\]: half of that of usual cameras of 640 columns, because rendering takes time.
const FOCAL: f64 = 290.0;
/// Resolution by that of the images for which the sensors' faults are stated.
const RESOLUTION: f64 = 0.5;
/// Faults of sensors and calibrations by those of the realistic preset, at most.
const FAULTS: f64 = 2.0;

/// Makes grasps, then views of them; `progress` hears of each view, and of those of a grasp that could not be made all at once.
///
/// # Errors
/// If the object cannot be grasped by this hand at all.
pub fn make_views(
    object: &Arc<Object>,
    hand: &Arc<Hand>,
    settings: &ViewSettings,
    progress: &(dyn Fn(u64) + Sync),
) -> anyhow::Result<Vec<View>> {
    let grasping = GraspSettings { contact_area: (8.0, 90.0), ..GraspSettings::default() };
    let grasper = Grasper::new(hand, object, &grasping)?;
    let failures = AtomicU64::new(0);
    let of_grasp = |grasp: u32| -> Vec<View> {
        let seed = mixed(settings.seed, u64::from(grasp));
        let Ok(moments) = grasper.sequence(seed, TRIES, MOMENTS) else {
            failures.fetch_add(1, Ordering::Relaxed);
            progress(u64::from(settings.views_per_grasp));
            return Vec::new();
        };
        let view = |k: u32| {
            let moment = &moments[k as usize % moments.len()];
            let view = view(object, hand, moment, mixed(seed, u64::from(k) + 1));
            progress(1);
            view.map(|(points, truth)| View { points, truth, grasp })
        };
        (0..settings.views_per_grasp).into_par_iter().filter_map(view).collect()
    };
    let views: Vec<Vec<View>> = (0..settings.grasps).into_par_iter().map(of_grasp).collect();
    if views.iter().all(Vec::is_empty) {
        let failures = failures.into_inner();
        bail!("{}: none of {failures} grasps holds by this hand", object.name);
    }
    Ok(views.into_iter().flatten().collect())
}

/// Points of a view of `moment` and the true pose; none if too little of the object is seen.
fn view(
    object: &Arc<Object>,
    hand: &Arc<Hand>,
    moment: &GraspSnapshot,
    seed: u64,
) -> Option<(SensedPoints, Isometry3<f64>)> {
    let mut random = SplitMix64::new(seed);
    let settings = sensors(object.radius, FAULTS * random.uniform(), seed)?;
    let (frame, truth) = simulate_frame(&settings, object, hand, moment, mixed(seed, 0)).ok()?;
    if frame.mask.count() < LEAST_SEEN {
        return None;
    }
    let prepared = PreparedFrame::new(&frame, object).ok()?;
    let points = SensedPoints::new(&prepared, object.radius).ok()?;
    Some((points, truth))
}

/// Pixels of the object that a view must show.
const LEAST_SEEN: usize = 60;

/// Sensors with `faults` times those of the realistic preset, and a small image about an object of that `radius` \[m\].
fn sensors(radius: f64, faults: f64, seed: u64) -> Option<SynthSettings> {
    let mut sensor = SensorSettings::realistic();
    let (nearest, farthest) = (0.35, 0.75);
    let columns = (2.6 * radius * FOCAL / 0.45).ceil();
    let base = sensor.names();
    let known = |name: &str| base.iter().find(|(n, _)| n == name).map_or(0.0, |(_, v)| *v);
    let mut changes: Vec<(&str, f64)> = vec![
        ("viewpoint.nearest", nearest),
        ("viewpoint.farthest", farthest),
        ("viewpoint.focal_width_ratio", FOCAL / columns),
        ("viewpoint.hidden_share", 0.65),
        ("viewpoint.aim", 0.01),
        ("background.things", 6.0),
    ];
    let in_pixels = ["mask.wobble", "mask.leak", "depth.fattening", "color.blur"];
    changes.extend(in_pixels.map(|name| (name, RESOLUTION * faults * known(name))));
    let lengths = ["mask.wobble_length", "depth.correlation", "depth.disparity_step"];
    changes.extend(lengths.map(|name| (name, RESOLUTION * known(name))));
    let scaled = [
        "depth.scale",
        "depth.warp",
        "depth.noise",
        "depth.correlated_noise",
        "depth.hole_share",
        "touch.false_share",
        "calibration.hand_translation",
        "calibration.hand_rotation_deg",
        "calibration.joint_deg",
    ];
    changes.extend(scaled.map(|name| (name, faults * known(name))));
    // Stated for an image of 640 columns.
    let principal = faults * known("calibration.principal_px") * RESOLUTION * 640.0 / columns;
    changes.push(("calibration.principal_px", principal));
    for (name, value) in changes {
        sensor.set(name, &value.to_string()).ok()?;
    }
    let size = std::num::NonZeroUsize::new(columns as usize)?;
    let one = std::num::NonZeroU32::MIN;
    Some(SynthSettings {
        frames: one,
        frames_per_grasp: one,
        width: size,
        height: size,
        lens: None,
        undeclared_lens: false,
        film: None,
        sensor,
        seed,
        grasp: Default::default(),
    })
}

/// A seed of its own for each `number`.
pub fn mixed(seed: u64, number: u64) -> u64 {
    let mut state = seed ^ number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    state ^ (state >> 31)
}

/// A tensor that holds the bytes of `text`.
pub fn text_tensor(text: &str) -> Tensor {
    Tensor { shape: vec![text.len()], values: text.bytes().map(f32::from).collect() }
}

/// Text of a [`text_tensor`].
pub fn tensor_text(values: &[f32]) -> String {
    let bytes: Vec<u8> = values.iter().map(|v| *v as u8).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Numbers of a stored point: position, normal, color, force, and what of it is known.
const STORED: usize = 15;
/// Numbers of a stored view: how many points were seen and felt, the pose, and the grasp.
const HEAD: usize = 10;

/// Writes `views` to a file, whole or not at all.
///
/// # Errors
/// If it cannot be written.
pub fn save_views(file: &Path, views: &[View], of: &str) -> anyhow::Result<()> {
    let (mut heads, mut points) = (Vec::new(), Vec::new());
    for View { points: SensedPoints { seen, felt }, truth, grasp } in views {
        heads.extend([seen.len() as f32, felt.len() as f32]);
        heads.extend(truth.rotation.coords.iter().map(|v| *v as f32));
        heads.extend(truth.translation.vector.iter().map(|v| *v as f32));
        heads.push(*grasp as f32);
        for p in seen.iter().chain(felt) {
            points.extend(p.position.iter().chain(&p.normal).map(|v| *v as f32));
            points.extend(p.color.unwrap_or_default());
            points.extend(p.force.unwrap_or_default().iter().map(|v| *v as f32));
            let flags = [p.color.is_some(), p.force.is_some(), p.is_contact];
            points.extend(flags.map(|flag| f32::from(u8::from(flag))));
        }
    }
    let array = |values: Vec<f32>, width: usize| Tensor {
        shape: vec![values.len() / width, width],
        values,
    };
    let all = [
        ("heads", array(heads, HEAD)),
        ("points", array(points, STORED)),
        ("settings", text_tensor(of)),
    ];
    let all: Tensors = all.into_iter().map(|(name, t)| (name.to_owned(), t)).collect();
    Ok(write_tensors(file, &all)?)
}

/// Views of a file, if they are `of` these settings.
///
/// # Errors
/// If the file is broken or of other settings.
pub fn load_views(file: &Path, of: &str) -> anyhow::Result<Vec<View>> {
    let all = read_tensors(file)?;
    let values = |name: &str| {
        let found = all.get(name).map(|t| t.values.as_slice());
        found.with_context(|| format!("{}: no {name}", file.display()))
    };
    let stored = tensor_text(values("settings")?);
    if stored != of {
        bail!(
            "{}: made with {stored}, and now {of}: give the same settings, or remove it",
            file.display()
        );
    }
    let mut points = values("points")?.as_chunks::<STORED>().0.iter().map(|p| {
        let vector = |at: usize| Vector3::new(p[at], p[at + 1], p[at + 2]).cast::<f64>();
        SensedPoint {
            position: vector(0).into(),
            normal: vector(3),
            color: (p[12] > 0.0).then_some([p[6], p[7], p[8]]),
            force: (p[13] > 0.0).then(|| vector(9)),
            is_contact: p[14] > 0.0,
        }
    });
    let view = |head: &[f32; HEAD]| {
        let [seen, felt, i, j, k, w, x, y, z, grasp] = *head;
        let [i, j, k, w] = [i, j, k, w].map(f64::from);
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        let translation = Vector3::new(x, y, z).cast::<f64>();
        let seen = points.by_ref().take(seen as usize).collect();
        let felt = points.by_ref().take(felt as usize).collect();
        View {
            points: SensedPoints { seen, felt },
            truth: Isometry3::from_parts(translation.into(), rotation),
            grasp: grasp as u32,
        }
    };
    Ok(values("heads")?.as_chunks().0.iter().map(view).collect())
}
