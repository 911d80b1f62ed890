//! Sums by square tiles of the image.

use nalgebra::{Matrix6, Vector3, Vector6};

use super::cases::{Case, case, contour, softras, with_occluder};
use super::*;
use crate::mode::Mode;
use crate::pose_loss::{Counts, Loss, Tile};

/// A case with depth, a kernel and an occluder.
fn hidden_lump(mode: Mode, count: usize) -> Case {
    let options = LossOptions { kernel: RobustKernel::Huber { scale: 0.05 }, ..full_options() };
    let mesh = painted(lump(0.045, 24), 0.05);
    with_occluder(case("hidden lump", &mesh, lamp(), mode, options, Vector3::zeros(), count))
}

#[test]
fn tiles_agree_with_the_processor_and_add_up_to_the_whole() {
    let Some(gpu) = gpu("tiles_agree_with_the_processor_and_add_up_to_the_whole") else { return };
    for mode in [contour(1.0), softras(|_| ())] {
        let Case { mut problem, hypotheses, .. } = hidden_lump(mode, 3);
        let mut session = gpu.prepare(&problem).unwrap();
        let whole = session.linearize(&hypotheses).unwrap();
        for side in [1, 5, 8, 11, 14, 16, 37, 500, usize::MAX] {
            let cpu = problem.linearize_tiles(&hypotheses, side).unwrap();
            let gpu = session.linearize_tiles(&hypotheses, side).unwrap();
            assert_eq!((cpu.len(), gpu.len()), (3, 3));
            for ((cpu, gpu), whole) in cpu.iter().zip(&gpu).zip(&whole) {
                compare(side, cpu, gpu, whole);
            }
            // To the bit, alone or among others.
            assert_eq!(session.linearize_tiles(&hypotheses[1..2], side).unwrap()[0], gpu[1]);
        }
        // Nothing of it stays.
        assert_eq!(session.linearize(&hypotheses).unwrap(), whole);
    }
}

fn compare(side: usize, cpu: &[Tile], gpu: &[Tile], whole: &Linearized) {
    let place = |tile: &Tile| (tile.column, tile.row);
    assert!(gpu.windows(2).all(|pair| place(&pair[0]) < place(&pair[1])), "{side}");
    // What brings nothing may be left out.
    let counted = cpu.iter().filter(|tile| tile.at.loss.counts != Counts::default());
    let counted: Vec<&Tile> = counted.collect();
    assert!(gpu.iter().map(place).eq(counted.iter().map(|tile| place(tile))), "{side}");
    let mut worst = [0.0f64; 3];
    for (c, g) in counted.iter().zip(gpu) {
        assert_eq!(c.at.loss.counts, g.at.loss.counts, "{side}: {:?}", place(g));
        let errors = errors(&c.at, &g.at);
        // What is next to nothing need not be exact by itself, nor are single pixels.
        let least = if side < 8 { 1.0 } else { 1e-2 };
        let scale = |of: fn(&Linearized) -> f64| (of(&c.at) / of(whole)).min(least) / least;
        let scales =
            [scale(|l| l.loss.total), scale(|l| l.gradient.norm()), scale(|l| l.hessian.norm())];
        (0..3).for_each(|i| worst[i] = worst[i].max(errors[i] * scales[i]));
    }
    println!("{} tiles of {side}: loss, gradient, JtJ {worst:?}", gpu.len());
    assert!(worst.iter().all(|e| *e < 1e-4), "{side}: {worst:?}");
    let sum = Linearized {
        loss: Loss { total: gpu.iter().map(|t| t.at.loss.total).sum(), ..whole.loss },
        gradient: gpu.iter().map(|t| t.at.gradient).sum::<Vector6<f64>>(),
        hessian: gpu.iter().map(|t| t.at.hessian).sum::<Matrix6<f64>>(),
    };
    assert!(errors(whole, &sum).iter().all(|e| *e < 1e-5), "{side}: {:?}", errors(whole, &sum));
    if side >= 160 {
        assert_eq!(gpu[0].at, *whole);
    }
}

#[test]
fn tiles_are_split_into_batches_and_buffers_grow() {
    let Some(gpu) = gpu("tiles_are_split_into_batches_and_buffers_grow") else { return };
    let Case { problem, hypotheses, .. } = hidden_lump(contour(1.0), 7);
    let mut session = GpuSession::new(gpu.device.clone(), &problem).unwrap();
    let expected = session.linearize_tiles(&hypotheses, 11).unwrap();
    let whole = session.linearize(&hypotheses).unwrap();
    session.capacity = Capacity { entries: 1, segments: 1, pieces: 1 };
    // In turns.
    session.budget = 6_000_000;
    assert_eq!(session.linearize_tiles(&hypotheses, 11).unwrap(), expected);
    assert_eq!(session.linearize(&hypotheses).unwrap(), whole);
    // An error leaves the other calls as they were.
    session.budget = 1000;
    assert!(matches!(session.linearize_tiles(&hypotheses, 11), Err(BackendError::TooLarge { .. })));
    session.budget = 1 << 30;
    assert_eq!(session.linearize(&hypotheses).unwrap(), whole);
    assert_eq!(session.linearize_tiles(&[], 11).unwrap(), Vec::<Vec<Tile>>::new());
}
