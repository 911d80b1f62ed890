//! What went wrong along the way, said once at the end.

use std::process::ExitCode;

use crate::output::complain;

/// How a run over many frames ended.
pub(crate) struct Outcome {
    /// Frames that succeeded.
    pub(crate) done: usize,
    /// What failed, one line each.
    pub(crate) failures: Vec<String>,
}

impl Outcome {
    /// Prints the summary to standard error; the exit code is 0 if nothing failed, 2 if some frames did and
    /// 1 if nothing succeeded.
    pub(crate) fn exit_code(self) -> ExitCode {
        if self.failures.is_empty() {
            return ExitCode::SUCCESS;
        }
        complain(format!("\n{} done, {} failed:", self.done, self.failures.len()));
        self.failures.iter().for_each(|failure| complain(format!("  {failure}")));
        ExitCode::from(if self.done > 0 { 2 } else { 1 })
    }
}
