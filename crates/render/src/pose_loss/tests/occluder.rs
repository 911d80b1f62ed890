//! Known bodies in front of the object.

use super::*;
use crate::raster::depth_map;

#[test]
fn a_known_occluder_silences_what_it_hides() {
    let model = RenderModel::new(&painted(lump(0.045, 90), 0.05)).unwrap();
    let mut noise = Noise(21);
    let truth = pose(&mut noise);
    let bar = RenderModel::new(&cuboid(Vector3::new(0.024, 0.2, 0.02))).unwrap();
    let hand = depth_map(&camera(), &[(&bar, Isometry3::translation(0.005, 0.0, 0.3))]);
    let target = target_of(&model, &truth, &lamp(), Some(hand), 0.5);
    let loss = PoseLoss::new(Mode::default(), full_options());
    let guess =
        twisted(&truth, &(truth * model.center()), &[0.003, 0.001, -0.003, 0.05, -0.04, 0.05]);
    let (cosine, error) = compare_gradient(&loss, &model, &guess, &lamp(), &target);
    assert!(cosine > 0.999 && error < 0.03, "{cosine} {error}");
    let value = loss.evaluate(&model, &guess, &lamp(), &target);
    assert!(value.counts.hidden > 500, "{value:?}");
    // At the truth the hidden part costs nothing, while without the occluder it is all residual.
    let at_truth = loss.evaluate(&model, &truth, &lamp(), &target).total;
    let blind = Target { occluder: None, ..target.clone() };
    assert!(loss.evaluate(&model, &truth, &lamp(), &blind).total > 20.0 * at_truth);
    // Hidden altogether: neither covered pixels nor derivatives.
    let wall = target.with_occluder(DepthImage::filled(160, 120, 0.2)).unwrap();
    let nothing = loss.linearize(&model, &guess, &Point3::origin(), &lamp(), &wall);
    assert_eq!(nothing.gradient, Vector6::zeros());
    assert_eq!(nothing.loss.counts.covered, 0);
    // Hidden pixels of the mask cost nothing, or as much as if the object were not there at all.
    let counting =
        PoseLoss::new(Mode::default(), LossOptions { penalize_occluded: true, ..full_options() });
    let away = Isometry3::translation(9.0, 0.0, 0.4);
    let missed = counting.evaluate(&model, &away, &lamp(), &wall).total;
    let hidden = counting.linearize(&model, &guess, &Point3::origin(), &lamp(), &wall);
    assert!((hidden.loss.total - missed).abs() < 1e-9 && missed > 0.1);
    assert!(nothing.loss.total < 0.2 * missed, "{nothing:?}");
    assert_eq!(hidden.gradient, Vector6::zeros());
}
