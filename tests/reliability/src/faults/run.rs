//! A run of the program that may be interrupted.

use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

/// No command here takes as long.
const HANG: Duration = Duration::from_secs(300);

/// A run that has not begun.
pub(super) struct Run {
    command: Command,
}

/// How a run ended.
pub(super) struct Ended {
    /// None of one that a signal ended.
    pub(super) code: Option<i32>,
    pub(super) error: String,
    pub(super) took: Duration,
    pub(super) hung: bool,
}

impl Run {
    pub(super) fn new(program: &Path, words: &str, folder: &Path) -> Self {
        // Writing beyond a limit is then an error like that of a full disk, and no signal.
        let mut command = Command::new("sh");
        command.args([
            "-c",
            "trap '' XFSZ; ulimit -f ${PREHEND_BLOCKS:-unlimited}; exec \"$@\"",
            "sh",
        ]);
        command.arg(program).args(words.split_whitespace()).current_dir(folder);
        command.env("PREHEND_CACHE", "").env_remove("PREHEND_LOG").env_remove("PREHEND_BLOCKS");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        Self { command }
    }

    /// With files no longer than so many blocks of 512 bytes, as if the disk were full behind them.
    pub(super) fn with_blocks(mut self, blocks: usize) -> Self {
        self.command.env("PREHEND_BLOCKS", blocks.to_string());
        self
    }

    /// With so many threads, where the command has that option.
    pub(super) fn with_threads(mut self, threads: usize) -> Self {
        self.command.args(["--threads", &threads.to_string()]);
        self
    }

    /// To the end.
    pub(super) fn end(self) -> Result<Ended> {
        self.interrupted(HANG, |_| Ok(()))
    }

    /// To the end, but for what `interrupt` does to it after a while.
    pub(super) fn interrupted(
        mut self,
        after: Duration,
        interrupt: impl FnOnce(&mut Child) -> Result<()>,
    ) -> Result<Ended> {
        let start = Instant::now();
        let mut child = self.command.spawn().context("sh")?;
        let mut pipe = child.stderr.take().context("no standard error")?;
        let reader = thread::spawn(move || {
            let mut text = Vec::new();
            pipe.read_to_end(&mut text).map(|_| String::from_utf8_lossy(&text).into_owned())
        });
        let mut interrupt = Some(interrupt);
        let (mut hung, mut status, mut interrupted) = (false, None, Ok(()));
        while status.is_none() {
            status = child.try_wait()?;
            if status.is_none()
                && start.elapsed() >= after
                && let Some(interrupt) = interrupt.take()
            {
                interrupted = interrupt(&mut child);
                if interrupted.is_err() {
                    child.kill()?;
                }
            }
            if start.elapsed() > HANG && !hung {
                hung = true;
                child.kill()?;
            }
            thread::sleep(Duration::from_micros(500));
        }
        let error = reader.join().ok().context("no standard error")??;
        interrupted?;
        let code = status.and_then(|status| status.code());
        Ok(Ended { code, error, took: start.elapsed(), hung })
    }
}
