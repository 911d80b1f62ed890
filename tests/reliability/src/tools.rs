//! Attacks that other programs carry out: cargo's tests, libFuzzer and cargo-mutants.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::table::Row;

/// A part of the code that is changed here and there.
pub struct Mutated {
    /// Its name.
    pub name: &'static str,
    package: &'static str,
    /// Its files, from the root of the repository.
    files: &'static str,
    /// What it is built with.
    features: &'static str,
    /// Which tests have to notice: arguments of `cargo test`.
    tests: &'static [&'static str],
}

/// All parts.
pub const MUTANTS: &[Mutated] = &[
    Mutated {
        name: "autodiff",
        package: "prehend-autodiff",
        files: "crates/autodiff/src/**/*.rs",
        features: "faer",
        tests: &["--lib", "--test", "*"],
    },
    Mutated {
        name: "sim",
        package: "prehend-sim",
        files: "crates/sim/src/**/*.rs",
        features: "faer",
        tests: &["--lib", "--test", "*"],
    },
    Mutated {
        name: "metrics",
        package: "prehend-refine",
        files: "crates/refine/src/evaluate/metrics/*.rs",
        features: "",
        tests: &["--lib", "--test", "it"],
    },
    Mutated {
        name: "factors",
        package: "prehend-refine",
        files: "crates/refine/src/factor/**/*.rs",
        features: "",
        tests: &["--lib", "--test", "it"],
    },
];

/// The share of mutants that tests have to notice.
const NOTICED: f64 = 0.9;

fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.ancestors().nth(2).unwrap_or(package).to_owned()
}

fn cargo(words: &[&str]) -> Command {
    let mut command = Command::new("cargo");
    command.args(words).current_dir(root()).stdin(Stdio::null());
    command
}

fn install(package: &str) -> Result<()> {
    let is_there = cargo(&[package.trim_start_matches("cargo-"), "--version"]);
    let is_there = { is_there }.stdout(Stdio::null()).stderr(Stdio::null()).status()?.success();
    if !is_there {
        let status = cargo(&["install", package, "--locked"]).status()?;
        ensure!(status.success(), "{package} is not to be had: {status}");
    }
    Ok(())
}

/// The command `prehend`, built as users have it.
///
/// # Errors
/// If it does not compile.
pub fn program() -> Result<PathBuf> {
    let words = ["build", "--release", "--package", "prehend-refine", "--features", "mcap"];
    let mut command = cargo(&words);
    command.arg("--message-format=json-render-diagnostics").stderr(Stdio::inherit());
    let output = command.output().context("cargo")?;
    ensure!(output.status.success(), "the command was not built: {}", output.status);
    let messages = String::from_utf8_lossy(&output.stdout);
    let messages = messages.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let mut programs = messages.filter_map(|m| m["executable"].as_str().map(PathBuf::from));
    programs.next_back().context("cargo tells no program")
}

/// Runs libFuzzer for `seconds` on each parser of `only`.
///
/// # Errors
/// If it cannot be built, or does not run.
pub fn fuzz(seconds: u64, only: &[&str]) -> Result<Vec<Row>> {
    let mut command = Command::new(root().join("fuzz/run"));
    command.arg(seconds.to_string()).args(only).stdin(Stdio::null()).stdout(Stdio::piped());
    let mut child = command.spawn().context("fuzz/run")?;
    let output = child.stdout.take().context("no output")?;
    let mut rows = Vec::new();
    for line in BufReader::new(output).lines() {
        let line = line?;
        eprintln!("{line}");
        let cells: Vec<&str> = line.split_whitespace().collect();
        if let [parser, files, coverage, crashes, hangs] = cells[..]
            && let (Ok(tried), Ok(crashes), Ok(hangs)) =
                (files.parse(), crashes.parse(), hangs.parse())
        {
            let note = format!("{seconds} s, {coverage} edges");
            let row = Row::new(format!("files of `{parser}`, by coverage"));
            rows.push(Row { tried, crashes, hangs, note, ..row });
        }
    }
    let status = child.wait()?;
    ensure!(rows.len() == only.len(), "{} of {} parsers: {status}", rows.len(), only.len());
    Ok(rows)
}

