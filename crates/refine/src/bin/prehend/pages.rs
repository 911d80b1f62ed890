//! `prehend completions` and `prehend man`: what shells and `man` know of the command.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::anyhow;
use clap::{Args, Command};
use clap_complete::Shell;
use prehend_refine::data::bop::create_folder;

use crate::terminal::say;

#[derive(Args)]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

impl Completions {
    /// Prints what completes the words of `command`.
    pub(crate) fn run(self, mut command: Command) -> anyhow::Result<ExitCode> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut command, "prehend", &mut script);
        say(String::from_utf8(script)?.trim_end())?;
        Ok(ExitCode::SUCCESS)
    }
}

#[derive(Args)]
pub(crate) struct Man {
    /// Write a page for each command to this folder, instead of printing the first
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    out: Option<PathBuf>,
}

impl Man {
    /// Writes the pages of `command`.
    pub(crate) fn run(self, command: Command) -> anyhow::Result<ExitCode> {
        if let Some(folder) = &self.out {
            create_folder(folder)?;
            clap_mangen::generate_to(command, folder)
                .map_err(|e| anyhow!("{}: {e}", folder.display()))?;
            return Ok(ExitCode::SUCCESS);
        }
        let mut page = Vec::new();
        clap_mangen::Man::new(command).render(&mut page)?;
        say(String::from_utf8(page)?.trim_end())?;
        Ok(ExitCode::SUCCESS)
    }
}
