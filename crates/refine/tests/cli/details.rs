//! `--details`: tables of all that is known of frames.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use nalgebra::Matrix4;
use prehend_refine::data::bop::ResultRow;

use crate::fixture::Workplace;

/// A column of a NumPy archive: its type, its shape, and its bytes.
struct Array {
    kind: String,
    shape: String,
    bytes: Vec<u8>,
}

impl Array {
    fn numbers(&self) -> Vec<f64> {
        assert_eq!(self.kind, "<f8");
        self.bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect()
    }

    fn integers(&self) -> Vec<i64> {
        assert_eq!(self.kind, "<i8");
        self.bytes.as_chunks().0.iter().map(|b| i64::from_le_bytes(*b)).collect()
    }

    fn texts(&self) -> Vec<String> {
        let width: usize = self.kind.strip_prefix("<U").unwrap().parse().unwrap();
        let letter = |b: &[u8; 4]| char::from_u32(u32::from_le_bytes(*b)).unwrap();
        let letters: Vec<char> = self.bytes.as_chunks().0.iter().map(letter).collect();
        let text = |row: &[char]| row.iter().collect::<String>().trim_end_matches('\0').to_owned();
        letters.chunks(width).map(text).collect()
    }
}

/// The arrays of a NumPy archive.
fn archive(path: &Path) -> BTreeMap<String, Array> {
    let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    let mut arrays = BTreeMap::new();
    for k in 0..archive.len() {
        let mut entry = archive.by_index(k).unwrap();
        let name = entry.name().unwrap().strip_suffix(".npy").unwrap().to_owned();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((10 + length) % 64, 0);
        let header = String::from_utf8(bytes[10..10 + length].to_vec()).unwrap();
        let between = |start: &str, end: &str| {
            let rest = header.split_once(start).unwrap().1;
            rest.split_once(end).unwrap().0.to_owned()
        };
        let (kind, shape) = (between("'descr': '", "'"), between("'shape': (", ")"));
        arrays.insert(name, Array { kind, shape, bytes: bytes[10 + length..].to_vec() });
    }
    arrays
}

/// Whether matrices in rows are those poses.
fn are_poses(matrices: &[f64], rows: &[ResultRow]) -> bool {
    matrices.len() == 16 * rows.len()
        && rows.iter().zip(matrices.chunks(16)).all(|(row, matrix)| {
            let off = row.t_cam_model.to_homogeneous() - Matrix4::from_row_slice(matrix);
            off.abs().max() < 1e-9
        })
}

#[test]
fn refined_frames_are_rows_of_a_numpy_archive() {
    let place = Workplace::new();
    let refine = "refine --dataset ds --poses ds/init.csv --out r.csv";
    place.succeed(&format!("{refine} --details d.npz"));
    let (table, rows) = (archive(&place.path("d.npz")), place.poses("r.csv"));
    let column = |name: &str| table.get(name).unwrap_or_else(|| panic!("{name}"));
    assert_eq!(column("scene_id").integers(), [1, 1]);
    assert_eq!(column("im_id").integers(), [0, 1]);
    assert_eq!(column("obj_id").integers(), [5, 5]);
    assert_eq!(column("t_cam_model").shape, "2, 4, 4");
    assert!(are_poses(&column("t_cam_model").numbers(), &rows));
    let initial = place.poses("ds/init.csv");
    assert!(are_poses(&column("initial_t_cam_model").numbers(), &initial));
    // BOP's file has fewer digits of the score.
    let probability = column("probability").numbers();
    assert!(probability.iter().zip(&rows).all(|(p, row)| (p - row.score).abs() < 1e-6));
    assert_eq!(column("covariance").shape, "2, 6, 6");
    let centers = column("center").numbers();
    for (k, matrix) in column("covariance").numbers().chunks(36).enumerate() {
        let covariance = nalgebra::Matrix6::from_row_slice(matrix);
        assert!((covariance - covariance.transpose()).abs().max() < 1e-12);
        // Some tenths of a millimeter and of a degree.
        for (axis, variance) in covariance.diagonal().iter().enumerate() {
            let (low, high) = if axis < 3 { (1e-5, 1e-2) } else { (1e-4, 0.2) };
            assert!((low..high).contains(&variance.sqrt()), "{axis}: {}", variance.sqrt());
        }
        // The object's center is where the object is.
        let center = nalgebra::Vector3::from_column_slice(&centers[3 * k..3 * k + 3]);
        assert!((center - rows[k].t_cam_model.translation.vector).norm() < 0.02);
    }
    assert!(column("iterations").integers().iter().all(|count| *count > 0));
    assert!(column("scales").texts().iter().all(|scales| scales.contains("camera")));
    assert!(!column("termination").texts()[0].is_empty());
    // What is not the same every time is there on demand.
    assert!(column("seconds").numbers().iter().all(|s| s.is_nan()));
    assert!(!table.contains_key("status"));
    place.succeed(&format!("{refine} --threads 1 --details again.npz"));
    let read = |name| std::fs::read(place.path(name)).unwrap();
    assert!(read("again.npz") == read("d.npz"));
    place.succeed(&format!("{refine} --time --details timed.npz"));
    let timed = archive(&place.path("timed.npz"));
    assert!(timed["seconds"].numbers().iter().all(|s| *s > 0.0));
    assert!(timed["t_cam_model"].bytes == column("t_cam_model").bytes);
}

