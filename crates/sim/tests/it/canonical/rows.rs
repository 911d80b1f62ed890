//! Canonical problems, and how their results are judged and printed.

use super::integrators::Scheme;
use super::laws::Law;

/// A problem with a closed form.
pub(crate) struct Problem {
    pub(crate) name: &'static str,
    pub(crate) over: Over,
}

/// Problem as a function of integrator, law or both; without rows where it does not apply.
pub(crate) enum Over {
    Integrators(fn(&Scheme) -> Vec<Row>),
    Laws(fn(&Law) -> Vec<Row>),
    Pairs(fn(&Scheme, &Law) -> Vec<Row>),
}

/// One measured quantity beside its closed form.
pub(crate) struct Row {
    quantity: String,
    measured: f64,
    expected: f64,
    judged: Judged,
}

#[derive(Clone, Copy)]
enum Judged {
    Within(f64),
    AtMost,
}

impl Row {
    /// `measured` should equal `expected` to within `tolerance`.
    pub(crate) fn new(
        quantity: impl Into<String>,
        measured: f64,
        expected: f64,
        tolerance: f64,
    ) -> Self {
        let judged = Judged::Within(tolerance);
        Self { quantity: quantity.into(), measured, expected, judged }
    }

    /// `measured` should equal `expected` to within a fraction `tolerance` of it.
    pub(crate) fn relative(
        quantity: impl Into<String>,
        measured: f64,
        expected: f64,
        tolerance: f64,
    ) -> Self {
        Self::new(quantity, measured, expected, tolerance * expected.abs())
    }

    /// `measured` should not exceed `bound`.
    pub(crate) fn at_most(quantity: impl Into<String>, measured: f64, bound: f64) -> Self {
        Self { quantity: quantity.into(), measured, expected: bound, judged: Judged::AtMost }
    }

    /// Whether it does; not a number never does.
    pub(crate) fn is_met(&self) -> bool {
        match self.judged {
            Judged::Within(tolerance) => (self.measured - self.expected).abs() <= tolerance,
            Judged::AtMost => self.measured <= self.expected,
        }
    }
}

/// The first line of the table.
pub(crate) fn heading() -> String {
    format!(
        "{:<24} {:<38} {:<20} {:<16} {:>14} {:>14} {:>9} {:>9} verdict",
        "problem", "quantity", "integrator", "law", "measured", "closed form", "error", "tolerance"
    )
}

/// One line of the table.
pub(crate) fn line(problem: &str, integrator: &str, law: &str, row: &Row) -> String {
    let Row { quantity, measured, expected, judged } = row;
    let (sign, tolerance) = match judged {
        Judged::Within(tolerance) => ("", format!("{tolerance:.1e}")),
        Judged::AtMost => ("≤ ", String::new()),
    };
    let (expected_text, error) = (format!("{sign}{expected:.7}"), (measured - expected).abs());
    let verdict = if row.is_met() { "ok" } else { "MISSED" };
    format!(
        "{problem:<24} {quantity:<38} {integrator:<20} {law:<16} {measured:>14.7} {expected_text:>14} \
         {error:>9.1e} {tolerance:>9} {verdict}"
    )
}

#[test]
fn what_is_out_of_tolerance_is_missed() {
    assert!(Row::new("", 1.0, 1.1, 0.11).is_met() && !Row::new("", 1.0, 1.1, 0.09).is_met());
    assert!(Row::at_most("", 1.0, 1.0).is_met() && !Row::at_most("", 1.1, 1.0).is_met());
    assert!(!Row::new("", f64::NAN, 0.0, f64::INFINITY).is_met());
    assert!(!Row::at_most("", f64::NAN, 1.0).is_met());
    assert!(line("p", "i", "l", &Row::relative("q", 2.0, 1.0, 0.5)).ends_with("MISSED"));
}
