//! Rendered images on the tape, as one array node, so that an image loss composes with what moves the scene.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};
use prehend_autodiff::rigid::rotation_vector_jacobian;
use prehend_autodiff::{CustomVjp, Var, custom};

use super::{BufferAdjoints, Renderer, Rendering, Scene, SceneGradient};
use crate::model::{ModelError, RenderModel};
use crate::shading::Shader;

/// Numbers on the tape in the place of a scene's own. What is not given keeps its value and has no derivative.
#[derive(Clone, Debug, Default)]
pub struct SceneVars {
    /// Poses `t_cam_model` of objects (their places in the scene), with unit quaternions as simulation states have.
    pub poses: Vec<(usize, Isometry3<Var>)>,
    /// Welded vertices of objects, as [`RenderModel::positions`] \[m\].
    pub positions: Vec<(usize, Vec<Vector3<Var>>)>,
    /// Colors of welded vertices, as [`RenderModel::with_colors`].
    pub colors: Vec<(usize, Vec<[Var; 3]>)>,
    /// Texels of objects, as [`RenderModel::texture`].
    pub texels: Vec<(usize, Vec<[Var; 3]>)>,
    /// fx, fy, cx, cy \[px\].
    pub intrinsics: Option<[Var; 4]>,
    /// Parameters of the shader.
    pub shader: Option<Vec<Var>>,
    /// Color of the background.
    pub background: Option<[Var; 3]>,
}

/// Images on the tape, row-major, one entry a pixel, as in [`Buffers`](super::Buffers).
#[derive(Clone, Debug)]
pub struct BufferVars {
    /// Color over the background.
    pub color: Vec<[Var; 3]>,
    /// Coverage.
    pub alpha: Vec<Var>,
    /// Z of the surface \[m\], 0 where there is none.
    pub depth: Vec<Var>,
}

/// Why a scene cannot take numbers from the tape.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RecordError {
    /// There is no such object.
    #[error("object {object} of a scene with {objects}")]
    Object {
        /// The place asked for.
        object: usize,
        /// Objects of the scene.
        objects: usize,
    },
    /// The shader has another number of parameters.
    #[error("{found} parameters given for a shader with {expected}")]
    Parameters {
        /// Parameters given.
        found: usize,
        /// Parameters of the shader.
        expected: usize,
    },
    /// A model cannot take the numbers.
    #[error("object {object}: {source}")]
    Model {
        /// Place of the object.
        object: usize,
        /// Why not.
        source: ModelError,
    },
}

/// A group of inputs of the node.
enum Input {
    /// With the pose's rotation and the offset of the model's center from its origin, camera frame.
    Pose {
        object: usize,
        rotation: UnitQuaternion<f64>,
        arm: Vector3<f64>,
    },
    Positions(usize),
    Colors(usize),
    Texels(usize),
    Intrinsics,
    Shader,
    Background,
}

impl Input {
    /// The derivatives of its numbers, in their order.
    fn pick(&self, gradient: &SceneGradient) -> Vec<f64> {
        match self {
            Self::Pose { object, rotation, arm } => {
                let twist = &gradient.objects[*object].twist;
                let force = Vector3::new(twist[0], twist[1], twist[2]);
                let torque = Vector3::new(twist[3], twist[4], twist[5]) + arm.cross(&force);
                let coordinates = rotation_vector_jacobian(rotation).tr_mul(&torque);
                force.iter().chain(coordinates.iter()).copied().collect()
            }
            Self::Positions(object) => {
                gradient.objects[*object].positions().iter().flatten().copied().collect()
            }
            Self::Colors(object) => gradient.objects[*object].colors().as_flattened().to_vec(),
            Self::Texels(object) => gradient.objects[*object].texels().into_flattened(),
            Self::Intrinsics => gradient.intrinsics.to_vec(),
            Self::Shader => gradient.shader.clone(),
            Self::Background => gradient.background.to_vec(),
        }
    }
}

struct ImageNode<Sh> {
    rendering: Rendering<Sh>,
    inputs: Vec<Input>,
}

impl<Sh: Shader + 'static> CustomVjp for ImageNode<Sh> {
    fn vjp(&self, output_adjoints: &[f64], input_adjoints: &mut [f64]) {
        let pixels = self.rendering.buffers.alpha.len();
        let (color, rest) = output_adjoints.split_at(3 * pixels);
        let (alpha, depth) = rest.split_at(pixels);
        let gradient = self.rendering.vjp(&BufferAdjoints {
            color: color.as_chunks().0.to_vec(),
            alpha: alpha.to_vec(),
            depth: depth.to_vec(),
            normal: Vec::new(),
        });
        let by = self.inputs.iter().flat_map(|input| input.pick(&gradient));
        input_adjoints.iter_mut().zip(by).for_each(|(sum, by)| *sum += by);
    }
}

