//! Rendering on another device: what it answers, and what happens when it fails.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::Isometry3;
use prehend_refine::baselines::Heuristic;
use prehend_refine::scene::{PreparedFrame, default_scene};
use prehend_refine::search::{PoseSearch, SearchSettings};
use prehend_refine::{Method, PoseFinder, refine};
use prehend_render::{
    Backend, BackendError, Hypothesis, Linearized, Loss, PoseProblem, Session, Tile,
};

/// A device that computes as the processor does, and is lost after some calls.
#[derive(Clone, Default)]
struct Fragile {
    /// Calls that it answers; all without a number.
    lasts: Option<usize>,
    calls: Arc<AtomicUsize>,
    most: Arc<AtomicUsize>,
}

struct FragileSession(PoseProblem, Fragile);

impl Backend for Fragile {
    fn name(&self) -> &str {
        "fragile"
    }

    fn prepare(&self, problem: &PoseProblem) -> Result<Box<dyn Session>, BackendError> {
        Ok(Box::new(FragileSession(problem.clone(), self.clone())))
    }
}

impl FragileSession {
    fn call(&self, hypotheses: usize) -> Result<(), BackendError> {
        let before = self.1.calls.fetch_add(1, Ordering::Relaxed);
        self.1.most.fetch_max(hypotheses, Ordering::Relaxed);
        if self.1.lasts.is_none_or(|lasts| before < lasts) {
            return Ok(());
        }
        Err(BackendError::Device { device: "fragile".into(), reason: "lost".into() })
    }
}

impl Session for FragileSession {
    fn evaluate(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Loss>, BackendError> {
        self.call(hypotheses.len())?;
        self.0.evaluate(hypotheses)
    }

    fn linearize(&mut self, hypotheses: &[Hypothesis]) -> Result<Vec<Linearized>, BackendError> {
        self.call(hypotheses.len())?;
        self.0.linearize(hypotheses)
    }

    fn linearize_tiles(
        &mut self,
        hypotheses: &[Hypothesis],
        side: usize,
    ) -> Result<Vec<Vec<Tile>>, BackendError> {
        self.call(hypotheses.len())?;
        self.0.linearize_tiles(hypotheses, side)
    }
}

/// The pose of the built-in scene that `method` finds, rendered by `backend`.
fn refined(method: &Method, backend: Option<Arc<dyn Backend>>) -> Isometry3<f64> {
    let scene = default_scene(1).unwrap();
    let mut frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
    if let Some(backend) = backend {
        frame = frame.with_backend(backend);
    }
    *refine(&frame, &scene.initial, method).unwrap().t_cam_object()
}

fn methods() -> [Method; 2] {
    let heuristic = Heuristic { iterations: 30, ..Heuristic::combined() };
    [Method::Fused(Box::default()), Method::Heuristic(Box::new(heuristic))]
}

#[test]
fn a_device_that_is_lost_midway_costs_no_frame() {
    for method in methods() {
        let expected = refined(&method, None);
        for lasts in [Some(0), Some(7), None] {
            let device = Fragile { lasts, ..Fragile::default() };
            let found = refined(&method, Some(Arc::new(device.clone())));
            assert_eq!(found, expected, "{lasts:?}");
            // A factor does not ask a lost device again.
            let calls = device.calls.load(Ordering::Relaxed);
            assert!(calls >= lasts.map_or(20, |lasts| lasts + 1), "{calls}");
            assert!(calls <= lasts.map_or(calls, |lasts| lasts + 8), "{calls}");
        }
    }
}

#[test]
fn hypotheses_go_to_the_device_together() {
    let scene = default_scene(1).unwrap();
    let device = Fragile::default();
    let found = |backend: Option<Arc<dyn Backend>>| {
        let mut frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
        if let Some(backend) = backend {
            frame = frame.with_backend(backend);
        }
        let settings = SearchSettings::default();
        PoseSearch::new(Arc::clone(&scene.object), settings).unwrap().find(&frame).unwrap()
    };
    assert_eq!(found(Some(Arc::new(device.clone()))), found(None));
    let most = device.most.load(Ordering::Relaxed);
    assert!(most > SearchSettings::default().seen, "{most}");
    let device = Fragile::default();
    refined(&methods()[0], Some(Arc::new(device.clone())));
    assert!(device.most.load(Ordering::Relaxed) > 3);
}

/// Within 0.05 mm and 0.05° of what the processor finds.
#[test]
#[cfg(feature = "gpu")]
fn a_graphics_device_finds_the_same_poses() {
    let gpu = match prehend_render::Gpu::with_software() {
        Ok(gpu) => gpu,
        Err(error) => {
            let required = std::env::var("PREHEND_REQUIRE_GPU").is_ok_and(|v| v == "1");
            assert!(!required, "{error}");
            println!("a_graphics_device_finds_the_same_poses skipped: {error}");
            return;
        }
    };
    for method in methods() {
        let [cpu, gpu] = [None, Some(Arc::new(gpu.clone()) as Arc<dyn Backend>)]
            .map(|backend| refined(&method, backend));
        let apart = (cpu.translation.vector - gpu.translation.vector).norm();
        let turned = cpu.rotation.angle_to(&gpu.rotation).to_degrees();
        println!("{:.4} mm, {turned:.4}°", 1e3 * apart);
        assert!(apart < 5e-5 && turned < 0.05, "{apart} m, {turned}°");
    }
}
