//! Changes of the code that tests must notice.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Stdio;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::table::Row;
use crate::tools::{cargo, root};

/// A part of the code that is changed here and there.
pub struct Mutated {
    /// Its name.
    pub name: &'static str,
    package: &'static str,
    /// Its files, from the root of the repository.
    files: &'static str,
    /// Features that it is built with.
    features: &'static str,
    /// Which tests have to notice, the fastest first.
    rounds: &'static [Round],
}

/// Tests that are built and run together.
struct Round {
    profile: Profile,
    /// Arguments of `cargo test`.
    tests: &'static [&'static str],
}

/// How tests are built.
#[derive(Clone, Copy, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
enum Profile {
    /// Built fast.
    Mutants,
    /// Runs fast: simulations take up to 40 times as long with the other.
    Dev,
}

/// Unit tests.
const UNIT: Round = Round { profile: Profile::Mutants, tests: &["--lib"] };

/// All parts.
pub const MUTANTS: &[Mutated] = &[
    Mutated {
        name: "autodiff",
        package: "prehend-autodiff",
        files: "crates/autodiff/src/**/*.rs",
        features: "faer",
        rounds: &[UNIT, Round { profile: Profile::Mutants, tests: &["--test", "*"] }],
    },
    Mutated {
        name: "sim",
        package: "prehend-sim",
        files: "crates/sim/src/**/*.rs",
        features: "faer",
        rounds: &[
            Round {
                profile: Profile::Mutants,
                tests: &["--lib", "--", "--skip=sticking::tests", "--skip=articulated::adjoint"],
            },
            Round { profile: Profile::Dev, tests: &["--lib", "--test", "it"] },
        ],
    },
    Mutated {
        name: "metrics",
        package: "prehend-refine",
        files: "crates/refine/src/evaluate/metrics/*.rs",
        features: "",
        rounds: &[
            Round { profile: Profile::Mutants, tests: &["--lib", "evaluate::"] },
            Round { profile: Profile::Dev, tests: &["--test", "it", "--test", "cli"] },
        ],
    },
    Mutated {
        name: "factors",
        package: "prehend-refine",
        files: "crates/refine/src/factor/**/*.rs",
        features: "",
        rounds: &[
            Round { profile: Profile::Mutants, tests: &["--lib", "factor::"] },
            Round { profile: Profile::Dev, tests: &["--lib", "--test", "it"] },
        ],
    },
];

/// The share of mutants that tests have to notice.
const NOTICED: f64 = 0.9;

fn install(package: &str) -> Result<()> {
    let is_there = cargo(&[package.trim_start_matches("cargo-"), "--version"]);
    let is_there = { is_there }.stdout(Stdio::null()).stderr(Stdio::null()).status()?.success();
    if !is_there {
        let status = cargo(&["install", package, "--locked"]).status()?;
        ensure!(status.success(), "{package} is not to be had: {status}");
    }
    Ok(())
}

/// Changes `part` in at least `count` places, one after the other, and counts how often a test fails. `seed` says which, `target/mutants` has the details.
///
/// # Errors
/// If cargo-mutants cannot be run, or its tests fail without a change.
pub fn run(part: &Mutated, count: usize, seed: usize) -> Result<Row> {
    install("cargo-mutants")?;
    let all = cargo(&part.words()).args(["--list", "--json"]).output()?;
    ensure!(all.status.success(), "{}", String::from_utf8_lossy(&all.stderr));
    let all: Vec<Value> = serde_json::from_slice(&all.stdout)?;
    let every = (all.len() / count.max(1)).max(1);
    let shard = format!("{}/{every}", seed % every);
    let mut chosen = ["--shard", &shard, "--sharding", "round-robin"].map(String::from).to_vec();
    let mut found: Option<Found> = None;
    for (number, round) in part.rounds.iter().enumerate() {
        let folder = root().join(format!("target/mutants/{}-{number}", part.name));
        let of_round = part.found(&chosen, round, &folder)?;
        let found = match &mut found {
            None => found.insert(of_round),
            Some(found) => {
                found.notice(&of_round);
                found
            }
        };
        if found.missed.is_empty() {
            break;
        }
        // The tests that take longer see only what the others missed.
        let exactly = |name: &String| ["--re".into(), format!("^{}$", escaped(name))];
        chosen = found.missed.iter().flat_map(exactly).collect();
    }
    let Found { missed, caught, unviable } = found.context("no tests")?;
    let note = format!("of {}; {unviable} more do not compile", all.len());
    let row = Row::new(format!("mutants of {}", part.name));
    let (tried, wrong) = (caught.len() + missed.len(), missed.len());
    Ok(Row { tried, wrong, required: NOTICED, note, ..row })
}

