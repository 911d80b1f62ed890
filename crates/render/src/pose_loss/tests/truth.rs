//! Gradients against differences of pictures that an average over many rays a pixel makes: the truth that a camera
//! sees, which knows nothing of contours.

use super::*;
use prehend_geometry::objects::YcbObject;

/// Samples a pixel, across and down.
const SAMPLES: usize = 9;

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
        let object = SceneObject { model: self.model, t_cam_model: *pose };
        render_scene(&window.camera, &[object], &self.light, [0.0; 3], std::env::var("NS").map_or(SAMPLES, |v| v.parse().unwrap())).color
    }

    /// What a camera sees of the object at `pose`; whatever it touches belongs to the mask.
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

    /// Cosine and relative error of the gradient of the mean squared error, with rotations scaled to lengths at 4 cm.
    pub(super) fn compare(
        &self,
        truth: &Isometry3<f64>,
        guess: &Isometry3<f64>,
        half_width: f64,
    ) -> (f64, f64) {
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
            sum * target.normalisation
        };
        // A third of a pixel either way.
        let pixel = guess.translation.vector.z / self.camera.fx;
        let difference = Vector6::from_fn(|axis, _| {
            let step = 0.3 * pixel * if axis < 3 { 1.0 } else { 25.0 };
            let at = |s: f64| value(&twisted(guess, &center, &unit(axis, s * step)));
            (at(1.0) - at(-1.0)) / (2.0 * step)
        });
        let scale = Vector6::new(1.0, 1.0, 1.0, 25.0, 25.0, 25.0);
        let b = difference.component_mul(&scale);
        let loss = PoseLoss::new(contour(half_width), LossOptions::default());
        let at = loss.linearise(self.model, guess, &center, &self.light, &target);
        let a = at.gradient.component_mul(&scale);
        if std::env::var_os("SHOW").is_some() {
            println!("{:.4} | {:.4}", a.transpose(), b.transpose());
        }
        (a.dot(&b) / (a.norm() * b.norm()), (a - b).norm() / b.norm())
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

#[test]
fn gradients_of_household_objects_are_true() {
    let objects = [
        YcbObject::MustardBottle,
        YcbObject::SugarBox,
        YcbObject::TomatoSoupCan,
        YcbObject::PottedMeatCan,
        YcbObject::BleachCleanser,
    ];
    let mut worst = (1.0f64, 0.0f64);
    for object in objects {
        let mut model = RenderModel::new(&object.mesh()).unwrap();
        if std::env::var_os("UNI").is_some() { model = model.with_uniform_color([0.8, 0.6, 0.7]); }
        let light = if std::env::var_os("AMB").is_some() { Light::ambient(0.9) } else { lamp() };
        let hw: f64 = std::env::var("HW").map_or(0.645, |v| v.parse().unwrap());
        for camera in cameras() {
            for seed in 0..2 {
                let [truth, guess] = pair(&model, &camera, 70 + seed);
                let scene = Scene { model: &model, light, camera };
                let (cosine, error) = scene.compare(&truth, &guess, hw);
                println!(
                    "{} {}x{} {seed}: {cosine:.5} {error:.4}",
                    object.name(),
                    camera.width,
                    camera.height
                );
                worst = (worst.0.min(cosine), worst.1.max(error));
            }
        }
    }
    assert!(worst.0 > 0.999 && worst.1 < 0.02, "{worst:?}");
}
