//! The scenes that arrays stand for.

use std::sync::Arc;

use nalgebra::Point3;
use prehend_render::{Light, RenderModel, Scene};
use pyo3::prelude::*;

use super::camera::with_intrinsics;
use super::inputs::{Input, batch_of};
use super::light::light;
use super::mesh::single;
use super::pose::pose;
use super::renderer::PyRenderer;
use crate::arrays::Numbers;
use crate::error::{Raise, wrong};

/// Inputs of pictures, each once for all, or a batch.
pub(super) struct Inputs<'a> {
    pose: Input<'a>,
    /// In the order of [`NAMES`].
    others: [Option<Input<'a>>; 6],
    pub(super) batch: Option<usize>,
}

/// Inputs after the pose.
const NAMES: [&str; 6] = ["vertices", "colors", "texels", "light", "background", "intrinsics"];

impl Inputs<'_> {
    /// Whether each input is a batch, None where it was not given.
    pub(super) fn batched(&self) -> Vec<Option<bool>> {
        let of = |input: &Option<Input<'_>>| input.as_ref().map(|own| own.batch().is_some());
        let mut all = vec![Some(self.pose.batch().is_some())];
        all.extend(self.others.iter().map(of));
        all
    }
}

impl PyRenderer {
    pub(super) fn inputs<'a>(
        &self,
        pose: &'a Numbers<'_>,
        others: [&'a Option<Numbers<'_>>; 6],
    ) -> PyResult<Inputs<'a>> {
        let vertices = self.model.positions().len();
        let texels = match self.model.texture() {
            Some((width, height, _)) => vec![height, width, 3],
            None if others[2].is_some() => return Err(wrong("texels: the mesh has no texture")),
            None => Vec::new(),
        };
        let shapes: [&[usize]; 6] = [&[vertices, 3], &[vertices, 3], &texels, &[3, 5], &[3], &[4]];
        let pose = Input::new(pose, &super::pose::SHAPE, "pose")?;
        let mut batches = vec![("pose", pose.batch())];
        let mut inputs = [const { None }; 6];
        for (k, given) in others.into_iter().enumerate() {
            if let Some(given) = given {
                let input = Input::new(given, shapes[k], NAMES[k])?;
                batches.push((NAMES[k], input.batch()));
                inputs[k] = Some(input);
            }
        }
        let batch = batch_of(&batches)?;
        Ok(Inputs { pose, others: inputs, batch })
    }

    /// The model of a picture.
    fn shaped(&self, inputs: &Inputs<'_>, picture: usize) -> PyResult<Arc<RenderModel>> {
        let [vertices, colors, texels, ..] = &inputs.others;
        let mut model = (*self.model).clone();
        if let Some(vertices) = vertices {
            let points = vertices.of(picture).as_chunks().0;
            let points: Vec<Point3<f64>> = points.iter().map(|p: &[f64; 3]| (*p).into()).collect();
            model = model.with_positions(&points).raise()?;
        }
        if let Some(colors) = colors {
            model = model.with_colors(&single(colors.of(picture))).raise()?;
        }
        if let Some(texels) = texels {
            model = model.with_texels(single(texels.of(picture))).raise()?;
        }
        Ok(Arc::new(model))
    }

    pub(super) fn scenes(&self, inputs: &Inputs<'_>) -> PyResult<Vec<(Scene, Light)>> {
        let [vertices, colors, texels, lights, backgrounds, intrinsics] = &inputs.others;
        let shapes = [vertices, colors, texels].map(Option::as_ref);
        let varied = shapes.into_iter().flatten().any(|input| input.batch().is_some());
        let mut model = self.model.clone();
        let mut scenes = Vec::new();
        for picture in 0..inputs.batch.unwrap_or(1) {
            if varied || (picture == 0 && shapes.iter().any(Option::is_some)) {
                model = self.shaped(inputs, picture)?;
            }
            let mut camera = self.camera;
            if let Some(own) = intrinsics {
                camera = with_intrinsics(&camera, own.of(picture))?;
            }
            let mut scene = Scene::new(camera);
            scene.background = match backgrounds.as_ref().map(|own| own.of(picture)) {
                Some([r, g, b]) => [*r, *g, *b],
                _ => self.background,
            };
            let pose = pose(inputs.pose.of(picture), "pose")?;
            let light = lights.as_ref().map_or(self.light, |own| light(own.of(picture)));
            scenes.push((scene.with(model.clone(), pose), light));
        }
        Ok(scenes)
    }
}
