//! Poses of a dataset against its truth.

use prehend_refine::data::bop::ResultRow;
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::metrics::{ScoredRow, Statistic, summarize};
use pyo3::prelude::*;

use super::dataset::PyDataset;
use super::poses::poses;
use crate::arrays::{Array, Numbers, array};
use crate::error::wrong;
use crate::threads::detached;

/// Names of the metrics; of each pose its metrics, n × metrics, NaN where there are none; means and medians of the metrics; what is wrong with poses that
/// could not be scored, by their places.
type Scores<'py> = (Vec<&'static str>, Array<'py>, Array<'py>, Array<'py>, Vec<(usize, String)>);

/// `prehend.evaluate` is made of it. `ids` are the numbers of scene, image and object of each pose.
#[pyfunction]
pub(crate) fn _score<'py>(
    py: Python<'py>,
    dataset: &PyDataset,
    ids: Vec<(u32, u32, u32)>,
    poses: Numbers<'py>,
) -> PyResult<Scores<'py>> {
    let poses = self::poses(&poses, "poses")?;
    if poses.len() != ids.len() {
        return Err(wrong(format!("{} poses of {} objects in images", poses.len(), ids.len())));
    }
    let rows = ids.iter().zip(poses).map(|(&(scene_id, im_id, obj_id), t_cam_model)| ResultRow {
        scene_id,
        im_id,
        obj_id,
        score: -1.0,
        t_cam_model,
        time: -1.0,
    });
    let rows: Vec<ResultRow> = rows.collect();
    let scored: Vec<Result<ScoredRow, String>> = detached(py, || {
        let mut scorer = Scorer::new(&dataset.dataset);
        rows.iter().map(|row| scorer.score(row).map_err(|error| error.to_string())).collect()
    })?;
    let good: Vec<ScoredRow> = scored.iter().filter_map(|row| row.as_ref().ok().copied()).collect();
    let summary = summarize(&good);
    let count = summary.columns.len();
    let mut values = Vec::with_capacity(count * scored.len());
    let mut faults = Vec::new();
    for (place, outcome) in scored.into_iter().enumerate() {
        match outcome {
            Ok(row) => {
                values.extend(row.score.values().map(|value| value.unwrap_or(f64::NAN)));
            }
            Err(error) => {
                values.extend(std::iter::repeat_n(f64::NAN, count));
                faults.push((place, error));
            }
        }
    }
    let of = |number: fn(&Statistic) -> f64| {
        let each = summary.overall.iter();
        let numbers = each.map(|s| s.as_ref().map_or(f64::NAN, number)).collect();
        array(py, numbers, &[count])
    };
    let (means, medians) = (of(|s| s.mean)?, of(|s| s.median)?);
    let values = array(py, values, &[rows.len(), count])?;
    Ok((summary.columns.to_vec(), values, means, medians, faults))
}
