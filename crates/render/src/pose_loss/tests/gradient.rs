//! Whole gradients against finite differences of the loss.

use super::*;

#[test]
fn gradients_match_differences_of_the_value() {
    // Shading jumps at the edges of the box, and jumps inside the object have no derivative.
    let scenes = [
        ("textured box", textured_box(), Light::ambient(0.9)),
        ("painted lump", painted(lump(0.045, 90), 0.05), lamp()),
        ("painted sphere", painted(sphere(0.045, 240), 0.04), lamp()),
    ];
    let options = [
        (1.0, LossOptions::default()),
        (1.0, full_options()),
        (1.5, LossOptions { robust: Robust::Cauchy(0.1), ..full_options() }),
        (1.0, LossOptions { robust: Robust::Huber(0.05), ..LossOptions::default() }),
    ];
    for (name, mesh, light) in scenes {
        let model = RenderModel::new(&mesh).unwrap();
        for (seed, (half_width, options)) in options.into_iter().enumerate() {
            let mut noise = Noise(40 + seed as u64);
            let truth = pose(&mut noise);
            let target = target_of(&model, &truth, &light, None, 0.5);
            let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.004 } else { 0.08 });
            let guess = twisted(&truth, &(truth * model.center()), &twist);
            let loss = PoseLoss::new(contour(half_width), options);
            let (cosine, error) = compare_gradient(&loss, &model, &guess, &light, &target);
            assert!(cosine > 0.999 && error < 0.02, "{name} {seed}: {cosine} {error}");
        }
    }
}

#[test]
fn an_object_partly_outside_the_image_has_the_right_gradient() {
    let model = RenderModel::new(&painted(lump(0.045, 90), 0.05)).unwrap();
    let mut noise = Noise(31);
    for shift in
        [Vector3::new(0.11, 0.0, 0.0), Vector3::new(-0.1, -0.08, 0.0), Vector3::new(0.0, 0.0, -0.3)]
    {
        let mut truth = pose(&mut noise);
        truth.translation.vector += shift;
        let target = target_of(&model, &truth, &lamp(), None, 0.5);
        let loss = PoseLoss::new(Mode::default(), full_options());
        let guess =
            twisted(&truth, &(truth * model.center()), &[0.002, 0.001, -0.003, 0.05, -0.04, 0.05]);
        let (cosine, error) = compare_gradient(&loss, &model, &guess, &lamp(), &target);
        assert!(cosine > 0.998 && error < 0.05, "{shift}: {cosine} {error}");
    }
}

#[test]
fn contours_inside_the_object_have_derivatives() {
    // Seen from the side, a torus hides a part of itself; in half of these poses the step is visible.
    let model = RenderModel::new(&painted(torus(0.04, 0.015, 90), 0.05)).unwrap();
    let loss = PoseLoss::default();
    for seed in 140..152 {
        let mut noise = Noise(seed);
        let truth = pose(&mut noise);
        let target = target_of(&model, &truth, &lamp(), None, 0.5);
        let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.004 } else { 0.08 });
        let guess = twisted(&truth, &(truth * model.center()), &twist);
        let (cosine, error) = compare_gradient(&loss, &model, &guess, &lamp(), &target);
        assert!(cosine > 0.999 && error < 0.1, "{seed}: {cosine} {error}");
    }
}
