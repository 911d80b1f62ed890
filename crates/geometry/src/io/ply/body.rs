//! The values, one row an element, whatever their encoding.

use std::path::Path;
use std::str::SplitAsciiWhitespace;

use super::header::{Encoding, Header, PlyElement, PlyNumber, Property};
use crate::io::limits::MAX_ELEMENTS;
use crate::io::{MeshError, Result};

/// Values that are still to be read.
pub(super) struct PlyBody<'a> {
    pub(super) path: &'a Path,
    bytes: &'a [u8],
    encoding: Encoding,
    line: SplitAsciiWhitespace<'a>,
}

impl<'a> PlyBody<'a> {
    pub(super) fn new(file: &'a [u8], header: &Header, path: &'a Path) -> Self {
        let bytes = file.get(header.length..).unwrap_or_default();
        Self { path, bytes, encoding: header.encoding, line: "".split_ascii_whitespace() }
    }

    /// Hands each row of `element` to `use_row`, as a list of values for each property; a complaint of `use_row`
    /// becomes an error that names the row.
    pub(super) fn rows(
        &mut self,
        element: &PlyElement,
        mut use_row: impl FnMut(usize, &[Vec<f64>]) -> Result<(), String>,
    ) -> Result<()> {
        // An element without properties occupies no bytes, whatever its count says.
        if element.properties.is_empty() {
            return Ok(());
        }
        let mut row = vec![Vec::new(); element.properties.len()];
        for i in 0..element.count {
            let result = self.row(&element.properties, &mut row).map_err(|reason| {
                format!("{reason} (the header declares {} of them)", element.count)
            });
            result.and_then(|()| use_row(i, &row)).map_err(|reason| {
                MeshError::malformed(self.path, format!("{} {i}", element.name), reason)
            })?;
        }
        Ok(())
    }

    /// Moves to the next non-empty line of an ASCII body; `None` at its end.
    fn next_row(&mut self) -> Option<()> {
        if self.encoding != Encoding::Ascii {
            return Some(());
        }
        loop {
            if self.bytes.is_empty() {
                return None;
            }
            let end = self
                .bytes
                .iter()
                .position(|&b| b == b'\n' || b == b'\r')
                .unwrap_or(self.bytes.len());
            let (line, rest) = self.bytes.split_at(end);
            self.bytes = rest.get(1..).unwrap_or_default();
            self.line = std::str::from_utf8(line).ok()?.split_ascii_whitespace();
            if self.line.clone().next().is_some() {
                return Some(());
            }
        }
    }

    fn value(&mut self, number: PlyNumber) -> Option<f64> {
        match self.encoding {
            Encoding::Ascii => self.line.next()?.parse().ok(),
            Encoding::Binary { big_endian } => {
                let value = number.decode(self.bytes, big_endian)?;
                self.bytes = self.bytes.get(number.size()..)?;
                Some(value)
            }
        }
    }

    /// Reads one row into `row`, a list of values for each property.
    fn row(&mut self, properties: &[Property], row: &mut [Vec<f64>]) -> Result<(), &'static str> {
        const ENDED: &str = "the file ends, or the row holds something that is not a number";
        self.next_row().ok_or("the file ends before it")?;
        for (property, values) in properties.iter().zip(row) {
            values.clear();
            let n = match property.count {
                None => 1.0,
                Some(count) => self.value(count).ok_or(ENDED)?,
            };
            if n.is_nan() || n < 0.0 || n.fract() != 0.0 {
                return Err("a list length that is no count");
            }
            if n > MAX_ELEMENTS as f64 {
                return Err("a list of more items than any mesh may have");
            }
            // A hostile length costs nothing: reading stops where the file does.
            for _ in 0..n as usize {
                values.push(self.value(property.item).ok_or(ENDED)?);
            }
        }
        if self.encoding == Encoding::Ascii && self.line.next().is_some() {
            return Err("more values in the line than the header declares");
        }
        Ok(())
    }
}
