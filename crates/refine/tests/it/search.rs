//! The search from sensors alone on the built-in scene.

use std::sync::{Arc, LazyLock};

use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::scene::{Scene, default_scene};
use prehend_refine::search::{PoseSearch, SearchSettings};
use prehend_refine::{Frame, PoseCandidate, PoseFinder, PreparedFrame, RefineError};

static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).unwrap());

fn search(settings: SearchSettings) -> Result<Vec<PoseCandidate>, RefineError> {
    let frame = PreparedFrame::new(&SCENE.frame, &SCENE.object)?;
    PoseSearch::new(Arc::clone(&SCENE.object), settings)?.find(&frame)
}

#[test]
fn the_bottle_is_found_from_sensors_alone() {
    let found = search(SearchSettings::default()).unwrap();
    let best = &found[0].t_cam_object;
    let (pe, oe) = (pe_cm(best, &SCENE.truth), oe_deg(best, &SCENE.truth));
    assert!(pe < 0.3 && oe < 3.0, "{pe} cm, {oe}°");
    assert!(found.windows(2).all(|f| f[0].score >= f[1].score && f[0].weight >= f[1].weight));
    assert!((found.iter().map(|f| f.weight).sum::<f64>() - 1.0).abs() < 1e-9);
}

#[test]
fn vision_alone_finds_it_too() {
    let mut observation = SCENE.frame.clone();
    observation.hand = None;
    let search = PoseSearch::new(Arc::clone(&SCENE.object), SearchSettings::default()).unwrap();
    let frame = PreparedFrame::new(&observation, &SCENE.object).unwrap();
    let best = search.find(&frame).unwrap()[0].t_cam_object;
    let (pe, oe) = (pe_cm(&best, &SCENE.truth), oe_deg(&best, &SCENE.truth));
    assert!(pe < 0.3 && oe < 3.0, "{pe} cm, {oe}°");
}

#[test]
fn any_number_of_threads_finds_the_same() {
    let few =
        SearchSettings { rotations: 200, placed: 40, turned: 16, ..SearchSettings::default() };
    let found = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| search(few.clone())).unwrap()
    });
    assert_eq!(found[0], found[1]);
    assert_eq!(found[0], found[2]);
}

#[test]
fn bad_input_is_an_error() {
    let none = SearchSettings { rotations: 0, ..SearchSettings::default() };
    let error = search(none).unwrap_err().to_string();
    assert!(error.contains("rotations is 0, must be finite and above zero"), "{error}");
    let nan = SearchSettings { scale: f64::NAN, ..SearchSettings::default() };
    assert!(search(nan).unwrap_err().to_string().contains("scale is NaN"));

    let search = PoseSearch::new(Arc::clone(&SCENE.object), SearchSettings::default()).unwrap();
    let refused = |change: &dyn Fn(&mut Frame)| {
        let mut observation = SCENE.frame.clone();
        change(&mut observation);
        let frame = PreparedFrame::new(&observation, &SCENE.object).unwrap();
        search.find(&frame).unwrap_err()
    };
    let dark = refused(&|o| o.depth.pixels_mut().fill(0.0));
    assert!(matches!(dark, RefineError::NoDepth));
    let forces = refused(&|o| {
        o.hand.as_mut().unwrap().forces.pop();
    });
    assert!(matches!(forces, RefineError::TaxelCount { .. }));
}
