//! A frame and its object, with what factors derive from them.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::{Isometry3, Point3};
use prehend_render::{Backend, Camera, Cpu, DepthImage, Target, TargetError, draw_depth};
use serde::{Deserialize, Serialize};

use super::{BoxSums, ForegroundSettings, Frame, HandMeasurement, Object, RegionEvidence};
use crate::error::RefineError;

/// A frame and the object whose pose is sought, checked, with what factors derive from them: each image is made when it is first asked
/// for, and once.
pub struct PreparedFrame<'a> {
    frame: &'a Frame,
    object: &'a Arc<Object>,
    hand_depth: OnceLock<Arc<DepthImage>>,
    depth: OnceLock<Arc<DepthImage>>,
    /// Segmented images by what may hide the object and by how many times smaller they are.
    segmented: Mutex<BTreeMap<(Occluders, usize), Arc<Target>>>,
    /// Root mean square of the colors under the mask.
    brightness: OnceLock<f64>,
    /// Regions by mask and colors.
    regions: OnceLock<(ForegroundSettings, Arc<RegionEvidence>)>,
    /// Regions that are not those of the mask and the frame's own colors.
    pub(crate) given_regions: Option<Arc<RegionEvidence>>,
    /// Renderer, if not the processor.
    backend: Option<Arc<dyn Backend>>,
    /// Columns and rows beyond which nothing is looked for that may hide the object; all if it is not known.
    pub(crate) focus: Option<[Range<usize>; 2]>,
    /// Views of other cameras.
    views: Vec<CameraView<'a>>,
}

/// View of another camera.
pub(crate) struct CameraView<'a> {
    /// Which of the observation's [`views`](Frame::views) it is.
    pub index: usize,
    /// The first camera's coordinates → its own \[m\].
    pub t_view_cam: Isometry3<f64>,
    /// Its frame, in its own coordinates.
    pub frame: PreparedFrame<'a>,
}

/// Occluders of the object in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Occluders {
    /// The hand, where its pose and joints say that it is.
    Hand,
    /// The hand, and what depth shows nearer beside the mask.
    Measured,
    /// Anything wherever the mask is not set: nothing is compared there.
    Unmasked,
}

/// The object in an image, with what may hide it.
pub(crate) struct Segmented {
    pub(crate) target: Arc<Target>,
    /// Root mean square of the colors under the mask.
    pub(crate) brightness: f64,
}

/// Within how many pixels of the border of a mask colors are those of object and others mixed, and masks are shrunk or grown.
pub(crate) const MASK_MARGIN: usize = 4;

/// How far in front of the object something beside the mask must be to hide it \[m\]: what is seen there may be the
/// object itself, where the mask falls short.
const IN_FRONT: f32 = 10e-3;

impl<'a> PreparedFrame<'a> {
    /// `object` as `observation` shows it; without a hand there, nothing is known to hide the object.
    ///
    /// # Errors
    /// If an image has not the camera's size, the mask is empty, or there is not one joint position a joint.
    pub fn new(observation: &'a Frame, object: &'a Arc<Object>) -> Result<Self, RefineError> {
        observation.require_sizes()?;
        if observation.mask.count() == 0 {
            return Err(RefineError::EmptyMask);
        }
        if let Some(measured) = &observation.hand {
            measured.hand.check_joints(&measured.joints)?;
        }
        let seeing = observation.views.iter().enumerate();
        let seeing = seeing.filter(|(_, view)| view.observation().mask.count() > 0);
        let views = seeing.map(|(index, view)| {
            let frame = Self::new(view.observation(), object)?;
            Ok(CameraView { index, t_view_cam: view.t_view_cam(), frame })
        });
        Ok(Self {
            views: views.collect::<Result<_, RefineError>>()?,
            frame: observation,
            object,
            hand_depth: OnceLock::new(),
            depth: OnceLock::new(),
            segmented: Mutex::default(),
            brightness: OnceLock::new(),
            regions: OnceLock::new(),
            given_regions: None,
            backend: None,
            focus: None,
        })
    }

