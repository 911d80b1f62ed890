//! Columns as a Parquet file, uncompressed, in one group of rows.

use std::error::Error;
use std::sync::Arc;

use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::parser::parse_message_type;

use super::column::{TableColumn, Values};

/// The content of the file. Arrays of a row are lists, row-major: their lengths are the same in all rows, their shapes are not kept.
pub(super) fn file(columns: &[TableColumn]) -> Result<Vec<u8>, Box<dyn Error>> {
    let fields: String = columns.iter().map(field).collect();
    let schema = Arc::new(parse_message_type(&format!("message frames {{ {fields} }}"))?);
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, properties)?;
    let mut group = writer.next_row_group()?;
    for column in columns {
        if let Some(mut values) = group.next_column()? {
            write(column, &mut values)?;
            values.close()?;
        }
    }
    group.close()?;
    Ok(writer.into_inner()?)
}

/// A column in the words of a schema.
fn field(TableColumn { name, shape, values }: &TableColumn) -> String {
    let (kind, meaning) = match values {
        Values::Integers(_) => ("INT64", ""),
        Values::Numbers(_) => ("DOUBLE", ""),
        Values::Texts(_) => ("BINARY", " (STRING)"),
    };
    if shape.is_empty() {
        return format!("REQUIRED {kind} {name}{meaning}; ");
    }
    let element = format!("REQUIRED {kind} element{meaning};");
    format!("REQUIRED group {name} (LIST) {{ REPEATED group list {{ {element} }} }} ")
}

fn write(
    column: &TableColumn,
    writer: &mut SerializedColumnWriter<'_>,
) -> Result<(), ParquetError> {
    // Within a list, all but the first element of a row repeat, and none is absent.
    let levels = (!column.shape.is_empty()).then(|| {
        let count = column.values.count();
        let repeats = |k: usize| i16::from(!k.is_multiple_of(column.width()));
        (vec![1; count], (0..count).map(repeats).collect::<Vec<i16>>())
    });
    let (definition, repetition) = match &levels {
        Some((definition, repetition)) => (Some(&definition[..]), Some(&repetition[..])),
        None => (None, None),
    };
    match &column.values {
        Values::Integers(values) => {
            writer.typed::<Int64Type>().write_batch(values, definition, repetition)
        }
        Values::Numbers(values) => {
            writer.typed::<DoubleType>().write_batch(values, definition, repetition)
        }
        Values::Texts(texts) => {
            let texts: Vec<ByteArray> = texts.iter().map(|t| t.as_str().into()).collect();
            writer.typed::<ByteArrayType>().write_batch(&texts, definition, repetition)
        }
    }?;
    Ok(())
}
