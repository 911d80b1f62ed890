//! What a study compares, and on which frames.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::kind::{INITIAL, Kind, TRUTH};
use super::sweep::Sweep;
use crate::data::bop::{DatasetError, ResultRow, read_results};
use crate::data::identity::file_fingerprint;
use crate::method::Method;
use crate::strategy::Strategy;

/// All inputs and settings that determine a study's results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Design {
    /// Which study.
    pub study: Kind,
    /// Folder of the split.
    pub dataset: String,
    /// Fingerprint of the split's annotations.
    pub annotations: String,
    /// Initial poses.
    pub levels: Vec<Level>,
    /// Rows of the poses' files that are left out.
    pub filters: String,
    /// Methods.
    pub methods: Vec<MethodSettings>,
    /// The iterations at which poses are compared; empty except in the steps study.
    pub steps: Vec<usize>,
    /// Faults of the observation; empty except in the robustness study.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sweeps: Vec<Sweep>,
    /// Fingerprint of the rig that frames and models are corrected by, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig: Option<String>,
    /// Seed of the points on objects' surfaces.
    pub seed: u64,
    /// What renders.
    pub backend: String,
    /// Which part of the frames.
    pub shard: Shard,
}

/// Initial poses of one level of noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Its name; `low` and `high` are the paper's.
    pub name: String,
    /// Fingerprint of the file of poses.
    pub poses: String,
    /// Number of frames, all shards together.
    pub frames: usize,
    /// Rows of the file that could not be read, and why.
    pub unreadable: Vec<String>,
}

/// A method with all that it is set to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MethodSettings {
    /// Its name.
    pub name: String,
    /// Its settings, as text.
    pub settings: String,
}

/// One run of a method on a frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trial {
    pub(super) method: String,
    /// The fault of the observation and its amount; `None` at the start of a sweep.
    pub(super) fault: Option<(Sweep, f64)>,
    /// The rows of the table that its poses make.
    pub(super) rows: Vec<String>,
}

/// One initial pose of a study.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Number among all frames of the study.
    pub index: usize,
    /// Number of its level.
    pub(super) level: usize,
    /// The initial pose.
    pub(super) row: ResultRow,
    /// Which of the image's rows it is.
    pub(super) instance: usize,
}

impl Level {
    /// Reads a file of initial poses, keeping the rows that `admit` admits; frames are numbered from `first` and belong to
    /// level number `level`.
    ///
    /// # Errors
    /// If the file cannot be read at all.
    pub fn read(
        name: &str,
        file: &Path,
        level: usize,
        first: usize,
        admit: impl Fn(&ResultRow) -> bool,
    ) -> Result<(Self, Vec<Frame>), DatasetError> {
        let poses = file_fingerprint(file)?;
        let read = read_results(file)?;
        let rows = read.rows.into_iter().zip(read.instances).filter(|(row, _)| admit(row));
        let frame = |(k, (row, instance))| Frame { index: first + k, level, row, instance };
        let frames: Vec<Frame> = rows.enumerate().map(frame).collect();
        let (name, unreadable) = (name.into(), read.errors);
        Ok((Self { name, poses, frames: frames.len(), unreadable }, frames))
    }
}

impl Design {
    /// The rows of the study's tables.
    pub(super) fn rows(&self) -> Vec<String> {
        let compared = self.trials().into_iter().flat_map(|trial| trial.rows);
        [TRUTH, INITIAL].into_iter().map(str::to_owned).chain(compared).collect()
    }

    /// The runs on a frame, in the order of the tables' rows.
    pub(super) fn trials(&self) -> Vec<Trial> {
        let names = self.methods.iter().map(|m| m.name.clone());
        match self.study {
            Kind::Steps => {
                let rows: Vec<String> = self.steps.iter().map(usize::to_string).collect();
                names.map(|method| Trial { method, fault: None, rows: rows.clone() }).collect()
            }
            Kind::Robustness => self
                .sweeps
                .iter()
                .flat_map(|sweep| sweep.amounts().iter().map(|&amount| (*sweep, amount)))
                .flat_map(|(sweep, amount)| {
                    names.clone().map(move |method| Trial {
                        rows: vec![perturbed(&method, sweep, amount)],
                        fault: (amount != sweep.amounts()[0]).then_some((sweep, amount)),
                        method,
                    })
                })
                .collect(),
            _ => names
                .map(|method| Trial { rows: vec![method.clone()], method, fault: None })
                .collect(),
        }
    }

