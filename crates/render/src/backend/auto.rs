//! The best device at hand, with the processor to fall back on.

use super::{Backend, BackendError, Cpu, Hypothesis, PoseProblem, Session};
use crate::pose_loss::{Linearised, Loss, PoseImage};

/// Another backend while it works, and the processor from its first failure on.
///
/// A problem that the device cannot take, a device that is lost, runs out of memory or fails in any other way costs a
/// warning in the log, and the call at hand is answered by the processor.
#[derive(Debug)]
pub struct WithFallback<B>(pub B);

/// The graphics device of this machine with the processor to fall back on, or the processor where there is none.
///
/// Software adapters do not count, since the processor by itself is faster, unless the environment variable
/// `PREHEND_SOFTWARE_GPU` is `1`.
pub fn auto() -> Box<dyn Backend> {
    #[cfg(feature = "gpu")]
    {
        let software = std::env::var("PREHEND_SOFTWARE_GPU").is_ok_and(|v| v == "1");
        let gpu = if software { super::Gpu::with_software() } else { super::Gpu::new() };
        match gpu {
            Ok(gpu) => return Box::new(WithFallback(gpu)),
            Err(BackendError::NoDevice(reason)) => log::debug!("no graphics device: {reason}"),
            Err(error) => log::warn!("{error}; continuing on the CPU"),
        }
    }
    Box::new(Cpu)
}

impl<B: Backend> Backend for WithFallback<B> {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn prepare(&self, problem: &PoseProblem) -> Result<Box<dyn Session>, BackendError> {
        let device = self.0.prepare(problem).map_err(warn).ok();
        Ok(Box::new(FallbackSession { device, processor: problem.clone() }))
    }
}

struct FallbackSession {
    /// Gone after its first failure.
    device: Option<Box<dyn Session>>,
    processor: PoseProblem,
}

impl FallbackSession {
    fn run<T>(
        &mut self,
        call: impl Fn(&mut dyn Session) -> Result<T, BackendError>,
    ) -> Result<T, BackendError> {
        if let Some(device) = &mut self.device {
            match call(device.as_mut()) {
                Ok(answer) => return Ok(answer),
                Err(error) => {
                    warn(error);
                    self.device = None;
                }
            }
        }
        call(&mut self.processor)
    }
}

fn warn(error: BackendError) {
    log::warn!("{error}; continuing on the CPU");
}

impl Session for FallbackSession {
    fn evaluate(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Loss>, BackendError> {
        self.run(|session| session.evaluate(hypotheses))
    }

    fn linearise(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Linearised>, BackendError> {
        self.run(|session| session.linearise(hypotheses))
    }

    fn render(&mut self, hypothesis: &Hypothesis) -> Result<PoseImage, BackendError> {
        self.run(|session| session.render(hypothesis))
    }
}
