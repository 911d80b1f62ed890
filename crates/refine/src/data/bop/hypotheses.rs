//! Files of hypotheses: all poses that a search ended with, beside the results file of the best ones.

use std::path::Path;

use nalgebra::Isometry3;

use super::error::DatasetError;
use super::results::{ReadResults, ResultRow, read_results};

/// Alternatives of `poses`, the rows of a results file, object → camera \[m\]; `None` of a pose that does not come from a search.
///
/// A file of hypotheses is a results file with any number of rows a target, and shares among them as scores. Rows of a target follow each other: first that
/// with the pose in the results file, then its alternatives.
///
/// # Errors
/// When the file cannot be read, a row is malformed, or the pose that it belongs to is not among `poses`.
pub fn read_hypotheses(
    file: &Path,
    poses: &[ResultRow],
) -> Result<Vec<Option<Vec<Isometry3<f64>>>>, DatasetError> {
    let ReadResults { rows, lines, errors, .. } = read_results(file)?;
    if let Some(error) = errors.first() {
        return Err(DatasetError::unusable(file, error));
    }
    let mut alternatives = vec![None; poses.len()];
    let mut current: Option<usize> = None;
    for (row, line) in rows.iter().zip(lines) {
        let field = |column: &str| format!("line {line}: {column}");
        if !(0.0..=1.0).contains(&row.score) {
            let problem = format!("{} is no share, from 0 to 1", row.score);
            return Err(DatasetError::field(file, &field("score"), problem));
        }
        let ids = |row: &ResultRow| (row.scene_id, row.im_id, row.obj_id);
        let first = poses.iter().enumerate().position(|(at, pose)| {
            ids(pose) == ids(row)
                && pose.t_cam_model == row.t_cam_model
                && alternatives[at].is_none()
        });
        if let Some(at) = first {
            alternatives[at] = Some(Vec::new());
            current = Some(at);
            continue;
        }
        let of_current = current.filter(|at| ids(&poses[*at]) == ids(row));
        let Some(others) = of_current.and_then(|at| alternatives[at].as_mut()) else {
            let (scene, image, object) = ids(row);
            let problem = format!(
                "scene {scene} image {image} object {object}: neither that of a pose to be refined nor after such a one; the file of \
                 another search has to be removed, or the right one named with --hypotheses"
            );
            return Err(DatasetError::field(file, &field("pose"), problem));
        };
        others.push(row.t_cam_model);
    }
    Ok(alternatives)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use nalgebra::Vector3;

    use super::*;
    use crate::data::bop::write_results;

    fn row(im_id: u32, x: f64, score: f64) -> ResultRow {
        let t_cam_model = Isometry3::new(Vector3::new(x, 0.0, 0.5), Vector3::new(x, 0.1, 0.2));
        ResultRow { scene_id: 1, im_id, obj_id: 5, score, t_cam_model, time: -1.0 }
    }

    #[test]
    fn alternatives_follow_their_pose() {
        let dir = tempfile::tempdir().unwrap();
        let (poses_file, file) = (dir.path().join("poses.csv"), dir.path().join("hypotheses.csv"));
        // Two instances in one image, one in another, and a pose that is not of a search.
        let poses = [row(0, 0.1, -3.0), row(0, 0.2, -4.0), row(1, 0.3, -5.0), row(2, 0.4, 1.0)];
        write_results(&poses_file, &poses).unwrap();
        let all = [
            row(0, 0.1, 0.9),
            row(0, 0.7, 0.1),
            row(0, 0.2, 1.0),
            row(1, 0.3, 0.5),
            row(1, 0.8, 0.3),
            row(1, 0.9, 0.2),
        ];
        write_results(&file, &all).unwrap();
        let poses = read_results(&poses_file).unwrap().rows;
        let found = read_hypotheses(&file, &poses).unwrap();
        let counts: Vec<_> = found.iter().map(|r| r.as_ref().map(Vec::len)).collect();
        assert_eq!(counts, [Some(1), Some(0), Some(2), None]);
        assert_eq!(found[2].as_ref().unwrap()[1], read_results(&file).unwrap().rows[5].t_cam_model);

        let refused = |rows: &[ResultRow]| {
            write_results(&file, rows).unwrap();
            read_hypotheses(&file, &poses).unwrap_err().to_string()
        };
        let unknown = refused(&[row(0, 0.1, 0.9), row(7, 0.1, 0.1)]);
        let expected = "line 3: pose: scene 1 image 7 object 5: neither";
        assert!(unknown.contains("hypotheses.csv") && unknown.contains(expected), "{unknown}");
        assert!(refused(&[row(0, 0.7, 0.5)]).contains("line 2: pose"));
        let share = refused(&[row(0, 0.1, 1.5)]);
        assert!(share.contains("line 2: score: 1.5 is no share"), "{share}");
        fs::write(&file, "1,0,5,1,1 0 0,0 0 500,-1\n").unwrap();
        let broken = read_hypotheses(&file, &poses).unwrap_err().to_string();
        assert!(broken.contains("hypotheses.csv: line 1: R: "), "{broken}");
    }
}
