//! Attributes as numbers, switches and keywords.

use super::element::Element;
use super::error::Result;

/// A switch that may be left to the presence of a range.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Limited {
    /// Limited, whatever the range.
    Yes,
    /// Not limited, whatever the range.
    No,
    /// Limited where the range is not empty.
    #[default]
    Auto,
}

/// Attributes of the positions of a joint or tendon.
pub(super) const RANGE: [&str; 2] = ["limited", "range"];

/// Attributes of the actuators' forces on a joint or tendon.
pub(super) const FORCE_RANGE: [&str; 2] = ["actuatorfrclimited", "actuatorfrcrange"];

/// A range, and whether it limits.
#[derive(Clone, Copy, Default)]
pub(super) struct Limits {
    pub(super) range: [f64; 2],
    pub(super) limited: Limited,
}

impl Limits {
    pub(super) fn read(&mut self, e: &Element, [limited, range]: [&'static str; 2]) -> Result<()> {
        self.range = e.numbers(range)?.unwrap_or(self.range);
        self.limited = e.limited(limited)?.unwrap_or(self.limited);
        Ok(())
    }
}

/// Larger numbers are mistakes, and products of some of them without end.
const LARGEST: f64 = 1e30;

impl Element {
    /// A finite number.
    pub(super) fn number(&self, field: &'static str) -> Result<Option<f64>> {
        Ok(self.numbers::<1>(field)?.map(|[x]| x))
    }

    /// A finite number that is not negative.
    pub(super) fn magnitude(&self, field: &'static str) -> Result<Option<f64>> {
        match self.number(field)? {
            Some(x) if x < 0.0 => Err(self.invalid(field, "must not be negative")),
            x => Ok(x),
        }
    }

    /// Exactly `N` finite numbers.
    pub(super) fn numbers<const N: usize>(&self, field: &'static str) -> Result<Option<[f64; N]>> {
        let Some(list) = self.list(field, N)? else { return Ok(None) };
        let count = list.len();
        let exact = |_| self.invalid(field, format!("must have {N} numbers, not {count}"));
        list.try_into().map(Some).map_err(exact)
    }

    /// Replaces the first numbers of `values` by those given, of which there may be fewer.
    pub(super) fn leading(&self, field: &'static str, values: &mut [f64]) -> Result<()> {
        let list = self.list(field, values.len())?.unwrap_or_default();
        values.iter_mut().zip(list).for_each(|(old, new)| *old = new);
        Ok(())
    }

    /// Any finite numbers, at most `most` of them.
    pub(super) fn list(&self, field: &'static str, most: usize) -> Result<Option<Vec<f64>>> {
        let Some(text) = self.text(field) else { return Ok(None) };
        let mut numbers = Vec::new();
        for word in text.split_whitespace() {
            let number = word.parse::<f64>().ok().filter(|x| x.abs() <= LARGEST);
            let Some(number) = number else {
                let reason = format!("has '{word}', which is no number up to {LARGEST:e}");
                return Err(self.invalid(field, reason));
            };
            if numbers.len() == most {
                return Err(self.invalid(field, format!("has more than {most} numbers")));
            }
            numbers.push(number);
        }
        Ok(Some(numbers))
    }

    /// The coefficients of a polynomial without a constant, up to the third power; the first is not negative.
    pub(super) fn coefficients(&self, field: &'static str) -> Result<Option<[f64; 3]>> {
        let Some(list) = self.list(field, 3)? else { return Ok(None) };
        let mut all = [0.0; 3];
        all[..list.len()].copy_from_slice(&list);
        if all[0] < 0.0 { Err(self.invalid(field, "must not be negative")) } else { Ok(Some(all)) }
    }

    /// A whole number.
    pub(super) fn integer<T: TryFrom<i64>>(&self, field: &'static str) -> Result<Option<T>> {
        let Some(text) = self.text(field) else { return Ok(None) };
        let number = text.trim().parse::<i64>().ok().and_then(|x| T::try_from(x).ok());
        match number {
            Some(x) => Ok(Some(x)),
            None => Err(self.invalid(field, format!("is '{text}', no whole number in range"))),
        }
    }

    /// One of `words`.
    pub(super) fn keyword<T: Copy>(
        &self,
        field: &'static str,
        words: &[(&str, T)],
    ) -> Result<Option<T>> {
        let Some(text) = self.text(field) else { return Ok(None) };
        match words.iter().find(|(word, _)| *word == text.trim()) {
            Some((_, value)) => Ok(Some(*value)),
            None => {
                let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
                Err(self.invalid(field, format!("is '{text}', none of: {}", known.join(", "))))
            }
        }
    }

    /// `true` or `false`.
    pub(super) fn switch(&self, field: &'static str) -> Result<Option<bool>> {
        self.keyword(field, &[("true", true), ("false", false)])
    }

    /// `true`, `false` or `auto`.
    pub(super) fn limited(&self, field: &'static str) -> Result<Option<Limited>> {
        let words = [("true", Limited::Yes), ("false", Limited::No), ("auto", Limited::Auto)];
        self.keyword(field, &words)
    }
}
