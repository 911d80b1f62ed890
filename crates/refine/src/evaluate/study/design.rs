//! Methods, steps and faults that a study compares.

use std::path::Path;

use super::initial_pose::InitialPose;
use super::kind::Kind;
use super::record::{INITIAL, Key, Record, TRUTH};
use super::sweep::Sweep;
use crate::data::bop::{Dataset, DatasetError};
use crate::data::identity::{SENSED, dataset_fingerprint, file_fingerprint, fingerprint, program};
use crate::method::Method;
use crate::strategy::Strategy;

/// JSON files of a scene that only scoring reads.
const ANNOTATIONS: [&str; 2] = ["scene_gt.json", "scene_bodies_gt.json"];

/// All inputs and settings that determine a study's results, beside the initial poses.
#[derive(Clone, Debug)]
pub struct Design {
    kind: Kind,
    /// Name of the dataset's folder.
    dataset: String,
    /// Methods by name, with their settings.
    pub(super) methods: Vec<(String, Method)>,
    sweeps: Vec<Sweep>,
    /// Iterations after which poses are compared; in the steps study.
    pub(super) steps: Vec<usize>,
    program: String,
    /// Fingerprints of annotations and rig, and the source of masks.
    inputs: String,
    seed: u64,
}

impl Design {
    /// A study of `methods` on `dataset`, whose frames and models are corrected by the file `rig`, if there is one; `sweeps` are
    /// the faults of the robustness study, `seed` that of the points on objects' surfaces.
    ///
    /// # Errors
    /// If annotations or rig cannot be read.
    pub fn new(
        kind: Kind,
        dataset: &Dataset,
        methods: Vec<(String, Method)>,
        sweeps: Vec<Sweep>,
        rig: Option<&Path>,
        seed: u64,
    ) -> Result<Self, DatasetError> {
        let root = dataset.root().canonicalize().unwrap_or_else(|_| dataset.root().into());
        let rig = rig.map(file_fingerprint).transpose()?.unwrap_or_default();
        let annotations = [&SENSED[..], &ANNOTATIONS].concat();
        Ok(Self {
            kind,
            dataset: root.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            steps: methods.first().map_or_else(Vec::new, |(_, method)| Self::steps(kind, method)),
            methods,
            sweeps,
            program: program(),
            inputs: format!("{} {rig}", dataset_fingerprint(dataset, &annotations)?),
            seed,
        })
    }

    /// With masks of another source than the dataset's files, which `identity` tells from others.
    pub fn with_masks(self, identity: &str) -> Self {
        Self { inputs: format!("{} {identity}", self.inputs), ..self }
    }

    /// The rows of an initial pose in the order of the tables, without results.
    pub fn rows(&self, initial: &InitialPose) -> Vec<Record> {
        let inputs = fingerprint(format!("{} {}", self.inputs, initial.fingerprint).as_bytes());
        let row = |method: &str, settings: String, (steps, sweep, amount)| {
            let key = Key {
                study: self.kind,
                dataset: self.dataset.clone(),
                level: initial.level.clone(),
                frame: initial.frame,
                method: method.into(),
                steps,
                sweep,
                amount,
            };
            let [program, seed] = [self.program.clone(), self.seed.to_string()];
            let provenance = [program, inputs.clone(), settings, seed];
            let target = [initial.row.scene_id, initial.row.im_id, initial.row.obj_id];
            Record::new(key, initial.frames, target, provenance)
        };
        let mut rows =
            [TRUTH, INITIAL].map(|name| row(name, String::new(), Default::default())).to_vec();
        for condition in self.conditions() {
            rows.extend(self.methods.iter().map(|(name, method)| {
                row(name, fingerprint(format!("{method:?}").as_bytes()), condition)
            }));
        }
        rows
    }

    /// Numbers of steps, or faults with their amounts, under which methods are compared.
    fn conditions(&self) -> Vec<(Option<usize>, Option<Sweep>, Option<u32>)> {
        match self.kind {
            Kind::Steps => self.steps.iter().map(|&steps| (Some(steps), None, None)).collect(),
            Kind::Robustness => {
                let amounts = self
                    .sweeps
                    .iter()
                    .flat_map(|sweep| sweep.amounts().iter().map(move |amount| (sweep, amount)));
                amounts.map(|(&sweep, &amount)| (None, Some(sweep), Some(amount))).collect()
            }
            _ => vec![(None, None, None)],
        }
    }

    /// The method of a study, with the settings that it has there; `iterations` replaces the number of iterations of the method
    /// itself. The steps study runs all of them, 1000 unless told otherwise.
    pub fn method(kind: Kind, mut method: Method, iterations: Option<usize>) -> Method {
        if kind == Kind::Steps {
            method.set_exhaustive();
            method.set_iterations(1000);
        }
        if let Some(iterations) = iterations {
            method.set_iterations(iterations);
        }
        method
    }

    /// The iterations after which a study compares poses: the paper's 100, 200, 400, 600 and 1000 if the last one is 1000.
    fn steps(kind: Kind, method: &Method) -> Vec<usize> {
        let tenths: &[usize] = if kind == Kind::Steps { &[1, 2, 4, 6, 10] } else { &[] };
        let mut steps: Vec<usize> =
            tenths.iter().map(|tenths| method.iterations() * tenths / 10).collect();
        steps.retain(|&step| step > 0);
        steps.dedup();
        steps
    }
}

#[cfg(test)]
mod tests {
    use super::super::initial_pose::InitialPose;
    use super::*;
    use crate::data::bop::ResultRow;
    use nalgebra::Isometry3;

    /// Labels of the rows of a study.
    fn labels(kind: Kind, methods: &[&str], iterations: Option<usize>) -> Vec<String> {
        let method = |name: &&str| {
            let named = Method::named(name).unwrap();
            ((*name).to_owned(), Design::method(kind, named, iterations))
        };
        let methods: Vec<_> = methods.iter().map(method).collect();
        let design = Design {
            kind,
            dataset: "ds".into(),
            steps: Design::steps(kind, &methods[0].1),
            methods,
            sweeps: vec![Sweep::HandPosition, Sweep::MissingTouch],
            program: String::new(),
            inputs: String::new(),
            seed: 0,
        };
        let row = ResultRow {
            scene_id: 1,
            im_id: 2,
            obj_id: 5,
            score: 1.0,
            t_cam_model: Isometry3::identity(),
            time: -1.0,
        };
        let (level, fingerprint) = ("low".into(), "0".into());
        let initial = InitialPose { level, frame: 0, frames: 1, row, instance: 0, fingerprint };
        design.rows(&initial).iter().map(|row| row.key.label()).collect()
    }

    #[test]
    fn rows_follow_from_the_study() {
        let main = labels(Kind::Main, &["combined", "robust-icp"], None);
        assert_eq!(main, ["truth", "initial", "combined", "robust-icp"]);
        let steps = |iterations| labels(Kind::Steps, &["combined-free"], iterations)[2..].to_vec();
        let paper = [100, 200, 400, 600, 1000].map(|n| format!("{n} steps"));
        assert_eq!(steps(None), paper);
        assert_eq!(steps(Some(5)), [1, 2, 3, 5].map(|n| format!("{n} steps")));
        let faults = labels(Kind::Robustness, &["robust-icp", "fused"], None);
        assert_eq!(faults.len(), 2 + 2 * (4 + 2));
        assert_eq!(
            faults[2..5],
            ["robust-icp hand-position 0", "fused hand-position 0", "robust-icp hand-position 2"]
        );
    }
}
