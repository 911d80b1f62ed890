//! Derivatives of single pixels against finite differences.

use super::*;
use crate::contour::Band;

/// A pixel that shows the object.
#[derive(Clone)]
struct Sample {
    hit: bool,
    /// The face whose color it shows.
    face: u32,
    pixel: Pixel,
}

fn pixels<const D: bool>(
    model: &RenderModel,
    pose: &Isometry3<f64>,
    center: &Point3<f64>,
    light: &Light,
) -> Vec<Option<Sample>> {
    let camera = camera();
    let options = ContourOptions::default();
    let view =
        ContourView::new(options.drawing(1), model, pose, center, &camera, light, &Region::EMPTY);
    let mut out = vec![None; camera.width * camera.height];
    for (index, visible) in view.visible.iter().enumerate() {
        view.visit::<D>(index, |x, y, seen| {
            out[y * camera.width + x] =
                seen.map(|s| Sample { hit: s.hit, face: 0, pixel: s.pixel });
        });
        let band = Band::new(view.pieces.iter(), &visible.region, view.scene.drawing.step.reach());
        for (i, &face) in visible.face.iter().enumerate() {
            let (x, y) = visible.position(i);
            if let Some(sample) = &mut out[y * camera.width + x] {
                let edge = view.pieces.get(band.piece[i] as usize);
                sample.face = if sample.hit { face } else { edge.unwrap().face };
            }
        }
    }
    out
}

/// Compares rows with central differences over all pixels that `pick` takes from both renderings and the
/// derivatives, unless the face seen changes between (kinks are the business of the tests of whole gradients); returns the cosine and the relative error of the whole Jacobian, and the number of entries.
fn compare_rows(
    model: &RenderModel,
    light: &Light,
    seed: u64,
    pick: impl Fn(&Sample) -> Option<Vec<(f32, Row)>>,
) -> (f64, f64, usize) {
    let pose = pose(&mut Noise(seed));
    let center = pose * model.center() + Vector3::new(0.01, -0.02, 0.015);
    let analytic = pixels::<true>(model, &pose, &center, light);
    let (mut ab, mut aa, mut bb, mut error, mut count) = (0.0, 0.0, 0.0, 0.0, 0);
    for axis in 0..6 {
        // About a fiftieth of a pixel either way.
        let step = if axis < 3 { 3e-5 } else { 6e-4 };
        let moved = [1.0, -1.0].map(|sign| {
            let pose = twisted(&pose, &center, &unit(axis, sign * step));
            pixels::<false>(model, &pose, &center, light)
        });
        // Rotations move points by about 4 cm a radian.
        let weight = if axis < 3 { 1.0 } else { 25.0 };
        for (i, pixel) in analytic.iter().enumerate() {
            let (Some(pixel), Some(high), Some(low)) = (pixel, &moved[0][i], &moved[1][i]) else {
                continue;
            };
            if high.face != pixel.face || low.face != pixel.face {
                continue;
            }
            let (Some(values), Some(high), Some(low)) = (pick(pixel), pick(high), pick(low)) else {
                continue;
            };
            for ((value, high), low) in values.iter().zip(&high).zip(&low) {
                let difference = weight * (high.0 - low.0) as f64 / (2.0 * step);
                let derivative = weight * value.1[axis] as f64;
                ab += difference * derivative;
                aa += derivative * derivative;
                bb += difference * difference;
                error += (difference - derivative).powi(2);
                count += 1;
            }
        }
    }
    (ab / (aa * bb).sqrt(), (error / bb).sqrt(), count)
}

fn interior_colors(p: &Sample) -> Option<Vec<(f32, Row)>> {
    (p.hit && p.pixel.depth_weight == 1.0)
        .then(|| (0..3).map(|k| (p.pixel.color[k], p.pixel.color_rows[k])).collect())
}

#[test]
fn interior_rows_of_a_texture_match_differences() {
    let model = RenderModel::new(&textured_box()).unwrap();
    for seed in 1..5 {
        let (cosine, error, count) =
            compare_rows(&model, &Light::ambient(0.9), seed, interior_colors);
        assert!(cosine > 0.999 && error < 0.04 && count > 10_000, "{cosine} {error} {count}");
    }
}

#[test]
fn interior_rows_of_shading_match_differences() {
    let model = RenderModel::new(&lump(0.045, 120)).unwrap().with_uniform_color([0.8, 0.6, 0.7]);
    for seed in 1..5 {
        let (cosine, error, count) = compare_rows(&model, &lamp(), seed, interior_colors);
        assert!(cosine > 0.999 && error < 0.05 && count > 10_000, "{cosine} {error} {count}");
    }
}

#[test]
fn depth_rows_match_differences() {
    for (name, mesh) in [("box", textured_box()), ("lump", lump(0.045, 120))] {
        let model = RenderModel::new(&mesh).unwrap();
        let (cosine, error, count) = compare_rows(&model, &lamp(), 3, |p| {
            (p.hit && p.pixel.depth_weight == 1.0).then(|| vec![(p.pixel.z, p.pixel.z_row)])
        });
        assert!(cosine > 0.999 && error < 0.05 && count > 3000, "{name} {cosine} {error} {count}");
    }
}

#[test]
fn contour_rows_match_differences() {
    let meshes =
        [textured_box(), painted(lump(0.045, 120), 0.05), painted(torus(0.04, 0.015, 60), 0.05)];
    for (i, mesh) in meshes.into_iter().enumerate() {
        let model = RenderModel::new(&mesh).unwrap();
        let coverage = |p: &Sample| {
            (p.pixel.coverage < 1.0).then(|| vec![(p.pixel.coverage, p.pixel.coverage_row)])
        };
        let (cosine, error, count) = compare_rows(&model, &lamp(), 4, coverage);
        assert!(cosine > 0.999 && error < 0.05 && count > 1000, "{i} {cosine} {error} {count}");
        let outside = |p: &Sample| {
            (!p.hit).then(|| (0..3).map(|k| (p.pixel.color[k], p.pixel.color_rows[k])).collect())
        };
        let (cosine, error, count) = compare_rows(&model, &lamp(), 4, outside);
        assert!(cosine > 0.999 && error < 0.05 && count > 1000, "{i} {cosine} {error} {count}");
    }
}
