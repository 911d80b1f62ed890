//! Copies of a made-up dataset, and the program on them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use prehend_refine::data::bop::{ResultRow, read_results};
use prehend_refine::scene::default_scene;
use prehend_refine::synth::write_dataset;
use serde_json::Value;

/// Two images of one scene, made once a test run.
fn sample() -> &'static Path {
    static SAMPLE: OnceLock<PathBuf> = OnceLock::new();
    SAMPLE.get_or_init(|| {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli-sample");
        let _ = fs::remove_dir_all(&dir);
        let scenes = [1, 2].map(|seed| default_scene(seed).unwrap());
        write_dataset(&dir, &scenes).unwrap();
        dir
    })
}

/// Where all runs of this test run keep what a hand needs: to prepare it takes longer than most of them.
fn kept() -> &'static Path {
    static KEPT: OnceLock<PathBuf> = OnceLock::new();
    KEPT.get_or_init(|| {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli-kept");
        let _ = fs::remove_dir_all(&dir);
        dir
    })
}

/// A folder to work in, with the sample as `ds/`.
pub(crate) struct Workplace {
    dir: tempfile::TempDir,
}

/// Exit code and output of the program.
pub(crate) struct Said {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Workplace {
    pub(crate) fn new() -> Self {
        let place = Self::empty();
        copy(sample(), &place.path("ds"));
        place
    }

    pub(crate) fn empty() -> Self {
        Self { dir: tempfile::tempdir().unwrap() }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    pub(crate) fn remove(&self, name: &str) {
        let path = self.path(name);
        if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }.unwrap();
    }

    /// Cuts a file to `keep` of its length.
    pub(crate) fn truncate(&self, name: &str, keep: f64) {
        let bytes = fs::read(self.path(name)).unwrap();
        fs::write(self.path(name), &bytes[..(bytes.len() as f64 * keep) as usize]).unwrap();
    }

    /// Replaces `old`, which must be there, once.
    pub(crate) fn replace(&self, name: &str, old: &str, new: &str) {
        let text = self.read(name);
        assert!(text.contains(old), "{name} has no {old}");
        self.write(name, &text.replacen(old, new, 1));
    }

    pub(crate) fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    pub(crate) fn edit_json(&self, name: &str, edit: impl FnOnce(&mut Value)) {
        let mut value = self.json(name);
        edit(&mut value);
        self.write(name, &value.to_string());
    }

    pub(crate) fn copy(&self, from: &str, to: &str) {
        copy(&self.path(from), &self.path(to));
    }

    /// The poses in a results file, which must be without fault.
    pub(crate) fn poses(&self, name: &str) -> Vec<ResultRow> {
        let results = read_results(&self.path(name)).unwrap();
        assert!(results.errors.is_empty(), "{:?}", results.errors);
        results.rows
    }

    /// Names of what is in the folder, sorted.
    pub(crate) fn listing(&self) -> Vec<String> {
        let files = fs::read_dir(self.dir.path()).unwrap();
        let mut names: Vec<_> =
            files.map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// `prehend` with the words of `arguments`, to be run here.
    pub(crate) fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_prehend"));
        command.args(arguments.split_whitespace()).current_dir(self.dir.path());
        command.env("PREHEND_CACHE", kept()).env_remove("PREHEND_LOG").env_remove("CLICOLOR_FORCE");
        command
    }

    /// Runs `prehend` here with the words of `arguments`.
    pub(crate) fn prehend(&self, arguments: &str) -> Said {
        let Output { status, stdout, stderr } = self.command(arguments).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        let said = Said { code: status.code().unwrap(), out: text(stdout), err: text(stderr) };
        assert!(!said.err.contains("panicked"), "{}", said.err);
        said
    }

    /// Runs `prehend`, which must succeed without complaint.
    pub(crate) fn succeed(&self, arguments: &str) -> String {
        let said = self.prehend(arguments);
        assert_eq!((said.code, said.err.as_str()), (0, ""), "{arguments}");
        said.out
    }
}

/// Copies a file or a folder with all that is in it.
pub(crate) fn copy(from: &Path, to: &Path) {
    if !from.is_dir() {
        // Copied data may be read-only; the copy must not be.
        fs::write(to, fs::read(from).unwrap()).unwrap();
        return;
    }
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        copy(&entry.path(), &to.join(entry.file_name()));
    }
}
