//! Poses as a BOP results file.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::{Value, json};

use super::detect::unknown;
use crate::data::bop::{ResultRow, read_results};
use crate::data::{AssetError, timed_methods};

/// Malformed lines that are named, at most.
const NAMED: usize = 5;

/// Numbers of poses, malformed lines, images and timed poses; ids of scenes and objects; lowest, mean and highest score; methods, as the file of
/// times beside this one has them.
pub(super) fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Value, AssetError> {
    let results = read_results(path)?;
    let (rows, errors) = (&results.rows, &results.errors);
    if rows.is_empty() && !errors.is_empty() {
        let columns = "the columns are not those of a BOP results file";
        return Err(unknown(path, &format!("{columns} ({})", errors[0])));
    }
    warnings.extend(errors.iter().take(NAMED).cloned());
    if errors.len() > NAMED {
        warnings.push(format!("and {} more lines", errors.len() - NAMED));
    }
    let ids = |of: fn(&ResultRow) -> u32| rows.iter().map(of).collect::<BTreeSet<_>>();
    let images: BTreeSet<_> = rows.iter().map(|row| (row.scene_id, row.im_id)).collect();
    let mut scores: Vec<f64> = rows.iter().map(|row| row.score).collect();
    scores.sort_by(f64::total_cmp);
    let mean = scores.iter().sum::<f64>() / scores.len() as f64;
    let range = scores.first().zip(scores.last()).map(|(low, high)| [*low, mean, *high]);
    let mut times = path.as_os_str().to_owned();
    times.push(".times.csv");
    Ok(json!({
        "rows": rows.len(),
        "malformed": errors.len(),
        "scenes": ids(|row| row.scene_id),
        "images": images.len(),
        "objects": ids(|row| row.obj_id),
        "scores": range,
        "timed": rows.iter().filter(|row| row.time >= 0.0).count(),
        "methods": timed_methods(Path::new(&times)),
    }))
}
