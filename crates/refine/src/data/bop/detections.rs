//! Detections: boxes and masks of objects that a detector or a segmentation network found, in BOP's and COCO's format.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use prehend_geometry::limits::MAX_PIXELS;
use prehend_render::Mask;
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;
use serde_json::value::RawValue;

use super::error::DatasetError;
use super::json::{convert, read_entries};
use super::numbers::{Numbers, Real};

/// Detections of a results file (`[{"scene_id", "image_id", "category_id", "score", "bbox", "segmentation"}, …]`).
#[derive(Clone, Debug)]
pub struct Detections {
    file: PathBuf,
    /// In the file's order; errors are of entries with numbers that are not finite.
    by_object: BTreeMap<Ids, Vec<Result<Detection, DatasetError>>>,
    /// Set when a box was warned of that seems to be two corners.
    told: Arc<OnceLock<()>>,
}

/// Scene, image and object.
type Ids = (u32, u32, u32);

/// An object that was detected in an image.
#[derive(Clone, Debug)]
pub(crate) struct Detection {
    /// Confidence; higher is better.
    score: f64,
    shape: DetectionShape,
}

/// Pixels of a detection.
#[derive(Clone, Debug)]
enum DetectionShape {
    /// Height and width \[px\], and run lengths by columns, of unset and set pixels in turns.
    Mask([usize; 2], Vec<u32>),
    /// Left, top, width and height \[px\].
    Box([f64; 4]),
}

/// Scene, image and object of an entry of the file.
#[derive(Deserialize)]
struct ImagePlace {
    scene_id: u32,
    image_id: u32,
    category_id: u32,
}

/// Entry of the file.
#[derive(Deserialize)]
struct DetectionEntry {
    score: Option<Real>,
    bbox: Option<Numbers<4>>,
    segmentation: Option<Segmentation>,
}

/// Pixels of an object as COCO has them.
#[derive(Deserialize)]
#[serde(untagged, expecting = "is neither run lengths (counts and size) nor polygons")]
enum Segmentation {
    RunLengths(RunLengths),
    Polygons(Vec<IgnoredAny>),
}

/// COCO's run lengths of a mask, by columns, of unset and set pixels in turns.
#[derive(Deserialize)]
struct RunLengths {
    counts: RleCounts,
    /// Height and width.
    size: [usize; 2],
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "is neither a list of run lengths nor a string of compressed ones")]
enum RleCounts {
    Plain(Vec<u64>),
    Compressed(String),
}

impl Detections {
    /// Reads a file of detections. An entry with a number that is not finite costs its object in its image alone.
    ///
    /// # Errors
    /// When the file is absent or broken, and [`DatasetError::Unusable`] for an entry without a box or a mask, or with run lengths that do not fill its mask.
    pub fn load(file: &Path) -> Result<Self, DatasetError> {
        let entries: Vec<Box<RawValue>> = read_entries(file)?;
        let mut by_object: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for (k, text) in entries.iter().enumerate() {
            let name = format!("[{k}]");
            let ImagePlace { scene_id, image_id, category_id } = convert(file, &name, text)?;
            let found = match Detection::read(file, &name, text) {
                Err(error) if serde_json::from_str::<Value>(text.get()).is_err() => Err(error),
                read => Ok(read?),
            };
            by_object.entry((scene_id, image_id, category_id)).or_default().push(found);
        }
        Ok(Self { file: file.to_owned(), by_object, told: Arc::default() })
    }

    /// The file.
    pub(crate) fn file(&self) -> &Path {
        &self.file
    }

    /// Detections of an object in an image, the best first.
    ///
    /// # Errors
    /// If one has a number that is not finite.
    pub(crate) fn of(&self, ids: Ids) -> Result<Vec<&Detection>, DatasetError> {
        let all = self.by_object.get(&ids).into_iter().flatten();
        let all = all.map(|found| found.as_ref().map_err(Clone::clone));
        let mut found: Vec<&Detection> = all.collect::<Result<_, _>>()?;
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(found)
    }

