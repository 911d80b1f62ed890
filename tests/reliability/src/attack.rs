//! What is tried one after the other, and what came of it.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::process::Command;

use anyhow::Result;
use prehend_refine::data::{Identity, Journal};
use serde_json::json;

use crate::table::Row;

/// Something to try.
pub struct Attack<'a> {
    name: String,
    run: Box<dyn FnOnce() -> Result<Row> + 'a>,
}

impl<'a> Attack<'a> {
    /// What `run` does, which returns its row of the table. The name is of it alone.
    pub fn new(name: impl Into<String>, run: impl FnOnce() -> Result<Row> + 'a) -> Self {
        Self { name: name.into(), run: Box::new(run) }
    }

    /// Carries it out and says at once what came of it: all of them take long. One that breaks off is a row of its own kind.
    fn carry_out(self) -> Row {
        let commit = commit();
        let mut row = (self.run)().unwrap_or_else(|error| {
            let note = format!("{error:#}");
            Row { tried: 1, wrong: 1, note, ..Row::new(self.name) }
        });
        row.commit = commit;
        eprintln!("{}: {} of {} held; {}", row.what, row.held(), row.tried, row.note);
        row
    }
}

/// Carries out all attacks.
pub fn carry_out(attacks: Vec<Attack<'_>>) -> Vec<Row> {
    attacks.into_iter().map(Attack::carry_out).collect()
}

/// Carries out the attacks that the journal at `path` has no row of yet, so that a night may be cut short; also of other code than it was
/// begun with, for every row has its commit. With `restart` none counts. In the end the journal is removed.
///
/// # Errors
/// If the journal is of other attacks, or cannot be written.
pub fn carry_on(attacks: Vec<Attack<'_>>, path: &Path, restart: bool) -> Result<Vec<Row>> {
    let names: Vec<&str> = attacks.iter().map(|attack| attack.name.as_str()).collect();
    let identity = Identity::of(&json!({ "attacks": names }));
    let (mut journal, mut rows): (_, BTreeMap<usize, Row>) =
        Journal::open(path, &identity, restart)?;
    for (index, attack) in attacks.into_iter().enumerate() {
        if let Entry::Vacant(open) = rows.entry(index) {
            open.insert(journal.append(index, &attack.carry_out())?);
        }
    }
    journal.discard()?;
    Ok(rows.into_values().collect())
}

/// The commit of the code at hand, with a `+` where it was changed since; empty if git does not tell.
fn commit() -> String {
    let words = ["describe", "--always", "--exclude=*", "--dirty=+"];
    let output = Command::new("git").args(words).output();
    output.map_or_else(|_| String::new(), |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use anyhow::bail;

    use super::*;

    fn good(name: &str) -> Row {
        Row { tried: 2, ..Row::new(name) }
    }

    #[test]
    fn what_breaks_off_is_a_row_that_is_not_good() {
        let attacks = vec![
            Attack::new("a", || bail!("no program")),
            Attack::new("b", || Ok(good("all of b"))),
        ];
        let rows = carry_out(attacks);
        assert_eq!((rows[0].what.as_str(), rows[0].note.as_str()), ("a", "no program"));
        assert!(!rows[0].is_good() && rows[1].is_good());
    }

    #[test]
    fn what_the_journal_has_is_not_tried_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.journal");
        let tried = Cell::new(0);
        let attack = |name: &'static str| {
            let tried = &tried;
            Attack::new(name, move || {
                tried.set(tried.get() + 1);
                Ok(good(name))
            })
        };
        // A run that is cut short after its first attack.
        let identity = Identity::of(&json!({ "attacks": ["a", "b"] }));
        let (mut journal, _) = Journal::open::<Row>(&path, &identity, false).unwrap();
        journal.append(0, &Row { note: "kept".into(), ..good("a") }).unwrap();
        drop(journal);
        let rows = carry_on(vec![attack("a"), attack("b")], &path, false).unwrap();
        assert_eq!((tried.get(), rows.len(), rows[0].note.as_str()), (1, 2, "kept"));
        assert!(!path.exists());
    }
}
