//! Whether a camera can see a surface.

use nalgebra::Vector3;

/// Surface that is inclined to the line of sight by less than this sine counts less, down to nothing where it looks away.
const INCLINED: f64 = 0.2;

/// How much a surface looks at the camera at `place`, where it has the outward `normal`, of any length (camera frame): from 0
/// if it looks away to 1, in a smooth step, so that costs do not jump as a surface turns.
pub(super) fn facing(normal: &Vector3<f64>, place: &Vector3<f64>) -> f64 {
    let cosine = -normal.dot(place) / (normal.norm() * place.norm());
    // Nothing where there is no normal, either.
    let x = if cosine > 0.0 { (cosine / INCLINED).min(1.0) } else { 0.0 };
    x * x * (3.0 - 2.0 * x)
}
