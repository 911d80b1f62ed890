//! How well frames fit what is said of them.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use crate::MM_PER_M;
use crate::error::RefineError;
use crate::factor::TactileFactor;
use crate::problem::State;
use crate::scene::{PreparedFrame, median};
use crate::strategy::{FusedPixels, FusedSettings};

/// Residuals of one frame at its given calibrations, by sensor.
#[derive(Clone, Debug)]
pub struct FrameResiduals {
    /// How far behind the surfaces of object and hand depth is \[m\], with column and row.
    depth: [Vec<([usize; 2], f64)>; 2],
    /// How far the outline of the mask is from the object's \[px\].
    outline: Option<f64>,
    /// How far touched skin is from the object's surface, positive outside \[m\].
    touch: Vec<f64>,
}

/// Fewest pixels of the object that must agree with the mask, or else the mask is not asked.
const FEWEST: usize = 30;

impl FrameResiduals {
    /// Residuals of `frame` with the object at `t_cam_object` (object → camera) \[m\], by default settings.
    ///
    /// # Errors
    /// If the pose is not finite, or forces do not fit the taxels.
    pub fn of(
        frame: &PreparedFrame<'_>,
        t_cam_object: &Isometry3<f64>,
    ) -> Result<Self, RefineError> {
        let has_mask = frame.observation().mask.count() > 0;
        Self::new(frame, t_cam_object, &FusedSettings::default(), has_mask)
    }

    /// As [`Self::of`] has it, with these settings; the mask counts only if there is one.
    pub(super) fn new(
        frame: &PreparedFrame<'_>,
        t_cam_object: &Isometry3<f64>,
        settings: &FusedSettings,
        has_mask: bool,
    ) -> Result<Self, RefineError> {
        let state = State::new(frame, t_cam_object)?;
        let pixels = FusedPixels::new(frame, &state, settings.hand_depth.margin);
        let feels = frame.hand().is_some_and(|hand| !hand.forces.is_empty());
        let touch = feels.then(|| TactileFactor::new(frame, &settings.tactile)).transpose()?;
        Ok(Self {
            depth: [pixels.on_object(FEWEST), pixels.on_hand()],
            outline: pixels.outline_distance().filter(|_| has_mask),
            touch: touch.map_or_else(Vec::new, |touch| touch.touched_distances(&state)),
        })
    }

    /// Medians over the frame, of each sensor that says something.
    pub fn sensors(&self) -> Vec<SensorResidual> {
        let Self { depth: [on_object, on_hand], outline, touch } = self;
        let millimeters =
            |pixels: &[([usize; 2], f64)]| pixels.iter().map(|(_, r)| r * MM_PER_M).collect();
        let kinds: [(&str, &str, Vec<f64>); 4] = [
            ("depth on the object", "mm", millimeters(on_object)),
            ("depth on the hand", "mm", millimeters(on_hand)),
            ("outline", PIXELS, outline.iter().copied().collect()),
            ("touched skin", "mm", touch.iter().map(|r| r * MM_PER_M).collect()),
        ];
        let residual = |(sensor, unit, values): (&'static str, &'static str, Vec<f64>)| {
            let size = median(values.iter().map(|v| v.abs()))?;
            let offset = median(values.iter().copied()).filter(|_| unit != PIXELS);
            Some(SensorResidual { sensor, unit, size, offset })
        };
        kinds.into_iter().filter_map(residual).collect()
    }
}

/// Residuals of a sensor: medians of a frame, or over frames, the medians of those.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorResidual {
    /// Name of the measured quantity, such as `outline`.
    pub sensor: &'static str,
    /// The unit.
    pub unit: &'static str,
    /// Median of absolute residuals.
    pub size: f64,
    /// Median of residuals with a sign: depth is positive behind a surface, skin outside of it. `None` of the outline.
    pub offset: Option<f64>,
}

/// Residuals of many frames, by sensor.
#[derive(Clone, Debug)]
pub struct Residuals {
    /// By name and unit: those of each frame.
    frames: BTreeMap<(&'static str, &'static str), Vec<SensorResidual>>,
    /// Width and height of images \[px\].
    size: [usize; 2],
    /// By cell of the image, row by row: sum and number of residuals of depth \[m\].
    cells: Vec<(f64, usize)>,
}

/// Unit of the residual that has no sign.
const PIXELS: &str = "px";

/// Width and height of a cell \[px\].
const CELL: usize = 16;

/// FusedPixels that a cell must have.
const FULL: usize = 50;

/// Limit to which residuals of depth are clamped in a cell \[m\].
const FAR: f64 = 10e-3;

impl Residuals {
    /// No residuals yet, of images of `width` × `height` pixels.
    pub fn new((width, height): (usize, usize)) -> Self {
        let cells = width.div_ceil(CELL) * height.div_ceil(CELL);
        Self { frames: BTreeMap::new(), size: [width, height], cells: vec![(0.0, 0); cells] }
    }

    /// Adds those of a frame.
    pub fn add(&mut self, frame: &FrameResiduals) {
        for residual in frame.sensors() {
            self.frames.entry((residual.sensor, residual.unit)).or_default().push(residual);
        }
        let [on_object, on_hand] = &frame.depth;
        let columns = self.size[0].div_ceil(CELL);
        for ([x, y], residual) in on_object.iter().chain(on_hand) {
            if let Some((sum, count)) = self.cells.get_mut(y / CELL * columns + x / CELL) {
                *sum += residual.clamp(-FAR, FAR);
                *count += 1;
            }
        }
    }

    /// Medians over frames, of each sensor that any frame has.
    pub fn sensors(&self) -> Vec<SensorResidual> {
        let of =
            |(&(sensor, unit), frames): (&(&'static str, &'static str), &Vec<SensorResidual>)| {
                let size = median(frames.iter().map(|frame| frame.size))?;
                let offset = median(frames.iter().filter_map(|frame| frame.offset));
                Some(SensorResidual { sensor, unit, size, offset })
            };
        self.frames.iter().filter_map(of).collect()
    }

    /// The mean residual of depth \[m\] at the pixel (x, y) and around it, of object and hand; `None` where hardly any were seen.
    pub fn depth_at(&self, x: usize, y: usize) -> Option<f64> {
        let columns = self.size[0].div_ceil(CELL);
        let (sum, count) = self.cells.get(y / CELL * columns + x / CELL)?;
        (*count >= FULL).then(|| sum / *count as f64)
    }

    /// Width and height of images \[px\].
    pub fn size(&self) -> (usize, usize) {
        (self.size[0], self.size[1])
    }
}
