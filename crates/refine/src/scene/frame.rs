//! Measurements of the sensors at one moment.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_render::{Camera, DepthImage, DistortionError, Mask, Remap, RgbImage};

use super::{Hand, TouchReading};
use crate::error::RefineError;

/// A hand, its measured pose and joint positions, and its touch. Other bodies of a frame, tables, objects and further hands, are parts of it.
#[derive(Clone, Debug)]
pub struct HandMeasurement {
    /// Kinematics, shape and skin.
    pub hand: Arc<Hand>,
    /// Hand base coordinates → camera coordinates \[m\].
    pub t_cam_hand: Isometry3<f64>,
    /// Joint positions in the order of the robot's joints \[rad\].
    pub joints: Vec<f64>,
    /// Force of the object on each taxel, in the taxel's link frame \[N\], or [`UNKNOWN_FORCE`](Self::UNKNOWN_FORCE); empty without a skin.
    pub forces: Vec<Vector3<f64>>,
    /// Readings of sensors that measure no forces.
    pub touch: Vec<TouchReading>,
    /// Standard deviations of `t_cam_hand` at the object's place in each direction, and about each axis \[m, rad\], where they are known.
    pub pose_sigmas: [Option<f64>; 2],
    /// Standard deviations of joint positions where they are known \[rad or m\], in the order of the joints; an empty list for none. The others are as
    /// accurate as the estimator's settings state.
    pub joint_sigmas: Vec<Option<f64>>,
}

impl HandMeasurement {
    /// Hand without touch, its base at `t_cam_hand` \[m\] and its joints at `joints` \[rad\].
    pub fn new(hand: Arc<Hand>, t_cam_hand: Isometry3<f64>, joints: Vec<f64>) -> Self {
        let (forces, touch, joint_sigmas) = (Vec::new(), Vec::new(), Vec::new());
        Self { hand, t_cam_hand, joints, forces, touch, pose_sigmas: [None; 2], joint_sigmas }
    }

    /// Measurement with the force of the object on each taxel, in its link's frame \[N\].
    pub fn with_forces(self, forces: Vec<Vector3<f64>>) -> Self {
        Self { forces, ..self }
    }

    /// The force on a taxel of which nothing is known, as on a dead one: it is no evidence of anything.
    pub const UNKNOWN_FORCE: Vector3<f64> = Vector3::new(f64::NAN, f64::NAN, f64::NAN);

    /// True of a force on a taxel that is unknown. A force that is a number in some axes only is broken.
    pub(crate) fn is_unknown(force: &Vector3<f64>) -> bool {
        force.iter().all(|f| f.is_nan())
    }
}

/// Images of one moment, with the hand, its touch and gravity where they are known, all in the camera frame.
///
/// ```
/// use prehend_refine::Frame;
/// use prehend_render::{Camera, DepthImage, Mask};
///
/// let camera = Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };
/// let frame = Frame::new(camera).depth(DepthImage::filled(640, 480, 0.6)).mask(Mask::filled(640, 480, true));
/// assert!(frame.hand.is_none());
/// ```
#[derive(Clone, Debug)]
pub struct Frame {
    /// Intrinsics.
    pub camera: Camera,
    /// Color image.
    pub color: RgbImage,
    /// Depth image \[m\], 0 where missing.
    pub depth: DepthImage,
    /// Pixels on the visible part of the object.
    pub mask: Mask,
    /// Gravitational acceleration \[m/s²\], where known.
    pub gravity: Option<Vector3<f64>>,
    /// The hand, where known.
    pub hand: Option<HandMeasurement>,
    /// Frames of other cameras at the same moment.
    pub views: Vec<AdditionalView>,
}

/// Frame of another camera.
#[derive(Clone, Debug)]
pub struct AdditionalView {
    /// Its coordinates → those of the first camera \[m\].
    t_cam_view: Isometry3<f64>,
    /// In its own frame, with the hand there, and nothing of what that feels.
    frame: Frame,
}

impl AdditionalView {
    /// The first camera's coordinates → its own \[m\].
    pub fn t_view_cam(&self) -> Isometry3<f64> {
        self.t_cam_view.inverse()
    }

    /// Its frame, in its own coordinates.
    pub fn observation(&self) -> &Frame {
        &self.frame
    }

    /// Takes over where the hand is.
    fn place(&mut self, hand: Option<&HandMeasurement>) {
        let t_view_cam = self.t_view_cam();
        self.frame.hand = hand.map(|hand| HandMeasurement {
            pose_sigmas: hand.pose_sigmas,
            joint_sigmas: hand.joint_sigmas.clone(),
            ..hand.hand.measured(t_view_cam * hand.t_cam_hand, hand.joints.clone())
        });
    }
}

