//! The time that estimates took.

use std::collections::BTreeMap;
use std::path::Path;

use crate::data::bop::{DatasetError, ResultRow};

/// By how much the times of rows of one image may differ \[s\].
const SAME_TIME: f64 = 1e-3;

/// The mean over images of the time that `rows` of the results file `file` took \[s\]; `None` if that of a row is unknown
/// (below zero), or there are no rows.
///
/// # Errors
/// If rows of one image differ in time: BOP wants the time of the whole image on each of its rows.
pub fn seconds_per_image(file: &Path, rows: &[ResultRow]) -> Result<Option<f64>, DatasetError> {
    let mut times: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    for ResultRow { scene_id, im_id, time, .. } in rows {
        if *time < 0.0 {
            return Ok(None);
        }
        let first = *times.entry((*scene_id, *im_id)).or_insert(*time);
        if (first - time).abs() > SAME_TIME {
            let problem =
                format!("scene {scene_id} image {im_id} has rows of {first} s and of {time} s");
            return Err(DatasetError::field(file, "time", problem));
        }
    }
    Ok((!times.is_empty()).then(|| times.values().sum::<f64>() / times.len() as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;

    #[test]
    fn images_count_once_and_unequal_times_are_refused() {
        let row = |im_id, time| ResultRow {
            scene_id: 1,
            im_id,
            obj_id: 5,
            score: 1.0,
            t_cam_model: Isometry3::identity(),
            time,
        };
        let mean = |rows: &[ResultRow]| seconds_per_image(Path::new("poses.csv"), rows);
        assert_eq!(mean(&[row(0, 1.0), row(0, 1.0), row(1, 4.0)]), Ok(Some(2.5)));
        assert_eq!(mean(&[row(0, 1.0), row(1, -1.0)]), Ok(None));
        assert_eq!(mean(&[]), Ok(None));
        let error = mean(&[row(0, 1.0), row(0, 1.1)]).unwrap_err().to_string();
        assert_eq!(error, "poses.csv: time: scene 1 image 0 has rows of 1 s and of 1.1 s");
    }
}
