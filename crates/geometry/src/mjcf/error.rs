//! Errors of MJCF models, with file, line and element.

use std::fmt;
use std::path::PathBuf;

use super::warning::Warning;

/// Result of reading a part of a model.
pub(super) type Result<T, E = MjcfError> = std::result::Result<T, E>;

/// An element of a model's files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file; none where the model was given as text.
    pub file: Option<PathBuf>,
    /// The line of its start tag, from 1.
    pub line: u32,
    /// The tag.
    pub element: String,
    /// Its `name` attribute, empty where it has none.
    pub name: String,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.file {
            Some(file) => write!(f, "{}:{}: {}", file.display(), self.line, self.element)?,
            None => write!(f, "line {}: {}", self.line, self.element)?,
        }
        if self.name.is_empty() { Ok(()) } else { write!(f, " '{}'", self.name) }
    }
}

/// Why a model could not be read.
#[derive(Debug, thiserror::Error)]
pub enum MjcfError {
    /// A file of the model cannot be read.
    #[error("cannot read MJCF file {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// A file is not well-formed XML, or its outermost element is not `mujoco`.
    #[error("{}invalid MJCF: {message}", .file.as_ref().map(|f| format!("{}: ", f.display())).unwrap_or_default())]
    Xml {
        /// The file; none where the model was given as text.
        file: Option<PathBuf>,
        /// Message of the parser, with line and column where it gives them.
        message: String,
    },
    /// A model too large or nested too deeply.
    #[error("the model is too large: {count} {what}, at most {limit} are read")]
    TooLarge {
        /// Bytes, elements, or levels of tags.
        what: &'static str,
        /// How many.
        count: usize,
        /// How many are read.
        limit: usize,
    },
    /// A file that the model names cannot be used.
    #[error("{place}: file '{file}': {reason}")]
    File {
        /// The element that names it.
        place: Box<Place>,
        /// The file as the model names it.
        file: String,
        /// Why not.
        reason: String,
    },
    /// An attribute that is missing, or whose value does not fit.
    #[error("{place}: {field} {reason}")]
    Value {
        /// The element.
        place: Box<Place>,
        /// The attribute.
        field: &'static str,
        /// Reason, such as `must be positive` or `is missing`.
        reason: String,
    },
    /// Something that changes masses, degrees of freedom, contacts or actuation and is not supported.
    #[error("{0}: not supported (with `partial`, it is left out)")]
    Unsupported(Box<Warning>),
    /// An element that must not be where it is, or has the name of another.
    #[error("{place}: {reason}")]
    Structure {
        /// The element.
        place: Box<Place>,
        /// Reason, such as `the world has no joints`.
        reason: String,
    },
}