    /// Warning, once a file, of a box that leaves an image of `width` by `height` pixels as left, top, width and height but fits it as two corners.
    pub(crate) fn corners(&self, found: &Detection, width: usize, height: usize) -> Option<String> {
        let DetectionShape::Box(bbox) = found.shape else { return None };
        let [x, y, right, bottom] = bbox;
        // Boxes may be rounded up.
        let leaves = x + right > width as f64 + 1.0 || y + bottom > height as f64 + 1.0;
        let fits = |from: f64, to: f64, size: usize| from >= 0.0 && from < to && to <= size as f64;
        let is_suspect = leaves && fits(x, right, width) && fits(y, bottom, height);
        (is_suspect && self.told.set(()).is_ok()).then(|| {
            format!(
                "the box {bbox:?} leaves the image as [x, y, width, height], as which it is read, but fits it as [x1, y1, x2, y2] (other boxes are not named)"
            )
        })
    }
}

impl DetectionEntry {
    /// Pixels of the entry.
    ///
    /// # Errors
    /// The field at fault, and what is wrong with it.
    fn shape(self) -> Result<DetectionShape, (&'static str, String)> {
        let wrong = |problem| ("segmentation", problem);
        match (self.segmentation, self.bbox) {
            (Some(Segmentation::Polygons(polygons)), _) => {
                let count = polygons.len();
                Err(wrong(format!("{count} polygons: convert to run lengths (counts, size)")))
            }
            (Some(Segmentation::RunLengths(runs)), _) => {
                Ok(DetectionShape::Mask(runs.size, runs.lengths().map_err(wrong)?))
            }
            (None, Some(Numbers(bbox))) if bbox[2] > 0.0 && bbox[3] > 0.0 => {
                Ok(DetectionShape::Box(bbox))
            }
            (None, Some(_)) => {
                Err(("bbox", "is [left, top, width, height], width and height above zero".into()))
            }
            (None, None) => Err(("bbox", "is missing, and so is segmentation".into())),
        }
    }
}

impl Detection {
    /// The entry `name` of a file of that `text`.
    fn read(file: &Path, name: &str, text: &RawValue) -> Result<Self, DatasetError> {
        let entry: DetectionEntry = convert(file, name, text)?;
        let score = entry.score.map_or(1.0, |score| score.0);
        let shape = entry.shape().map_err(|(field, problem)| {
            DatasetError::field(file, &format!("{name}.{field}"), problem)
        })?;
        Ok(Self { score, shape })
    }

    /// Its mask, or its box as one, in an image of `width` by `height` pixels.
    ///
    /// # Errors
    /// Height and width of its mask, if these are others.
    pub(crate) fn mask(&self, width: usize, height: usize) -> Result<Mask, [usize; 2]> {
        match &self.shape {
            DetectionShape::Mask(size, _) if *size != [height, width] => Err(*size),
            DetectionShape::Mask(size, lengths) => {
                let mut pixels = vec![false; width * height];
                let mut at = 0;
                for (k, length) in lengths.iter().enumerate() {
                    let end = at + *length as usize;
                    if k % 2 == 1 {
                        (at..end).for_each(|k| pixels[k % height * width + k / height] = true);
                    }
                    at = end;
                }
                Mask::new(width, height, pixels).map_err(|_| *size)
            }
            DetectionShape::Box([left, top, columns, rows]) => {
                let [left, top, right, bottom] =
                    [*left, *top, left + columns, top + rows].map(|v| v.round().max(0.0) as usize);
                let columns = [left, top, right.saturating_sub(left), bottom.saturating_sub(top)];
                Ok(Mask::of_box(width, height, columns))
            }
        }
    }

    /// True of a box.
    pub(crate) fn is_box(&self) -> bool {
        matches!(self.shape, DetectionShape::Box(_))
    }
}