/// Values of triples, in f32.
fn rounded(triples: &[[Var; 3]]) -> Vec<[f32; 3]> {
    triples.iter().map(|t| t.map(|v| v.value() as f32)).collect()
}

impl<Sh: Shader + Clone + 'static> Renderer<Sh> {
    /// Renders `scene` with `vars` in the place of its own numbers, and records the images as one node of the tape.
    ///
    /// A loss of how a body looks after a simulation is differentiated by where it started, say. Vertices, colors and
    /// texels are rounded to f32.
    ///
    /// # Errors
    /// When the scene or the shader has no such objects or numbers.
    ///
    /// # Panics
    /// If a number belongs to another recording (see [`Var`]).
    pub fn record(&self, scene: &Scene, vars: &SceneVars) -> Result<BufferVars, RecordError> {
        let (mut scene, mut renderer) = (scene.clone(), self.clone());
        let (mut inputs, mut numbers) = (Vec::new(), Vec::new());
        let objects = scene.objects.len();
        let edit =
            |scene: &mut Scene,
             object: usize,
             change: &dyn Fn(RenderModel) -> Result<RenderModel, ModelError>| {
                let body =
                    scene.objects.get_mut(object).ok_or(RecordError::Object { object, objects })?;
                let changed = change(RenderModel::clone(&body.model));
                body.model =
                    Arc::new(changed.map_err(|source| RecordError::Model { object, source })?);
                Ok(())
            };
        for (object, positions) in &vars.positions {
            let values: Vec<Point3<f64>> =
                positions.iter().map(|p| p.map(Var::value).into()).collect();
            edit(&mut scene, *object, &|model| model.with_positions(&values))?;
            inputs.push(Input::Positions(*object));
            numbers.extend(positions.iter().flatten());
        }
        for (object, colors) in &vars.colors {
            edit(&mut scene, *object, &|model| model.with_colors(&rounded(colors)))?;
            inputs.push(Input::Colors(*object));
            numbers.extend(colors.as_flattened());
        }
        for (object, texels) in &vars.texels {
            edit(&mut scene, *object, &|model| model.with_texels(rounded(texels)))?;
            inputs.push(Input::Texels(*object));
            numbers.extend(texels.as_flattened());
        }
        for (object, pose) in &vars.poses {
            let object = *object;
            let body =
                scene.objects.get_mut(object).ok_or(RecordError::Object { object, objects })?;
            let translation = pose.translation.vector.map(Var::value);
            let rotation =
                Unit::new_normalize(pose.rotation.quaternion().coords.map(Var::value).into());
            body.t_cam_model = Isometry3::from_parts(translation.into(), rotation);
            let arm = body.center().coords - translation;
            inputs.push(Input::Pose { object, rotation, arm });
            numbers.extend(pose.translation.vector.iter());
            numbers.extend(pose.rotation.quaternion().coords.iter());
        }
        if let Some(intrinsics) = &vars.intrinsics {
            let camera = &mut scene.camera;
            [camera.fx, camera.fy, camera.cx, camera.cy] = intrinsics.map(Var::value);
            inputs.push(Input::Intrinsics);
            numbers.extend(intrinsics);
        }
        if let Some(parameters) = &vars.shader {
            let (found, expected) = (parameters.len(), renderer.parameters.len());
            if found != expected {
                return Err(RecordError::Parameters { found, expected });
            }
            renderer.parameters = parameters.iter().map(|p| p.value()).collect();
            inputs.push(Input::Shader);
            numbers.extend(parameters);
        }
        if let Some(background) = &vars.background {
            scene.background = background.map(Var::value);
            inputs.push(Input::Background);
            numbers.extend(background);
        }
        let rendering = renderer.render(&scene);
        let buffers = &rendering.buffers;
        let pixels = buffers.alpha.len();
        let mut outputs = buffers.color.as_flattened().to_vec();
        outputs.extend(&buffers.alpha);
        outputs.extend(&buffers.depth);
        let images = custom(&numbers, &outputs, ImageNode { rendering, inputs });
        Ok(BufferVars {
            color: images[..3 * pixels].as_chunks().0.to_vec(),
            alpha: images[3 * pixels..4 * pixels].to_vec(),
            depth: images[4 * pixels..].to_vec(),
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;
    use prehend_autodiff::lie::{lift, perturb_about};
    use prehend_autodiff::{Recording, Scalar};
    use prehend_geometry::shapes::cuboid;

    use super::*;
    use crate::camera::Camera;
    use crate::light::Light;
    use crate::shapes_for_tests::{lump, painted};

    fn scene() -> Scene {
        let camera = Camera { fx: 60.0, fy: 62.0, cx: 23.6, cy: 17.4, width: 48, height: 36 };
        let model = |mesh| Arc::new(RenderModel::new(mesh).unwrap());
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -0.7, 0.3));
        let pose = Isometry3::from_parts(Vector3::new(0.01, 0.0, 0.4).into(), turn);
        // Away from its origin, so that turns about origin and center differ.
        let mut mesh = painted(lump(0.05, 10), 0.1);
        mesh.vertices.iter_mut().for_each(|p| p.x += 0.03);
        Scene::new(camera)
            .with(model(&mesh), pose)
            .with(model(&cuboid(Vector3::repeat(0.2))), Isometry3::translation(0.1, 0.0, 0.8))
    }

    #[test]
    fn the_node_passes_on_the_vector_jacobian_product() {
        let (scene, renderer) = (scene(), Renderer::new(Light::headlight(0.4, 0.6)));
        let buffers = renderer.render(&scene).buffers;
        let pixels = buffers.alpha.len();
        let weight = |i: usize| (0.37 * i as f64).sin();
        let recording = Recording::start();
        let body = &scene.objects[0];
        let twist: Vec<Var> = recording.variables_of(&[0.0; 6]);
        let center = body.center().coords.map(Var::constant);
        let pose =
            perturb_about(&lift(&body.t_cam_model), &center, &Vector6::from_fn(|i, _| twist[i]));
        let positions: Vec<Vector3<Var>> = body
            .model
            .positions()
            .iter()
            .map(|p| p.coords.map(|v| recording.variable(v)))
            .collect();
        let colors = body.model.vertex_colors().unwrap();
        let colors = colors.iter().map(|c| c.map(|v| recording.variable(v.into()))).collect();
        let shader = recording.variables_of(&renderer.parameters);
        let camera = &scene.camera;
        let intrinsics = recording.variables([camera.fx, camera.fy, camera.cx, camera.cy]);
        let vars = SceneVars {
            poses: vec![(0, pose)],
            positions: vec![(0, positions.clone())],
            colors: vec![(0, colors)],
            intrinsics: Some(intrinsics),
            shader: Some(shader.clone()),
            background: Some(recording.variables([0.0; 3])),
            ..SceneVars::default()
        };
        let images = renderer.record(&scene, &vars).unwrap();
        let all = || {
            let color = images.color.as_flattened().iter();
            color.chain(&images.alpha).chain(&images.depth).copied()
        };
        let values =
            buffers.color.as_flattened().iter().chain(&buffers.alpha).chain(&buffers.depth);
        all().zip(values).for_each(|(var, value)| assert!((var.value() - value).abs() < 1e-6));
        let seeds: Vec<(Var, f64)> = all().enumerate().map(|(i, var)| (var, weight(i))).collect();
        let adjoints = recording.vjp(&seeds);
        let direct = renderer.render(&scene).vjp(&BufferAdjoints {
            color: (0..pixels).map(|i| [0, 1, 2].map(|k| weight(3 * i + k))).collect(),
            alpha: (0..pixels).map(|i| weight(3 * pixels + i)).collect(),
            depth: (0..pixels).map(|i| weight(4 * pixels + i)).collect(),
            normal: Vec::new(),
        });
        let close = |var: Var, exact: f64| {
            let found = adjoints.wrt(var);
            assert!((found - exact).abs() < 1e-3 * (1.0 + exact.abs()), "{found} {exact}");
        };
        let object = &direct.objects[0];
        (0..6).for_each(|i| close(twist[i], object.twist[i]));
        (0..4).for_each(|i| close(intrinsics[i], direct.intrinsics[i]));
        shader.iter().zip(&direct.shader).for_each(|(var, exact)| close(*var, *exact));
        for (var, exact) in positions.iter().zip(object.positions()) {
            (0..3).for_each(|k| close(var[k], exact[k]));
        }
        for (var, exact) in vars.colors[0].1.iter().zip(object.colors()) {
            (0..3).for_each(|k| close(var[k], exact[k]));
        }
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        let (scene, renderer) = (scene(), Renderer::new(Light::ambient(1.0)));
        let recording = Recording::start();
        let error = |vars: SceneVars| renderer.record(&scene, &vars).unwrap_err();
        let shader = Some(recording.variables_of(&[1.0; 5]));
        let wrong = error(SceneVars { shader, ..SceneVars::default() });
        assert_eq!(wrong, RecordError::Parameters { found: 5, expected: 15 });
        let poses = vec![(2, Isometry3::identity())];
        let wrong = error(SceneVars { poses, ..SceneVars::default() });
        assert_eq!(wrong, RecordError::Object { object: 2, objects: 2 });
        let texels = vec![(0, vec![recording.variables([0.5; 3])])];
        let wrong = error(SceneVars { texels, ..SceneVars::default() });
        assert!(matches!(wrong, RecordError::Model { object: 0, .. }));
    }
}
