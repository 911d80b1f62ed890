//! How well frames fit what is said of them.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use crate::error::RefineError;
use crate::factor::{TactileFactor, TactileSettings};
use crate::problem::State;
use crate::scene::{Frame, median};
use crate::strategy::Pixels;

/// What is off in one frame where calibrations are believed.
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
    /// Of `frame` with the object at `t_cam_object` \[m\].
    pub(super) fn new(
        frame: &Frame<'_>,
        t_cam_object: &Isometry3<f64>,
        tactile: &TactileSettings,
        has_mask: bool,
    ) -> Result<Self, RefineError> {
        let state = State::new(frame, t_cam_object)?;
        let pixels = Pixels::new(frame, &state);
        let feels = frame.hand().is_some_and(|(_, hand)| !hand.forces.is_empty());
        let touch = feels.then(|| TactileFactor::new(frame, tactile)).transpose()?;
        Ok(Self {
            depth: [pixels.on_object(FEWEST), pixels.on_hand()],
            outline: pixels.outline_distance().filter(|_| has_mask),
            touch: touch.map_or_else(Vec::new, |touch| touch.touched_distances(&state)),
        })
    }
}

/// Residuals of a sensor over frames: medians of the frames' medians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorResidual {
    /// What is measured.
    pub sensor: &'static str,
    /// The unit.
    pub unit: &'static str,
    /// How large residuals are.
    pub size: f64,
    /// Of those with a sign, what they have in common: depth is positive behind a surface, skin outside of it.
    pub offset: Option<f64>,
}

/// Residuals of many frames, by sensor.
#[derive(Clone, Debug)]
pub struct Residuals {
    /// By name and unit: of each frame the median and the median size.
    frames: BTreeMap<(&'static str, &'static str), Vec<[f64; 2]>>,
    /// Width and height of images \[px\].
    size: [usize; 2],
    /// By cell of the image, row by row: sum and number of residuals of depth \[m\].
    cells: Vec<(f64, usize)>,
}

/// Unit of the residual that has no sign.
const PIXELS: &str = "px";

/// Width and height of a cell \[px\].
const CELL: usize = 16;

/// Pixels that a cell must have.
const FULL: usize = 50;

/// What counts at most of a residual in a cell \[m\].
const FAR: f64 = 10e-3;

impl Residuals {
    /// Of no frame yet, of images of so many columns and rows.
    pub fn new((width, height): (usize, usize)) -> Self {
        let cells = width.div_ceil(CELL) * height.div_ceil(CELL);
        Self { frames: BTreeMap::new(), size: [width, height], cells: vec![(0.0, 0); cells] }
    }

    /// Adds those of a frame.
    pub fn add(&mut self, frame: &FrameResiduals) {
        let FrameResiduals { depth: [on_object, on_hand], outline, touch } = frame;
        let millimeters =
            |pixels: &[([usize; 2], f64)]| pixels.iter().map(|(_, r)| r * 1e3).collect();
        let kinds: [((&str, &str), Vec<f64>); 4] = [
            (("depth on the object", "mm"), millimeters(on_object)),
            (("depth on the hand", "mm"), millimeters(on_hand)),
            (("outline", PIXELS), outline.iter().copied().collect()),
            (("touched skin", "mm"), touch.iter().map(|r| r * 1e3).collect()),
        ];
        for (kind, values) in kinds {
            let middle = median(values.iter().copied());
            if let Some((middle, size)) = middle.zip(median(values.iter().map(|v| v.abs()))) {
                self.frames.entry(kind).or_default().push([middle, size]);
            }
        }
        let columns = self.size[0].div_ceil(CELL);
        for ([x, y], residual) in on_object.iter().chain(on_hand) {
            if let Some((sum, count)) = self.cells.get_mut(y / CELL * columns + x / CELL) {
                *sum += residual.clamp(-FAR, FAR);
                *count += 1;
            }
        }
    }

    /// Of each sensor that any frame has.
    pub fn sensors(&self) -> Vec<SensorResidual> {
        let over_frames =
            |frames: &[[f64; 2]], k: usize| median(frames.iter().map(|frame| frame[k]));
        let of = |(&(sensor, unit), frames): (&(&'static str, &'static str), &Vec<[f64; 2]>)| {
            let offset = over_frames(frames, 0).filter(|_| unit != PIXELS);
            Some(SensorResidual { sensor, unit, size: over_frames(frames, 1)?, offset })
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