impl RunLengths {
    /// Run lengths, which fill the mask.
    fn lengths(self) -> Result<Vec<u32>, String> {
        let [height, width] = self.size;
        let lengths = match self.counts {
            RleCounts::Plain(lengths) => lengths,
            RleCounts::Compressed(text) => decompressed(&text)?,
        };
        let count = width.checked_mul(height).filter(|n| *n <= MAX_PIXELS);
        let count = count.ok_or_else(|| format!("size is {height} x {width} pixels"))?;
        let sum = lengths.iter().try_fold(0_u64, |sum, length| sum.checked_add(*length));
        if sum != Some(count as u64) {
            let sum = sum.map_or_else(|| "more".to_owned(), |sum| sum.to_string());
            return Err(format!(
                "the run lengths add up to {sum}, size is {height} x {width} = {count} pixels"
            ));
        }
        Ok(lengths.into_iter().map(|length| length as u32).collect())
    }
}

/// Run lengths of a compressed string: numbers of five bits a character from `0` on, the lowest first, of which the sixth says that more follow and the
/// highest is the sign; from the third on they are differences from the number two before.
fn decompressed(text: &str) -> Result<Vec<u64>, String> {
    let broken = || "counts are no compressed run lengths".to_owned();
    let mut lengths: Vec<i64> = Vec::new();
    let (mut value, mut shift) = (0_i64, 0_u32);
    for byte in text.bytes() {
        let bits =
            byte.checked_sub(b'0').filter(|bits| *bits < 64 && shift < 60).ok_or_else(broken)?;
        value |= i64::from(bits & 31) << shift;
        shift += 5;
        if bits & 32 != 0 {
            continue;
        }
        if bits & 16 != 0 {
            value |= -1 << shift;
        }
        let before = if lengths.len() > 2 { lengths[lengths.len() - 2] } else { 0 };
        lengths.push(before.checked_add(value).ok_or_else(broken)?);
        (value, shift) = (0, 0);
    }
    if shift != 0 {
        return Err(broken());
    }
    lengths.into_iter().map(|length| u64::try_from(length).map_err(|_| broken())).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn read(text: &str) -> Result<Detections, DatasetError> {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("found.json");
        fs::write(&file, text).unwrap();
        Detections::load(&file)
    }

    #[test]
    fn run_lengths_plain_and_compressed_are_the_same_mask() {
        // By pycocotools: the mask [[0,1,1,0],[0,1,0,0],[1,1,0,1]].
        let plain = r#"{"counts": [2, 5, 4, 1], "size": [3, 4]}"#;
        let compressed = r#"{"counts": "254L", "size": [3, 4]}"#;
        let expected = [0, 1, 1, 0, 0, 1, 0, 0, 1, 1, 0, 1].map(|v| v == 1);
        for runs in [plain, compressed] {
            let entry = format!(
                r#"[{{"scene_id": 1, "image_id": 2, "category_id": 5, "score": 0.5, "segmentation": {runs}, "bbox": [0,0,1,1], "time": -1}}]"#
            );
            let found = read(&entry).unwrap();
            let found = found.of((1, 2, 5)).unwrap();
            assert_eq!(found[0].mask(4, 3).unwrap().pixels(), expected);
            assert_eq!(found[0].mask(3, 4).unwrap_err(), [3, 4]);
        }
    }

    #[test]
    fn long_run_lengths_take_several_characters() {
        // By pycocotools: 100 x 3 pixels, rows 40 to 89 of column 1 and rows 5 to 98 of column 2.
        let counts = serde_json::json!(r"\4b1?\1B");
        let entry = format!(
            r#"[{{"scene_id": 1, "image_id": 2, "category_id": 5, "segmentation": {{"counts": {counts}, "size": [100, 3]}}}}]"#
        );
        let found = read(&entry).unwrap();
        let mask = found.of((1, 2, 5)).unwrap()[0].mask(3, 100).unwrap();
        for (x, rows) in [(1, 40..90), (2, 5..99)] {
            assert!((0..100).all(|y| mask.get(x, y) == Some(rows.contains(&y))));
        }
        assert_eq!(mask.count(), 50 + 94);
    }

    #[test]
    fn boxes_are_ordered_by_score() {
        let entry = |score: f64, bbox: &str| {
            format!(
                r#"{{"scene_id": 1, "image_id": 2, "category_id": 5, "score": {score}, "bbox": {bbox}}}"#
            )
        };
        let found =
            read(&format!("[{}, {}]", entry(0.2, "[0, 0, 4, 4]"), entry(0.9, "[1.2, -3, 2, 5]")))
                .unwrap();
        let of = |ids| found.of(ids).unwrap();
        let best = of((1, 2, 5))[0].mask(6, 4).unwrap();
        assert_eq!(best.bounds(), Some([1, 0, 2, 2]));
        assert!(best.is_box() && of((1, 2, 6)).is_empty() && of((2, 2, 5)).is_empty());
        let error = read(&format!("[{}]", entry(0.2, "[0, 0, 0, 4]"))).unwrap_err().to_string();
        assert!(error.contains("[0].bbox: is [left, top"), "{error}");
    }

    #[test]
    fn a_number_that_is_not_finite_costs_its_object_alone() {
        let entry = |object: u32, more: &str| {
            format!(r#"{{"scene_id": 1, "image_id": 2, "category_id": {object}, {more}}}"#)
        };
        let (bad, good) = (r#""bbox": [NaN, 0, 4, 4]"#, r#""bbox": [1, 0, 2, 2], "time": NaN"#);
        let found = read(&format!("\u{feff}[{}, {}]", entry(5, bad), entry(6, good))).unwrap();
        assert_eq!(found.of((1, 2, 6)).unwrap()[0].mask(4, 4).unwrap().count(), 4);
        let error = found.of((1, 2, 5)).unwrap_err().to_string();
        assert!(error.ends_with("found.json: [0].bbox[0]: number out of range"), "{error}");
        let found = read(&format!("[{}]", entry(5, r#""score": NaN"#))).unwrap();
        assert!(found.of((1, 2, 5)).is_err());
        // Other faults are still told at once.
        let error = read(&format!("[{}]", entry(5, r#""time": 1"#))).unwrap_err().to_string();
        assert!(error.contains("[0].bbox: is missing"), "{error}");
    }

    #[test]
    fn a_box_that_fits_as_two_corners_is_told_of_once() {
        let told = |bbox: &str| {
            let entry =
                format!(r#"[{{"scene_id": 1, "image_id": 2, "category_id": 5, "bbox": {bbox}}}]"#);
            let found = read(&entry).unwrap();
            let detection = found.of((1, 2, 5)).unwrap()[0];
            let warnings = [(); 2].map(|()| found.corners(detection, 640, 480));
            assert_eq!(warnings[1], None);
            warnings[0].clone().unwrap_or_default()
        };
        assert!(told("[300, 200, 400, 300]").starts_with("the box [300.0, 200.0, 400.0, 300.0]"));
        // Within the image; rounded up; an object that is cut off at the right.
        for bbox in ["[10, 20, 30, 40]", "[0.5, 0.5, 640, 480]", "[600, 20, 100, 40]"] {
            assert_eq!(told(bbox), "", "{bbox}");
        }
    }

    #[test]
    fn polygons_are_refused() {
        let entry = r#"[{"scene_id": 1, "image_id": 2, "category_id": 5, "segmentation": [[1.5, 2, 3, 4, 5, 6]]}]"#;
        let error = read(entry).unwrap_err().to_string();
        assert!(error.contains("[0].segmentation: 1 polygons: convert"), "{error}");
    }

    #[test]
    fn broken_masks_are_named() {
        let refused = |counts: &str| {
            let entry = format!(
                r#"[{{"scene_id": 1, "image_id": 2, "category_id": 5, "segmentation": {{"counts": {counts}, "size": [3, 4]}}}}]"#
            );
            read(&entry).unwrap_err().to_string()
        };
        assert!(
            refused("[2, 5]")
                .contains("[0].segmentation: the run lengths add up to 7, size is 3 x 4")
        );
        assert!(refused(r#""2\u00e9""#).contains("no compressed run lengths"));
        assert!(refused("[18446744073709551615, 5]").contains("add up to more"));
        assert!(refused("{}").contains("neither run lengths"));
    }
}
