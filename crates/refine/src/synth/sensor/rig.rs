//! Camera and tactile sensors with the faults that last through one grasp, and the frames they capture.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::SplitMix64;
use prehend_render::{
    Camera, DepthImage, DistortionError, Mask, RenderModel, RgbImage, SurfacePoint, depth_map,
    render_scene,
};
use serde_json::{Map, Value, json};

use super::calibration::Miscalibration;
use super::depth::DepthBias;
use super::film::{FilmScene, FilmSettings};
use super::lens::SimulatedLens;
use super::settings::SensorSettings;
use super::touch::TaxelCondition;
use crate::data::bop::{Tactile, rotation_to_row_major, translation_to_mm};
use crate::scene::{Frame, Hand, Object, prismatic_joints};
use crate::synth::annotation;
use crate::synth::files::Shot;
use crate::synth::grasp::GraspSnapshot;
use crate::synth::plan::SynthSettings;

/// Sensors with the faults that stay the same through a grasp.
pub(in crate::synth) struct SensorRig<'a> {
    settings: &'a SensorSettings,
    object: &'a Object,
    robot: &'a Arc<Hand>,
    camera: Camera,
    lens: Option<&'a SimulatedLens>,
    errors: Miscalibration,
    depth: DepthBias,
    taxels: Vec<TaxelCondition>,
    /// Colors of the hand.
    paint: [[f32; 3]; 3],
}

/// Images of the scene, without the sensors' faults.
pub(super) struct TrueView {
    pub(super) color: RgbImage,
    pub(super) depth: DepthImage,
    /// Visible parts of object and hand.
    pub(super) visible: Mask,
    pub(super) hand: Mask,
    /// The object's silhouette without the hand.
    pub(super) whole: Mask,
}

/// Distance of the places where `rig_gt.json` tells depth's warp \[px\].
const GRID: usize = 20;

/// Rays a pixel, along each axis.
const SAMPLES: usize = 3;

impl<'a> SensorRig<'a> {
    /// Sensors of a dataset, the camera behind a lens if there is one; `noise` decides their faults.
    pub(in crate::synth) fn new(
        settings: &'a SynthSettings,
        object: &'a Object,
        robot: &'a Arc<Hand>,
        lens: Option<&'a SimulatedLens>,
        noise: &mut SplitMix64,
    ) -> Self {
        let (camera, settings) = (settings.camera(), &settings.sensor);
        Self {
            errors: settings.calibration.draw(&prismatic_joints(&robot.tree), noise),
            depth: settings.depth.bias(&camera, noise),
            taxels: settings.touch.condition(robot.taxels.len(), noise),
            paint: random_paint(noise),
            settings,
            object,
            robot,
            lens,
            camera,
        }
    }

    /// Content of `rig_gt.json`: changes that bring what is said and measured to what is true. They are factors of focal lengths, shift of the principal
    /// point, factor of depth, what is to be added then on a grid of the image, the hand's pose in the frame of where it is said to be and joint positions to
    /// be added; and factors that taxels' readings have, with what was added to them then \[N\].
    pub(in crate::synth) fn faults(&self) -> Value {
        let Miscalibration { focal, principal, hand } = &self.errors;
        let (camera, scale) = (&self.camera, f64::from(self.depth.scale));
        let offset =
            |x: usize, y: usize| -1e3 * f64::from(self.depth.warp[y * camera.width + x]) / scale;
        let across = (0..camera.width).step_by(GRID);
        let row = |y: usize| across.clone().map(|x| offset(x, y)).collect::<Vec<f64>>();
        let names = self.robot.tree.joint_names().iter().cloned();
        let joints = names.zip(hand.joints.iter().map(|error| json!(-error)));
        let t_said_true = hand.pose.inverse();
        let felt =
            |taxel: &TaxelCondition| <[f64; 3]>::from(taxel.phantom / Tactile::UNITS_PER_NEWTON);
        let mut faults = json!({
            "focal_scale": focal.map(|scale| 1.0 / scale),
            "principal_point_px": principal.map(|shift| -shift * camera.width as f64),
            "depth_scale": 1.0 / scale,
            "depth_offset_mm": (0..camera.height).step_by(GRID).map(row).collect::<Vec<_>>(),
            "hand_R": rotation_to_row_major(&t_said_true.rotation),
            "hand_t": translation_to_mm(&t_said_true.translation),
            "joints": joints.collect::<Map<_, _>>(),
            "taxel_gains": self.taxels.iter().map(|taxel| taxel.gain).collect::<Vec<_>>(),
            "taxel_offsets_n": self.taxels.iter().map(felt).collect::<Vec<_>>(),
        });
        if let Some(lens) = self.lens.filter(|lens| !lens.is_declared) {
            faults["cam_dist"] = annotation::lens(&lens.model);
        }
        faults
    }

