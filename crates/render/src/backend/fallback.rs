//! A device with the processor to fall back on.

use super::{Backend, BackendError, Hypothesis, PoseProblem, Session};
use crate::pose_loss::{Linearized, Loss, PoseImage, Tile};

/// Another backend while it works, and the processor from its first failure on.
///
/// A problem that the device cannot take, a device that is lost, runs out of memory or fails in any other way costs a
/// warning in the log, and the call at hand is answered by the processor.
#[derive(Debug)]
pub struct WithFallback<B>(pub B);

impl<B: Backend> Backend for WithFallback<B> {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn prepare(&self, problem: &PoseProblem) -> Result<Box<dyn Session>, BackendError> {
        problem.loss.check()?;
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
    fn name(&self) -> &str {
        self.device.as_ref().map_or(self.processor.name(), |device| device.name())
    }

    fn evaluate(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Loss>, BackendError> {
        self.run(|session| session.evaluate(hypotheses))
    }

    fn linearize(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Linearized>, BackendError> {
        self.run(|session| session.linearize(hypotheses))
    }

    fn linearize_tiles(
        &mut self,
        hypotheses: &[Hypothesis],
        side: usize,
    ) -> Result<Vec<Vec<Tile>>, BackendError> {
        self.run(|session| session.linearize_tiles(hypotheses, side))
    }

    fn render(&mut self, hypothesis: &Hypothesis) -> Result<PoseImage, BackendError> {
        self.run(|session| session.render(hypothesis))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Vector3;
    use prehend_geometry::shapes::cuboid;

    use super::*;
    use crate::light::Light;
    use crate::model::RenderModel;
    use crate::pose_loss::PoseLoss;
    use crate::pose_loss::tests::{Noise, pose, target_of};

    /// A device that is lost in its second call, and must not be asked again.
    struct Fragile(PoseProblem, usize);

    fn lost() -> BackendError {
        BackendError::Device { device: "test".into(), reason: "lost".into() }
    }

    impl Session for Fragile {
        fn name(&self) -> &str {
            "fragile"
        }

        fn evaluate(&mut self, _: &[Hypothesis]) -> Result<Vec<Loss>, BackendError> {
            panic!("asked after its failure")
        }

        fn linearize(&mut self, h: &[Hypothesis]) -> Result<Vec<Linearized>, BackendError> {
            self.1 += 1;
            assert!(self.1 <= 2, "asked after its failure");
            if self.1 == 1 { self.0.linearize(&h[..0]) } else { Err(lost()) }
        }

        fn linearize_tiles(
            &mut self,
            _: &[Hypothesis],
            _: usize,
        ) -> Result<Vec<Vec<Tile>>, BackendError> {
            panic!("asked after its failure")
        }

        fn render(&mut self, _: &Hypothesis) -> Result<PoseImage, BackendError> {
            panic!("asked after its failure")
        }
    }

    /// Takes problems only if its flag says so.
    struct FragileBackend(bool);

    impl Backend for FragileBackend {
        fn name(&self) -> &str {
            "fragile"
        }

        fn prepare(&self, problem: &PoseProblem) -> Result<Box<dyn Session>, BackendError> {
            if self.0 { Ok(Box::new(Fragile(problem.clone(), 0))) } else { Err(lost()) }
        }
    }

    #[test]
    fn a_failing_device_is_replaced_by_the_processor_in_the_same_call() {
        let model = RenderModel::new(&cuboid(Vector3::new(0.06, 0.08, 0.1))).unwrap();
        let (light, t_cam_object) = (Light::headlight(0.4, 0.5), pose(&mut Noise(2)));
        let target = Arc::new(target_of(&model, &t_cam_object, &light, None, 0.5));
        let mut problem = PoseProblem { model: Arc::new(model), target, loss: PoseLoss::default() };
        let hypotheses = [Hypothesis { t_cam_object, light }];
        let expected = problem.linearize(&hypotheses).unwrap();
        let mut session = WithFallback(FragileBackend(true)).prepare(&problem).unwrap();
        // The device's own answer, then the processor's.
        assert_eq!(session.linearize(&hypotheses).unwrap(), []);
        assert_eq!(session.name(), "fragile");
        assert_eq!(session.linearize(&hypotheses).unwrap(), expected);
        assert_eq!(session.linearize(&hypotheses).unwrap(), expected);
        assert_eq!(session.name(), "CPU");
        assert_eq!(session.evaluate(&hypotheses).unwrap()[0], expected[0].loss);
        assert!(session.render(&hypotheses[0]).is_ok());
        let mut session = WithFallback(FragileBackend(false)).prepare(&problem).unwrap();
        assert_eq!(session.linearize(&hypotheses).unwrap(), expected);
    }
}