    /// The frame with another model of the object.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub(crate) fn of_object<'b>(
        &'b self,
        object: &'b Arc<Object>,
    ) -> Result<PreparedFrame<'b>, RefineError> {
        let frame = PreparedFrame::new(self.frame, object)?;
        let mut frame = frame.with_depths(self.hand_depth(), self.depth());
        frame.given_regions.clone_from(&self.given_regions);
        frame.backend.clone_from(&self.backend);
        Ok(frame)
    }

    /// The frame on another rendering device ([`Device::open`](prehend_render::Device::open)): factors compare all hypotheses of a call there at once.
    ///
    /// The processor renders where the device fails.
    pub fn with_backend(self, backend: Arc<dyn Backend>) -> Self {
        let of_view = |view: CameraView<'a>| {
            let frame = view.frame.with_backend(Arc::clone(&backend));
            CameraView { frame, ..view }
        };
        let views = self.views.into_iter().map(of_view).collect();
        // The processor needs no sessions.
        Self { backend: Some(backend).filter(|b| b.name() != Cpu.name()), views, ..self }
    }

    /// Renderer, if not the processor.
    pub(crate) fn backend(&self) -> Option<&Arc<dyn Backend>> {
        self.backend.as_ref()
    }

    /// Frame whose depth image of the hand and copy of the measured depth are known already \[m\].
    pub(crate) fn with_depths(self, hand: &Arc<DepthImage>, measured: &Arc<DepthImage>) -> Self {
        let [hand_depth, depth] = [hand, measured].map(|image| OnceLock::from(Arc::clone(image)));
        Self { hand_depth, depth, ..self }
    }

    /// Views of other cameras that have a mask of the object.
    pub(crate) fn views(&self) -> &[CameraView<'a>] {
        &self.views
    }

    /// Frame.
    pub fn observation(&self) -> &'a Frame {
        self.frame
    }

    /// The object whose pose is sought.
    pub fn object(&self) -> &'a Arc<Object> {
        self.object
    }

    /// The hand, its pose and touch, where known.
    pub fn hand(&self) -> Option<&'a HandMeasurement> {
        self.frame.hand.as_ref()
    }

    /// The hand, which `factor` needs.
    ///
    /// # Errors
    /// [`RefineError::Missing`].
    pub fn require_hand(&self, factor: &'static str) -> Result<&'a HandMeasurement, RefineError> {
        self.hand().ok_or(RefineError::Missing { what: "hand", factor })
    }

    /// Depth as measured \[m\], 0 where missing.
    pub fn depth(&self) -> &Arc<DepthImage> {
        self.depth.get_or_init(|| Arc::new(self.frame.depth.clone()))
    }

    /// Depth image of the hand alone \[m\], 0 where it is not.
    pub fn hand_depth(&self) -> &Arc<DepthImage> {
        self.hand_depth.get_or_init(|| Arc::new(hand_depth(&self.frame.camera, self.hand())))
    }

    /// Log-likelihood ratio of object and others at each pixel \[nat\]: those given, or else by the mask, and by colors if these `count`.
    ///
    /// # Errors
    /// [`RefineError::EmptyMask`].
    pub(crate) fn regions(
        &self,
        count: bool,
        settings: &ForegroundSettings,
    ) -> Result<Arc<RegionEvidence>, RefineError> {
        let known = self.regions.get().filter(|(of, _)| count && of == settings);
        if let Some(known) = self.given_regions.as_ref().or(known.map(|(_, known)| known)) {
            return Ok(Arc::clone(known));
        }
        let Frame { color, mask, .. } = self.frame;
        let made = RegionEvidence::of_mask(Some(color).filter(|_| count), mask, settings);
        let made = Arc::new(made.ok_or(RefineError::EmptyMask)?);
        if count {
            self.regions.get_or_init(|| (*settings, Arc::clone(&made)));
        }
        Ok(made)
    }

    /// Column, row and depth \[m\] of some `limit` masked pixels with depth, on a regular grid of the image; at least one.
    ///
    /// # Errors
    /// [`RefineError::NoDepth`] if no pixel of the grid has a depth.
    pub(crate) fn masked_depths(
        &self,
        limit: usize,
    ) -> Result<Vec<(usize, usize, f64)>, RefineError> {
        let Frame { depth, mask, .. } = self.frame;
        let at = |x: usize, y: usize| {
            let z = f64::from(depth.get(x, y)?);
            (mask.get(x, y)? && z > 0.0).then_some((x, y, z))
        };
        let step = ((mask.count() as f64 / limit.max(1) as f64).sqrt().ceil() as usize).max(1);
        let depths: Vec<_> = (0..depth.height())
            .step_by(step)
            .flat_map(|y| (0..depth.width()).step_by(step).filter_map(move |x| at(x, y)))
            .collect();
        if depths.is_empty() { Err(RefineError::NoDepth) } else { Ok(depths) }
    }

    /// The places of measured depths within the mask in the camera frame \[m\].
    ///
    /// # Errors
    /// [`RefineError::NoDepth`] if no pixel of the grid has a depth.
    pub fn masked_points(&self, limit: usize) -> Result<Vec<Point3<f64>>, RefineError> {
        let camera = &self.frame.camera;
        let depths = self.masked_depths(limit)?;
        Ok(depths.into_iter().map(|(x, y, z)| camera.unproject(x as f64, y as f64, z)).collect())
    }

    /// The segmented image, `factor` times smaller.
    ///
    /// # Errors
    /// If nothing of the mask is left.
    pub(crate) fn segmented(
        &self,
        occluders: Occluders,
        factor: usize,
    ) -> Result<Segmented, RefineError> {
        let fault = |error: TargetError| RefineError::Images(error.to_string());
        let Frame { camera, color, mask, .. } = self.frame;
        let mut images = self.segmented.lock().unwrap_or_else(PoisonError::into_inner);
        let target = match images.entry((occluders, factor)) {
            Entry::Occupied(known) => Arc::clone(known.get()),
            Entry::Vacant(unknown) => {
                let factor = factor.clamp(1, camera.width.min(camera.height));
                let occluder = match occluders {
                    Occluders::Hand if factor == 1 => (**self.hand_depth()).clone(),
                    Occluders::Hand => self.hand_depth().downsampled(factor),
                    Occluders::Measured => self.measured_occluder(factor),
                    Occluders::Unmasked => self.unmasked_occluder(factor),
                };
                let target = Target::reduced(*camera, color, mask, factor);
                let target = target.and_then(|target| target.with_occluder(occluder));
                Arc::clone(unknown.insert(Arc::new(target.map_err(fault)?)))
            }
        };
        let brightness = *self.brightness.get_or_init(|| brightness(self.frame));
        Ok(Segmented { target, brightness })
    }

    /// Depth of the hand, and of something just before the camera where the mask is not set; `factor` times smaller.
    fn unmasked_occluder(&self, factor: usize) -> DepthImage {
        let mask = &self.frame.mask;
        let (width, height) = (mask.width(), mask.height());
        let (hand, inner) = (self.hand_depth().pixels(), eroded(width, mask.pixels(), MASK_MARGIN));
        let nearest = |at: usize| if inner[at] { hand[at] } else { f32::MIN_POSITIVE };
        DepthImage::downsampled_of(width, height, factor, [0..width, 0..height], nearest)
    }

    /// Depth of the hand and of what was measured beside the mask, whichever is nearer; `factor` times smaller.
    fn measured_occluder(&self, factor: usize) -> DepthImage {
        let Frame { depth, mask, .. } = self.frame;
        let (width, height) = (depth.width(), depth.height());
        let within = self.focus.clone().unwrap_or([0..width, 0..height]);
        let (hand, depth, mask) = (self.hand_depth().pixels(), depth.pixels(), mask.pixels());
        let nearest = |at: usize| {
            let (hand, measured) = (hand[at], depth[at]);
            let front = measured + IN_FRONT;
            let nearer = hand <= 0.0 || front < hand;
            let seen = !mask[at] && measured.is_finite() && measured > 0.0;
            if seen && nearer { front } else { hand }
        };
        DepthImage::downsampled_of(width, height, factor, within, nearest)
    }
}

