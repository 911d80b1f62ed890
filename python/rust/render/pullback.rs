//! Pictures as arrays, and derivatives by them carried back.

use nalgebra::Vector3;
use numpy::PyUntypedArrayMethods;
use prehend_render::{BufferAdjoints, Light, Rendering, Scene, SceneGradient, vjp_each};
use pyo3::prelude::*;

use super::named;
use super::pose::by_matrix;
use crate::arrays::{Array, Numbers, array, in_order};
use crate::error::wrong;
use crate::threads::detached;

/// Carries derivatives of a number by pictures back to what made them. Made by `Renderer.vjp`; call it as often as wanted.
#[pyclass(frozen, module = "prehend")]
pub(crate) struct RenderPullback {
    renderings: Vec<Rendering<Light>>,
    scenes: Vec<Scene>,
    /// For each input whether it is a batch, None if it was not given.
    batched: Vec<Option<bool>>,
    batch: bool,
}

impl RenderPullback {
    pub(super) fn new(scenes: Vec<Scene>, batched: Vec<Option<bool>>, batch: bool) -> Self {
        Self { renderings: Vec::new(), scenes, batched, batch }
    }

    pub(super) fn of(self, renderings: Vec<Rendering<Light>>) -> Self {
        Self { renderings, ..self }
    }

    pub(super) fn is_batch(&self) -> bool {
        self.batch
    }

    /// The shape of what has the shape `own` for one picture.
    fn shape(&self, own: &[usize]) -> Vec<usize> {
        shape(self.batch.then_some(self.renderings.len()), own)
    }

    /// The numbers of an adjoint, none if it was not given.
    fn adjoint(
        &self,
        given: Option<&Numbers<'_>>,
        channels: &[usize],
        what: &str,
    ) -> PyResult<Vec<f64>> {
        let Some(given) = given else { return Ok(Vec::new()) };
        let camera = &self.scenes[0].camera;
        let expected = self.shape(&[&[camera.height, camera.width], channels].concat());
        if given.shape() != expected {
            let own = given.shape();
            return Err(wrong(format!(
                "{what}: an array of {expected:?} is expected, not {own:?}"
            )));
        }
        Ok(in_order(given).into_owned())
    }

    /// The derivatives by one input: of each picture, or their sum where it is the same for all.
    fn gathered<'py>(
        &self,
        py: Python<'py>,
        input: usize,
        each: bool,
        own: &[usize],
        parts: Vec<Vec<f64>>,
    ) -> PyResult<Array<'py>> {
        let of_each = if each { self.batch } else { self.batched[input].unwrap_or(false) };
        if of_each {
            return array(py, parts.concat(), &shape(Some(parts.len()), own));
        }
        let mut sum = vec![0.0; own.iter().product()];
        for part in &parts {
            sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
        }
        array(py, sum, own)
    }
}

