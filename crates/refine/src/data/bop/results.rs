//! Results files of the BOP challenge: one estimated pose a row; and all poses that a search ended with, beside the best ones.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use prehend_geometry::plain_target;

use super::error::DatasetError;
use super::files::{read_bytes, write_atomically};
use super::numbers::Numbers;
use super::pose::{Rotation, pose, rotation_to_row_major, rotations_off, translation_to_mm};

const COLUMNS: [&str; 7] = ["scene_id", "im_id", "obj_id", "score", "R", "t", "time"];

/// One estimated pose.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultRow {
    /// Scene of the split.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
    /// Object whose pose this is.
    pub obj_id: u32,
    /// Confidence; higher is better, the scale is the method's own.
    pub score: f64,
    /// Maps model coordinates into the camera frame \[m\].
    pub t_cam_model: Isometry3<f64>,
    /// Seconds spent on the whole image, the same on all its rows; −1 if unknown.
    pub time: f64,
}

/// Rows of a results file that could be read, and the faults of the others.
#[derive(Clone, Debug, Default)]
pub struct ReadResults {
    /// The well-formed rows in file order.
    pub rows: Vec<ResultRow>,
    /// For each of `rows`, its index from 0 among all the file's rows of the same image, malformed
    /// ones included: the instance that [`super::DatasetImage::mask`] asks for.
    pub instances: Vec<usize>,
    /// The line of each of `rows`, from 1, the header included.
    pub lines: Vec<u64>,
    /// Fault of each malformed row, in file order, such as `line 3: R: "x" is not a number`: the line number is
    /// from 1, the header included, and the column is `row` where the number of columns is wrong.
    pub errors: Vec<String>,
}

/// Reads a results file (`scene_id,im_id,obj_id,score,R,t,time`; R row-major, t in mm). The header may
/// be absent. Rotations that are up to 0.02 from orthonormal are replaced by the nearest ones, with one warning a file where that is more than rounding.
///
/// # Errors
/// When the file cannot be read at all or is empty; malformed rows are listed in [`ReadResults::errors`] and the
/// others still returned.
pub fn read_results(file: &Path) -> Result<ReadResults, DatasetError> {
    let bytes = read_bytes(file)?;
    let text = String::from_utf8_lossy(&bytes);
    if text.trim().is_empty() {
        return Err(DatasetError::unusable(file, "the file is empty"));
    }
    let reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .quoting(false)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut results = ReadResults::default();
    let mut off: Option<f64> = None;
    let mut rows_of_image: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for (index, record) in reader.into_records().enumerate() {
        let record = record.map_err(|e| DatasetError::unusable(file, e))?;
        let fields: Vec<&str> = record.iter().collect();
        if index == 0 && fields[0].ends_with("scene_id") {
            continue;
        }
        let instance = image_of(&fields).map_or(0, |image| {
            let count = rows_of_image.entry(image).or_default();
            *count += 1;
            *count - 1
        });
        let line = record.position().map_or(0, csv::Position::line);
        match parse_row(&fields) {
            Ok((row, deviation)) => {
                off = deviation.into_iter().chain(off).reduce(f64::max);
                results.rows.push(row);
                results.instances.push(instance);
                results.lines.push(line);
            }
            Err((column, problem)) => {
                results.errors.push(format!("line {line}: {column}: {problem}"));
            }
        }
    }
    if let Some(deviation) = off {
        log::warn!("{}", rotations_off(file, deviation));
    }
    Ok(results)
}

fn image_of(fields: &[&str]) -> Option<(u32, u32)> {
    Some((fields.first()?.parse().ok()?, fields.get(1)?.parse().ok()?))
}

