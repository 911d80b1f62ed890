//! What is said of a law.

/// One thing that was tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What was measured, with its unit.
    pub what: String,
    /// The figure.
    pub measured: f64,
    /// What to think of it.
    pub verdict: Verdict,
    /// What was expected, or what it means.
    pub remark: String,
}

/// What to think of a finding.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Verdict {
    /// As it should be.
    Sound,
    /// A property of the law, neither good nor bad.
    Note,
    /// A law must not do that.
    Wrong,
}

impl Verdict {
    /// A word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sound => "sound",
            Self::Note => "note",
            Self::Wrong => "WRONG",
        }
    }

    pub(super) fn when(sound: bool) -> Self {
        if sound { Self::Sound } else { Self::Wrong }
    }
}