    /// A film of `moments`.
    pub(in crate::synth) fn film(
        &self,
        settings: &FilmSettings,
        moments: &[GraspSnapshot],
        noise: &mut SplitMix64,
    ) -> FilmScene {
        let mut first = |moment: &GraspSnapshot| self.viewpoint(moment, noise);
        let t_cam_hand = moments.first().map_or_else(Isometry3::identity, &mut first);
        FilmScene::new(settings, moments, &t_cam_hand, &self.object.center, noise)
    }

    /// Object and hand in hand base coordinates.
    fn bodies(&self, moment: &GraspSnapshot) -> Vec<(&RenderModel, Isometry3<f64>)> {
        let mut bodies: Vec<(&RenderModel, _)> = vec![(&self.object.model, moment.t_hand_object)];
        bodies.extend(self.robot.render_bodies(&Isometry3::identity(), &moment.joints));
        bodies
    }

    fn viewpoint(&self, moment: &GraspSnapshot, noise: &mut SplitMix64) -> Isometry3<f64> {
        let bodies = self.bodies(moment);
        self.settings.viewpoint.choose(&self.camera, &bodies, &moment.gravity, noise)
    }

    /// Captures a frame of `moment`, whose joints and taxels are those of the hand, from anywhere or as a frame of that number in a film.
    ///
    /// # Errors
    /// If an image has not the size of the lens's camera.
    pub(in crate::synth) fn capture(
        &self,
        moment: &GraspSnapshot,
        film: Option<(&FilmScene, usize)>,
        noise: &mut SplitMix64,
    ) -> Result<Shot, DistortionError> {
        let t_cam_hand = match film {
            Some((film, frame)) => film.t_cam_hand(frame, moment),
            None => self.viewpoint(moment, noise),
        };
        let mut bodies = self.bodies(moment);
        bodies.iter_mut().for_each(|(_, pose)| *pose = t_cam_hand * *pose);
        let gravity = t_cam_hand.rotation * moment.gravity;
        let mut paints = Vec::new();
        for (model, pose, paint) in film.iter().flat_map(|(film, frame)| film.passing(*frame)) {
            bodies.push((model, pose));
            paints.push(paint);
        }
        let mut still = film.map(|(film, _)| film.surroundings.clone());
        let mut seen =
            self.render(&bodies, &paints, &gravity, still.as_mut().unwrap_or(&mut *noise));
        if let Some(lens) = self.lens {
            seen = lens.photograph(&seen)?;
        }
        let forces = self.settings.touch.simulate_taxels(&moment.taxel_forces, &self.taxels, noise);
        let (mut t_cam_hand_told, mut joints) = self.errors.hand.apply(&t_cam_hand, &moment.joints);
        if let Some(play) = self.settings.play.draw(&prismatic_joints(&self.robot.tree), noise) {
            (t_cam_hand_told, joints) = play.apply(&t_cam_hand_told, &joints);
        }
        let mut still = film.map(|(film, _)| film.surroundings.clone());
        let gains = self.settings.color.gains(still.as_mut().unwrap_or(&mut *noise));
        let told = Frame {
            camera: self.errors.camera(&self.camera),
            color: self.settings.color.expose(&seen.color, gains, noise),
            depth: self.settings.depth.measure(&seen.depth, &self.camera, &self.depth, noise),
            mask: self.settings.mask.segment(&seen.visible, &seen.hand, noise),
            gravity: Some(gravity),
            hand: Some(self.robot.measured(t_cam_hand_told, joints).with_forces(forces)),
            views: Vec::new(),
        };
        let truth = t_cam_hand * moment.t_hand_object;
        let hand = Some((t_cam_hand, moment.joints.clone()));
        let lens = self.lens.filter(|lens| lens.is_declared).map(|lens| lens.model);
        let TrueView { whole, visible, .. } = seen;
        Ok(Shot { told, lens, truth, hand, world: None, whole, visible })
    }

