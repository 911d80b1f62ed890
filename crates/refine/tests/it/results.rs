//! Files of poses.

use std::fs;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use prehend_refine::data::bop::{
    DatasetError, ReadResults, ResultRow, read_results, share_image_times, write_results,
};

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
    assert!(matches!(read_results(&path), Err(DatasetError::Missing { file, .. }) if file == path));
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
