//! Camera and tactile sensors with the faults that last through one grasp, and the frames they capture.

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::SplitMix64;
use prehend_geometry::robot::{Drive, Motion};
use prehend_render::{
    Camera, DepthImage, Mask, RenderModel, RgbImage, SceneObject, SurfacePoint, depth_map,
    render_shaded,
};

use super::calibration::Miscalibration;
use super::depth::DepthBias;
use super::settings::SensorSettings;
use super::touch::TaxelCondition;
use crate::scene::{Hand, HandMeasurement, Object, Observation};
use crate::synth::grasp::GraspSnapshot;

/// Sensors with the faults that stay the same through a grasp.
pub(in crate::synth) struct Rig<'a> {
    settings: &'a SensorSettings,
    object: &'a Object,
    robot: &'a Hand,
    camera: Camera,
    errors: Miscalibration,
    depth: DepthBias,
    taxels: Vec<TaxelCondition>,
    paint: Paint,
}

/// One frame: measurements and ground truth.
pub(in crate::synth) struct Shot {
    /// The measurements.
    pub(in crate::synth) told: Observation,
    /// Object → camera.
    pub(in crate::synth) truth: Isometry3<f64>,
    /// Hand base → camera, and the joint positions.
    pub(in crate::synth) hand: (Isometry3<f64>, Vec<f64>),
    /// The object's silhouette, as far as it lies within the image.
    pub(in crate::synth) whole: Mask,
    /// The part of it that nothing hides.
    pub(in crate::synth) visible: Mask,
}

/// Rays a pixel, along each axis.
const SAMPLES: usize = 3;

impl<'a> Rig<'a> {
    /// Sensors of `width` by `height` pixels; `noise` decides their faults.
    pub(in crate::synth) fn new(
        settings: &'a SensorSettings,
        object: &'a Object,
        robot: &'a Hand,
        (width, height): (usize, usize),
        noise: &mut SplitMix64,
    ) -> Self {
        let camera = settings.viewpoint.camera(width, height);
        Self {
            errors: settings.calibration.draw(&slides(robot), noise),
            depth: settings.depth.bias(&camera, noise),
            taxels: settings.touch.condition(robot.taxels.len(), noise),
            paint: Paint::random(noise),
            settings,
            object,
            robot,
            camera,
        }
    }

    /// Captures a frame of `moment`, whose joints and taxels are those of the hand.
    pub(in crate::synth) fn capture(&self, moment: &GraspSnapshot, noise: &mut SplitMix64) -> Shot {
        let identity = Isometry3::identity();
        let mut bodies: Vec<(&RenderModel, Isometry3<f64>)> =
            vec![(&self.object.model, moment.t_hand_object)];
        bodies.extend(self.robot.render_bodies(&identity, &moment.joints));
        let viewpoint = &self.settings.viewpoint;
        let t_cam_hand = viewpoint.choose(&self.camera, &bodies, &moment.gravity, noise);
        bodies.iter_mut().for_each(|(_, pose)| *pose = t_cam_hand * *pose);
        let gravity = t_cam_hand.rotation * moment.gravity;
        let Rendered { color, depth, visible, hand } = self.render_rgbd(&bodies, &gravity, noise);

        let alone = depth_map(&self.camera, &bodies[..1]);
        let mut whole = visible.clone();
        for (set, z) in whole.pixels_mut().iter_mut().zip(alone.pixels()) {
            *set |= *z > 0.0;
        }
        let reading = HandMeasurement {
            t_cam_hand: self.errors.hand(&t_cam_hand),
            joints: self.errors.joints(&moment.joints),
            forces: self.settings.touch.simulate_taxels(&moment.taxel_forces, &self.taxels, noise),
        };
        let told = Observation {
            camera: self.errors.camera(&self.camera),
            color: self.settings.color.expose(&color, noise),
            depth: self.settings.depth.measure(&depth, &self.camera, &self.depth, noise),
            mask: self.settings.mask.segment(&visible, &hand, noise),
            gravity: Some(gravity),
            hand: Some(reading),
        };
        let truth = t_cam_hand * moment.t_hand_object;
        Shot { told, truth, hand: (t_cam_hand, moment.joints.clone()), whole, visible }
    }

    /// Renders color and depth without the camera's faults; the first of `bodies` is the object.
    fn render_rgbd(
        &self,
        bodies: &[(&RenderModel, Isometry3<f64>)],
        gravity: &Vector3<f64>,
        noise: &mut SplitMix64,
    ) -> Rendered {
        let (width, height) = (self.camera.width, self.camera.height);
        let lights = self.settings.light.draw(bodies, &-gravity, noise);
        let (wall, behind) = self.settings.background.draw(&self.camera, noise);
        let drawn: Vec<_> =
            bodies.iter().map(|(model, pose)| SceneObject { model, t_cam_model: *pose }).collect();
        let shade = |body: usize, point: &SurfacePoint<f32>| {
            let albedo = if body == 0 { point.albedo } else { self.paint.of(body) };
            lights.shade(point, albedo)
        };
        let picture = render_shaded(&self.camera, &drawn, SAMPLES, shade, |x, y| {
            wall.pixels()[y * width + x]
        });
        let mut depth = picture.depth;
        for (z, far) in depth.pixels_mut().iter_mut().zip(behind.pixels()) {
            *z = if *z > 0.0 { *z } else { *far };
        }
        let mask_of = |wanted: fn(u32) -> bool| {
            let mut mask = Mask::filled(width, height, false);
            for (set, body) in mask.pixels_mut().iter_mut().zip(&picture.object) {
                *set = body.is_some_and(wanted);
            }
            mask
        };
        let (visible, hand) = (mask_of(|body| body == 0), mask_of(|body| body > 0));
        Rendered { color: picture.color, depth, visible, hand }
    }
}

struct Rendered {
    color: RgbImage,
    depth: DepthImage,
    visible: Mask,
    hand: Mask,
}

/// Colors of the hand's parts.
struct Paint {
    tones: [[f32; 3]; 3],
}

impl Paint {
    /// Black anodized metal, gray plastic and black rubber, each a little different every time.
    fn random(noise: &mut SplitMix64) -> Self {
        let tones = [[0.21, 0.22, 0.24], [0.42, 0.43, 0.44], [0.14, 0.14, 0.15]].map(|tone| {
            let lighter = 0.8 + 0.5 * noise.uniform() as f32;
            tone.map(|v: f32| v * lighter)
        });
        Self { tones }
    }

    fn of(&self, body: usize) -> [f32; 3] {
        self.tones[[0, 2, 1, 2][body % 4]]
    }
}

/// Whether each of the robot's joints is prismatic.
fn slides(robot: &Hand) -> Vec<bool> {
    let mut slides = vec![false; robot.tree.joint_names().len()];
    for joint in robot.tree.joints() {
        if let (Motion::Prismatic, Drive::Variable { index, .. }) = (joint.motion, joint.drive) {
            slides[index] = true;
        }
    }
    slides
}
