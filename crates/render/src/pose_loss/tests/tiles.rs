//! The loss by tiles, against the whole and against its own differences.

use super::*;

#[test]
fn tiles_add_up_and_each_has_the_derivatives_of_its_own_share() {
    let model = RenderModel::new(&painted(torus(0.04, 0.015, 60), 0.05)).unwrap();
    let truth = pose(&mut Noise(4));
    let target = target_of(&model, &truth, &lamp(), None, 0.0);
    let center = truth * model.center();
    let guess = twisted(&truth, &center, &[0.002, 0.001, -0.004, 0.03, -0.04, 0.03]);
    let loss = PoseLoss { options: full_options(), ..PoseLoss::default() };
    let tiles = |pose: &Isometry3<f64>, side| {
        loss.linearize_tiles(&model, pose, &center, &lamp(), &target, side)
    };
    let whole = loss.linearize(&model, &guess, &center, &lamp(), &target);
    let single = tiles(&guess, usize::MAX);
    assert_eq!((single.len(), single[0].column, single[0].row), (1, 0, 0));
    assert_eq!(single[0].at, whole);
    for side in [7, 16, 50] {
        let parts = tiles(&guess, side);
        assert!(parts.windows(2).all(|p| (p[0].column, p[0].row) < (p[1].column, p[1].row)));
        let total: f64 = parts.iter().map(|t| t.at.loss.total).sum();
        assert!((total / whole.loss.total - 1.0).abs() < 1e-5);
        let gradient: Vector6<f64> = parts.iter().map(|t| t.at.gradient).sum();
        assert!((gradient - whole.gradient).norm() < 1e-4 * whole.gradient.norm());
        let hessian: Matrix6<f64> = parts.iter().map(|t| t.at.hessian).sum();
        assert!((hessian - whole.hessian).norm() < 1e-5 * whole.hessian.norm());
    }
    // The share of one tile, as the pose moves.
    let of = |pose: &Isometry3<f64>, tile: &Tile| {
        let found = tiles(pose, 40);
        let same = found.iter().find(|t| (t.column, t.row) == (tile.column, tile.row));
        same.map_or(0.0, |t| t.at.loss.total)
    };
    let parts = tiles(&guess, 40);
    let strongest = |a: &&Tile, b: &&Tile| a.at.gradient.norm().total_cmp(&b.at.gradient.norm());
    let tile = parts.iter().max_by(strongest).unwrap();
    let step = 2e-5;
    let difference = Vector6::from_fn(|k, _| {
        let step = if k < 3 { step } else { 20.0 * step };
        let at = |sign: f64| of(&twisted(&guess, &center, &unit(k, sign * step)), tile);
        (at(1.0) - at(-1.0)) / (2.0 * step)
    });
    let cosine = difference.dot(&tile.at.gradient) / (difference.norm() * tile.at.gradient.norm());
    assert!(cosine > 0.99, "{cosine}: {difference:?} {:?}", tile.at.gradient);
}