    /// Rows of the tables that are compared frame by frame, each with the row that it is compared with.
    pub(super) fn pairs(&self) -> Vec<(String, String)> {
        let Some(reference) = self.study.reference() else { return Vec::new() };
        let trials = self.trials();
        let rows: Vec<&String> = trials.iter().flat_map(|t| &t.rows).collect();
        let pair = |trial: &Trial| {
            let other = trial.rows[0].replacen(&trial.method, reference, 1);
            (trial.method != reference && rows.contains(&&other))
                .then(|| (trial.rows[0].clone(), other))
        };
        trials.iter().filter_map(pair).collect()
    }

    /// The number of frames, all shards together.
    pub(super) fn frames(&self) -> usize {
        self.levels.iter().map(|l| l.frames).sum()
    }

    /// The settings of a study's method; `iterations` replaces the number of iterations of the method itself. The steps
    /// study runs all of them, 1000 unless told otherwise.
    pub fn method(study: Kind, mut method: Method, iterations: Option<usize>) -> Method {
        if study == Kind::Steps {
            method.set_exhaustive();
            method.set_iterations(1000);
        }
        if let Some(iterations) = iterations {
            method.set_iterations(iterations);
        }
        method
    }

    /// The iterations at which a study compares poses: the paper's 100, 200, 400, 600 and 1000 if the last one is 1000.
    pub fn steps(study: Kind, method: &Method) -> Vec<usize> {
        let tenths: &[usize] = if study == Kind::Steps { &[1, 2, 4, 6, 10] } else { &[] };
        let mut steps: Vec<usize> =
            tenths.iter().map(|tenths| method.iterations() * tenths / 10).collect();
        steps.retain(|&step| step > 0);
        steps.dedup();
        steps
    }
}

/// Name of the row of a method under a fault.
pub(super) fn perturbed(method: &str, sweep: Sweep, amount: f64) -> String {
    format!("{method} {sweep} {amount}")
}

/// One of several parts of a study: frame k belongs to part k mod `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// Number of the part, from 0.
    pub index: usize,
    /// Number of parts.
    pub count: usize,
}

impl Shard {
    /// The whole study.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Whether frame `frame` belongs to it.
    pub fn holds(self, frame: usize) -> bool {
        frame % self.count == self.index
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts =
            text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if index < count => Ok(Self { index, count }),
            _ => {
                Err(format!("{text:?} is no shard: expected i/n with i from 0 to n-1, such as 0/4"))
            }
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tables::tests::{example, methods};
    use super::*;

    #[test]
    fn shards_part_the_frames() {
        let shards: Vec<Shard> = ["0/3", "1/3", "2/3"].map(|t| t.parse().unwrap()).into();
        for frame in 0..10 {
            assert_eq!(shards.iter().filter(|s| s.holds(frame)).count(), 1);
        }
        assert!(shards[1].holds(4) && shards[1].to_string() == "1/3");
        for text in ["3/3", "1", "a/2", "-1/2", "0/0"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }

    #[test]
    fn steps_are_those_of_the_paper() {
        let named = Method::named("combined-free").unwrap();
        let steps = |study, iterations| {
            Design::steps(study, &Design::method(study, named.clone(), iterations))
        };
        assert_eq!(steps(Kind::Steps, None), [100, 200, 400, 600, 1000]);
        assert_eq!(steps(Kind::Steps, Some(5)), [1, 2, 3, 5]);
        assert!(steps(Kind::Main, None).is_empty());
    }

    #[test]
    fn trials_and_pairs_follow_from_the_methods() {
        let (mut design, _) = example();
        assert_eq!(design.rows(), ["truth", "initial", "combined", "robust-icp"]);
        design.methods = methods(&["robust-icp", "fused"]);
        let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(design.pairs(), [pair("fused", "robust-icp")]);
        design.study = Kind::Evidence;
        assert_eq!(design.pairs(), [pair("robust-icp", "fused")]);
        design.study = Kind::Steps;
        assert_eq!(design.pairs(), []);
        design.study = Kind::Robustness;
        design.sweeps = vec![Sweep::MissingTouch, Sweep::Joints];
        let trials = design.trials();
        assert_eq!(trials.len(), 2 * (2 + 4));
        assert_eq!((trials[1].fault, trials[1].rows[0].as_str()), (None, "fused missing-touch 0"));
        assert_eq!(trials[11].fault, Some((Sweep::Joints, 5.0)));
        assert_eq!(design.pairs().len(), 6);
        assert_eq!(design.pairs()[5], pair("fused joints 5", "robust-icp joints 5"));
    }
}
