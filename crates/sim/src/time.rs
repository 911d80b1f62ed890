//! Time steps.

/// One of the steps of a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Number of the step, from 0.
    pub index: usize,
    /// Time step \[s\].
    pub dt: f64,
}

impl Step {
    /// Time at its start \[s\].
    pub fn time(&self) -> f64 {
        self.index as f64 * self.dt
    }

    /// The step that follows.
    #[must_use]
    pub fn after(self) -> Self {
        Self { index: self.index + 1, ..self }
    }

    /// The step divided into `parts` equal ones.
    pub fn parts(self, parts: usize) -> impl Iterator<Item = Self> {
        let (first, dt) = (self.index * parts, self.dt / parts as f64);
        (first..first + parts).map(move |index| Self { index, dt })
    }
}

/// All steps of a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeSteps {
    /// Time step \[s\].
    pub dt: f64,
    /// Number of steps.
    pub steps: usize,
}

impl TimeSteps {
    /// The same time in steps no longer than `limit` \[s\], but no more than `max_steps` of them.
    #[must_use]
    pub fn refined(self, limit: f64, max_steps: usize) -> Self {
        let time = self.dt * self.steps as f64;
        let most = max_steps.max(self.steps) as f64;
        // Without a limit that is a number the most is the safest.
        let wanted = if limit > 0.0 { (time / limit).ceil() } else { most };
        let steps = wanted.clamp(self.steps as f64, most);
        if steps < 1.0 { self } else { Self { dt: time / steps, steps: steps as usize } }
    }
}
