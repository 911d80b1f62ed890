//! Gradients against differences of pictures that an average over many rays a pixel makes: the truth that a camera
//! sees, which knows nothing of contours.

use super::*;
use crate::scene::render_scene;
use prehend_geometry::objects::YcbObject;

/// Samples a pixel, across and down.
const SAMPLES: usize = 11;

/// A view whose part around the object is rendered with many samples.
pub(super) struct Scene<'a> {
    pub(super) model: &'a RenderModel,
    pub(super) light: Light,
    pub(super) camera: Camera,
}

/// The part of the image that a picture shows.
struct Window {
    camera: Camera,
    x: usize,
    y: usize,
}

impl Scene<'_> {
    /// The pixels that the object may cover at this pose or next to it.
    fn window(&self, pose: &Isometry3<f64>) -> Window {
        let posed = crate::posed::Posed::new(self.model, &self.camera, pose, 8.0);
        let region = posed.projected.region;
        let camera = Camera {
            cx: self.camera.cx - region.x0 as f64,
            cy: self.camera.cy - region.y0 as f64,
            width: region.width(),
            height: region.y1 - region.y0,
            ..self.camera
        };
        Window { camera, x: region.x0, y: region.y0 }
    }

    fn picture(&self, window: &Window, pose: &Isometry3<f64>) -> RgbImage {
        let (camera, bodies) = (&window.camera, [(self.model, *pose)]);
        render_scene(camera, &bodies, SAMPLES, |_, p| self.light.color(p), |_, _| [0.0; 3]).color
    }

    /// Camera image of the object at `pose`; every pixel that it touches belongs to the mask.
    fn target(&self, pose: &Isometry3<f64>) -> Target {
        let window = self.window(pose);
        let picture = self.picture(&window, pose);
        let (width, height) = (self.camera.width, self.camera.height);
        let mut whole = RgbImage::filled(width, height, [0.0; 3]);
        for y in 0..window.camera.height {
            for x in 0..window.camera.width {
                whole.pixels_mut()[(window.y + y) * width + window.x + x] =
                    picture.get(x, y).unwrap();
            }
        }
        let mask = whole.pixels().iter().map(|c| *c != [0.0; 3]).collect();
        let mask = Mask::new(width, height, mask).unwrap();
        Target::new(self.camera, &whole, &mask).unwrap()
    }

    /// Cosine and relative error of the gradient of half the mean squared error, with rotations scaled to lengths at the model's radius, for each
    /// mode and number of samples a pixel.
    pub(super) fn compare<const N: usize>(
        &self,
        truth: &Isometry3<f64>,
        guess: &Isometry3<f64>,
        ways: [(Mode, usize); N],
    ) -> [(f64, f64); N] {
        let target = self.target(truth);
        let window = self.window(guess);
        let center = truth * self.model.center();
        let value = |pose: &Isometry3<f64>| {
            let picture = self.picture(&window, pose);
            let mut sum = 0.0;
            for y in 0..window.camera.height {
                for x in 0..window.camera.width {
                    let ours = picture.get(x, y).unwrap();
                    let theirs = target.color[(window.y + y) * self.camera.width + window.x + x];
                    (0..3).for_each(|k| sum += f64::from(ours[k] - theirs[k]).powi(2));
                }
            }
            0.5 * sum * target.normalization
        };
        // A tenth of a pixel either way, also where rotations move most: where two outlines are less than a pixel apart, the
        // loss bends within a pixel.
        let pixel = guess.translation.vector.z / self.camera.fx;
        let difference = Vector6::from_fn(|axis, _| {
            let step = 0.1 * pixel / if axis < 3 { 1.0 } else { self.model.radius() };
            let at = |s: f64| value(&twisted(guess, &center, &unit(axis, s * step)));
            (at(1.0) - at(-1.0)) / (2.0 * step)
        });
        let arm = 1.0 / self.model.radius();
        let scale = Vector6::new(1.0, 1.0, 1.0, arm, arm, arm);
        let b = difference.component_mul(&scale);
        ways.map(|(mode, samples)| {
            let loss = PoseLoss::new(mode, LossOptions::default()).with_samples(samples);
            let at = loss.linearize(self.model, guess, &center, &self.light, &target);
            let a = at.gradient.component_mul(&scale);
            (a.dot(&b) / (a.norm() * b.norm()), (a - b).norm() / b.norm())
        })
    }
}

