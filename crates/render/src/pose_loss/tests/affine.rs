//! The loss minimized over a correction of the colors.

use super::*;

/// An image of the object with another exposure and black level, and a pose next to the true one.
fn problem(seed: u64) -> (RenderModel, Isometry3<f64>, Target) {
    let model = RenderModel::new(&painted(lump(0.045, 90), 0.05)).unwrap();
    let mut noise = Noise(seed);
    let truth = pose(&mut noise);
    let affine = Affine { gain: [0.7, 1.2, 0.9], offset: [0.1, -0.05, 0.03] };
    let target = target_of(&model, &truth, &lamp().corrected(&affine), None, 0.5);
    let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.003 } else { 0.06 });
    let guess = twisted(&truth, &(truth * model.center()), &twist);
    (model, guess, target)
}

#[test]
fn gradients_are_those_of_the_minimum() {
    for (seed, robust) in [Robust::None, Robust::None, Robust::Cauchy(0.1)].into_iter().enumerate()
    {
        let (model, guess, target) = problem(60 + seed as u64);
        let options = LossOptions { affine: true, robust, ..full_options() };
        let loss = PoseLoss::new(Mode::default(), options);
        let (cosine, error) = compare_gradient(&loss, &model, &guess, &lamp(), &target);
        assert!(cosine > 0.999 && error < 0.04, "{seed}: {cosine} {error}");
    }
}

#[test]
fn the_correction_is_the_best_and_makes_a_light() {
    let (model, guess, target) = problem(63);
    let center = guess * model.center();
    let free = PoseLoss::new(Mode::default(), LossOptions { affine: true, ..full_options() });
    let fixed = PoseLoss::new(Mode::default(), full_options());
    let at = free.linearize(&model, &guess, &center, &lamp(), &target);
    assert_eq!(free.evaluate(&model, &guess, &lamp(), &target), at.loss);
    let affine = at.affine.unwrap();
    let under = |affine: &Affine| {
        fixed.linearize(&model, &guess, &center, &lamp().corrected(affine), &target)
    };
    let corrected = under(&affine);
    assert!((corrected.loss.total - at.loss.total).abs() < 1e-6 * at.loss.total);
    assert!((corrected.gradient - at.gradient).norm() < 1e-3 * at.gradient.norm());
    assert_eq!(corrected.affine, None);
    for k in 0..3 {
        for (gain, offset) in [(0.02, 0.0), (-0.02, 0.0), (0.0, 0.01), (0.0, -0.01)] {
            let mut other = affine;
            other.gain[k] += gain;
            other.offset[k] += offset;
            assert!(under(&other).loss.total > at.loss.total);
        }
    }
    // What a correction explains is not evidence for the pose.
    let less = corrected.jtj - at.jtj;
    assert!(less.symmetric_eigenvalues().min() > -1e-6 * less.norm());
    assert!(less.norm() > 1e-3 * corrected.jtj.norm());
    assert!(at.jtj.symmetric_eigenvalues().min() > 0.0);
}

/// The negative of a picture is no picture of the object in another light.
#[test]
fn bright_does_not_become_dark() {
    let (model, guess, target) = problem(65);
    let mut negative = target.clone();
    for (color, coverage) in negative.color.iter_mut().zip(&target.coverage) {
        *color = color.map(|c| if *coverage > 0.0 { 1.0 - c } else { 0.0 });
    }
    let free = PoseLoss::new(Mode::default(), LossOptions { affine: true, ..full_options() });
    let fixed = PoseLoss::new(Mode::default(), full_options());
    let center = guess * model.center();
    let at = free.linearize(&model, &guess, &center, &lamp(), &negative);
    let affine = at.affine.unwrap();
    assert_eq!(affine.gain, [0.0; 3]);
    let light = lamp().corrected(&affine);
    let corrected = fixed.linearize(&model, &guess, &center, &light, &negative);
    assert!((corrected.loss.total - at.loss.total).abs() < 1e-6 * at.loss.total);
    assert!(at.jtj.symmetric_eigenvalues().min() > -1e-9 * at.jtj.norm());
    let (cosine, error) = compare_gradient(&free, &model, &guess, &lamp(), &negative);
    assert!(cosine > 0.999 && error < 0.04, "{cosine} {error}");
}

#[test]
fn with_nothing_to_correct_nothing_is() {
    let (model, _, target) = problem(64);
    let loss = PoseLoss::new(Mode::default(), LossOptions { affine: true, ..full_options() });
    let away = Isometry3::translation(9.0, 0.0, 0.4);
    let at = loss.linearize(&model, &away, &Point3::origin(), &lamp(), &target);
    assert_eq!(at.affine, Some(Affine::default()));
    assert_eq!((at.gradient, at.jtj), (Vector6::zeros(), Matrix6::zeros()));
}
