//! Normals, faces and the light's offset in a picture of the object.

use super::*;

#[test]
fn normals_and_faces_are_those_of_the_surface_seen() {
    let radius = 0.045;
    let model = RenderModel::new(&sphere(radius, 240)).unwrap();
    let pose = pose(&mut Noise(17));
    let picture = PoseLoss::default().render(&model, &pose, &camera(), &lamp());
    let center = pose * model.center();
    let mut shown = 0;
    for y in 0..camera().height {
        for x in 0..camera().width {
            let at = y * camera().width + x;
            let (normal, z) = (Vector3::from(picture.normal[at]), picture.depth.pixels()[at]);
            assert_eq!(picture.face[at].is_some(), z > 0.0);
            let Some(face) = picture.face[at] else {
                assert_eq!(normal, Vector3::zeros());
                continue;
            };
            shown += 1;
            assert!((face as usize) < model.face_count());
            let point = camera().unproject(x as f64, y as f64, f64::from(z));
            let expected = (point - center).normalize();
            assert!((normal.cast() - expected).norm() < 0.03, "{x} {y}: {normal} {expected}");
        }
    }
    assert!(shown > 1000);
}

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
