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
        (1.5, LossOptions { kernel: RobustKernel::Cauchy { scale: 0.1 }, ..full_options() }),
        (
            1.0,
            LossOptions { kernel: RobustKernel::Huber { scale: 0.05 }, ..LossOptions::default() },
        ),
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
fn creases_that_blend_have_derivatives() {
    // The light jumps at every edge of the boxes, and so do the colors of one.
    let mut colored = cuboid(Vector3::new(0.06, 0.08, 0.1));
    let color = |i: usize| [0.3 + 0.1 * (i % 5) as f32, 0.9 - 0.2 * (i % 4) as f32, 0.5];
    colored.colors = Some((0..colored.vertices.len()).map(color).collect());
    for mesh in [colored, cuboid(Vector3::new(0.06, 0.08, 0.1))] {
        let model = RenderModel::new(&mesh).unwrap();
        let mut errors = [0.0f64; 2];
        for seed in 60..66 {
            let mut noise = Noise(seed);
            let truth = pose(&mut noise);
            let target = target_of(&model, &truth, &lamp(), None, 0.5);
            let twist = [0, 1, 2, 3, 4, 5].map(|i| noise.next() * if i < 3 { 0.004 } else { 0.08 });
            let guess = twisted(&truth, &(truth * model.center()), &twist);
            for (mode, worst) in [contour(0.645), creased()].into_iter().zip(&mut errors) {
                let loss = PoseLoss::new(mode, full_options());
                *worst = worst.max(compare_gradient(&loss, &model, &guess, &lamp(), &target).1);
            }
        }
        // Where three edges meet the nearest one counts, which is not smooth.
        let [hard, soft] = errors;
        println!("hard {hard:.4}, soft {soft:.4}");
        assert!(soft < 0.03 && soft < 0.5 * hard, "{errors:?}");
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

/// A sheet that reaches beyond the image on all sides, with a color that changes evenly across it.
#[test]
fn slopes_go_on_over_the_border_of_the_image() {
    let corner = |x: f64, y: f64| Point3::new(x, y, 0.0);
    let mut sheet = TriMesh::new(
        vec![corner(-0.2, -0.2), corner(0.2, -0.2), corner(0.2, 0.2), corner(-0.2, 0.2)],
        vec![[0, 2, 1], [0, 3, 2]],
    );
    sheet.colors = Some([0.1, 0.9, 0.9, 0.1].map(|v| [v; 3]).into());
    let model = RenderModel::new(&sheet).unwrap();
    for (width, height) in [(6, 5), (1, 5)] {
        let (cx, cy) = (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
        let camera = Camera { fx: 40.0, fy: 40.0, cx, cy, width, height };
        let picture = RgbImage::filled(width, height, [0.7; 3]);
        let target = Target::new(camera, &picture, &Mask::filled(width, height, true)).unwrap();
        let pose = Isometry3::translation(0.0, 0.0, 0.4);
        let center = pose * Point3::origin();
        for samples in [1, 2, 4] {
            let loss = PoseLoss::new(contour(0.645), LossOptions::default()).with_samples(samples);
            let light = Light::ambient(1.0);
            let at = loss.linearize(&model, &pose, &center, &light, &target);
            let value = |s: f64| {
                let pose = twisted(&pose, &center, &unit(0, s));
                loss.evaluate(&model, &pose, &light, &target).total
            };
            let difference = (value(1e-4) - value(-1e-4)) / 2e-4;
            let error = (at.gradient[0] / difference - 1.0).abs();
            assert!(error < 5e-3, "{width}, {samples}: {} {difference}", at.gradient[0]);
        }
    }
}
