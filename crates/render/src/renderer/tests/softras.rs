//! Discrete decisions of the SoftRas mode.

use super::super::softras::SoftFaces;
use super::*;

/// Which faces count at a pixel, each with the branches that lead to its distance and coordinates, which is the nearest, and
/// which is at the center.
pub(super) fn decision(frame: &Frame, faces: &SoftFaces, place: Place) -> Vec<u32> {
    let (all, inside) = faces.decision(place.block, place.i);
    let at = [place.x as f64, place.y as f64];
    let mut pairs: Vec<(u32, u32)> = all
        .iter()
        .map(|&face| (face, faces.fragment(frame, face as usize, at).branches()))
        .collect();
    pairs.sort_unstable();
    let mut out: Vec<u32> =
        pairs.into_iter().flat_map(|(face, branches)| [face, branches]).collect();
    out.extend(all.first());
    out.extend(inside);
    out
}

#[test]
fn the_background_has_the_weight_delta() {
    let options = SoftRasOptions::default();
    let model = Arc::new(RenderModel::new(&cuboid(Vector3::repeat(0.1))).unwrap());
    let mut scene = Scene::new(camera()).with(model, at(0.0, 0.0, 0.4));
    let renderer = Renderer::new(lighting()).with_mode(Mode::SoftRas(options));
    let before_black = renderer.render(&scene).buffers;
    scene.background = [1.0; 3];
    let before_white = renderer.render(&scene).buffers;
    // Beyond the border a pixel shows the surface's color, until the presence of the face is like δ = 1e-10.
    let mut partly = 0;
    for i in 0..before_black.alpha.len() {
        let share = before_white.color[i][0] - before_black.color[i][0];
        if before_black.alpha[i] == 0.0 {
            assert_eq!(share, 1.0);
        } else {
            assert!(share < 1e-5, "{share} {}", before_black.alpha[i]);
            partly += usize::from(before_black.alpha[i] < 0.5);
        }
    }
    assert!(partly > 50, "{partly}");
}

/// A face hidden behind as many as count still gives depth and face of its pixel: here all of them only spread to it.
#[test]
fn faces_behind_those_that_count_give_the_depth() {
    let options = SoftRasOptions { sigma: 5e-3, blur_radius: 0.02, ..SoftRasOptions::default() };
    for (faces_per_pixel, seed) in [(1, 0.0), (2, 0.01)] {
        let options = SoftRasOptions { faces_per_pixel, ..options };
        let renderer = Renderer::new(lighting()).with_mode(Mode::SoftRas(options));
        let model = Arc::new(RenderModel::new(&painted(lump(0.05, 16), 0.06)).unwrap());
        let direction = Vector6::new(0.01, -0.02, 0.03, 0.3, -0.2, 0.1);
        let render = |amount: f64| {
            let pose = at(seed, 0.0, 0.4);
            let center = (pose * model.center()).coords;
            let pose = perturb_about(&pose, &center, &(direction * amount));
            renderer.render(&Scene::new(camera()).with(model.clone(), pose))
        };
        let (middle, ends) = (render(0.0), [&render(-1e-6), &render(1e-6)]);
        let Visible::SoftRas(faces) = &middle.visible else { panic!("the other mode") };
        let regions = faces.regions();
        let all = regions.iter().enumerate().flat_map(|(block, region)| places(block, region));
        let hidden = all.filter(|place| {
            let (all, inside) = faces.decision(place.block, place.i);
            inside.is_some_and(|face| !all.contains(&face))
        });
        assert!(hidden.count() > 100);
        check(&middle, ends, 2e-6, |g| g.objects[0].twist.dot(&direction));
    }
}
