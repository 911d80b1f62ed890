//! The loss of a pose.

use std::sync::Arc;

use prehend_geometry::RobustKernel;
use prehend_render::{
    DepthOptions, Hypothesis, Light, LossOptions, PoseProblem, Session, light_samples,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::camera::camera;
use super::image::{depth, picture, target};
use super::inputs::{Input, batch_of};
use super::light::{given, light, to_array};
use super::mesh::{Look, model};
use super::mode::mode;
use super::named;
use super::pose::{by_matrix, pose};
use super::pullback::shape;
use crate::arrays::{Array, Numbers, array};
use crate::error::{Raise, wrong};
use crate::threads::detached;

/// How well a mesh at a pose explains a segmented image: a number with its gradient and its Gauss–Newton matrix.
///
/// `mesh`, `K`, `colors`, `uvs`, `texture`, `light`, `mode` and the mode's settings are as of `Renderer`. `image` (H × W × 3, bytes or 0..1) is
/// compared where `mask` (H × W) is not zero; a mask of floating-point numbers is the share of each pixel that the object covers, and `image` then the object
/// before black. `depth` (H × W, m, 0 where unknown) is measured depth, `occluder` the depth of known bodies that may hide the object.
///
/// The loss is a mean over the mask's pixels and three channels: of half the squared difference of color (`color_weight`; `kernel` "squared", "huber",
/// "cauchy", "geman_mcclure" or "tukey" with `kernel_scale`), of coverage (`mask_weight`), and of depth in units of `depth_scale` [m] up to
/// `depth_truncation` [m] (`depth_weight`). Each pixel is drawn with `samples` × `samples` samples. Pixels are computed in single precision.
#[pyclass(name = "PoseLoss", frozen, module = "prehend")]
pub(crate) struct PyPoseLoss {
    problem: PoseProblem,
    light: Light,
}

impl PyPoseLoss {
    /// Poses, each under its light, and the length of the batch.
    fn hypotheses(
        &self,
        poses: &Numbers<'_>,
        lights: Option<&Numbers<'_>>,
    ) -> PyResult<(Vec<Hypothesis>, Option<usize>)> {
        let poses = Input::new(poses, &super::pose::SHAPE, "pose")?;
        let lights =
            lights.map(|own| Input::new(own, &super::light::SHAPE, "light")).transpose()?;
        let own = lights.as_ref().and_then(Input::batch);
        let batch = batch_of(&[("pose", poses.batch()), ("light", own)])?;
        let mut all = Vec::new();
        for k in 0..batch.unwrap_or(1) {
            let light = lights.as_ref().map_or(self.light, |own| light(own.of(k)));
            all.push(Hypothesis { t_cam_object: pose(poses.of(k), "pose")?, light });
        }
        Ok((all, batch))
    }
}

#[pymethods]
impl PyPoseLoss {
    #[new]
    #[pyo3(signature = (
        mesh, K, image, mask, *, depth=None, occluder=None, colors=None, uvs=None, texture=None, light=None,
        color_weight=1.0, mask_weight=0.0, depth_weight=1.0, depth_scale=0.02, depth_truncation=f64::INFINITY,
        kernel="squared", kernel_scale=0.1, penalize_occluded=false, samples=1, mode="contour", **settings
    ))]
    #[expect(non_snake_case, clippy::too_many_arguments)] // Python's own
    fn new(
        mesh: &Bound<'_, PyAny>,
        K: Numbers<'_>,
        image: &Bound<'_, PyAny>,
        mask: &Bound<'_, PyAny>,
        depth: Option<Numbers<'_>>,
        occluder: Option<Numbers<'_>>,
        colors: Option<Numbers<'_>>,
        uvs: Option<Numbers<'_>>,
        texture: Option<Bound<'_, PyAny>>,
        light: Option<Numbers<'_>>,
        color_weight: f64,
        mask_weight: f64,
        depth_weight: f64,
        depth_scale: f64,
        depth_truncation: f64,
        kernel: &str,
        kernel_scale: f64,
        penalize_occluded: bool,
        samples: usize,
        mode: &str,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let image = picture(image)?;
        let mut target = target(camera(&K, (image.height(), image.width()))?, &image, mask)?;
        if let Some(given) = &depth {
            target = target.with_depth(&self::depth(given, "depth")?).raise()?;
        }
        if let Some(given) = &occluder {
            target = target.with_occluder(self::depth(given, "occluder")?).raise()?;
        }
        let options = LossOptions {
            color_weight,
            mask_weight,
            depth: depth.as_ref().map(|_| DepthOptions {
                weight: depth_weight,
                scale: depth_scale,
                truncation: depth_truncation,
            }),
            kernel: self::kernel(kernel, kernel_scale)?,
            penalize_occluded,
        };
        let mode = self::mode(mode, settings)?;
        let loss = prehend_render::PoseLoss { mode, options, samples };
        loss.check().raise()?;
        let model = model(mesh, &Look { colors, uvs, texture })?;
        let problem = PoseProblem { model, target: Arc::new(target), loss };
        Ok(Self { problem, light: given(light.as_ref())? })
    }

    /// The loss of the object at `pose`, mesh to camera frame (4 × 4, m): a number; or of a batch of poses (B × 4 × 4), side by side on all cores: B numbers.
    /// `light` (3 × 5) takes the place of the loss's own.
    #[pyo3(signature = (pose, *, light=None))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        pose: Numbers<'py>,
        light: Option<Numbers<'py>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (hypotheses, batch) = self.hypotheses(&pose, light.as_ref())?;
        let losses = detached(py, || self.problem.losses(&hypotheses))?;
        numbers(py, losses.iter().map(|loss| loss.total).collect(), batch)
    }

    /// The loss with its derivatives: its value, its gradient (6) and its Gauss–Newton matrix (`hessian`, 6 × 6) by a left twist of the pose, translation [m] then rotation
    /// [rad], about the object's center in the camera frame (`center`, 3); and as `pose` its gradient by the entries of the matrix (4 × 4), of whose
    /// upper left block the nearest rotation counts. Of a batch with its length in front.
    ///
    /// A step of Gauss–Newton is `perturb(pose, -solve(at.hessian, at.gradient), at.center)`.
    #[pyo3(signature = (pose, *, light=None))]
    fn linearize<'py>(
        &self,
        py: Python<'py>,
        pose: Numbers<'py>,
        light: Option<Numbers<'py>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (hypotheses, batch) = self.hypotheses(&pose, light.as_ref())?;
        let linearized = detached(py, || self.problem.clone().linearize(&hypotheses))?.raise()?;
        let mut values = Vec::new();
        let [mut gradients, mut hessians, mut poses, mut centers] = [const { Vec::new() }; 4];
        for (at, hypothesis) in linearized.iter().zip(&hypotheses) {
            let center = hypothesis.t_cam_object * self.problem.model.center();
            values.push(at.loss.total);
            gradients.extend(at.gradient.iter());
            hessians.extend(at.hessian.iter());
            poses.extend(by_matrix(&at.gradient, &hypothesis.t_cam_object, &center));
            centers.extend(center.iter());
        }
        let fields = (
            numbers(py, values, batch)?,
            array(py, gradients, &shape(batch, &[6]))?,
            array(py, hessians, &shape(batch, &[6, 6]))?,
            array(py, poses, &shape(batch, &super::pose::SHAPE))?,
            array(py, centers, &shape(batch, &[3]))?,
        );
        named(py, "LinearizedLoss", fields)
    }

    /// The light (3 × 5) that explains the image best if the object is at `pose` (4 × 4), by robust least squares over at most about `most` pixels that show the
    /// object alone, `margin` pixels away from its outline and the mask's.
    #[pyo3(signature = (pose, *, margin=1, most=4096))]
    fn fit_light<'py>(
        &self,
        py: Python<'py>,
        pose: Numbers<'py>,
        margin: usize,
        most: usize,
    ) -> PyResult<Array<'py>> {
        let (hypotheses, None) = self.hypotheses(&pose, None)? else {
            return Err(wrong("pose: one pose is expected, not a batch"));
        };
        let PoseProblem { model, target, .. } = &self.problem;
        let pose = &hypotheses[0].t_cam_object;
        let fitted = detached(py, || {
            let samples = light_samples(model, pose, target, margin, most);
            // The pull settles what normals in a narrow cone leave open.
            Light::fit(&samples, 1e-3)
        })?;
        to_array(py, &fitted.raise()?)
    }

    /// The light (3 × 5).
    #[getter]
    fn light<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        to_array(py, &self.light)
    }

    /// Center of the mesh's bounding box, mesh frame \[m\]: twists turn about where the pose puts it.
    #[getter]
    fn center<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        array(py, self.problem.model.center().iter().copied().collect(), &[3])
    }

    /// Rows and columns of the image.
    #[getter]
    fn size(&self) -> (usize, usize) {
        let camera = self.problem.target.camera();
        (camera.height, camera.width)
    }

    fn __repr__(&self) -> String {
        let (faces, area) = (self.problem.model.face_count(), self.problem.target.area());
        format!("PoseLoss({faces} faces, {area} px of mask)")
    }
}

/// One number for each of a batch, or a number.
fn numbers(py: Python<'_>, values: Vec<f64>, batch: Option<usize>) -> PyResult<Bound<'_, PyAny>> {
    match batch {
        Some(count) => Ok(array(py, values, &[count])?.into_any()),
        None => Ok(values[0].into_pyobject(py)?.into_any()),
    }
}

fn kernel(name: &str, scale: f64) -> PyResult<RobustKernel> {
    match name {
        "squared" => Ok(RobustKernel::Squared),
        "huber" => Ok(RobustKernel::Huber { scale }),
        "cauchy" => Ok(RobustKernel::Cauchy { scale }),
        "geman_mcclure" => Ok(RobustKernel::GemanMcClure { scale }),
        "tukey" => Ok(RobustKernel::Tukey { scale }),
        _ => Err(wrong(format!(
            "kernel: \"squared\", \"huber\", \"cauchy\", \"geman_mcclure\" or \"tukey\" is expected, not {name:?}"
        ))),
    }
}