/// Pixels of an image of `width` columns whose neighbors up to `reach` columns and rows away are all set.
pub(crate) fn eroded(width: usize, set: &[bool], reach: usize) -> Vec<bool> {
    let values: Vec<f32> = set.iter().map(|set| f32::from(u8::from(*set))).collect();
    let (columns, mut sums) = (width.max(1), BoxSums::default());
    sums.find(&values, (columns, set.len() / columns), reach);
    let all = (2 * reach + 1).pow(2) as f32;
    sums.all.iter().map(|sum| *sum >= all).collect()
}

/// Root mean square of the colors under the mask; never zero.
fn brightness(observation: &Frame) -> f64 {
    let Frame { color, mask, .. } = observation;
    let [left, top, width, height] = mask.bounds().unwrap_or_default();
    let line = |row: usize| row * mask.width() + left..row * mask.width() + left + width;
    let pixels = (top..top + height)
        .flat_map(|row| color.pixels()[line(row)].iter().zip(&mask.pixels()[line(row)]));
    let (sum, count) = pixels
        .filter(|(_, m)| **m)
        .flat_map(|(c, _)| c)
        .fold((0.0, 0.0), |(s, n), &v| (s + f64::from(v).powi(2), n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt().max(0.02)
}

/// Depth image of a hand, whose joints must have been checked \[m\]; 0 where it is not.
pub(crate) fn hand_depth(camera: &Camera, hand: Option<&HandMeasurement>) -> DepthImage {
    let mut depth = DepthImage::default();
    draw_hand_depth(&mut depth, camera, hand);
    depth
}

/// Draws the depth of a hand, whose joints must have been checked, into an existing image \[m\].
pub(crate) fn draw_hand_depth(
    depth: &mut DepthImage,
    camera: &Camera,
    hand: Option<&HandMeasurement>,
) {
    match hand {
        Some(HandMeasurement { hand, t_cam_hand, joints, .. }) => {
            draw_depth(depth, camera, &hand.render_bodies(t_cam_hand, joints));
        }
        None => depth.refill(camera.width, camera.height, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use prehend_render::{Mask, RgbImage};

    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn images_of_another_size_and_an_empty_mask_are_named() {
        let scene = default_scene(1).unwrap();
        let refused = |change: &dyn Fn(&mut Frame)| {
            let mut observation = scene.frame.clone();
            change(&mut observation);
            PreparedFrame::new(&observation, &scene.object).map(|_| ()).unwrap_err().to_string()
        };
        let color = refused(&|o| o.color = RgbImage::filled(640, 479, [0.0; 3]));
        assert!(color.contains("the color image has 640x479 pixels, the camera has 640x480"));
        let depth = refused(&|o| o.depth = DepthImage::filled(320, 480, 1.0));
        assert!(depth.contains("the depth image has 320x480 pixels"), "{depth}");
        let mask = refused(&|o| o.mask = Mask::filled(1, 1, true));
        assert!(mask.contains("the mask has 1x1 pixels"), "{mask}");
        let empty = refused(&|o| o.mask = Mask::filled(640, 480, false));
        assert_eq!(empty, RefineError::EmptyMask.to_string());
    }

    #[test]
    fn erosion_leaves_what_is_surrounded() {
        let square = |k: usize| (2..7).contains(&(k % 10)) && (1..6).contains(&(k / 10));
        let set: Vec<bool> = (0..80).map(square).collect();
        let left = eroded(10, &set, 2);
        let kept: Vec<usize> = (0..80).filter(|k| left[*k]).collect();
        assert_eq!(kept, [34]);
    }
}
