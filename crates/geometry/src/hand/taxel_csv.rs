//! Taxel lists in comma-separated files.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};

use super::Taxel;
use crate::io::limits::{MAX_NUMBER, MAX_TEXT_BYTES};
use crate::io::read_plain;

/// Why a taxel list could not be read.
#[derive(Debug, thiserror::Error)]
pub enum TaxelError {
    /// The file cannot be opened or is no CSV table.
    #[error("{}: {source}", path.display())]
    Csv {
        /// The file.
        path: PathBuf,
        /// Error of the CSV reader, with the line where there is one.
        source: csv::Error,
    },
    /// The header lacks a column.
    #[error("{}: line 1: no column `{column}`", path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The column that is missing.
        column: &'static str,
    },
    /// A field holds something else than it should.
    #[error("{}: line {line}: column `{column}`: expected {expected}, found `{found}`", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// Line of the file, from 1.
        line: u64,
        /// Column name.
        column: &'static str,
        /// Value expected, such as `the name of a link`.
        expected: &'static str,
        /// Text of the cell.
        found: String,
    },
}

const COLUMNS: [&str; 9] = ["idx", "patch", "link", "x_m", "y_m", "z_m", "nx", "ny", "nz"];

/// Reads a taxel list with the columns `idx` (from 0, rising by one), `patch`, `link`, `x_m`, `y_m`, `z_m`
/// (position in the link frame \[m\]), `nx`, `ny`, `nz` (outward normal, normalized here), in any order; other
/// columns are ignored.
pub fn load_taxels(path: &Path) -> Result<Vec<Taxel>, TaxelError> {
    let wrap = |source| TaxelError::Csv { path: path.to_owned(), source };
    let text = read_plain(path, MAX_TEXT_BYTES).map_err(|e| wrap(e.into()))?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_slice());
    let header = reader.headers().map_err(wrap)?.clone();
    let mut places = [0; COLUMNS.len()];
    for (place, column) in places.iter_mut().zip(COLUMNS) {
        let found = header.iter().position(|h| h == column);
        *place = found.ok_or_else(|| TaxelError::Column { path: path.to_owned(), column })?;
    }
    let mut taxels = Vec::new();
    for record in reader.records() {
        let record = record.map_err(wrap)?;
        let text = |k: usize| record.get(places[k]).unwrap_or_default();
        let fail = |k: usize, expected| TaxelError::Field {
            path: path.to_owned(),
            line: record.position().map_or(0, csv::Position::line),
            column: COLUMNS[k],
            expected,
            found: text(k).to_owned(),
        };
        let number = |k: usize| match text(k).parse::<f64>() {
            Ok(value) if value.abs() <= MAX_NUMBER => Ok(value),
            _ => Err(fail(k, "a number within ±1e9")),
        };
        if text(0).parse() != Ok(taxels.len()) {
            return Err(fail(0, "the taxel's place in the list, from 0"));
        }
        if text(2).is_empty() {
            return Err(fail(2, "the name of a link"));
        }
        let normal = Vector3::new(number(6)?, number(7)?, number(8)?);
        taxels.push(Taxel {
            index: taxels.len(),
            patch: text(1).to_owned(),
            link: text(2).to_owned(),
            position: Point3::new(number(3)?, number(4)?, number(5)?),
            normal: normal
                .try_normalize(1e-6)
                .ok_or_else(|| fail(6, "a normal that is not zero"))?,
        });
    }
    Ok(taxels)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "link,idx,patch,taxel,x_m,y_m,z_m,nx,ny,nz\n";

    fn load(text: &str) -> Result<Vec<Taxel>, TaxelError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.csv");
        std::fs::write(&path, text).unwrap();
        load_taxels(&path)
    }

    #[test]
    fn reads_columns_in_any_order() {
        let list =
            load(&format!("{HEADER}palm,0,51,1,0.01,0.02,0.03,0,0,2\ntip,1,03,1,0,0,0,1,0,0\n"))
                .unwrap();
        assert_eq!(list[0].position, Point3::new(0.01, 0.02, 0.03));
        assert_eq!(
            (list[0].normal, list[1].link.as_str(), list[1].patch.as_str()),
            (Vector3::z(), "tip", "03")
        );
    }

    #[test]
    fn errors_name_file_line_and_column() {
        for (text, expected) in [
            (
                format!("{HEADER}palm,0,51,1,0.01,abc,0,0,0,1\n"),
                "line 2: column `y_m`: expected a number within ±1e9",
            ),
            (format!("{HEADER}palm,0,51,1,0.01,NaN,0,0,0,1\n"), "line 2: column `y_m`"),
            (
                format!("{HEADER}palm,0,51,1,0,0,0,0,0,1\npalm,2,51,1,0,0,0,0,0,1\n"),
                "line 3: column `idx`",
            ),
            (
                format!("{HEADER}palm,0,51,1,0,0,0,0,0,0\n"),
                "line 2: column `nx`: expected a normal",
            ),
            (format!("{HEADER}palm,0,51,1,0,0,0,1e308,0,1\n"), "line 2: column `nx`"),
            (format!("{HEADER}palm,0,51,1,1e308,0,0,0,0,1\n"), "line 2: column `x_m`"),
            (format!("{HEADER},0,51,1,0,0,0,0,0,1\n"), "line 2: column `link`"),
            (format!("{HEADER}palm,0,51\n"), "line: 2"),
            ("idx,patch\n".to_owned(), "line 1: no column `link`"),
        ] {
            let error = load(&text).unwrap_err().to_string();
            assert!(error.contains("list.csv") && error.contains(expected), "{error}");
        }
        assert!(
            load_taxels(Path::new("missing.csv"))
                .unwrap_err()
                .to_string()
                .starts_with("missing.csv: ")
        );
    }
}
