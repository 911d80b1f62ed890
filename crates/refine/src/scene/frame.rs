//! One frame, with what all factors derive from it.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::Point3;
use prehend_render::{Camera, DepthImage, depth_map};

use super::segmented::Segmented;
use super::{Hand, HandMeasurement, Object, Observation};
use crate::error::RefineError;

/// An observation of an object in a hand, checked, with what factors derive from it: each thing is made when it is first asked
/// for, and once.
pub struct Frame<'a> {
    observation: &'a Observation,
    object: &'a Arc<Object>,
    hand: Option<(&'a Arc<Hand>, &'a HandMeasurement)>,
    hand_depth: OnceLock<Arc<DepthImage>>,
    depth: OnceLock<Arc<DepthImage>>,
    /// Segmented images by what may hide the object and by how many times smaller they are.
    segmented: Mutex<BTreeMap<(Occluders, usize), Segmented>>,
}

/// What may hide the object in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Occluders {
    /// The hand, where its pose and joints say that it is.
    Hand,
    /// The hand, and what depth shows nearer beside the mask.
    Measured,
}

/// How far in front of the object something beside the mask must be to hide it \[m\]: what is seen there may be the
/// object itself, where the mask falls short.
const IN_FRONT: f32 = 10e-3;

impl<'a> Frame<'a> {
    /// `object` in `hand` as `observation` shows them; without a hand, or without its state in the observation, nothing is known to
    /// hide the object.
    ///
    /// # Errors
    /// If an image has not the camera's size, the mask is empty, or there is not one joint position a joint.
    pub fn new(
        observation: &'a Observation,
        object: &'a Arc<Object>,
        hand: Option<&'a Arc<Hand>>,
    ) -> Result<Self, RefineError> {
        observation.check_sizes().map_err(|(image, problem)| {
            RefineError::Images(format!("the {image} has {problem}"))
        })?;
        if observation.mask.count() == 0 {
            return Err(RefineError::EmptyMask);
        }
        let hand = hand.zip(observation.hand.as_ref());
        if let Some((hand, measured)) = hand {
            hand.check_joints(&measured.joints)?;
        }
        Ok(Self {
            observation,
            object,
            hand,
            hand_depth: OnceLock::new(),
            depth: OnceLock::new(),
            segmented: Mutex::default(),
        })
    }

    /// What was sensed.
    pub fn observation(&self) -> &'a Observation {
        self.observation
    }

    /// The object whose pose is sought.
    pub fn object(&self) -> &'a Arc<Object> {
        self.object
    }

    /// The hand and its state, if both are known.
    pub fn hand(&self) -> Option<(&'a Arc<Hand>, &'a HandMeasurement)> {
        self.hand
    }

    /// The hand and its state, which `factor` needs.
    ///
    /// # Errors
    /// [`RefineError::Missing`].
    pub fn require_hand(
        &self,
        factor: &'static str,
    ) -> Result<(&'a Arc<Hand>, &'a HandMeasurement), RefineError> {
        let what = if self.observation.hand.is_some() { "hand" } else { "hand state" };
        self.hand.ok_or(RefineError::Missing { what, factor })
    }

    /// Depth as measured \[m\], 0 where missing.
    pub fn depth(&self) -> &Arc<DepthImage> {
        self.depth.get_or_init(|| Arc::new(self.observation.depth.clone()))
    }

    /// Depth image of the hand alone \[m\], 0 where it is not.
    pub fn hand_depth(&self) -> &Arc<DepthImage> {
        self.hand_depth.get_or_init(|| {
            let hand = self.hand.map(|(hand, measured)| (&**hand, measured));
            Arc::new(hand_depth(&self.observation.camera, hand))
        })
    }

    /// Column, row and depth \[m\] of some `limit` masked pixels with depth, on a regular grid of the image; at least one.
    ///
    /// # Errors
    /// [`RefineError::NoDepth`] if no pixel of the grid has a depth.
    pub fn masked_depths(&self, limit: usize) -> Result<Vec<(usize, usize, f64)>, RefineError> {
        let Observation { depth, mask, .. } = self.observation;
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

    /// The places of [`masked_depths`](Self::masked_depths) in the camera frame \[m\].
    ///
    /// # Errors
    /// [`RefineError::NoDepth`] if no pixel of the grid has a depth.
    pub fn masked_points(&self, limit: usize) -> Result<Vec<Point3<f64>>, RefineError> {
        let camera = &self.observation.camera;
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
        let mut images = self.segmented.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(image) = images.get(&(occluders, factor)) {
            return Ok(image.clone());
        }
        let whole = match images.get(&(occluders, 1)) {
            Some(image) => image.clone(),
            None => {
                let occluder = match occluders {
                    Occluders::Hand => (**self.hand_depth()).clone(),
                    Occluders::Measured => self.measured_occluder(),
                };
                let image = Segmented::new(self.observation, occluder)?;
                images.insert((occluders, 1), image.clone());
                image
            }
        };
        let image = whole.downsampled(factor)?;
        images.insert((occluders, factor), image.clone());
        Ok(image)
    }

    /// Depth of the hand and of what was measured beside the mask, whichever is nearer.
    fn measured_occluder(&self) -> DepthImage {
        let mut occluder = (**self.hand_depth()).clone();
        let Observation { depth, mask, .. } = self.observation;
        let seen = depth.pixels().iter().zip(mask.pixels());
        for (nearest, (depth, masked)) in occluder.pixels_mut().iter_mut().zip(seen) {
            let known = *nearest > 0.0;
            if depth.is_finite()
                && *depth > 0.0
                && !masked
                && (!known || depth + IN_FRONT < *nearest)
            {
                *nearest = depth + IN_FRONT;
            }
        }
        occluder
    }
}

/// Depth image of a hand, whose joints must have been checked \[m\]; 0 where it is not.
pub(super) fn hand_depth(camera: &Camera, hand: Option<(&Hand, &HandMeasurement)>) -> DepthImage {
    match hand {
        Some((hand, measured)) => {
            depth_map(camera, &hand.render_bodies(&measured.t_cam_hand, &measured.joints))
        }
        None => DepthImage::filled(camera.width, camera.height, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use prehend_render::{Mask, RgbImage};

    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn images_of_another_size_are_named() {
        let scene = default_scene(1).unwrap();
        let refused = |change: &dyn Fn(&mut Observation)| {
            let mut observation = scene.observation.clone();
            change(&mut observation);
            Frame::new(&observation, &scene.object, None).map(|_| ()).unwrap_err().to_string()
        };
        let color = refused(&|o| o.color = RgbImage::filled(640, 479, [0.0; 3]));
        assert!(color.contains("the color image has 640x479 pixels, the camera has 640x480"));
        let depth = refused(&|o| o.depth = DepthImage::filled(320, 480, 1.0));
        assert!(depth.contains("the depth image has 320x480 pixels"), "{depth}");
        let mask = refused(&|o| o.mask = Mask::filled(1, 1, true));
        assert!(mask.contains("the mask has 1x1 pixels"), "{mask}");
    }

    #[test]
    fn a_wrong_number_of_joints_and_an_empty_mask_are_errors() {
        let scene = default_scene(1).unwrap();
        let mut observation = scene.observation.clone();
        observation.hand.as_mut().unwrap().joints.pop();
        let refused = Frame::new(&observation, &scene.object, Some(&scene.hand)).map(|_| ());
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("15") && message.contains("16"), "{message}");
        observation.mask = Mask::filled(640, 480, false);
        let refused = Frame::new(&observation, &scene.object, None).map(|_| ());
        assert!(matches!(refused, Err(RefineError::EmptyMask)));
    }
}
