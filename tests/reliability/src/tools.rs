//! Attacks that other programs carry out: cargo's tests and libFuzzer.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::attack::Attack;
use crate::table::Row;

/// The root of the repository.
pub fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.ancestors().nth(2).unwrap_or(package).to_owned()
}

/// Cargo, in that folder.
pub(crate) fn cargo(words: &[&str]) -> Command {
    let mut command = Command::new("cargo");
    command.args(words).current_dir(root()).stdin(Stdio::null());
    command
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

/// The tests of numbers here, and those of golden numbers on an old processor that qemu-user emulates.
pub fn numbers() -> Vec<Attack<'static>> {
    // Programs of that name, and modules of other programs.
    let tests = |words: &[&str]| {
        cargo(&[&["test", "--release", "--no-fail-fast", "--workspace"], words].concat())
    };
    let it =
        |package| cargo(&["test", "--release", "--package", package, "--test", "it", "finite"]);
    let golden = ["--test", "golden"];
    let mut to_the_bit = tests(&golden);
    to_the_bit.env("PREHEND_GOLDEN_BITS", "1");
    let commands = vec![
        ("finite numbers of autodiff, geometry and render", tests(&["--test", "finite*"])),
        ("finite numbers of sim", it("prehend-sim")),
        ("finite numbers of refine", it("prehend-refine")),
        ("golden numbers, to the bit", to_the_bit),
    ];
    let mut emulated = tests(&golden);
    // Without vector instructions beyond SSE4.2, and without fused products.
    let runner = "qemu-x86_64 -cpu Nehalem";
    emulated.env("CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER", runner);
    let attack = |(what, command)| Attack::new(what, move || tested(command, what));
    let mut attacks: Vec<_> = commands.into_iter().map(attack).collect();
    if cfg!(target_arch = "x86_64") {
        let what = "golden numbers on a processor without AVX, to 10⁻⁹";
        attacks.push(Attack::new(what, move || {
            let emulator =
                Command::new("qemu-x86_64").arg("--version").stdout(Stdio::null()).status();
            emulator.context("qemu-x86_64, of the package qemu-user")?;
            tested(emulated, what)
        }));
    }
    attacks
}

/// Results of `cargo test`.
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