/// The row, with how far its rotation is from orthonormal where that is more than rounding, or the column at fault and what is wrong with it.
fn parse_row(fields: &[&str]) -> Result<(ResultRow, Option<f64>), (&'static str, String)> {
    let [scene_id, im_id, obj_id, score, r, t, time] = fields else {
        return Err(("row", format!("expected {} columns, found {}", COLUMNS.len(), fields.len())));
    };
    let id =
        |field, text: &str| text.parse().map_err(|_| (field, format!("{text:?} is not an id")));
    let number = |field, text: &str| text.parse().map(|Numbers([v])| v).map_err(|e| (field, e));
    let r: Numbers<9> = r.parse().map_err(|e| ("R", e))?;
    let t_mm = t.parse().map_err(|e| ("t", e))?;
    let rotation = Rotation::try_from(r).map_err(|e| ("R", e))?;
    let row = ResultRow {
        scene_id: id("scene_id", scene_id)?,
        im_id: id("im_id", im_id)?,
        obj_id: id("obj_id", obj_id)?,
        score: number("score", score)?,
        t_cam_model: pose(&rotation, &t_mm),
        time: number("time", time)?,
    };
    Ok((row, rotation.deviation))
}

/// Gives all rows of an image the sum of their times, or −1 where one is unknown: BOP wants the time spent
/// on the whole image on each of its rows.
pub fn share_image_times(rows: &mut [ResultRow]) {
    let mut times: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    for row in rows.iter() {
        let sum = times.entry((row.scene_id, row.im_id)).or_default();
        *sum = if *sum < 0.0 || row.time < 0.0 { -1.0 } else { *sum + row.time };
    }
    for row in rows {
        row.time = times.get(&(row.scene_id, row.im_id)).copied().unwrap_or(-1.0);
    }
}

/// Writes rows with every digit of their values, atomically: the file appears whole or not at all.
///
/// # Errors
/// [`DatasetError::Unusable`] for a row with a value that is not finite (nothing is written), and
/// [`DatasetError::Unusable`].
pub fn write_results(file: &Path, rows: &[ResultRow]) -> Result<(), DatasetError> {
    let mut text = header();
    for (i, row) in rows.iter().enumerate() {
        text += &line(file, i, row)?;
    }
    write_atomically(file, text.as_bytes())
}

/// A results file that grows by a row at a time, for readers that do not wait for its end.
#[derive(Debug)]
pub struct ResultsWriter {
    path: PathBuf,
    file: File,
    rows: usize,
}

impl ResultsWriter {
    /// A new file with nothing but the header; an existing one is replaced.
    ///
    /// # Errors
    /// [`DatasetError::Unusable`].
    pub fn create(path: &Path) -> Result<Self, DatasetError> {
        let file = plain_target(path).and_then(File::create);
        let file = file.map_err(|e| DatasetError::writing(path, e))?;
        let mut writer = Self { path: path.to_owned(), file, rows: 0 };
        writer.write(&header())?;
        Ok(writer)
    }

    /// Adds a row, all of it at once.
    ///
    /// # Errors
    /// Those of [`write_results`].
    pub fn add(&mut self, row: &ResultRow) -> Result<(), DatasetError> {
        let line = line(&self.path, self.rows, row)?;
        self.rows += 1;
        self.write(&line)
    }

    fn write(&mut self, text: &str) -> Result<(), DatasetError> {
        self.file.write_all(text.as_bytes()).map_err(|e| DatasetError::writing(&self.path, e))
    }
}

fn header() -> String {
    COLUMNS.join(",") + "\n"
}

/// The line of row `i` of `file`.
fn line(file: &Path, i: usize, row: &ResultRow) -> Result<String, DatasetError> {
    let ResultRow { scene_id, im_id, obj_id, score, t_cam_model, time } = row;
    let r = rotation_to_row_major(&t_cam_model.rotation);
    let t_mm = translation_to_mm(&t_cam_model.translation);
    for (column, values) in [("score", &[*score][..]), ("R", &r), ("t", &t_mm), ("time", &[*time])]
    {
        if values.iter().any(|v| !v.is_finite()) {
            let field = format!("row {i} (scene {scene_id}, image {im_id}): {column}");
            return Err(DatasetError::field(file, &field, "not finite"));
        }
    }
    let (r, t) = (spaced(&r), spaced(&t_mm));
    Ok(format!("{scene_id},{im_id},{obj_id},{score},{r},{t},{time}\n"))
}

/// Shortest decimals that read back as the same numbers, separated by spaces.
fn spaced(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

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
