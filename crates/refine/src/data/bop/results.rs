//! Results files of the BOP challenge: one estimated pose a row.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use nalgebra::Isometry3;

use super::atomic::write_atomically;
use super::error::DatasetError;
use super::pose::{parse_numbers, pose_from_bop, rotation_to_row_major, translation_to_mm};

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

/// What one results file holds: the rows that could be read, and what is wrong with the others.
#[derive(Clone, Debug, Default)]
pub struct ReadResults {
    /// The well-formed rows in file order.
    pub rows: Vec<ResultRow>,
    /// For each of `rows`, its index from 0 among all the file's rows of the same image, malformed
    /// ones included: the instance that [`super::Frame::mask`] asks for.
    pub instances: Vec<usize>,
    /// What is wrong with each malformed row, in file order, such as `line 3: R: "x" is not a number`: the line number is
    /// from 1, the header included, and the column is `row` where the columns themselves are wrong in number.
    pub errors: Vec<String>,
}

/// Reads a results file (`scene_id,im_id,obj_id,score,R,t,time`; R row-major, t in mm). The header may
/// be absent. A rotation that is off by rounding only (1e-3) is replaced by the nearest rotation.
///
/// # Errors
/// When the file cannot be read at all or is empty; malformed rows are listed in [`ReadResults::errors`] and the
/// others still returned.
pub fn read_results(file: &Path) -> Result<ReadResults, DatasetError> {
    let bytes = fs::read(file).map_err(|e| DatasetError::reading(file, &e))?;
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
        match parse_row(&fields) {
            Ok(row) => {
                results.rows.push(row);
                results.instances.push(instance);
            }
            Err((column, problem)) => {
                let line = record.position().map_or(0, csv::Position::line);
                results.errors.push(format!("line {line}: {column}: {problem}"));
            }
        }
    }
    Ok(results)
}

fn image_of(fields: &[&str]) -> Option<(u32, u32)> {
    Some((fields.first()?.parse().ok()?, fields.get(1)?.parse().ok()?))
}

