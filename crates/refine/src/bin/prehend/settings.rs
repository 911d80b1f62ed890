//! `prehend settings`, and the options by which other commands take settings.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use prehend_refine::Settings;

use crate::terminal::say;

/// Settings of estimator, search, tracker and calibration.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct SettingsOptions {
    /// Take settings from this TOML file; `prehend settings` prints one with all of them, and what each is
    #[arg(long, value_name = "FILE")]
    settings: Option<PathBuf>,
    /// Change one setting, such as estimator.patches.sigma=1.5e-3, after --settings; may be repeated
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
}

/// A name and a value with = between them.
pub(crate) fn assignment(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("not of the form NAME=VALUE")?;
    Ok((name.to_owned(), value.to_owned()))
}

impl SettingsOptions {
    /// True if any are given: else the defaults are in effect.
    pub(crate) fn is_given(&self) -> bool {
        self.settings.is_some() || !self.set.is_empty()
    }

    /// The settings in effect.
    pub(crate) fn load(&self) -> anyhow::Result<Settings> {
        let mut settings = match &self.settings {
            Some(file) => Settings::load(file)?,
            None => Settings::default(),
        };
        for (name, value) in &self.set {
            let set = settings.set(name, value);
            set.map_err(|error| anyhow::anyhow!("--set {name}={value}: {error}"))?;
        }
        Ok(settings)
    }
}

#[derive(Args)]
pub(crate) struct PrintSettings {
    #[command(flatten)]
    settings: SettingsOptions,
}

impl PrintSettings {
    /// Prints the settings in effect.
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        say(self.settings.load()?.document()?.trim_end())?;
        Ok(ExitCode::SUCCESS)
    }
}
