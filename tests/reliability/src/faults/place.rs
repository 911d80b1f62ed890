//! A folder with a dataset, and the commands that take long on it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};

use super::run::{Ended, Run};

/// A command that takes long.
pub struct LongCommand {
    /// Its name.
    pub name: &'static str,
    /// Its words.
    pub words: &'static str,
    /// Folders of what it reads.
    pub inputs: &'static [&'static str],
    /// Outputs: files and folders.
    pub outputs: &'static [&'static str],
    /// Output files that a folder may be in the way of.
    pub blockable: &'static [&'static str],
    /// Tables each row of which is of one frame alone, whatever becomes of the others.
    pub tables: &'static [&'static str],
    /// Files of its outputs, and beside them, that grow while it is at work: journals and tables.
    pub growing: &'static [&'static str],
}

/// Those that are tried.
pub const COMMANDS: &[LongCommand] = &[
    LongCommand {
        name: "refine",
        words: "refine --dataset ds --poses ds/init_low.csv --out r.csv --details r.npz --report page",
        inputs: &["ds"],
        outputs: &["r.csv", "r.csv.times.csv", "r.npz", "page"],
        blockable: &["r.csv", "r.csv.times.csv", "r.npz", "page/index.html"],
        tables: &["r.csv"],
        growing: &["r.csv.journal"],
    },
    LongCommand {
        name: "initial",
        words: "initial --dataset ds --search --out i.csv",
        inputs: &["ds"],
        outputs: &["i.csv", "i.csv.hypotheses.csv"],
        blockable: &["i.csv", "i.csv.hypotheses.csv"],
        tables: &["i.csv", "i.csv.hypotheses.csv"],
        growing: &["i.csv.journal"],
    },
    LongCommand {
        name: "track",
        // Its report has times, which are never the same.
        words: "track --dataset ds --scene 21 --poses first.csv --out t.csv",
        inputs: &["ds/test/000021", "ds/models", "ds/hand"],
        outputs: &["t.csv"],
        blockable: &["t.csv"],
        tables: &[],
        growing: &[],
    },
    LongCommand {
        name: "study",
        words: "study noise --dataset ds --iterations 2 --out st.csv --report stpage",
        inputs: &["ds"],
        outputs: &["st.csv", "stpage"],
        blockable: &["stpage/index.html"],
        tables: &[],
        growing: &["st.csv"],
    },
    LongCommand {
        name: "calibrate",
        words: "calibrate --dataset ds --poses ds/init_low.csv --out rig.json",
        inputs: &["ds"],
        outputs: &["rig.json", "rig.models"],
        blockable: &["rig.json"],
        tables: &[],
        growing: &[],
    },
    LongCommand {
        name: "synth",
        words: "synth --objects 061_foam_brick --frames 4 --out made",
        inputs: &[],
        outputs: &["made"],
        blockable: &["made/test/000021/scene_gt.json", "made/test_targets_bop19.json"],
        tables: &[],
        growing: &["made/test/000021/journal.jsonl"],
    },
    LongCommand {
        name: "export",
        words: "export --dataset ds --scene 21 --poses ds/init_low.csv --glb f.glb",
        inputs: &["ds/test/000021", "ds/models", "ds/hand"],
        outputs: &["f.glb"],
        blockable: &["f.glb"],
        tables: &[],
        growing: &[],
    },
];

/// Files by their paths in a folder.
pub(super) type Files = BTreeMap<PathBuf, Vec<u8>>;

/// The folder.
pub struct Place {
    folder: tempfile::TempDir,
    program: PathBuf,
}

impl Place {
    /// With a dataset that `program`, the command `prehend`, makes; its path is absolute, for it is run elsewhere.
    ///
    /// # Errors
    /// If it cannot.
    pub fn new(program: PathBuf) -> Result<Self> {
        let place = Self { folder: tempfile::tempdir()?, program };
        let made = place
            .run("synth --objects 061_foam_brick,006_mustard_bottle --frames 3 --out ds")
            .end()?;
        ensure!(made.code == Some(0), "no dataset: {}", made.error);
        let poses = fs::read_to_string(place.path("ds/init_low.csv"))?;
        let first: Vec<&str> = poses
            .lines()
            .filter(|line| line.starts_with("scene") || line.starts_with("21,0,"))
            .collect();
        fs::write(place.path("first.csv"), first.join("\n") + "\n")?;
        Ok(place)
    }

    /// A file or folder in it.
    pub fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program with these words, to be run here.
    pub(super) fn run(&self, words: &str) -> Run {
        Run::new(&self.program, words, self.folder.path())
    }

    /// Removes what `command` wrote.
    pub(super) fn clear(&self, command: &LongCommand) -> Result<()> {
        for name in command.outputs.iter().chain(command.growing) {
            let path = self.path(name);
            match fs::symlink_metadata(&path) {
                Ok(there) if there.is_dir() => fs::remove_dir_all(path)?,
                Ok(_) => fs::remove_file(path)?,
                Err(_) => {}
            }
        }
        Ok(())
    }

    /// Files that `command` has written, but for hidden ones.
    pub(super) fn written(&self, command: &LongCommand) -> Result<Files> {
        let mut files = Files::new();
        for name in command.outputs {
            gather(&self.path(name), Path::new(name), &mut files)?;
        }
        files.values_mut().for_each(without_seconds);
        Ok(files)
    }

    /// Runs `command` from nothing to its end: what it writes, and what it said.
    pub(super) fn reference(&self, command: &LongCommand) -> Result<(Files, Ended)> {
        self.clear(command)?;
        let ended = self.run(command.words).end()?;
        ensure!(ended.code == Some(0), "{}: {}", command.name, ended.error);
        Ok((self.written(command)?, ended))
    }
}

/// Empties the column `seconds` of a CSV table that has one.
fn without_seconds(content: &mut Vec<u8>) {
    let Ok(text) = std::str::from_utf8(content) else { return };
    let columns: Vec<&str> = text.lines().next().unwrap_or_default().split(',').collect();
    let Some(column) = columns.iter().position(|name| *name == "seconds") else { return };
    let line = |line: &str| {
        let cells = line.split(',').enumerate();
        cells.map(|(k, cell)| if k == column { "" } else { cell }).collect::<Vec<_>>().join(",")
    };
    *content = text.split('\n').map(line).collect::<Vec<_>>().join("\n").into_bytes();
}

fn gather(path: &Path, name: &Path, files: &mut Files) -> Result<()> {
    let is_hidden = name.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
    if is_hidden || !path.exists() {
        return Ok(());
    }
    if path.is_dir() {
        for entry in fs::read_dir(path)? {
            let entry = entry?;
            gather(&entry.path(), &name.join(entry.file_name()), files)?;
        }
    } else {
        files.insert(name.to_owned(), fs::read(path)?);
    }
    Ok(())
}
