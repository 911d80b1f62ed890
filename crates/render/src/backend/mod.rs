//! Where poses are compared with an image: this processor, or a graphics device.

mod auto;
mod cpu;
mod error;
#[cfg(feature = "gpu")]
mod gpu;

use std::sync::Arc;

use nalgebra::Isometry3;

pub use auto::{WithFallback, auto};
pub use cpu::Cpu;
pub use error::BackendError;
#[cfg(feature = "gpu")]
pub use gpu::Gpu;

use crate::light::Light;
use crate::model::RenderModel;
use crate::pose_loss::{Linearised, Loss, PoseImage, PoseLoss, Target};

/// What many poses have in common.
#[derive(Clone, Debug)]
pub struct PoseProblem {
    /// The object.
    pub model: Arc<RenderModel>,
    /// The image that it is compared with.
    pub target: Arc<Target>,
    /// How.
    pub loss: PoseLoss,
}

/// One pose to try.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypothesis {
    /// Pose of the object, mesh to camera frame \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// Light in the camera frame.
    pub light: Light,
}

/// A device that compares many poses with an image at once.
pub trait Backend: Send + Sync {
    /// What computes, for people to read.
    fn name(&self) -> &str;

    /// Uploads a problem. What the session allocates serves all its calls.
    ///
    /// # Errors
    /// When the problem does not fit the device.
    fn prepare(&self, problem: &PoseProblem) -> Result<Box<dyn Session>, BackendError>;
}

/// A problem on its device. Results come in the order of the hypotheses, and a hypothesis has the same result whatever
/// the others are.
pub trait Session: Send {
    /// The loss of each hypothesis.
    ///
    /// # Errors
    /// When the device fails.
    fn evaluate(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Loss>, BackendError>;

    /// The loss of each hypothesis with its derivatives by the twist about the model's centre
    /// ([`RenderModel::center`], posed).
    ///
    /// # Errors
    /// When the device fails.
    fn linearise(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Linearised>, BackendError>;

    /// The picture of one hypothesis.
    ///
    /// # Errors
    /// When the device fails.
    fn render(&mut self, hypothesis: &Hypothesis) -> Result<PoseImage, BackendError>;
}
