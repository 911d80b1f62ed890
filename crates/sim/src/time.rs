//! Time steps.

/// One of the steps of a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Number of the step, from 0.
    pub index: usize,
    /// Time at its start \[s\].
    pub start: f64,
    /// Time step \[s\].
    pub dt: f64,
}

impl Step {
    /// Step number `index` of equal ones of `dt` \[s\].
    pub fn new(index: usize, dt: f64) -> Self {
        Self { index, start: index as f64 * dt, dt }
    }

    /// Time at its end \[s\].
    pub fn end(&self) -> f64 {
        self.start + self.dt
    }

    /// The step divided into `parts` equal ones.
    pub fn parts(self, parts: usize) -> impl Iterator<Item = Self> {
        let dt = self.dt / parts as f64;
        let part =
            move |k| Self { index: self.index * parts + k, start: self.start + k as f64 * dt, dt };
        (0..parts).map(part)
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
    /// The steps, the first of which starts at `time` \[s\].
    pub(crate) fn after(self, time: f64) -> impl DoubleEndedIterator<Item = Step> {
        let Self { dt, steps } = self;
        (0..steps).map(move |index| Step { index, start: time + index as f64 * dt, dt })
    }

    /// Time at the end of steps that start at `time` \[s\].
    pub(crate) fn end(self, time: f64) -> f64 {
        self.after(time).next_back().map_or(time, |last| last.end())
    }

    /// Time in steps no longer than `limit` \[s\], but no more than `max_steps` of them.
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
