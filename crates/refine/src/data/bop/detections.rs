//! Detections: boxes and masks of objects that a detector or a segmentation network found, in BOP's and COCO's format.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use prehend_geometry::limits::MAX_PIXELS;
use prehend_render::Mask;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::error::DatasetError;
use super::json::read_json;
use super::numbers::{Numbers, Real};

/// Detections of a results file (`[{"scene_id", "image_id", "category_id", "score", "bbox", "segmentation"}, …]`).
#[derive(Clone, Debug)]
pub struct Detections {
    file: PathBuf,
    /// By scene and image, in the file's order.
    by_image: BTreeMap<(u32, u32), Vec<Detection>>,
}

/// An object that was detected in an image.
#[derive(Clone, Debug)]
pub(crate) struct Detection {
    pub(crate) obj_id: u32,
    /// Confidence; higher is better.
    pub(crate) score: f64,
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

/// Entry of the file.
#[derive(Deserialize)]
struct Entry {
    scene_id: u32,
    image_id: u32,
    category_id: u32,
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
    counts: Counts,
    /// Height and width.
    size: [usize; 2],
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "is neither a list of run lengths nor a string of compressed ones")]
enum Counts {
    Plain(Vec<u64>),
    Compressed(String),
}

impl Detections {
    /// Reads a file of detections.
    ///
    /// # Errors
    /// When the file is absent or broken, and [`DatasetError::Unusable`] for an entry without a box or a mask, or with run lengths that do not fill its mask.
    pub fn load(file: &Path) -> Result<Self, DatasetError> {
        let entries: Vec<Entry> = read_json(file)?;
        let mut by_image: BTreeMap<_, Vec<Detection>> = BTreeMap::new();
        for (k, entry) in entries.into_iter().enumerate() {
            let fault = |(name, problem): (&str, String)| {
                DatasetError::field(file, &format!("[{k}].{name}"), problem)
            };
            let score = entry.score.map_or(1.0, |score| score.0);
            let (obj_id, image) = (entry.category_id, (entry.scene_id, entry.image_id));
            let shape = entry.shape().map_err(fault)?;
            by_image.entry(image).or_default().push(Detection { obj_id, score, shape });
        }
        Ok(Self { file: file.to_owned(), by_image })
    }

    /// The file.
    pub(crate) fn file(&self) -> &Path {
        &self.file
    }

    /// Detections of an object in an image, the best first.
    pub(crate) fn of(&self, scene_id: u32, im_id: u32, obj_id: u32) -> Vec<&Detection> {
        let all = self.by_image.get(&(scene_id, im_id)).into_iter().flatten();
        let mut found: Vec<&Detection> = all.filter(|found| found.obj_id == obj_id).collect();
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        found
    }
}

impl Entry {
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
            Counts::Plain(lengths) => lengths,
            Counts::Compressed(text) => decompressed(&text)?,
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
            let found = found.of(1, 2, 5);
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
        let mask = found.of(1, 2, 5)[0].mask(3, 100).unwrap();
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
        let best = found.of(1, 2, 5)[0].mask(6, 4).unwrap();
        assert_eq!(best.bounds(), Some([1, 0, 2, 2]));
        assert!(best.is_box() && found.of(1, 2, 6).is_empty() && found.of(2, 2, 5).is_empty());
        let error = read(&format!("[{}]", entry(0.2, "[0, 0, 0, 4]"))).unwrap_err().to_string();
        assert!(error.contains("[0].bbox: is [left, top"), "{error}");
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
