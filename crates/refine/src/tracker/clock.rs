//! Computation time of a frame, and its budget.

use std::time::{Duration, Instant};

/// Computation time of a frame, by task.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timing {
    /// Preparing images, points and factors.
    pub preparation: Duration,
    /// Evaluating factors and solving for steps.
    pub steps: Duration,
    /// Covariances and checks.
    pub validation: Duration,
    /// Finding an object that was not followed: all that it takes.
    pub recovery: Duration,
}

impl Timing {
    /// All of it.
    pub fn total(&self) -> Duration {
        self.preparation + self.steps + self.validation + self.recovery
    }
}

/// Runs from the beginning of a frame.
pub(super) struct Clock {
    start: Instant,
    budget: Option<Duration>,
    last_lap: Instant,
}

impl Clock {
    pub(super) fn start(budget: Option<Duration>) -> Self {
        let start = Instant::now();
        Self { start, budget, last_lap: start }
    }

    /// Time since the lap before.
    pub(super) fn lap(&mut self) -> Duration {
        let now = Instant::now();
        let lap = now - self.last_lap;
        self.last_lap = now;
        lap
    }

    /// Whether something that takes `duration` would end in time.
    pub(super) fn has(&self, duration: Duration) -> bool {
        self.budget.is_none_or(|budget| self.start.elapsed() + duration < budget)
    }
}
