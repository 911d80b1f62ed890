//! How light makes a color of a surface point.

mod derivative;
mod first_order;
mod lamps;
pub(crate) mod surface;

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

pub(crate) use derivative::{Chunks, by_parameters, by_point};
pub use lamps::{Lamp, Lighting, Material};

/// A visible point of a surface, as a [`Shader`] sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint<S> {
    /// Position, camera frame \[m\].
    pub position: Vector3<S>,
    /// Unit normal towards the side that is seen, camera frame; zero where the surface has none.
    pub normal: Vector3<S>,
    /// Unlit color, 0..=1.
    pub albedo: [S; 3],
}

/// Color of a lit surface point: one function, generic over the scalar, from which the renderer takes all derivatives.
///
/// Colors above one are kept: pictures clamp when they are saved. A shader of fog, whose density and color can be
/// estimated from images:
///
/// ```
/// use prehend_autodiff::Scalar;
/// use prehend_render::{Shader, SurfacePoint};
///
/// struct Fog([f64; 4]);
///
/// impl Shader for Fog {
///     fn parameters(&self) -> Vec<f64> {
///         self.0.to_vec()
///     }
///     fn shade<S: Scalar>(&self, p: &[S], point: &SurfacePoint<S>) -> [S; 3] {
///         let clear = (-p[0] * point.position.z).exp();
///         [0, 1, 2].map(|c| p[c + 1] + clear * (point.albedo[c] - p[c + 1]))
///     }
/// }
/// # use nalgebra::Vector3;
/// # let point = SurfacePoint { position: Vector3::z() * 2.0, normal: -Vector3::z(), albedo: [1.0; 3] };
/// # let color = Fog([0.5, 0.2, 0.2, 0.2]).shade(&[0.5, 0.2, 0.2, 0.2], &point);
/// # assert!((color[0] - (0.2 + 0.8 * (-1.0f64).exp())).abs() < 1e-12);
/// ```
pub trait Shader: Send + Sync {
    /// Numbers that can be estimated, passed back to [`shade`](Self::shade).
    fn parameters(&self) -> Vec<f64> {
        Vec::new()
    }

    /// The color of `point`, for `parameters` as many as [`parameters`](Self::parameters) gives.
    fn shade<S: Scalar>(&self, parameters: &[S], point: &SurfacePoint<S>) -> [S; 3];
}
