//! Films: one camera that stands still, and what passes in front of it.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;
use prehend_geometry::shapes::{cuboid, cylinder, sphere};
use prehend_render::{RenderModel, look_at};
use serde::Serialize;

use crate::synth::grasp::{GraspSnapshot, Waves};

/// Settings of a film of a moving hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FilmSettings {
    /// Frames a second.
    pub rate: f64,
    /// Things that nobody knows of, each of which passes in front of the object once.
    pub occluders: u32,
}

/// Sway of the hand in each direction, root mean square \[m\].
const SWAY: f64 = 0.02;
/// Time that something takes to pass, least and most \[s\].
const PASSING: (f64, f64) = (1.0, 2.0);
/// From where to where something passes, to either side of the line to the object \[m\].
const PATH: f64 = 0.25;
/// Segments around what is round.
const SEGMENTS: usize = 24;

/// The camera and its surroundings through a film.
pub(in crate::synth) struct FilmScene {
    rate: f64,
    /// Axes that stand still → camera.
    rotation: UnitQuaternion<f64>,
    /// Center of the object when the film begins, in the frames of camera and hand \[m\].
    in_camera: Point3<f64>,
    in_hand: Point3<f64>,
    sway: [Waves; 3],
    passes: Vec<Passage>,
    /// Random numbers of light and background, the same in every frame.
    pub(super) surroundings: SplitMix64,
}

/// Something that passes.
struct Passage {
    model: RenderModel,
    paint: [f32; 3],
    /// The frame in the middle, and how many it takes.
    middle: f64,
    frames: f64,
    /// Place at the middle, way, and axis of its turns.
    place: Point3<f64>,
    way: Vector3<f64>,
    axis: Vector3<f64>,
}

impl FilmScene {
    /// A film of `moments` seen from `t_cam_hand` in the first of them.
    pub(super) fn new(
        settings: &FilmSettings,
        moments: &[GraspSnapshot],
        t_cam_hand: &Isometry3<f64>,
        center: &Point3<f64>,
        noise: &mut SplitMix64,
    ) -> Self {
        let (turn, in_hand) = moments.first().map_or_else(
            || (UnitQuaternion::identity(), *center),
            |first| (first.turn, first.t_hand_object * center),
        );
        let in_camera = t_cam_hand * in_hand;
        let count = settings.occluders;
        let pass = |k: u32| {
            let share = (f64::from(k) + 0.3 + 0.4 * noise.uniform()) / f64::from(count);
            Passage::random(settings.rate, share * moments.len() as f64, &in_camera, noise)
        };
        let passes = (0..count).map(pass).collect();
        Self {
            rate: settings.rate,
            rotation: t_cam_hand.rotation * turn.inverse(),
            in_camera,
            in_hand,
            sway: std::array::from_fn(|_| Waves::new(noise)),
            passes,
            surroundings: noise.clone(),
        }
    }

    /// Hand base → camera in a frame.
    pub(super) fn t_cam_hand(&self, frame: usize, moment: &GraspSnapshot) -> Isometry3<f64> {
        let at = |frame: usize| {
            let time = frame as f64 / self.rate;
            Vector3::from_fn(|i, _| SWAY * self.sway[i].at(time))
        };
        let center = self.in_camera + at(frame) - at(0);
        let turn = Isometry3::from_parts(Translation3::identity(), self.rotation * moment.turn);
        Translation3::from(center) * turn * Translation3::from(-self.in_hand.coords)
    }

    /// Things that pass in a frame, each with its pose in the camera frame and its color.
    pub(super) fn passing(
        &self,
        frame: usize,
    ) -> impl Iterator<Item = (&RenderModel, Isometry3<f64>, [f32; 3])> {
        self.passes.iter().filter_map(move |pass| {
            let share = (frame as f64 - pass.middle) / pass.frames;
            let turn = UnitQuaternion::from_scaled_axis(pass.axis * share);
            let place = pass.place + pass.way * share;
            let pose = Isometry3::from_parts(Translation3::from(place), turn);
            (share.abs() <= 0.5).then_some((&pass.model, pose, pass.paint))
        })
    }
}

impl Passage {
    /// Across the line to an object at `center`, at its middle in frame `middle`.
    fn random(rate: f64, middle: f64, center: &Point3<f64>, noise: &mut SplitMix64) -> Self {
        let mut between = |(low, high): (f64, f64)| low + (high - low) * noise.uniform();
        let size = Vector3::from_fn(|_, _| between((0.02, 0.06)));
        let mesh = match (3.0 * between((0.0, 1.0))) as u32 {
            0 => cuboid(size),
            1 => cylinder(0.5 * size.x, 2.0 * size.y, SEGMENTS),
            _ => sphere(0.5 * size.max(), SEGMENTS),
        };
        let frames = rate * between(PASSING);
        let nearer = between((0.65, 0.85));
        let angle = between((0.0, std::f64::consts::TAU));
        // In the plane that the camera looks at: its axes across the line to the object.
        let across = look_at(&Point3::origin(), center, &Vector3::y(), 0.0).rotation.inverse();
        let way = across * Vector3::new(angle.cos(), angle.sin(), 0.0) * (2.0 * PATH);
        let paint = [0; 3].map(|_| between((0.05, 0.9)) as f32);
        let axis = Vector3::from_fn(|_, _| between((-2.0, 2.0)));
        let off = across * Vector3::new(-angle.sin(), angle.cos(), 0.0) * between((-0.03, 0.03));
        let place = Point3::from(center.coords * nearer + off);
        // Shapes of the sizes above have faces; what cannot be drawn would be a small box.
        let model = RenderModel::new(&mesh).or_else(|_| RenderModel::new(&cuboid(size)));
        let model = model.unwrap_or_else(|fault| unreachable!("a cuboid cannot be drawn: {fault}"));
        Self { model, paint, middle, frames, place, way, axis }
    }
}