#[test]
fn tracked_frames_say_how_they_came_about() {
    let place = Workplace::new();
    place.succeed("track --dataset ds --poses ds/init.csv --budget 0 --out t.csv --details d.npz");
    let table = archive(&place.path("d.npz"));
    assert_eq!(table["status"].texts(), ["relocalized", "predicted"]);
    assert!(are_poses(&table["t_cam_model"].numbers(), &place.poses("t.csv")));
    // Of a frame that was not looked at nothing is known.
    let probability = table["probability"].numbers();
    assert!(probability[0] > 0.0 && probability[1].is_nan());
    assert!(table["covariance"].numbers()[36..].iter().all(|v| v.is_nan()));
    assert!(table["cost"].numbers()[0].is_finite() && table["cost"].numbers()[1].is_nan());
    assert!(!table.contains_key("initial_t_cam_model") && !table.contains_key("stamp_ns"));
}

#[test]
fn tables_that_cannot_be_written_are_refused_before_the_work() {
    let place = Workplace::new();
    for (file, why) in [("d.xls", ".npz"), ("no/d.npz", "no/d.npz")] {
        for command in ["refine", "track"] {
            let line = format!("{command} --dataset ds --poses ds/init.csv --out r.csv");
            let said = place.prehend(&format!("{line} --details {file}"));
            assert!(said.code == 1 && said.err.contains(why), "{}", said.err);
            assert!(!place.path("r.csv").exists());
        }
    }
}

#[cfg(not(feature = "parquet"))]
#[test]
fn a_build_without_parquet_says_how_to_get_it() {
    let place = Workplace::new();
    let refine = "refine --dataset ds --poses ds/init.csv --out r.csv --details d.parquet";
    let said = place.prehend(refine);
    assert!(said.code == 1 && said.err.contains("--features parquet"), "{}", said.err);
}

#[cfg(feature = "parquet")]
#[test]
fn parquet_has_what_numpy_has() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::{Field, RowAccessor};

    let place = Workplace::new();
    let refine = "refine --dataset ds --poses ds/init.csv --out r.csv --details";
    place.succeed(&format!("{refine} d.npz"));
    place.succeed(&format!("{refine} d.parquet"));
    let arrays = archive(&place.path("d.npz"));
    let file = File::open(place.path("d.parquet")).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 2);
    let names: Vec<&String> = rows[0].get_column_iter().map(|(name, _)| name).collect();
    assert_eq!(names.len(), arrays.len());
    for (k, name) in names.into_iter().enumerate() {
        let array = &arrays[name];
        let mut found = Vec::new();
        for row in &rows {
            let (_, field) = row.get_column_iter().nth(k).unwrap();
            match field {
                Field::ListInternal(list) => found.extend(list.elements().iter().cloned()),
                single => found.push(single.clone()),
            }
        }
        let same = match array.kind.as_str() {
            "<i8" => array.integers().into_iter().map(Field::Long).collect::<Vec<_>>() == found,
            "|b1" => array.bytes.iter().map(|b| Field::Bool(*b == 1)).collect::<Vec<_>>() == found,
            "<f8" => array
                .numbers()
                .iter()
                .zip(&found)
                .all(|(a, b)| matches!(b, Field::Double(b) if a.to_bits() == b.to_bits())),
            _ => array.texts().into_iter().map(Field::Str).collect::<Vec<_>>() == found,
        };
        assert!(same, "{name}");
    }
    assert_eq!(rows[1].get_long(1).unwrap(), 1);
}