/// Results of some mutants.
struct Found {
    missed: BTreeSet<String>,
    /// Those that ran into the limit of time among them.
    caught: BTreeSet<String>,
    unviable: usize,
}

impl Found {
    /// Results of cargo-mutants in `folder`.
    fn read(folder: &Path) -> Result<Self> {
        let names = |file: &str| -> Result<BTreeSet<String>> {
            let text = std::fs::read_to_string(folder.join(file))?;
            Ok(text.lines().map(String::from).collect())
        };
        let mut caught = names("caught.txt")?;
        caught.append(&mut names("timeout.txt")?);
        Ok(Self { missed: names("missed.txt")?, caught, unviable: names("unviable.txt")?.len() })
    }

    /// Takes over what other tests caught of those that were missed. They may have met more: patterns do not choose all kinds of changes.
    fn notice(&mut self, other: &Self) {
        let caught: Vec<String> = self.missed.intersection(&other.caught).cloned().collect();
        self.missed.retain(|name| !other.caught.contains(name));
        self.caught.extend(caught);
    }
}

/// A regular expression for `text` itself.
fn escaped(text: &str) -> String {
    let special = |c: &char| r"\.+*?()|[]{}^$".contains(*c);
    text.chars().flat_map(|c| special(&c).then_some('\\').into_iter().chain([c])).collect()
}

impl Mutated {
    fn words(&self) -> [&'static str; 5] {
        ["mutants", "--package", self.package, "--file", self.files]
    }

    /// Results of a round with all mutants that the options `chosen` choose. Nothing of another run in `output` is left.
    fn found(&self, chosen: &[String], round: &Round, output: &Path) -> Result<Found> {
        if output.exists() {
            std::fs::remove_dir_all(output)?;
        }
        std::fs::create_dir_all(output)?;
        let mut command = cargo(&self.words());
        command.args(chosen).args(["--profile", round.profile.into()]);
        command.args(["--features", self.features]);
        command.args(["--no-times", "--colors", "never", "--output"]).arg(output);
        // Nothing else is built either, examples above all.
        let status =
            command.args(round.tests.iter().map(|word| format!("--cargo-arg={word}"))).status()?;
        // 2 and 3: no test noticed some mutant, or some test did not end with it.
        ensure!(matches!(status.code(), Some(0 | 2 | 3)), "cargo mutants: {status}");
        Found::read(&output.join("mutants.out"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_mutants_of_the_first_round_count() {
        let round = |missed: &[&str], caught: &[&str]| {
            let folder = tempfile::tempdir().unwrap();
            let files =
                [("missed", missed), ("caught", caught), ("timeout", &[]), ("unviable", &[])];
            for (name, names) in files {
                std::fs::write(folder.path().join(format!("{name}.txt")), names.join("\n"))
                    .unwrap();
            }
            Found::read(folder.path()).unwrap()
        };
        let mut found = round(&["a", "b", "not tried again"], &["c", "d"]);
        found.notice(&round(&["b"], &["a", "of no sample"]));
        assert_eq!(found.caught, ["a", "c", "d"].map(String::from).into());
        assert_eq!(found.missed, ["b", "not tried again"].map(String::from).into());
    }

    #[test]
    fn an_escaped_name_means_itself_alone() {
        assert_eq!(escaped("a.rs:1: replace * with +"), r"a\.rs:1: replace \* with \+");
    }
}
