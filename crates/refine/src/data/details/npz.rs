//! Columns as a NumPy archive: a ZIP file of arrays (`.npy` 1.0, NumPy Enhancement Proposal 1), stored as they are.

use std::error::Error;
use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::column::{TableColumn, Values};

/// The content of the file. Entries have no time, so that the same columns are the same bytes.
pub(super) fn archive(columns: &[TableColumn]) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    for column in columns {
        archive.start_file(format!("{}.npy", column.name), options)?;
        archive.write_all(&array(column))?;
    }
    Ok(archive.finish()?.into_inner())
}

/// The content of the `.npy` file of a column: a row a frame along the first axis.
///
/// Texts are of NumPy's fixed width in UTF-32, that of the longest, so that no array needs pickle.
fn array(column: &TableColumn) -> Vec<u8> {
    let longest = match &column.values {
        // NumPy has no texts of no width.
        Values::Texts(texts) => texts.iter().map(|t| t.chars().count()).max().unwrap_or(0).max(1),
        _ => 0,
    };
    let kind = match &column.values {
        Values::Integers(_) => "<i8".to_owned(),
        Values::Numbers(_) => "<f8".to_owned(),
        Values::Texts(_) => format!("<U{longest}"),
    };
    let rows = column.values.count() / column.width();
    // A tuple of one number has a comma behind it.
    let mut shape = format!("{rows}{}", if column.shape.is_empty() { "," } else { "" });
    column.shape.iter().for_each(|n| shape += &format!(", {n}"));
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    // Magic, version and length are 10 bytes; all together, with the line break, end at a multiple of 64.
    let padded = (10 + header.len() + 1).next_multiple_of(64) - 10;
    header += &" ".repeat(padded - header.len() - 1);
    header.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    match &column.values {
        Values::Integers(values) => values.iter().for_each(|v| out.extend(v.to_le_bytes())),
        Values::Numbers(values) => values.iter().for_each(|v| out.extend(v.to_le_bytes())),
        Values::Texts(texts) => {
            for text in texts {
                let start = out.len();
                text.chars().for_each(|c| out.extend(u32::from(c).to_le_bytes()));
                out.resize(start + 4 * longest, 0);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_is_what_numpy_writes() {
        let column = TableColumn {
            name: "covariance",
            shape: vec![1, 2],
            values: Values::Numbers(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        };
        let bytes = array(&column);
        // numpy.lib.format.write_array of that array begins so.
        let header = b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': (3, 1, 2), }";
        assert!(bytes.starts_with(header), "{:?}", String::from_utf8_lossy(&bytes[..80]));
        assert_eq!((bytes[127], bytes.len()), (b'\n', 128 + 48));
        assert_eq!(bytes[128..136], 1f64.to_le_bytes());
    }

    #[test]
    fn texts_are_as_wide_as_the_longest() {
        let column = TableColumn::new("warnings", ["", "5° off"].map(String::from), Values::Texts);
        let bytes = array(&column);
        assert!(String::from_utf8_lossy(&bytes).contains("'<U6'"));
        assert_eq!(bytes.len(), 128 + 2 * 6 * 4);
        assert_eq!(bytes[128 + 24 + 4..][..4], u32::from('°').to_le_bytes());
    }
}
