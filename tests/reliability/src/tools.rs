//! Attacks that other programs carry out: cargo's tests, libFuzzer and cargo-mutants.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::attack::Attack;
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
    /// Which tests have to notice, the fastest first: arguments of `cargo test`.
    tests: &'static [&'static [&'static str]],
}

/// All parts.
pub const MUTANTS: &[Mutated] = &[
    Mutated {
        name: "autodiff",
        package: "prehend-autodiff",
        files: "crates/autodiff/src/**/*.rs",
        features: "faer",
        tests: &[&["--lib"], &["--test", "*"]],
    },
    Mutated {
        name: "sim",
        package: "prehend-sim",
        files: "crates/sim/src/**/*.rs",
        features: "faer",
        tests: &[&["--lib"], &["--test", "*"]],
    },
    Mutated {
        name: "metrics",
        package: "prehend-refine",
        files: "crates/refine/src/evaluate/metrics/*.rs",
        features: "",
        tests: &[&["--lib"], &["--test", "it"]],
    },
    Mutated {
        name: "factors",
        package: "prehend-refine",
        files: "crates/refine/src/factor/**/*.rs",
        features: "",
        tests: &[&["--lib"], &["--test", "it"]],
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

/// Runs libFuzzer for `seconds` on `parser`.
///
/// # Errors
/// If it cannot be built, or does not run.
pub fn fuzz(parser: &str, seconds: u64) -> Result<Row> {
    let mut command = Command::new(root().join("fuzz/run"));
    command.args([&seconds.to_string(), parser]).stdin(Stdio::null()).stderr(Stdio::inherit());
    let output = command.output().context("fuzz/run")?;
    let said = String::from_utf8_lossy(&output.stdout);
    let cells: Vec<&str> = said.lines().last().unwrap_or_default().split_whitespace().collect();
    let numbers: Vec<usize> = cells.iter().filter_map(|cell| cell.parse().ok()).collect();
    let [tried, edges, crashes, hangs] = numbers[..] else {
        bail!("fuzz/run: {}", output.status);
    };
    let note = format!("{seconds} s, {edges} edges");
    let row = Row::new(format!("files of `{parser}`, by coverage"));
    Ok(Row { tried, crashes, hangs, note, ..row })
}

/// The tests of numbers here, and those of golden numbers on an old processor that qemu-user plays, if it is installed.
pub fn numbers() -> Vec<Attack<'static>> {
    // Programs of that name, and modules of other programs.
    let tests = |words: &[&str]| cargo(&[&["test", "--release", "--workspace"], words].concat());
    let it =
        |package| cargo(&["test", "--release", "--package", package, "--test", "it", "finite"]);
    let golden = ["--test", "golden"];
    let mut to_the_bit = tests(&golden);
    to_the_bit.env("PREHEND_GOLDEN_BITS", "1");
    let mut commands = vec![
        ("finite numbers of autodiff, geometry and render", tests(&["--test", "finite*"])),
        ("finite numbers of sim", it("prehend-sim")),
        ("finite numbers of refine", it("prehend-refine")),
        ("golden numbers, to the bit", to_the_bit),
    ];
    let old = Command::new("qemu-x86_64").arg("--version").stdout(Stdio::null()).status();
    if cfg!(target_arch = "x86_64") && old.is_ok() {
        let mut command = tests(&golden);
        // Without vector instructions beyond SSE4.2, and without fused products.
        let runner = "qemu-x86_64 -cpu Nehalem";
        command.env("CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER", runner);
        commands.push(("golden numbers on a processor without AVX, to 10⁻⁹", command));
    }
    let attack = |(what, command)| Attack::new(what, move || tested(command, what));
    commands.into_iter().map(attack).collect()
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
    let all = cargo(&part.words()).args(["--list", "--json"]).output()?;
    ensure!(all.status.success(), "{}", String::from_utf8_lossy(&all.stderr));
    let all: Vec<Value> = serde_json::from_slice(&all.stdout)?;
    let every = (all.len() / count.max(1)).max(1);
    let shard = format!("{}/{every}", seed % every);
    let mut chosen = ["--shard", &shard, "--sharding", "round-robin"].map(String::from).to_vec();
    let (mut caught, mut missed, mut unviable) = (0, 0, 0);
    for (round, tests) in part.tests.iter().enumerate() {
        let round = root().join(format!("target/mutants/{}-{round}", part.name));
        let outcomes = part.round(&chosen, tests, &round)?;
        let number = |name: &str| outcomes[name].as_u64().unwrap_or(0) as usize;
        caught += number("caught") + number("timeout");
        unviable += number("unviable");
        missed = number("missed");
        // The tests that take longer see only what the others missed.
        let names = std::fs::read_to_string(round.join("mutants.out/missed.txt"))?;
        let is_special = |c: char| !c.is_ascii_alphanumeric();
        let exactly = |name: &str| ["--re".into(), format!("^{}$", name.replace(is_special, "."))];
        chosen = names.lines().flat_map(exactly).collect();
        if missed == 0 {
            break;
        }
    }
    let note =
        format!("of {}; {} % required; {unviable} more do not compile", all.len(), 1e2 * NOTICED);
    let row = Row::new(format!("mutants of {}", part.name));
    Ok(Row { tried: caught + missed, wrong: missed, required: NOTICED, note, ..row })
}

impl Mutated {
    fn words(&self) -> [&'static str; 5] {
        ["mutants", "--package", self.package, "--file", self.files]
    }

    /// What cargo-mutants says came of `tests`, with all mutants that the options `chosen` choose. Nothing of another run in `output` is left.
    fn round(&self, chosen: &[String], tests: &[&str], output: &Path) -> Result<Value> {
        if output.exists() {
            std::fs::remove_dir_all(output)?;
        }
        std::fs::create_dir_all(output)?;
        let mut command = cargo(&self.words());
        command.args(chosen).args(["--profile", "mutants", "--features", self.features]);
        command.args(["--no-times", "--colors", "never", "--output"]).arg(output);
        // Nothing else is built either, examples above all.
        let status =
            command.args(tests.iter().map(|word| format!("--cargo-arg={word}"))).status()?;
        // 2 and 3: no test noticed some mutant, or some test did not end with it.
        ensure!(matches!(status.code(), Some(0 | 2 | 3)), "cargo mutants: {status}");
        let outcomes = std::fs::read_to_string(output.join("mutants.out/outcomes.json"))?;
        Ok(serde_json::from_str(&outcomes)?)
    }
}
