//! Many scenes under first-order light at once, compiled here.

use rayon::prelude::*;

use super::{BufferAdjoints, Renderer, Rendering, Scene, SceneGradient};
use crate::light::Light;
use crate::mode::Mode;

/// Renders scenes side by side on all cores, each under its light: [`Renderer::render`] of each, to the last bit.
///
/// Not generic, so that crates that need no shader of their own are spared compiling the renderer once more.
#[inline(never)]
pub fn render_each(mode: Mode, scenes: &[(Scene, Light)]) -> Vec<Rendering<Light>> {
    let one = |(scene, light): &(Scene, Light)| Renderer::new(*light).with_mode(mode).render(scene);
    scenes.par_iter().map(one).collect()
}

/// [`Rendering::vjp`] of each, side by side on all cores.
///
/// # Panics
/// If there are not as many adjoints as renderings, or one does not fit its images.
#[inline(never)]
pub fn vjp_each(
    renderings: &[Rendering<Light>],
    adjoints: &[BufferAdjoints],
) -> Vec<SceneGradient> {
    assert_eq!(renderings.len(), adjoints.len(), "adjoints of each rendering");
    renderings.par_iter().zip(adjoints).map(|(rendering, by)| rendering.vjp(by)).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Vector3};
    use prehend_geometry::shapes::cuboid;

    use super::*;
    use crate::camera::Camera;
    use crate::model::RenderModel;

    #[test]
    fn each_is_as_one_alone() {
        let camera = Camera { fx: 60.0, fy: 60.0, cx: 15.5, cy: 11.5, width: 32, height: 24 };
        let model = Arc::new(RenderModel::new(&cuboid(Vector3::repeat(0.1))).unwrap());
        let scene = |z| Scene::new(camera).with(model.clone(), Isometry3::translation(0.0, 0.0, z));
        let light = Light::headlight(0.4, 0.6);
        let scenes = [0.4, 0.5, 0.6].map(|z| (scene(z), light));
        let each = render_each(Mode::default(), &scenes);
        let adjoints = BufferAdjoints { alpha: vec![1.0; 32 * 24], ..BufferAdjoints::default() };
        let gradients = vjp_each(&each, &vec![adjoints.clone(); 3]);
        for (((scene, light), many), by) in scenes.iter().zip(&each).zip(&gradients) {
            let alone = Renderer::new(*light).render(scene);
            assert_eq!(alone.buffers, many.buffers);
            assert_eq!(alone.vjp(&adjoints).objects[0].twist, by.objects[0].twist);
        }
    }
}
