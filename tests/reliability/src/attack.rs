//! Attacks, run one after the other, and their results.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use prehend_geometry::write_atomic;
use prehend_refine::guard;

use crate::table::Row;
use crate::tools::root;

/// Something to try.
pub struct Attack<'a> {
    name: String,
    run: Box<dyn FnOnce() -> Result<Row> + 'a>,
}

impl<'a> Attack<'a> {
    /// Attack by `run`, which returns its row of the table. Each has another name.
    pub fn new(name: impl Into<String>, run: impl FnOnce() -> Result<Row> + 'a) -> Self {
        Self { name: name.into(), run: Box::new(run) }
    }

    /// Runs it and says at once what came of it: all of them take long. One that breaks off has a row of its own, too.
    fn run(self, commit: &str) -> Row {
        let mut row = guard(self.run).unwrap_or_else(|error| {
            let note = format!("{error:#}");
            Row { tried: 1, wrong: 1, note, ..Row::new(self.name) }
        });
        row.commit = commit.to_owned();
        eprintln!("{}: {} of {} held; {}", row.what, row.held(), row.tried, row.note);
        row
    }
}

/// Runs all attacks.
pub fn run_all(attacks: Vec<Attack<'_>>) -> Vec<Row> {
    let commit = commit();
    attacks.into_iter().map(|attack| attack.run(&commit)).collect()
}

/// Runs the attacks that `file` has no good row of yet, and keeps their rows there as they come: a night that was cut short goes on, also with
/// other code than it was begun with, for every row has its commit. With `restart` no row counts.
///
/// # Errors
/// If the file is of another kind, or cannot be written.
pub fn resume(attacks: Vec<Attack<'_>>, file: &Path, restart: bool) -> Result<Vec<Row>> {
    let mut rows: BTreeMap<String, Row> = match fs::read(file) {
        Ok(text) if !restart => {
            serde_json::from_slice(&text).with_context(|| file.display().to_string())?
        }
        _ => BTreeMap::new(),
    };
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let commit = commit();
    let mut all = Vec::new();
    for attack in attacks {
        let name = attack.name.clone();
        let row = match rows.remove(&name).filter(Row::is_good) {
            Some(row) => row,
            None => attack.run(&commit),
        };
        all.push(row.clone());
        rows.insert(name, row);
        write_atomic(file, &serde_json::to_vec_pretty(&rows)?)
            .with_context(|| file.display().to_string())?;
    }
    Ok(all)
}

/// The commit of the code at hand, with a `+` where it was changed since; empty if git does not tell.
fn commit() -> String {
    let words = ["describe", "--always", "--exclude=*", "--dirty=+"];
    let output = Command::new("git").args(words).current_dir(root()).output();
    output.map_or_else(|_| String::new(), |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use anyhow::bail;

    use super::*;

    fn good(name: &str) -> Row {
        Row { tried: 2, ..Row::new(name) }
    }

    #[test]
    fn what_breaks_off_is_a_row_that_is_not_good() {
        let attacks = vec![
            Attack::new("a", || bail!("no program")),
            Attack::new("b", || panic!("a fault")),
            Attack::new("c", || Ok(good("all of c"))),
        ];
        let rows = run_all(attacks);
        let said: Vec<_> = rows.iter().map(|row| (row.what.as_str(), row.is_good())).collect();
        assert_eq!(said, [("a", false), ("b", false), ("all of c", true)]);
        assert_eq!(rows[0].note, "no program");
    }

    #[test]
    fn what_has_a_good_row_is_not_tried_again() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("target/rows.json");
        let tried = RefCell::new(String::new());
        let run = |restart: bool, is_well: bool| {
            let attack = |name: &'static str, wrong: usize| {
                let tried = &tried;
                Attack::new(name, move || {
                    tried.borrow_mut().push_str(name);
                    Ok(Row { wrong, ..good(name) })
                })
            };
            let attacks = vec![attack("a", 0), attack("b", usize::from(!is_well))];
            let rows = resume(attacks, &file, restart).unwrap();
            assert_eq!(rows.iter().map(|row| row.what.as_str()).collect::<String>(), "ab");
            tried.take()
        };
        assert_eq!(run(false, false), "ab");
        assert_eq!(run(false, true), "b");
        assert_eq!(run(false, true), "");
        assert_eq!(run(true, true), "ab");
    }
}
