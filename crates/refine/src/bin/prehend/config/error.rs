//! What can be wrong with options.

use std::path::PathBuf;

use thiserror::Error;

/// A fault of a file of options.
#[derive(Debug, Error)]
pub(crate) enum ConfigError {
    /// It cannot be read.
    #[error("{}: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// It is no TOML.
    #[error("{}: line {line}: {problem}", file.display())]
    Syntax {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What the parser says.
        problem: String,
    },
    /// A key that is no option, or a value that it cannot take.
    #[error("{}: {field}: {problem}", file.display())]
    Field {
        /// The file.
        file: PathBuf,
        /// The key with its table, such as `refine.seed`.
        field: String,
        /// What is wrong.
        problem: String,
    },
    /// A value that a file of options cannot hold.
    #[error("--{option}: TOML has no text that is not UTF-8")]
    Text {
        /// The option's name.
        option: String,
    },
}

/// Why there is nothing to run.
#[derive(Debug, Error)]
pub(crate) enum ReadError {
    /// The command line is wrong, or asks for help.
    #[error(transparent)]
    Line(#[from] clap::Error),
    /// The file of options is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
}
