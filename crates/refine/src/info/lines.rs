//! Lines of a name and what it is, one below the other.

use std::fmt::{Display, Formatter, Result};

/// Writes the line of `name`.
pub(super) fn line(f: &mut Formatter<'_>, name: &str, value: impl Display) -> Result {
    writeln!(f, "  {name:<15} {value}")
}

/// Numbers with spaces between them.
pub(super) fn spaced(numbers: &[f64], digits: usize) -> String {
    let texts: Vec<String> = numbers.iter().map(|v| format!("{v:.digits$}")).collect();
    texts.join(" ")
}

/// `none` for an empty list.
pub(super) fn listed<T: Display>(items: &[T]) -> String {
    match items {
        [] => "none".to_owned(),
        items => items.iter().map(T::to_string).collect::<Vec<_>>().join(", "),
    }
}
