//! A strategy of one's own: tries random poses near the initial one and polishes the best by robust ICP.
//!
//! `cargo run --release --example custom_strategy`

use std::ops::ControlFlow;

use prehend::geometry::SplitMix64;
use prehend::refine::baselines::Icp;
use prehend::refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend::refine::factor::{PointToPlaneFactor, PointToPlaneSettings};
use prehend::refine::problem::{Block, Factor, State};
use prehend::refine::scene::default_scene;
use prehend::refine::strategy::Observer;
use prehend::refine::{Estimate, PreparedFrame, RefineError, Strategy, refine};

/// Random restarts, then ICP.
struct RandomRestarts {
    /// Poses tried.
    count: usize,
    /// Standard deviations of their displacement \[m\] and rotation \[rad\] about each axis.
    spread: (f64, f64),
    icp: Icp,
}

impl Strategy for RandomRestarts {
    fn run(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        let depth = PointToPlaneFactor::new(frame, &PointToPlaneSettings::default())?;
        let mut random = SplitMix64::new(1);
        let mut best = (depth.cost(initial), initial.clone());
        for _ in 0..self.count {
            let scale = |k| if k < 3 { self.spread.0 } else { self.spread.1 };
            let twist: [f64; 6] = std::array::from_fn(|k| scale(k) * random.normal());
            let state = initial.retract(&[Block::ObjectPose], &twist);
            let cost = depth.cost(&state);
            if cost < best.0 {
                best = (cost, state);
            }
        }
        self.icp.run(frame, &best.1, observe)
    }

    fn iterations(&self) -> usize {
        self.icp.iterations()
    }
}

pub(crate) fn main() -> anyhow::Result<()> {
    let scene = default_scene(1)?;
    let frame = PreparedFrame::new(&scene.frame, &scene.object)?;
    let strategy = RandomRestarts { count: 300, spread: (0.01, 0.15), icp: Icp::robust() };
    let errors = |pose| (pe_cm(pose, &scene.truth), oe_deg(pose, &scene.truth));
    let (pe, oe) = errors(&scene.initial);
    println!("initial pose: {pe:.2} cm, {oe:.1}°");
    let estimate = refine(&frame, &scene.initial, &strategy)?;
    let (pe, oe) = errors(estimate.t_cam_object());
    println!("refined pose: {pe:.2} cm, {oe:.1}°");
    // An observer may end a refinement early.
    let start = State::new(&frame, &scene.initial)?;
    let mut iterations = 0;
    strategy.run(&frame, &start, &mut |progress| {
        iterations = progress.iteration;
        if progress.iteration < 5 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    })?;
    anyhow::ensure!(pe < 0.5 && iterations == 5);
    Ok(())
}
