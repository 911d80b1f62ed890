//! Overlays: the object's outline at a pose over the image.

use nalgebra::{Isometry3, Vector2};
use prehend_render::{Camera, RgbImage, draw_outline};

use crate::calibration::Residuals;
use crate::scene::{Frame, Object};

/// Outline of the initial pose.
const BEFORE: [f32; 3] = [1.0, 0.25, 0.2];
/// Outline of the refined pose.
const AFTER: [f32; 3] = [0.2, 1.0, 0.35];
/// Outline of the hand.
const HAND: [f32; 3] = [0.35, 0.6, 1.0];

/// Light pixels between two pictures.
const GAP: usize = 6;

/// The image around the object twice, side by side: with the outline at `before`, and with that at `after`.
pub fn before_and_after(
    observation: &Frame,
    object: &Object,
    before: &Isometry3<f64>,
    after: &Isometry3<f64>,
) -> RgbImage {
    side_by_side(&compared(observation, object, Some(before), after))
}

/// The image around the object with the outline at `before`, or none without, and with that at `after`.
pub(super) fn compared(
    observation: &Frame,
    object: &Object,
    before: Option<&Isometry3<f64>>,
    after: &Isometry3<f64>,
) -> [RgbImage; 2] {
    let (image, window) = (brightened(observation), window(observation, object, after));
    [(before, BEFORE), (Some(after), AFTER)].map(|(pose, color)| match pose {
        Some(pose) => cut(&outlined(image.clone(), observation, object, pose, color), window),
        None => cut(&image, window),
    })
}

/// The image around the object twice, with outlines of object and hand: as an observation, a model and a pose (object → camera \[m\]) have
/// them before, and after a calibration.
pub fn rig_picture(
    before: (&Frame, &Object, &Isometry3<f64>),
    after: (&Frame, &Object, &Isometry3<f64>),
) -> [RgbImage; 2] {
    let window = window(before.0, before.1, before.2);
    [(before, BEFORE), (after, AFTER)].map(|((observation, object, pose), color)| {
        // Undistorted images are others than those before.
        let image = with_hand(brightened(observation), observation);
        cut(&outlined(image, observation, object, pose, color), window)
    })
}

/// Mean residuals of depth over the image before and after a calibration: red where depth is measured too far away, blue where too near, by
/// `brightest` \[m\] where colors are full; gray where none was seen.
pub fn depth_residual_picture(
    before: &Residuals,
    after: &Residuals,
    brightest: f64,
) -> [RgbImage; 2] {
    [before, after].map(|residuals| {
        let (width, height) = residuals.size();
        let mut image = RgbImage::filled(width, height, [0.6; 3]);
        for (i, pixel) in image.pixels_mut().iter_mut().enumerate() {
            if let Some(residual) = residuals.depth_at(i % width.max(1), i / width.max(1)) {
                let part = (residual / brightest).clamp(-1.0, 1.0) as f32;
                let rest = 1.0 - part.abs();
                *pixel = if part > 0.0 { [1.0, rest, rest] } else { [rest, rest, 1.0] };
            }
        }
        image
    })
}

/// Two images of the same size beside each other.
fn side_by_side(images: &[RgbImage; 2]) -> RgbImage {
    let (width, height) = (images[0].width(), images[0].height());
    let mut pair = RgbImage::filled(2 * width + GAP, height, [1.0; 3]);
    let row = pair.width();
    for (k, image) in images.iter().enumerate() {
        for (y, line) in image.pixels().chunks(width.max(1)).enumerate() {
            pair.pixels_mut()[y * row + k * (width + GAP)..][..width].copy_from_slice(line);
        }
    }
    pair
}

/// The whole image with the outline at `t_cam_object`, and the hand's in blue where it is known.
pub fn outline_picture(
    observation: &Frame,
    object: &Object,
    t_cam_object: &Isometry3<f64>,
) -> RgbImage {
    let image = with_hand(brightened(observation), observation);
    outlined(image, observation, object, t_cam_object, BEFORE)
}

/// `image` with the outline of the hand, where that is known.
fn with_hand(mut image: RgbImage, observation: &Frame) -> RgbImage {
    if let Some(hand) = &observation.hand {
        for (model, pose) in hand.hand.render_bodies(&hand.t_cam_hand, &hand.joints) {
            draw_outline(&mut image, &observation.camera, model, &pose, HAND, 1.0);
        }
    }
    image
}

/// `image` with the outline of the object in this color.
fn outlined(
    mut image: RgbImage,
    observation: &Frame,
    object: &Object,
    t_cam_object: &Isometry3<f64>,
    color: [f32; 3],
) -> RgbImage {
    draw_outline(&mut image, &observation.camera, &object.model, t_cam_object, color, 1.5);
    image
}

/// The image, brightened if it is dark, so that people see something.
fn brightened(observation: &Frame) -> RgbImage {
    let mut image = observation.color.clone();
    let masked = image.pixels().iter().zip(observation.mask.pixels()).filter(|(_, m)| **m);
    let mut values: Vec<f32> = masked.map(|(c, _)| c.iter().copied().fold(0.0, f32::max)).collect();
    values.sort_by(f32::total_cmp);
    let bright = values.get(values.len() * 9 / 10).copied().unwrap_or(1.0);
    let gain = (0.9 / bright.max(0.05)).max(1.0);
    image.pixels_mut().iter_mut().flatten().for_each(|v| *v = (*v * gain).min(1.0));
    image
}

/// Left, top, width and height of the surroundings of the mask, or without one, of the object at a pose \[px\].
fn window(observation: &Frame, object: &Object, t_cam_object: &Isometry3<f64>) -> [usize; 4] {
    let mask = &observation.mask;
    let (width, height) = (mask.width(), mask.height());
    let bounds = mask.bounds().or_else(|| projected(&observation.camera, object, t_cam_object));
    let Some([left, top, columns, rows]) = bounds else { return [0, 0, width, height] };
    // Square and half as large again, so that the hand and a misplaced outline are in view.
    let side = columns.max(rows) * 3 / 2;
    let begin =
        |center: usize, size: usize| center.saturating_sub(side / 2).min(size.saturating_sub(side));
    [
        begin(left + columns / 2, width),
        begin(top + rows / 2, height),
        side.min(width),
        side.min(height),
    ]
}

/// Left, top, width and height of what the image shows of an object \[px\].
fn projected(
    camera: &Camera,
    object: &Object,
    t_cam_object: &Isometry3<f64>,
) -> Option<[usize; 4]> {
    let size = Vector2::new(camera.width as f64, camera.height as f64);
    let pixels = object.mesh.vertices.iter().filter_map(|v| {
        let pixel = camera.project(&(t_cam_object * v))?;
        Some(Vector2::new(pixel.x, pixel.y).sup(&Vector2::zeros()).inf(&size))
    });
    let both = pixels.map(|p| (p, p)).reduce(|(l, h), (p, q)| (l.inf(&p), h.sup(&q)))?;
    let (low, side) = (both.0, both.1 - both.0);
    (side.min() >= 1.0).then_some([low.x, low.y, side.x, side.y].map(|v| v as usize))
}

/// A window of an image.
fn cut(image: &RgbImage, [left, top, width, height]: [usize; 4]) -> RgbImage {
    let mut cut = RgbImage::filled(width, height, [1.0; 3]);
    for (y, line) in cut.pixels_mut().chunks_mut(width.max(1)).enumerate() {
        line.copy_from_slice(&image.pixels()[(top + y) * image.width() + left..][..width]);
    }
    cut
}
