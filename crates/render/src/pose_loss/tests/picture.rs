//! The light's offset in a picture of the object.

use super::*;

#[test]
fn an_offset_of_the_light_lifts_the_object_only() {
    let model = RenderModel::new(&painted(lump(0.045, 60), 0.05)).unwrap();
    let pose = pose(&mut Noise(18));
    let lifted = Light { offset: [0.1, 0.2, 0.3], ..lamp() };
    let render = |light: &Light| PoseLoss::default().render(&model, &pose, &camera(), light);
    let (plain, lifted) = (render(&lamp()), render(&lifted));
    for (at, coverage) in plain.coverage.iter().enumerate() {
        for k in 0..3 {
            let difference = lifted.color.pixels()[at][k] - plain.color.pixels()[at][k];
            assert!((difference - coverage * 0.1 * (k + 1) as f32).abs() < 1e-5);
        }
    }
}
