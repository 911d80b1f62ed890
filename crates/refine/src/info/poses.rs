//! Poses as a BOP results file.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::InfoError;
use super::lines::{line, listed};
use crate::data::Times;
use crate::data::bop::{ResultRow, read_results};

/// Poses of objects in images.
#[derive(Clone, Debug, Serialize)]
pub struct PosesInfo {
    /// Poses.
    pub rows: usize,
    /// Lines that are none, which the warnings name.
    pub malformed: usize,
    /// Ids of their scenes.
    pub scenes: Vec<u32>,
    /// Images that have poses.
    pub images: usize,
    /// Ids of their objects.
    pub objects: Vec<u32>,
    /// Lowest and highest score, and the mean between them.
    pub scores: Option<[f64; 3]>,
    /// Poses whose time is known.
    pub timed: usize,
    /// What made them, as the file of times beside this one has it.
    pub methods: Vec<String>,
}

/// Malformed lines that are named, at most.
const NAMED: usize = 5;

impl PosesInfo {
    pub(super) fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Self, InfoError> {
        let results = read_results(path)?;
        let (rows, errors) = (&results.rows, &results.errors);
        if rows.is_empty() && !errors.is_empty() {
            let columns = "the columns are not those of a BOP results file";
            return Err(InfoError::unknown(path, format!("{columns} ({})", errors[0])));
        }
        warnings.extend(errors.iter().take(NAMED).cloned());
        if errors.len() > NAMED {
            warnings.push(format!("and {} more lines", errors.len() - NAMED));
        }
        let ids = |of: fn(&ResultRow) -> u32| {
            rows.iter().map(of).collect::<BTreeSet<_>>().into_iter().collect::<Vec<_>>()
        };
        let images: BTreeSet<_> = rows.iter().map(|row| (row.scene_id, row.im_id)).collect();
        let scores = rows.iter().map(|row| row.score);
        let range =
            scores.clone().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), score| {
                (low.min(score), high.max(score))
            });
        let mean = scores.sum::<f64>() / rows.len() as f64;
        let mut times = path.as_os_str().to_owned();
        times.push(".times.csv");
        Ok(Self {
            rows: rows.len(),
            malformed: errors.len(),
            scenes: ids(|row| row.scene_id),
            images: images.len(),
            objects: ids(|row| row.obj_id),
            scores: (!rows.is_empty()).then_some([range.0, mean, range.1]),
            timed: rows.iter().filter(|row| row.time >= 0.0).count(),
            methods: Times::methods(&PathBuf::from(times)),
        })
    }
}

impl fmt::Display for PosesInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rows, images, malformed, timed, .. } = self;
        line(f, "poses", format!("{rows} in {images} images; {malformed} malformed lines"))?;
        line(f, "scenes", listed(&self.scenes))?;
        line(f, "objects", listed(&self.objects))?;
        if let Some([low, mean, high]) = self.scores {
            line(f, "scores", format!("{low:.4} to {high:.4}, {mean:.4} on average"))?;
        }
        line(f, "times", format!("of {timed} poses"))?;
        if self.methods.is_empty() { Ok(()) } else { line(f, "methods", listed(&self.methods)) }
    }
}
