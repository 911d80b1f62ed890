//! The table of what was tried and what came of it.

use std::fmt;

use serde::{Deserialize, Serialize};

/// One kind of attack.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// Target and kind of the attack.
    pub what: String,
    /// Number of trials.
    pub tried: usize,
    /// Trials that ended in a panic or by a signal.
    pub crashes: usize,
    /// Trials that did not end in time.
    pub hangs: usize,
    /// Trials that ended in another result than they should.
    pub wrong: usize,
    /// The share that has to hold.
    pub required: f64,
    /// Note with sizes and times.
    pub note: String,
    /// The commit of the code, if it is told.
    pub commit: String,
}

impl Row {
    /// Empty row, of attacks that must all be withstood.
    pub fn new(what: impl Into<String>) -> Self {
        let (what, note, commit) = (what.into(), String::new(), String::new());
        Self { what, tried: 0, crashes: 0, hangs: 0, wrong: 0, required: 1.0, note, commit }
    }

    /// How often it held.
    pub fn held(&self) -> usize {
        self.tried.saturating_sub(self.crashes + self.hangs + self.wrong)
    }

    /// Whether something was tried, and enough of it held.
    pub fn is_good(&self) -> bool {
        self.tried > 0 && self.held() as f64 >= self.required * self.tried as f64
    }
}

/// Rows below each other, as Markdown.
pub struct Table<'a>(pub &'a [Row]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head =
            ["", "tried", "held", "crashes", "hangs", "wrong", "", "commit"].map(String::from);
        let cells = |row: &Row| {
            let [held, rest @ ..] = [row.held(), row.crashes, row.hangs, row.wrong];
            let [crashes, hangs, wrong] = rest;
            let numbers = [row.tried, held, crashes, hangs, wrong].map(|n| n.to_string());
            let [tried, held, crashes, hangs, wrong] = numbers;
            let (note, commit) = (row.note.clone(), row.commit.clone());
            [row.what.clone(), tried, held, crashes, hangs, wrong, note, commit]
        };
        let lines: Vec<_> = std::iter::once(head).chain(self.0.iter().map(cells)).collect();
        let widths: [usize; 8] = std::array::from_fn(|column| {
            lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0)
        });
        for (index, line) in lines.iter().enumerate() {
            for (column, (cell, width)) in line.iter().zip(widths).enumerate() {
                let is_text = column == 0 || column >= 6;
                if is_text {
                    write!(f, "| {cell:<width$} ")?
                } else {
                    write!(f, "| {cell:>width$} ")?
                }
            }
            writeln!(f, "|")?;
            if index == 0 {
                writeln!(f, "|---|--:|--:|--:|--:|--:|---|---|")?;
            }
        }
        Ok(())
    }
}