    /// Images of the pinhole camera, or of that of the lens; the first of `bodies` is the object, and the last ones have `paints`
    /// of their own.
    fn render(
        &self,
        bodies: &[(&RenderModel, Isometry3<f64>)],
        paints: &[[f32; 3]],
        gravity: &Vector3<f64>,
        noise: &mut SplitMix64,
    ) -> TrueView {
        let lights = self.settings.light.draw(bodies, &-gravity, noise);
        let background = &self.settings.background;
        // Of the lens's own size, but from as many random numbers: what follows is the same with any lens.
        let mut same = noise.clone();
        let (mut wall, mut behind) = background.draw(&self.camera, noise);
        let (mut camera, mut samples) = (&self.camera, SAMPLES);
        if let Some(lens) = self.lens {
            (wall, behind) = background.draw(&lens.background, &mut same);
            (camera, samples) = (&lens.pinhole, 1);
        }
        let scale = camera.width / wall.width();
        let shade = |body: usize, point: &SurfacePoint<f32>| {
            let own = body.checked_sub(bodies.len() - paints.len());
            let paint = own.map_or(self.paint[[0, 2, 1, 2][body % 4]], |own| paints[own]);
            let albedo = if body == 0 { point.albedo } else { paint };
            lights.shade(point, albedo)
        };
        let at = |x: usize, y: usize| y / scale * wall.width() + x / scale;
        let picture = render_scene(camera, bodies, samples, shade, |x, y| wall.pixels()[at(x, y)]);
        let mut depth = picture.depth;
        for (i, z) in depth.pixels_mut().iter_mut().enumerate().filter(|(_, z)| **z <= 0.0) {
            *z = behind.pixels()[at(i % camera.width, i / camera.width)];
        }
        let mask_of = |wanted: fn(u32) -> bool| {
            let mut mask = Mask::filled(camera.width, camera.height, false);
            for (set, body) in mask.pixels_mut().iter_mut().zip(&picture.object) {
                *set = body.is_some_and(wanted);
            }
            mask
        };
        let (visible, hand) = (mask_of(|body| body == 0), mask_of(|body| body > 0));
        let alone = depth_map(camera, &bodies[..1]);
        let mut whole = visible.clone();
        for (set, z) in whole.pixels_mut().iter_mut().zip(alone.pixels()) {
            *set |= *z > 0.0;
        }
        TrueView { color: picture.color, depth, visible, hand, whole }
    }
}

/// Colors of the hand's parts: black anodized metal, gray plastic and black rubber, each a little different every time.
fn random_paint(noise: &mut SplitMix64) -> [[f32; 3]; 3] {
    [[0.21, 0.22, 0.24], [0.42, 0.43, 0.44], [0.14, 0.14, 0.15]].map(|tone| {
        let lighter = 0.8 + 0.5 * noise.uniform() as f32;
        tone.map(|v: f32| v * lighter)
    })
}
