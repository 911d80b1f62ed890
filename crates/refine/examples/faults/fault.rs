//! Faults of models and data, each of a random size.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;
use prehend_refine::scene::{Frame, Object};
use prehend_render::Mask;

/// The kinds of faults: those of the model, of the mask, of depth, of the hand, of color and of the camera.
pub(crate) const KINDS: [&str; 14] = [
    "another model",
    "model size",
    "mask shifted",
    "mask of another frame",
    "mask cut",
    "mask grown",
    "depth of another frame",
    "depth scale",
    "depth bias",
    "hand displaced",
    "hand turned",
    "joints",
    "color of another frame",
    "focal length",
];

/// Gives a frame a fault of `kind`; `other` is another frame of the dataset, `objects` are all of its models.
pub(crate) fn apply(
    kind: &str,
    observation: &mut Frame,
    object: &mut Arc<Object>,
    objects: &BTreeMap<u32, Arc<Object>>,
    other: Frame,
    random: &mut SplitMix64,
) -> anyhow::Result<()> {
    let mut normal = || Vector3::from_fn(|_, _| random.normal());
    let (direction, errors) = (normal().normalize(), [(); 8].map(|()| normal()));
    let mut between = |least: f64, most: f64| least + (most - least) * random.uniform();
    let sign = if between(-1.0, 1.0) < 0.0 { -1.0 } else { 1.0 };
    let hand = observation.hand.as_mut();
    match kind {
        "another model" => {
            let others: Vec<_> = objects.values().filter(|o| o.name != object.name).collect();
            anyhow::ensure!(!others.is_empty(), "the dataset has no other model");
            let index = between(0.0, others.len() as f64) as usize;
            object.clone_from(others[index.min(others.len() - 1)]);
        }
        "model size" => {
            let (mut mesh, center) = (object.mesh.clone(), object.center);
            let size = 1.0 + sign * between(0.03, 0.12);
            mesh.vertices.iter_mut().for_each(|v| *v = center + (*v - center) * size);
            *object = Arc::new(Object::new(&object.name, mesh, Some(object.inertial.clone()), 0)?);
        }
        "mask shifted" => {
            let step = direction.xy().normalize() * between(8.0, 40.0);
            observation.mask = shifted(&observation.mask, step.x as i64, step.y as i64)?;
        }
        "mask of another frame" => observation.mask = other.mask,
        "mask cut" => {
            let mask = &mut observation.mask;
            let mut left = (mask.count() as f64 * between(0.25, 0.65)) as usize;
            let all = mask.pixels_mut().iter_mut().filter(|set| **set);
            for set in all {
                if left == 0 {
                    break;
                }
                (*set, left) = (false, left - 1);
            }
        }
        "mask grown" => {
            let (whole, reach) = (observation.mask.clone(), between(4.0, 12.0) as i64);
            for (dx, dy) in (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| (x, y))) {
                if dx * dx + dy * dy <= reach * reach {
                    let more = shifted(&whole, dx, dy)?;
                    let all = observation.mask.pixels_mut().iter_mut().zip(more.pixels());
                    all.for_each(|(set, more)| *set |= more);
                }
            }
        }
        "depth of another frame" => observation.depth = other.depth,
        "depth scale" => {
            let scale = (1.0 + sign * between(0.01, 0.06)) as f32;
            observation.depth.pixels_mut().iter_mut().for_each(|z| *z *= scale);
        }
        "depth bias" => {
            let bias = (sign * between(0.005, 0.03)) as f32;
            let measured = observation.depth.pixels_mut().iter_mut().filter(|z| **z > 0.0);
            measured.for_each(|z| *z += bias);
        }
        "hand displaced" => hand.into_iter().for_each(|hand| {
            let step = Translation3::from(direction * between(0.01, 0.06));
            hand.t_cam_hand = step * hand.t_cam_hand;
        }),
        "hand turned" => hand.into_iter().for_each(|hand| {
            let turn = direction * between(3.0, 15.0).to_radians();
            let turned = UnitQuaternion::from_scaled_axis(turn) * hand.t_cam_hand.rotation;
            hand.t_cam_hand.rotation = turned;
        }),
        "joints" => hand.into_iter().for_each(|hand| {
            let sigma = between(5.0, 20.0).to_radians();
            let errors = errors.iter().flatten();
            hand.joints.iter_mut().zip(errors).for_each(|(q, error)| *q += sigma * error);
        }),
        "color of another frame" => observation.color = other.color,
        "focal length" => {
            let scale = 1.0 + sign * between(0.02, 0.08);
            observation.camera.fx *= scale;
            observation.camera.fy *= scale;
        }
        unknown => anyhow::bail!("there is no fault {unknown:?}: one of {}", KINDS.join(", ")),
    }
    Ok(())
}

fn shifted(mask: &Mask, dx: i64, dy: i64) -> anyhow::Result<Mask> {
    let (width, height) = (mask.width() as i64, mask.height() as i64);
    let at = |k: usize| {
        let (x, y) = (k as i64 % width - dx, k as i64 / width - dy);
        (0..width).contains(&x)
            && (0..height).contains(&y)
            && mask.pixels()[(y * width + x) as usize]
    };
    Ok(Mask::new(mask.width(), mask.height(), (0..mask.pixels().len()).map(at).collect())?)
}
