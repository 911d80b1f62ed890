//! What is said of a law.

/// One thing that was tried.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Finding {
    /// What was measured, with its unit.
    pub(crate) what: String,
    /// The figure.
    pub(crate) measured: f64,
    /// What to think of it.
    pub(crate) verdict: Verdict,
    /// What was expected, or what it means.
    pub(crate) remark: String,
}

/// What to think of a finding.
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