/// Runs the tests of numbers here, and those of golden numbers on an old processor that qemu-user plays, if it is installed.
///
/// # Errors
/// If cargo cannot be run.
pub fn numbers() -> Result<Vec<Row>> {
    // Programs of that name, and modules of other programs.
    let tests = |words: &[&str]| cargo(&[&["test", "--release", "--workspace"], words].concat());
    let it = |package| ["test", "--release", "--package", package, "--test", "it", "finite"];
    let golden = ["--test", "golden"];
    let mut to_the_bit = tests(&golden);
    to_the_bit.env("PREHEND_GOLDEN_BITS", "1");
    let mut rows = vec![
        tested(tests(&["--test", "finite*"]), "finite numbers of autodiff, geometry and render")?,
        tested(cargo(&it("prehend-sim")), "finite numbers of sim")?,
        tested(cargo(&it("prehend-refine")), "finite numbers of refine")?,
        tested(to_the_bit, "golden numbers, to the bit")?,
    ];
    let old = Command::new("qemu-x86_64").arg("--version").stdout(Stdio::null()).status();
    if cfg!(target_arch = "x86_64") && old.is_ok() {
        let mut command = tests(&golden);
        // Without vector instructions beyond SSE4.2, and without fused products.
        let runner = "qemu-x86_64 -cpu Nehalem";
        command.env("CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER", runner);
        rows.push(tested(command, "golden numbers on a processor without AVX, to 10⁻⁹")?);
    }
    Ok(rows)
}

/// What `cargo test` says.
fn tested(mut command: Command, what: &str) -> Result<Row> {
    let output = command.stderr(Stdio::inherit()).output().context("cargo")?;
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let count = |word: &str| -> usize {
        let results = said.lines().filter(|line| line.starts_with("test result"));
        let number =
            |line: &str| line.split(word).next()?.rsplit(' ').next()?.parse::<usize>().ok();
        results.filter_map(number).sum()
    };
    let (passed, failed) = (count(" passed"), count(" failed"));
    if failed > 0 || !output.status.success() {
        eprintln!("{said}");
    }
    let wrong = failed.max(usize::from(!output.status.success()));
    Ok(Row { tried: passed + wrong, wrong, note: "tests".into(), ..Row::new(what) })
}

/// Changes `part` in at least `count` places, one after the other, and counts how often a test fails. `seed` says which, `target/mutants` has the details.
///
/// # Errors
/// If cargo-mutants cannot be run, or its tests fail without a change.
pub fn mutants(part: &Mutated, count: usize, seed: usize) -> Result<Row> {
    install("cargo-mutants")?;
    let chosen = ["mutants", "--package", part.package, "--file", part.files];
    let all = cargo(&chosen).args(["--list", "--json"]).output()?;
    ensure!(all.status.success(), "{}", String::from_utf8_lossy(&all.stderr));
    let all: Vec<Value> = serde_json::from_slice(&all.stdout)?;
    let every = (all.len() / count.max(1)).max(1);
    let output = root().join("target/mutants").join(part.name);
    // Nothing of another run is taken for this one's.
    if output.exists() {
        std::fs::remove_dir_all(&output)?;
    }
    std::fs::create_dir_all(&output)?;
    let mut command = cargo(&chosen);
    command.args(["--shard", &format!("{}/{every}", seed % every), "--sharding", "round-robin"]);
    command.args(["--profile", "mutants", "--features", part.features]);
    command.args(["--no-times", "--colors", "never", "--output"]).arg(&output);
    let status = command.arg("--").args(part.tests).status()?;
    // 2 and 3: no test noticed some mutant, or some test did not end with it.
    ensure!(matches!(status.code(), Some(0 | 2 | 3)), "cargo mutants: {status}");
    let outcomes = std::fs::read_to_string(output.join("mutants.out/outcomes.json"))?;
    let outcomes: Value = serde_json::from_str(&outcomes)?;
    let number = |name: &str| outcomes[name].as_u64().unwrap_or(0) as usize;
    let (caught, missed) = (number("caught") + number("timeout"), number("missed"));
    let note = format!(
        "of {}; {} % required; {} more do not compile",
        all.len(),
        1e2 * NOTICED,
        number("unviable")
    );
    let row = Row::new(format!("mutants of {}", part.name));
    Ok(Row { tried: caught + missed, wrong: missed, required: NOTICED, note, ..row })
}
