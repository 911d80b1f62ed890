//! Where poses are compared with an image: this processor, or a graphics device.

mod cpu;
mod device;
mod error;
#[cfg(feature = "gpu")]
mod gpu;

use std::sync::Arc;

use nalgebra::Isometry3;

pub use cpu::Cpu;
pub use device::Device;
pub use error::BackendError;
#[cfg(feature = "gpu")]
pub use gpu::Gpu;

use crate::light::Light;
use crate::model::RenderModel;
use crate::pose_loss::{Linearized, Loss, PoseLoss, Target, Tile};

/// Object, target and loss that many poses have in common.
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
///
/// ```
/// use std::sync::Arc;
///
/// use nalgebra::{Isometry3, Vector3};
/// use prehend_geometry::shapes::cuboid;
/// use prehend_render::{
///     Backend, Camera, Device, Hypothesis, Light, Mask, PoseLoss, PoseProblem, RenderModel, RgbImage,
///     Target,
/// };
///
/// let camera = Camera { fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5, width: 64, height: 48 };
/// let (image, mask) = (RgbImage::filled(64, 48, [0.5; 3]), Mask::filled(64, 48, true));
/// let problem = PoseProblem {
///     model: Arc::new(RenderModel::new(&cuboid(Vector3::repeat(0.1)))?),
///     target: Arc::new(Target::new(camera, &image, &mask)?),
///     loss: PoseLoss::default(),
/// };
/// let mut session = Device::Auto.open()?.prepare(&problem)?;
/// let hypotheses: Vec<Hypothesis> = (0..100)
///     .map(|i| Hypothesis {
///         t_cam_object: Isometry3::translation(0.0, 0.0, 0.3 + 0.01 * i as f64),
///         light: Light::headlight(0.5, 0.5),
///     })
///     .collect();
/// assert_eq!(session.linearize(&hypotheses)?.len(), 100);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Backend: Send + Sync {
    /// Name of the device, for people to read.
    fn name(&self) -> &str;

    /// Uploads a problem. What the session allocates serves all its calls.
    ///
    /// # Errors
    /// When a setting of the loss is out of its range, or the problem does not fit the device.
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

    /// The loss of each hypothesis with its derivatives by the twist about the model's center
    /// ([`RenderModel::center`], posed).
    ///
    /// # Errors
    /// When the device fails.
    fn linearize(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Linearized>, BackendError>;

    /// As [`linearize`](Self::linearize), by square tiles of the image that are `side` pixels wide:
    /// [`PoseLoss::linearize_tiles`]. Those to which no pixel is drawn or
    /// missed may be left out.
    ///
    /// # Errors
    /// When the device fails.
    fn linearize_tiles(
        &mut self,
        hypotheses: &[Hypothesis],
        side: usize,
    ) -> Result<Vec<Vec<Tile>>, BackendError>;
}
