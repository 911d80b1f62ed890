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
    pub fn new(header: Vec<String>) -> Self {
        Self { header, rows: Vec::new() }
    }

    /// Appends a row; missing cells are printed empty, surplus ones are left out.
    pub fn push(&mut self, row: Vec<String>) {
        self.rows.push(row);
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let cell = |row: &[String], column: usize| row.get(column).cloned().unwrap_or_default();
        let width = |column: usize| {
            let cells =
                self.rows.iter().chain([&self.header]).map(|r| cell(r, column).chars().count());
            cells.max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.header.len()).map(width).collect();
        let line = |row: &[String]| {
            let padded = widths.iter().enumerate().map(|(i, &w)| match i {
                0 => format!("{:<w$}", cell(row, i)),
                _ => format!("{:>w$}", cell(row, i)),
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
        let mut table = Table::new(vec!["object".into(), "IV cm³".into()]);
        table.push(vec!["mug".into(), "0.5".into()]);
        table.push(vec!["a longer name".into(), "12.25".into(), "surplus".into()]);
        table.push(vec!["short".into()]);
        let expected = "object         IV cm³\n-------------  ------\nmug               0.5\na longer name   12.25\nshort\n";
        assert_eq!(table.to_string(), expected);
    }
}