/// The two sizes of image, in which an object of 15 cm at 0.6 m covers about 12 thousand pixels.
pub(super) fn cameras() -> [Camera; 2] {
    [
        Camera { fx: 480.0, fy: 480.0, cx: 127.5, cy: 127.5, width: 256, height: 256 },
        Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 },
    ]
}

/// A pose in view and another, some pixels and degrees away.
pub(super) fn pair(model: &RenderModel, camera: &Camera, seed: u64) -> [Isometry3<f64>; 2] {
    let mut noise = Noise(seed);
    let turn = UnitQuaternion::from_scaled_axis(noise.vector(2.0));
    // The object spans about 130 pixels.
    let z = model.radius() * 2.0 * camera.fx / 130.0;
    let center = Vector3::new(0.0, 0.0, z) + noise.vector(0.01);
    let shift = Translation3::from(center - turn * model.center().coords);
    let truth = Isometry3::from_parts(shift, turn);
    let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.006 } else { 0.1 });
    [truth, twisted(&truth, &(truth * model.center()), &twist)]
}

/// The worst cosine and relative error over household objects and both cameras, for each number of samples a pixel.
fn worst<const N: usize>(
    name: &str,
    samples: [usize; N],
    light: Light,
    change: impl Fn(RenderModel) -> RenderModel,
) -> [(f64, f64); N] {
    let objects = [
        YcbObject::MustardBottle,
        YcbObject::SugarBox,
        YcbObject::TomatoSoupCan,
        YcbObject::PottedMeatCan,
        YcbObject::BleachCleanser,
    ];
    let mut worst = [(1.0f64, 0.0f64); N];
    for object in objects {
        let model = change(RenderModel::new(&object.mesh()).unwrap());
        for camera in cameras() {
            let [truth, guess] = pair(&model, &camera, 70);
            let scene = Scene { model: &model, light, camera };
            let found = scene.compare(&truth, &guess, samples.map(|n| (contour(0.645), n)));
            let (object, width) = (object.name(), camera.width);
            for (k, (cosine, error)) in found.into_iter().enumerate() {
                println!("{name} {object} {width} px, {}²: {cosine:.5} {error:.4}", samples[k]);
                worst[k] = (worst[k].0.min(cosine), worst[k].1.max(error));
            }
        }
    }
    worst
}

fn plain(model: RenderModel) -> RenderModel {
    model.with_uniform_color([0.8, 0.6, 0.7])
}

#[test]
fn gradients_of_outlines_are_true() {
    let [rough, fine] = worst("outline", [1, 4], Light::ambient(0.9), plain);
    assert!(rough.0 > 0.999 && rough.1 < 0.035, "{rough:?}");
    assert!(fine.0 > 0.999 && fine.1 < 0.02, "{fine:?}");
}

/// At the rims of cans, the edges of cartons and narrow bevels the light jumps from one face to the next, which counts where
/// slopes are taken between the sides of samples.
#[test]
fn gradients_of_shading_are_true_with_samples_in_the_pixel() {
    let [fine] = worst("shading", [4], lamp(), plain);
    assert!(fine.0 > 0.9995 && fine.1 < 0.02, "{fine:?}");
}

