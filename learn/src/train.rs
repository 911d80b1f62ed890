//! Training: batches of views, the loss, the optimizer, checkpoints.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};
use burn::tensor::Device;
use nalgebra::{Isometry3, Matrix3};
use prehend_geometry::SplitMix64;
use prehend_refine::Object;
use prehend_refine::network::{Tensor as Array, Tensors, read_tensors, write_tensors};
use prehend_refine::symmetry::{SymmetrySettings, find_symmetries};
use rayon::prelude::*;

use crate::adam::Moments;
use crate::loss::{Loss, ObjectPoints, TrueView, confidence_weighted_loss};
use crate::model::{Pass, Widths};
use crate::sample::{Sample, SampleSize, voter_positions};
use crate::views::{View, mixed, tensor_text, text_tensor};

/// Settings of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainSettings {
    /// Layers.
    pub widths: Widths,
    /// Points of a view.
    pub size: SampleSize,
    /// Views a step.
    pub batch: usize,
    /// Steps in all.
    pub steps: u32,
    /// Rate of the optimizer at its greatest.
    pub rate: f32,
    /// Seed of weights, batches and changes of views.
    pub seed: u64,
    /// Largest difference of mean colors, root mean square, from 0 to 1, of rotations that count as equal; 1 for those that are equal by shape alone.
    pub color_tolerance: f64,
}

impl Default for TrainSettings {
    fn default() -> Self {
        let size = SampleSize { points: 160, voters: 24 };
        let (widths, color_tolerance) = (Widths::default(), 0.05);
        Self { widths, size, batch: 32, steps: 9000, rate: 2e-3, seed: 0, color_tolerance }
    }
}

/// Steps in which the rate rises from zero.
const RISE: f32 = 100.0;
/// Turns that stand for an axis of revolution.
const TURNS: usize = 72;

/// Distance by which a symmetry may move the center \[radii\].
const OFF_CENTER: f64 = 0.05;

/// A network in training.
pub struct Training {
    settings: TrainSettings,
    weights: Tensors,
    moments: BTreeMap<String, Moments>,
    points: ObjectPoints,
    turns: Vec<Matrix3<f32>>,
    device: Device,
    step: u32,
}

impl Training {
    /// Training from the beginning on `device`, for `object` and its symmetries.
    ///
    /// # Errors
    /// If the mesh cannot be searched for symmetries.
    pub fn new(object: &Object, settings: TrainSettings, device: Device) -> anyhow::Result<Self> {
        let color_tolerance = Some(settings.color_tolerance);
        let symmetry = SymmetrySettings { color_tolerance, ..SymmetrySettings::default() };
        let symmetries = find_symmetries(&object.mesh, &symmetry)?;
        let mut motions = symmetries.sampled(TURNS);
        // The network turns about the center.
        let moved = |m: &Isometry3<f64>| (m * object.center - object.center).norm();
        motions.retain(|m| moved(m) <= OFF_CENTER * object.radius);
        let turn = |m: &Isometry3<f64>| m.rotation.to_rotation_matrix().into_inner();
        let turns: Vec<Matrix3<f32>> = motions.iter().map(|m| turn(m).cast()).collect();
        let weights = settings.widths.draw(mixed(settings.seed, 0));
        let zero = |(name, w): (&String, &Array)| (name.clone(), Moments::new(w.values.len()));
        Ok(Self {
            moments: weights.iter().map(zero).collect(),
            points: ObjectPoints::new(object, turns.clone()),
            device: device.autodiff(),
            settings,
            weights,
            turns,
            step: 0,
        })
    }

    /// Steps that are done.
    pub fn steps_done(&self) -> u32 {
        self.step
    }

    /// Number of motions that change nothing of the object.
    pub fn symmetries(&self) -> usize {
        self.turns.len()
    }

