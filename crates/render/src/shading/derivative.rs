//! Derivatives of any shader, by forward mode.

use nalgebra::Vector3;
use prehend_autodiff::{Fwd, Scalar};

use super::{Shader, SurfacePoint};

/// Parameters differentiated at once.
const CHUNK: usize = 8;

fn lifted<const N: usize>(values: &[f64]) -> Vec<Fwd<N>> {
    values.iter().map(|&v| Fwd::constant(v)).collect()
}

/// The parameters of a shader, prepared for differentiation by itself and by them.
pub(crate) struct Chunks {
    plain: Vec<Fwd<9>>,
    /// One copy a chunk, in which the chunk's parameters are the variables.
    seeded: Vec<Vec<Fwd<CHUNK>>>,
}

impl Chunks {
    pub(crate) fn new(parameters: &[f64]) -> Self {
        let seeded = (0..parameters.len()).step_by(CHUNK).map(|first| {
            let mut chunk = lifted(parameters);
            let rest = chunk[first..].iter_mut().take(CHUNK).enumerate();
            rest.for_each(|(i, p)| *p = Fwd::variable(p.value, i));
            chunk
        });
        Self { plain: lifted(parameters), seeded: seeded.collect() }
    }
}

/// The gradient of `adjoint` · color by position, normal and albedo.
#[inline]
pub(crate) fn by_point(
    shader: &impl Shader,
    parameters: &Chunks,
    point: &SurfacePoint<f64>,
    adjoint: [f64; 3],
) -> SurfacePoint<f64> {
    let vector = |v: &Vector3<f64>, first: usize| {
        Vector3::from_fn(|i, _| Fwd::<9>::variable(v[i], first + i))
    };
    let inputs = SurfacePoint {
        position: vector(&point.position, 0),
        normal: vector(&point.normal, 3),
        albedo: std::array::from_fn(|i| Fwd::variable(point.albedo[i], 6 + i)),
    };
    let color = shader.shade(&parameters.plain, &inputs);
    let along = |i: usize| -> f64 { (0..3).map(|c| adjoint[c] * color[c].derivative[i]).sum() };
    SurfacePoint {
        position: Vector3::from_fn(|i, _| along(i)),
        normal: Vector3::from_fn(|i, _| along(3 + i)),
        albedo: std::array::from_fn(|i| along(6 + i)),
    }
}

/// Adds the gradient of `adjoint` · color by the parameters to `gradient`.
#[inline]
pub(crate) fn by_parameters(
    shader: &impl Shader,
    parameters: &Chunks,
    point: &SurfacePoint<f64>,
    adjoint: [f64; 3],
    gradient: &mut [f64],
) {
    let constant = |v: f64| Fwd::<CHUNK>::constant(v);
    let point = SurfacePoint {
        position: point.position.map(constant),
        normal: point.normal.map(constant),
        albedo: point.albedo.map(constant),
    };
    for (chunk, out) in parameters.seeded.iter().zip(gradient.chunks_mut(CHUNK)) {
        let color = shader.shade(chunk, &point);
        for (i, g) in out.iter_mut().enumerate() {
            *g += (0..3).map(|c| adjoint[c] * color[c].derivative[i]).sum::<f64>();
        }
    }
}