/// A sharp print is seen by single pixels at their centers; samples within them see it between their sides.
#[test]
fn gradients_of_prints_are_true_with_samples_in_the_pixel() {
    let [rough, fine, finest] = worst("print", [1, 4, 8], Light::ambient(0.9), |m| m);
    assert!(rough.0 > 0.98 && rough.1 < 0.2, "{rough:?}");
    assert!(fine.0 > 0.999 && fine.1 < 0.04, "{fine:?}");
    assert!(finest.0 > 0.9995 && finest.1 < 0.02, "{finest:?}");
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn data_gradients_of_scans_are_true() {
    let data = std::env::var_os("PREHEND_DATA").map_or_else(
        || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        std::path::PathBuf::from,
    );
    for object in ["000005", "000006", "000021"] {
        let mesh = TriMesh::load(&data.join(format!("mujoco/models/obj_{object}.ply"))).unwrap();
        let model = RenderModel::new(&mesh.scaled(1e-3)).unwrap();
        for camera in cameras() {
            let [truth, guess] = pair(&model, &camera, 70);
            let scene = Scene { model: &model, light: lamp(), camera };
            let limits = [(1, 0.998, 0.12), (4, 0.999, 0.02), (8, 0.999, 0.02)];
            let found =
                scene.compare(&truth, &guess, limits.map(|limit| (contour(0.645), limit.0)));
            for ((samples, least, most), (cosine, error)) in limits.into_iter().zip(found) {
                println!("{object} {} px, {samples}²: {cosine:.5} {error:.4}", camera.width);
                assert!(cosine > least && error < most, "{object}: {cosine} {error}");
            }
        }
    }
}

/// Half the mean squared error of a picture with 9 x 9 hard samples a pixel.
fn supersampled_error(
    model: &RenderModel,
    pose: &Isometry3<f64>,
    light: &Light,
    target: &Target,
) -> f64 {
    let bodies = [(model, *pose)];
    let picture = render_scene(target.camera(), &bodies, 9, |_, p| light.color(p), |_, _| [0.0; 3]);
    let mut sum = 0.0;
    for (ours, theirs) in picture.color.pixels().iter().zip(&target.color) {
        (0..3).for_each(|k| sum += f64::from(ours[k] - theirs[k]).powi(2));
    }
    0.5 * sum * target.normalization
}

#[test]
fn gradients_match_differences_of_supersampled_pictures() {
    let scenes = [
        (textured_box(), Light::ambient(0.9)),
        (painted(lump(0.045, 120), 0.05), lamp()),
        (painted(sphere(0.045, 240), 0.04), lamp()),
    ];
    for (i, (mesh, light)) in scenes.into_iter().enumerate() {
        let model = RenderModel::new(&mesh).unwrap();
        for seed in 0..2 {
            let mut noise = Noise(70 + seed);
            let truth = pose(&mut noise);
            let center = truth * model.center();
            let bodies = [(&model, truth)];
            let picture =
                render_scene(&camera(), &bodies, 9, |_, p| light.color(p), |_, _| [0.0; 3]);
            let mask = picture.color.pixels().iter().map(|c| *c != [0.0; 3]).collect();
            let mask = Mask::new(160, 120, mask).unwrap();
            let target = Target::new(camera(), &picture.color, &mask).unwrap();
            let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.004 } else { 0.08 });
            let guess = twisted(&truth, &center, &twist);
            let difference = Vector6::from_fn(|axis, _| {
                let step = if axis < 3 { 2e-4 } else { 5e-3 };
                let value = |s: f64| {
                    let pose = twisted(&guess, &center, &unit(axis, s * step));
                    supersampled_error(&model, &pose, &light, &target)
                };
                (value(1.0) - value(-1.0)) / (2.0 * step)
            });
            let scale = Vector6::new(1.0, 1.0, 1.0, 25.0, 25.0, 25.0);
            let b = difference.component_mul(&scale);
            // A step of half-width 0.645 blurs as much as a pixel's box; one pixel is the default.
            for (half_width, limit) in [(0.645, 0.03), (1.0, 0.035)] {
                let loss = PoseLoss::new(contour(half_width), LossOptions::default());
                let at = loss.linearize(&model, &guess, &center, &light, &target);
                let a = at.gradient.component_mul(&scale);
                let cosine = a.dot(&b) / (a.norm() * b.norm());
                let error = (a - b).norm() / b.norm();
                assert!(
                    cosine > 0.999 && error < limit,
                    "{i} {seed} {half_width}: {cosine} {error}"
                );
            }
        }
    }
}