    /// One step on a batch of `views` of `object`.
    pub fn step(&mut self, views: &[View], object: &Object) -> Loss {
        let TrainSettings { size, batch, seed, .. } = self.settings;
        let first = u64::from(self.step) * batch as u64;
        let draw = |k: u64| {
            let mut random = SplitMix64::new(mixed(seed ^ 0xba7c, first + k));
            let view = (random.uniform() * views.len() as f64) as usize;
            Sample::draw(&views[view], object, size, &mut random)
        };
        let samples: Vec<Sample> = (0..batch as u64).into_par_iter().map(draw).collect();
        let truths: Vec<TrueView> = samples.iter().map(|s| s.truth).collect();
        let features: Vec<f32> = samples.into_iter().flat_map(|s| s.features).collect();
        let positions = voter_positions(&features, size);
        let pass = Pass::forward(&self.device, &self.weights, features, batch, size.voters);
        let loss = confidence_weighted_loss(&self.points, &pass.votes(), &positions, &truths);
        let gradients = pass.backward(loss.gradient.clone());
        self.step += 1;
        let rate = self.rate();
        for (name, weight) in &mut self.weights {
            if let (Some(moments), Some(gradient)) =
                (self.moments.get_mut(name), gradients.get(name))
            {
                moments.step(&mut weight.values, gradient, rate, self.step);
            }
        }
        loss
    }

    /// Rate of the current step: it rises fast and falls as a half cosine.
    fn rate(&self) -> f32 {
        let (step, steps) = (self.step as f32, self.settings.steps.max(1) as f32);
        let fall = 0.5 + 0.5 * (std::f32::consts::PI * (step / steps).min(1.0)).cos();
        self.settings.rate * (step / RISE).min(1.0) * fall.max(1e-3)
    }

    /// Tensors of a network file.
    pub fn network(&self, object: &Object) -> Tensors {
        let mut all = self.weights.clone();
        let array = |shape: Vec<usize>, values: Vec<f32>| Array { shape, values };
        let center = object.center.coords.iter().map(|v| *v as f32).collect();
        let rows = self
            .turns
            .iter()
            .flat_map(|turn| turn.transpose().iter().copied().collect::<Vec<f32>>());
        let rows: Vec<f32> = rows.collect();
        all.insert("object.center".into(), array(vec![3], center));
        all.insert("object.radius".into(), array(vec![1], vec![object.radius as f32]));
        all.insert("object.symmetries".into(), array(vec![self.turns.len(), 3, 3], rows));
        all
    }

    /// Writes all that is needed to go on with a training on `inputs` to a file, whole or not at all.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn save(&self, file: &Path, inputs: &str) -> anyhow::Result<()> {
        let mut all = self.weights.clone();
        for (name, moments) in &self.moments {
            let shape = vec![moments.mean.len()];
            let array = |values: &[f32]| Array { shape: shape.clone(), values: values.to_vec() };
            all.insert(format!("{name}.mean"), array(&moments.mean));
            all.insert(format!("{name}.square"), array(&moments.square));
        }
        let step = Array { shape: vec![1], values: vec![self.step as f32] };
        all.insert("step".into(), step);
        all.insert("settings".into(), text_tensor(&self.identity(inputs)));
        Ok(write_tensors(file, &all)?)
    }

    /// Goes on from what was [saved](Self::save) with the same settings and inputs.
    ///
    /// # Errors
    /// If the file is broken or of others.
    pub fn resume(&mut self, file: &Path, inputs: &str) -> anyhow::Result<()> {
        let mut all = read_tensors(file)?;
        let mut take = |name: &str, count: Option<usize>| {
            let found = all.remove(name).map(|t| t.values);
            let found = found.filter(|v| count.is_none_or(|count| v.len() == count));
            found.with_context(|| format!("{}: no {name} of this training", file.display()))
        };
        let settings = tensor_text(&take("settings", None)?);
        let now = self.identity(inputs);
        if settings != now {
            bail!(
                "{}: begun with {settings}, and now {now}: give the same settings, or remove it",
                file.display()
            );
        }
        for (name, weight) in &mut self.weights {
            let count = Some(weight.values.len());
            weight.values = take(name, count)?;
            let mean = take(&format!("{name}.mean"), count)?;
            let square = take(&format!("{name}.square"), count)?;
            self.moments.insert(name.clone(), Moments { mean, square });
        }
        self.step = take("step", Some(1))?[0] as u32;
        Ok(())
    }

    fn identity(&self, inputs: &str) -> String {
        format!("{:?}, {inputs}", self.settings)
    }
}
