//! What goes wrong with recordings.

use std::io;
use std::path::PathBuf;

/// Why a recording could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be opened, read or written.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The file is no MCAP file, or is broken from some place on.
    #[error("{}: {source}", file.display())]
    Format {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        source: mcap::McapError,
    },
    /// A topic is missing, ambiguous, or has something else than is expected.
    #[error("{}: {topic}: {problem}", file.display())]
    Topic {
        /// The file.
        file: PathBuf,
        /// Name of the topic, or what is looked for.
        topic: String,
        /// What is wrong with it.
        problem: String,
    },
}
