//! Overlays: the object's outline at a pose over the image.

use nalgebra::Isometry3;
use prehend_render::{RgbImage, draw_outline};

use crate::scene::{Hand, Object, Observation};

/// Outline of the initial pose.
const BEFORE: [f32; 3] = [1.0, 0.25, 0.2];
/// Outline of the refined pose.
const AFTER: [f32; 3] = [0.2, 1.0, 0.35];
/// Outline of the hand.
const HAND: [f32; 3] = [0.35, 0.6, 1.0];

/// Light pixels between two pictures.
const GAP: usize = 6;

/// The image around the object twice: with the outline at `before`, and with that at `after`.
pub fn before_and_after(
    observation: &Observation,
    object: &Object,
    before: &Isometry3<f64>,
    after: &Isometry3<f64>,
) -> RgbImage {
    let mut left = brightened(observation);
    let mut right = left.clone();
    draw_outline(&mut left, &observation.camera, &object.model, before, BEFORE, 1.5);
    draw_outline(&mut right, &observation.camera, &object.model, after, AFTER, 1.5);
    let window @ [.., width, height] = window(observation);
    let mut pair = RgbImage::filled(2 * width + GAP, height, [1.0; 3]);
    copy(&left, window, &mut pair, 0);
    copy(&right, window, &mut pair, width + GAP);
    pair
}

/// The whole image with the outline at `t_cam_object`, and the hand's in blue where it is known.
pub fn outline_picture(
    observation: &Observation,
    object: &Object,
    robot: Option<&Hand>,
    t_cam_object: &Isometry3<f64>,
) -> RgbImage {
    let mut image = brightened(observation);
    if let (Some(robot), Some(hand)) = (robot, &observation.hand) {
        for (model, pose) in robot.render_bodies(&hand.t_cam_hand, &hand.joints) {
            draw_outline(&mut image, &observation.camera, model, &pose, HAND, 1.0);
        }
    }
    draw_outline(&mut image, &observation.camera, &object.model, t_cam_object, BEFORE, 1.5);
    image
}

/// The image, brightened if it is dark, so that people see something.
fn brightened(observation: &Observation) -> RgbImage {
    let mut image = observation.color.clone();
    let masked = image.pixels().iter().zip(observation.mask.pixels()).filter(|(_, m)| **m);
    let mut values: Vec<f32> = masked.map(|(c, _)| c.iter().copied().fold(0.0, f32::max)).collect();
    values.sort_by(f32::total_cmp);
    let bright = values.get(values.len() * 9 / 10).copied().unwrap_or(1.0);
    let gain = (0.9 / bright.max(0.05)).max(1.0);
    image.pixels_mut().iter_mut().flatten().for_each(|v| *v = (*v * gain).min(1.0));
    image
}

/// Left, top, width and height of the mask's surroundings \[px\].
fn window(observation: &Observation) -> [usize; 4] {
    let mask = &observation.mask;
    let (width, height) = (mask.width(), mask.height());
    let Some([left, top, columns, rows]) = mask.bounds() else { return [0, 0, width, height] };
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

/// Copies `window` of one image into another, to column `column` of its top.
fn copy(from: &RgbImage, [left, top, width, height]: [usize; 4], to: &mut RgbImage, column: usize) {
    let row = to.width();
    for y in 0..height {
        let source = &from.pixels()[(top + y) * from.width() + left..][..width];
        to.pixels_mut()[y * row + column..][..width].copy_from_slice(source);
    }
}