/// The row, or the column at fault and what is wrong with it.
fn parse_row(fields: &[&str]) -> Result<ResultRow, (&'static str, String)> {
    let [scene_id, im_id, obj_id, score, r, t, time] = fields else {
        return Err(("row", format!("expected {} columns, found {}", COLUMNS.len(), fields.len())));
    };
    let id =
        |field, text: &str| text.parse().map_err(|_| (field, format!("{text:?} is not an id")));
    let number = |field, text: &str| parse_numbers(text).map(|[v]| v).map_err(|e| (field, e));
    let r = parse_numbers(r).map_err(|e| ("R", e))?;
    let t_mm = parse_numbers(t).map_err(|e| ("t", e))?;
    Ok(ResultRow {
        scene_id: id("scene_id", scene_id)?,
        im_id: id("im_id", im_id)?,
        obj_id: id("obj_id", obj_id)?,
        score: number("score", score)?,
        t_cam_model: pose_from_bop(&r, &t_mm).map_err(|e| ("R", e))?,
        time: number("time", time)?,
    })
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
/// [`DatasetError::Field`] for a row with a value that is not finite (nothing is written), and
/// [`DatasetError::Write`].
pub fn write_results(file: &Path, rows: &[ResultRow]) -> Result<(), DatasetError> {
    let mut text = COLUMNS.join(",") + "\n";
    for (i, row) in rows.iter().enumerate() {
        let ResultRow { scene_id, im_id, obj_id, score, t_cam_model, time } = row;
        let r = rotation_to_row_major(&t_cam_model.rotation);
        let t_mm = translation_to_mm(&t_cam_model.translation);
        for (column, values) in
            [("score", &[*score][..]), ("R", &r), ("t", &t_mm), ("time", &[*time])]
        {
            if values.iter().any(|v| !v.is_finite()) {
                let field = format!("row {i} (scene {scene_id}, image {im_id}): {column}");
                return Err(DatasetError::field(file, &field, "not finite"));
            }
        }
        let (r, t) = (spaced(&r), spaced(&t_mm));
        text += &format!("{scene_id},{im_id},{obj_id},{score},{r},{t},{time}\n");
    }
    write_atomically(file, text.as_bytes())
}

/// Shortest decimals that read back as the same numbers, separated by spaces.
fn spaced(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    const IDENTITY: &str = "1 0 0 0 1 0 0 0 1";

    fn read(text: &str) -> ReadResults {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses.csv");
        fs::write(&path, text).unwrap();
        read_results(&path).unwrap()
    }

    fn row(i: u32) -> ResultRow {
        let f = f64::from(i);
        ResultRow {
            scene_id: 4,
            im_id: i,
            obj_id: 7,
            score: 1.0 / (1.0 + f),
            t_cam_model: Isometry3::from_parts(
                Translation3::new(0.1 / (f + 3.0), -0.02 * f, 0.4379152083),
                UnitQuaternion::from_scaled_axis(Vector3::new(0.3 * f, 1.0, -0.7)),
            ),
            time: 0.125,
        }
    }

    #[test]
    fn written_rows_read_back_to_the_last_digits() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.csv");
        let rows: Vec<_> = (0..5).map(row).collect();
        write_results(&path, &rows).unwrap();
        let back = read_results(&path).unwrap();
        assert!(back.errors.is_empty());
        assert_eq!(back.rows.len(), 5);
        for (a, b) in rows.iter().zip(&back.rows) {
            let (pose, read) = (a.t_cam_model, b.t_cam_model);
            assert_eq!(*a, ResultRow { t_cam_model: pose, ..b.clone() });
            assert!((pose.translation.vector - read.translation.vector).norm() < 1e-15);
            assert!(pose.rotation.angle_to(&read.rotation) < 1e-14);
        }
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("scene_id,im_id,obj_id,score,R,t,time\n4,0,7,1,"));
    }

    #[test]
    fn malformed_rows_are_named_and_the_others_returned() {
        let good = format!("4,0,7,1,{IDENTITY},1 2 300,-1");
        let text = format!(
            "scene_id,im_id,obj_id,score,R,t,time\n{good}\n\
             4,1,7,1,{IDENTITY},1 2 300\n\
             4,2,7,1,1 0 0 0 1 0 0 0 nan,1 2 300,-1\n\
             4,3,7,1,2 0 0 0 1 0 0 0 1,1 2 300,-1\n\
             4,4,7,1,{IDENTITY},1 2,-1\n\
             4,5,seven,1,{IDENTITY},1 2 300,-1\n\
             4,6,7,inf,{IDENTITY},1 2 300,-1\n\
             4,7,7,1,{IDENTITY},1 2 300,soon\n\
             4,8,7,1,-1 0 0 0 1 0 0 0 1,1 2 300,-1\n\
             {good}\n4,9,7,1,1 0 0"
        );
        let results = read(&text);
        assert_eq!(results.rows.len(), 2);
        let expected = [
            "line 3: row: expected 7 columns, found 6",
            "line 4: R: value 8 is not finite",
            "line 5: R: not orthonormal",
            "line 6: t: expected 3 numbers, found 2",
            "line 7: obj_id: \"seven\" is not an id",
            "line 8: score: value 0 is not finite",
            "line 9: time: \"soon\" is not a number",
            "line 10: R: a reflection",
            "line 12: row: expected 7 columns, found 5",
        ];
        assert_eq!(results.errors.len(), expected.len());
        for (error, expected) in results.errors.iter().zip(expected) {
            assert!(error.starts_with(expected), "{error}");
        }
    }

    #[test]
    fn instances_count_malformed_rows_too() {
        let results = read(&format!(
            "1,0,7,1,{IDENTITY},0 0 500,-1\n1,0,8,1,{IDENTITY},0 0,-1\n1,1,7,1,{IDENTITY},0 0 500,-1\n1,0,9,1,{IDENTITY},0 0 500,-1\n"
        ));
        assert_eq!(results.instances, [0, 0, 2]);
        assert_eq!(results.rows.iter().map(|r| r.obj_id).collect::<Vec<_>>(), [7, 7, 9]);
    }

    #[test]
    fn rows_of_an_image_share_its_time() {
        let mut rows = [row(0), row(1), row(0), row(1), row(2)];
        rows[3].time = -1.0;
        rows[2].time = 1.0;
        share_image_times(&mut rows);
        assert_eq!(rows.map(|r| r.time), [1.125, -1.0, 1.125, -1.0, 0.125]);
    }

    #[test]
    fn absent_and_empty_files_and_rows_that_are_not_finite_are_errors() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("none.csv");
        assert!(matches!(read_results(&path), Err(DatasetError::Missing { file }) if file == path));
        fs::write(&path, "\n").unwrap();
        assert!(
            matches!(read_results(&path), Err(DatasetError::Unusable { file, .. }) if file == path)
        );
        fs::remove_file(&path).unwrap();
        let mut bad = row(1);
        bad.score = f64::NAN;
        let error = write_results(&path, &[row(0), bad]).unwrap_err();
        assert!(error.to_string().contains("row 1 (scene 4, image 1): score"), "{error}");
        assert!(!path.exists());
    }
}