#[pymethods]
impl RenderPullback {
    /// The derivatives of a number by the inputs, from those by color, coverage, depth and normal, each in the shape of its image; those left out
    /// are zero.
    ///
    /// By `pose`: the entries of the matrix (4 × 4), of whose upper left block the nearest rotation counts; and as `twist` by a left twist, translation [m] then rotation
    /// [rad], about the mesh's center in the camera frame (`perturb`). By `vertices`, `colors` and `texels` only where they were given. Inputs that
    /// are the same for a batch get the sum over its pictures, with `each` the derivatives of each picture.
    #[pyo3(signature = (color=None, coverage=None, depth=None, normal=None, *, each=false))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        color: Option<Numbers<'py>>,
        coverage: Option<Numbers<'py>>,
        depth: Option<Numbers<'py>>,
        normal: Option<Numbers<'py>>,
        each: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let color = self.adjoint(color.as_ref(), &[3], "color")?;
        let alpha = self.adjoint(coverage.as_ref(), &[], "coverage")?;
        let depth = self.adjoint(depth.as_ref(), &[], "depth")?;
        let normal = self.adjoint(normal.as_ref(), &[3], "normal")?;
        let count = self.renderings.len();
        let part = |all: &[f64], k: usize| -> Vec<f64> {
            all[k * (all.len() / count)..(k + 1) * (all.len() / count)].to_vec()
        };
        let adjoints: Vec<BufferAdjoints> = (0..count)
            .map(|k| BufferAdjoints {
                color: part(&color, k).as_chunks().0.to_vec(),
                alpha: part(&alpha, k),
                depth: part(&depth, k),
                normal: part(&normal, k).as_chunks().0.iter().map(vector).collect(),
            })
            .collect();
        let gradients = detached(py, || vjp_each(&self.renderings, &adjoints))?;
        let all = |of: &dyn Fn(&SceneGradient) -> Vec<f64>| gradients.iter().map(of).collect();
        let poses: Vec<Vec<f64>> = gradients
            .iter()
            .zip(&self.scenes)
            .map(|(gradient, scene)| {
                let (twist, object) = (&gradient.objects[0].twist, &scene.objects[0]);
                by_matrix(twist, &object.t_cam_model, &object.center()).to_vec()
            })
            .collect();
        let twists = all(&|g| g.objects[0].twist.iter().copied().collect());
        let [vertices, colors, texels] = [1, 2, 3].map(|k| self.batched[k].is_some());
        let rows = self.scenes[0].objects[0].model.positions().len();
        let vertices = vertices.then(|| {
            let by =
                all(&|g| g.objects[0].positions().iter().flat_map(|p| [p.x, p.y, p.z]).collect());
            self.gathered(py, 1, each, &[rows, 3], by)
        });
        let colors = colors.then(|| {
            let by = all(&|g| g.objects[0].colors().as_flattened().to_vec());
            self.gathered(py, 2, each, &[rows, 3], by)
        });
        let texels = texels.then(|| {
            let by = all(&|g| g.objects[0].texels().as_flattened().to_vec());
            let size = self.scenes[0].objects[0].model.texture();
            let (width, height) = size.map_or((0, 0), |(width, height, _)| (width, height));
            self.gathered(py, 3, each, &[height, width, 3], by)
        });
        let fields = (
            self.gathered(py, 0, each, &super::pose::SHAPE, poses)?,
            self.gathered(py, 0, each, &[6], twists)?,
            vertices.transpose()?,
            colors.transpose()?,
            texels.transpose()?,
            self.gathered(py, 4, each, &super::light::SHAPE, all(&|g| g.shader.clone()))?,
            self.gathered(py, 5, each, &[3], all(&|g| g.background.to_vec()))?,
            self.gathered(py, 6, each, &[4], all(&|g| g.intrinsics.to_vec()))?,
        );
        named(py, "RenderGradient", fields)
    }
}

/// The images of renderings, each as one array.
pub(super) fn picture<'py>(
    py: Python<'py>,
    renderings: &[Rendering<Light>],
    batch: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let (mut color, mut coverage, mut depth, mut normal) = (vec![], vec![], vec![], vec![]);
    let mut size = [0, 0];
    for rendering in renderings {
        let buffers = &rendering.buffers;
        size = [buffers.height, buffers.width];
        color.extend_from_slice(buffers.color.as_flattened());
        coverage.extend_from_slice(&buffers.alpha);
        depth.extend_from_slice(&buffers.depth);
        buffers.normal.iter().for_each(|n| normal.extend([n.x, n.y, n.z]));
    }
    let batch = batch.then_some(renderings.len());
    let [rows, columns] = size;
    let (plane, channels) = (shape(batch, &size), shape(batch, &[rows, columns, 3]));
    let fields = (
        array(py, color, &channels)?,
        array(py, coverage, &plane)?,
        array(py, depth, &plane)?,
        array(py, normal, &channels)?,
    );
    named(py, "Image", fields)
}

/// With the length of a batch in front.
pub(super) fn shape(batch: Option<usize>, own: &[usize]) -> Vec<usize> {
    batch.into_iter().chain(own.iter().copied()).collect()
}

fn vector(row: &[f64; 3]) -> Vector3<f64> {
    Vector3::from(*row)
}
