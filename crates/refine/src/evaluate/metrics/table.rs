//! Plain-text tables.

use std::fmt;

use serde::Serialize;

/// A table whose columns are aligned when printed: the first to the left, the others to the right.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new<S: Into<String>>(header: impl IntoIterator<Item = S>) -> Self {
        Self { header: header.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// Appends a row, of a cell a column.
    pub fn push(&mut self, row: Vec<String>) {
        self.rows.push(row);
    }

    /// Headings and rows.
    #[cfg(feature = "cli")]
    pub(crate) fn into_parts(self) -> (Vec<String>, Vec<Vec<String>>) {
        (self.header, self.rows)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |column: usize| {
            let cells = self.rows.iter().chain([&self.header]).filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.header.len()).map(width).collect();
        let line = |row: &[String]| {
            let padded = row.iter().zip(&widths).enumerate().map(|(i, (cell, &w))| match i {
                0 => format!("{cell:<w$}"),
                _ => format!("{cell:>w$}"),
            });
            padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
        };
        writeln!(f, "{}", line(&self.header))?;
        writeln!(f, "{}", widths.iter().map(|&w| "-".repeat(w)).collect::<Vec<_>>().join("  "))?;
        self.rows.iter().try_for_each(|row| writeln!(f, "{}", line(row)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_by_characters() {
        let mut table = Table::new(["object", "IV cm³"]);
        table.push(vec!["mug".into(), "0.5".into()]);
        table.push(vec!["a longer name".into(), "12.25".into()]);
        let expected = "object         IV cm³\n-------------  ------\nmug               0.5\na longer name   12.25\n";
        assert_eq!(table.to_string(), expected);
        let mut table = Table::new(["object", "|ΔIV|"]);
        table.push(vec!["mug".into(), "1".into()]);
        let parts = (vec!["object".into(), "|ΔIV|".into()], vec![vec!["mug".into(), "1".into()]]);
        assert_eq!(table.into_parts(), parts);
    }
}
