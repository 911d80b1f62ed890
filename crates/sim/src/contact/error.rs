//! Errors of the parameters of a law or of a gap smoothing.

use thiserror::Error;

/// Parameters of a contact law or of a gap smoothing that cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LawError {
    /// A parameter is out of its range.
    #[error("{name} must be {range}, is {value}")]
    Range {
        /// Name of the parameter.
        name: &'static str,
        /// Range that it has to be in.
        range: &'static str,
        /// Its value.
        value: f64,
    },
    /// A parameter was not given.
    #[error("{name} is missing")]
    Missing {
        /// Name of the parameter.
        name: &'static str,
    },
    /// Too many parameters, or too few.
    #[error("{given} parameters for a law of {expected}")]
    Count {
        /// Number given.
        given: usize,
        /// Number that the law has.
        expected: usize,
    },
    /// The law has no parameter of that name.
    #[error("the law has no parameter called {name:?}: one of {known}")]
    NoParameter {
        /// The name.
        name: String,
        /// Those that it has, with commas between them.
        known: String,
    },
    /// There is no law of that name.
    #[error("there is no contact law called {name:?}: one of {known}")]
    Unknown {
        /// The name.
        name: String,
        /// Those that there are, with commas between them.
        known: String,
    },
}

impl LawError {
    /// The place of the parameter called `name` among those with these names, empty where they have none.
    ///
    /// # Errors
    /// [`LawError::NoParameter`] if there is none of that name.
    pub(crate) fn place_of(name: &str, names: &[&str]) -> Result<usize, Self> {
        let found = names.iter().position(|own| !name.is_empty() && *own == name);
        found.ok_or_else(|| {
            let known: Vec<&str> = names.iter().copied().filter(|name| !name.is_empty()).collect();
            Self::NoParameter { name: name.to_owned(), known: known.join(", ") }
        })
    }

    /// Name of the parameter that is missing or out of its range.
    pub fn name(&self) -> Option<&'static str> {
        match *self {
            Self::Range { name, .. } | Self::Missing { name } => Some(name),
            Self::Count { .. } | Self::NoParameter { .. } | Self::Unknown { .. } => None,
        }
    }
}
