//! Findings about a law.

/// One thing that was tried.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Finding {
    /// Measured quantity, with its unit.
    pub(crate) what: String,
    /// Measured value, in the unit of `what`.
    pub(crate) measured: f64,
    /// Verdict on it.
    pub(crate) verdict: Verdict,
    /// Expected value, or meaning.
    pub(crate) remark: String,
}

/// Verdict on a finding.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Verdict {
    /// As it should be.
    Sound,
    /// A property of the law, neither good nor bad.
    Note,
    /// A law must not do that.
    Wrong,
}

impl Verdict {
    /// A word for it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Sound => "sound",
            Self::Note => "note",
            Self::Wrong => "WRONG",
        }
    }

    pub(crate) fn when(sound: bool) -> Self {
        if sound { Self::Sound } else { Self::Wrong }
    }
}