impl Frame {
    /// Frame of `camera` without images: black, without depth, and with an empty mask.
    pub fn new(camera: Camera) -> Self {
        let (width, height) = (camera.width, camera.height);
        Self {
            camera,
            color: RgbImage::filled(width, height, [0.0; 3]),
            depth: DepthImage::filled(width, height, 0.0),
            mask: Mask::filled(width, height, false),
            gravity: None,
            hand: None,
            views: Vec::new(),
        }
    }

    /// With a color image.
    pub fn color(self, color: RgbImage) -> Self {
        Self { color, ..self }
    }

    /// With a depth image \[m\], 0 where missing.
    pub fn depth(self, depth: DepthImage) -> Self {
        Self { depth, ..self }
    }

    /// With the visible pixels of the object.
    pub fn mask(self, mask: Mask) -> Self {
        Self { mask, ..self }
    }

    /// With a hand.
    pub fn hand(self, hand: HandMeasurement) -> Self {
        let mut frame = Self { hand: Some(hand), ..self };
        frame.place_views();
        frame
    }

    /// With gravitational acceleration in the camera frame \[m/s²\].
    pub fn gravity(self, gravity: Vector3<f64>) -> Self {
        Self { gravity: Some(gravity), ..self }
    }

    /// True of a mask that tells which pixels show the object, and not only about where it is: it is neither empty nor a box.
    pub(crate) fn is_segmented(&self) -> bool {
        self.mask.count() > 0 && !self.mask.is_box()
    }

    /// With what another camera saw at the same moment, whose coordinates `t_cam_view` takes to those of this one \[m\]. Hand and gravity are this one's.
    pub fn with_view(mut self, view: Self, t_cam_view: Isometry3<f64>) -> Self {
        let frame = Self { gravity: None, views: Vec::new(), ..view };
        self.views.push(AdditionalView { t_cam_view, frame });
        self.place_views();
        self
    }

    /// Tells the other cameras where the hand is. To be called when [`hand`](Self::hand) has changed.
    pub fn place_views(&mut self) {
        let Self { hand, views, .. } = self;
        views.iter_mut().for_each(|view| view.place(hand.as_ref()));
    }

    /// Makes images behind a lens those of a pinhole.
    ///
    /// # Errors
    /// If one has another size than `remap` is for.
    pub(crate) fn undistort(&mut self, remap: &Remap) -> Result<(), DistortionError> {
        self.color = remap.rgb(&self.color)?;
        self.depth = remap.depth(&self.depth)?;
        self.mask = remap.mask(&self.mask)?;
        Ok(())
    }

    /// Refuses images that have not the camera's size: the first of color, depth and mask, and what is wrong.
    pub(crate) fn check_sizes(&self) -> Result<(), (&'static str, String)> {
        let expected = (self.camera.width, self.camera.height);
        let sizes = [
            ("color image", self.color.width(), self.color.height()),
            ("depth image", self.depth.width(), self.depth.height()),
            ("mask", self.mask.width(), self.mask.height()),
        ];
        for (image, width, height) in sizes {
            if (width, height) != expected {
                let (w, h) = expected;
                return Err((image, format!("{width}x{height} pixels, the camera has {w}x{h}")));
            }
        }
        Ok(())
    }

    /// Refuses images that have not the camera's size, as a refinement does.
    ///
    /// # Errors
    /// [`RefineError::Images`].
    pub(crate) fn require_sizes(&self) -> Result<(), RefineError> {
        self.check_sizes()
            .map_err(|(image, problem)| RefineError::Images(format!("the {image} has {problem}")))
    }

    /// True if the picture shows anything under the mask: one color everywhere is what a camera gives that failed.
    pub(crate) fn has_colors(&self) -> bool {
        let width = self.mask.width();
        let Some([_, top, _, rows]) = self.mask.bounds() else { return false };
        let within = (top * width)..((top + rows) * width).min(self.color.pixels().len());
        let masks = &self.mask.pixels()[within.clone()];
        let masked = self.color.pixels()[within].iter().zip(masks).filter(|(_, m)| **m);
        let mut colors = masked.map(|(color, _)| color);
        let first = colors.next();
        colors.any(|color| Some(color) != first)
    }

    /// Depth was measured at any pixel.
    pub(crate) fn has_depth(&self) -> bool {
        self.depth.pixels().iter().any(|z| *z > 0.0)
    }
}

/// Magnitudes of gravity on solid ground, from small moons up, with room to spare \[m/s²\].
const PLAUSIBLE_GRAVITY: std::ops::Range<f64> = 1e-2..1e3;

/// Refuses a gravity that cannot be in m/s² or that presses nothing into the hand.
///
/// # Errors
/// If its norm is implausible: a message with it \[m/s²\].
pub fn check_gravity(gravity: &Vector3<f64>) -> Result<(), String> {
    let norm = gravity.norm();
    if PLAUSIBLE_GRAVITY.contains(&norm) {
        return Ok(());
    }
    Err(format!("{norm:.3e} m/s² is no gravity"))
}
