//! Nothing finite leads to NaN, infinity or a panic: what has no answer is an error that says why, or a neutral value.

use std::sync::{Arc, LazyLock};
use std::time::Duration;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_refine::baselines::{
    ChamferDepthFactor, ChamferDepthSettings, StabilityFactor, StabilitySettings,
};
use prehend_refine::evaluate::metrics::{
    PoseScore, ScoredModel, ScoredRow, oe_deg, oe_symmetric_deg, pe_cm, summarize,
};
use prehend_refine::factor::{
    FreeSpaceFactor, FreeSpaceSettings, GaussianPrior, HandDepthFactor, HandDepthSettings,
    PenetrationFactor, PenetrationSettings, PointToPlaneFactor, PointToPlaneSettings,
    PriorSettings, RenderingFactor, RenderingSettings, SupportFactor, SupportSettings,
    TactileFactor, TactileSettings, TouchModel,
};
use prehend_refine::problem::{Block, NoiseModel, NormalEquations};
use prehend_refine::scene::{Scene, default_scene};
use prehend_refine::search::{PoseSearch, SearchSettings};
use prehend_refine::strategy::Posterior;
use prehend_refine::symmetry::{ContinuousSymmetry, Symmetries};
use prehend_refine::tracker::{Recovery, Tracker, TrackerSettings};
use prehend_refine::{
    Estimate, Factor, Frame, Method, PoseCandidate, PoseFinder, PreparedFrame, RefineError, State,
    refine,
};
use prehend_render::{Camera, DepthImage, Mask, RgbImage};
use proptest::prelude::*;

static SCENE: LazyLock<Scene> = LazyLock::new(|| default_scene(1).unwrap());

/// Something that a camera or a hand may say.
type Fault = (&'static str, fn(&mut Frame));

const FAULTS: [Fault; 18] = [
    ("as it is", |_| {}),
    ("black", |o| o.color.pixels_mut().fill([0.0; 3])),
    ("white", |o| o.color.pixels_mut().fill([1.0; 3])),
    ("a mask of a pixel", |o| {
        let at = o.mask.pixels().iter().position(|masked| *masked).unwrap();
        o.mask.pixels_mut().fill(false);
        o.mask.pixels_mut()[at] = true;
    }),
    ("a mask of all", |o| o.mask.pixels_mut().fill(true)),
    ("no depth", |o| o.depth.pixels_mut().fill(0.0)),
    ("a wall", |o| o.depth.pixels_mut().fill(0.4)),
    ("depth at the lens", |o| o.depth.pixels_mut().fill(1e-30)),
    ("depth behind the camera", |o| o.depth.pixels_mut().fill(-1.0)),
    ("no touch", |o| o.hand.as_mut().unwrap().forces.fill(Vector3::zeros())),
    ("touch everywhere", |o| o.hand.as_mut().unwrap().forces.fill(-Vector3::z())),
    ("touch of an avalanche", |o| o.hand.as_mut().unwrap().forces.fill(Vector3::z() * -1e9)),
    ("no weight", |o| o.gravity = Some(Vector3::zeros())),
    ("a hand kilometers away", |o| {
        o.hand.as_mut().unwrap().t_cam_hand.translation.vector.x += 1e4;
    }),
    ("no hand", |o| (o.hand, o.gravity) = (None, None)),
    ("a picture of a pixel", |o| {
        let camera = Camera { width: 1, height: 1, cx: 0.0, cy: 0.0, ..o.camera };
        *o = Frame {
            gravity: o.gravity,
            hand: o.hand.clone(),
            color: RgbImage::filled(1, 1, [0.5; 3]),
            depth: DepthImage::filled(1, 1, 0.5),
            mask: Mask::filled(1, 1, true),
            ..Frame::new(camera)
        };
    }),
    ("depth of kilometers", |o| o.depth.pixels_mut().fill(1e6)),
    ("depth without end", |o| o.depth.pixels_mut().fill(1e38)),
];

/// Those that do not keep the search for closest points busy for seconds.
const QUICK: usize = FAULTS.len() - 2;

fn observation(fault: Fault) -> Frame {
    let mut observation = SCENE.frame.clone();
    fault.1(&mut observation);
    observation
}

/// Numbers, or an error: `of` gives nothing else. An error is none of what is as it is, at the truth or near it.
fn assert_finite(what: &str, of: impl FnOnce() -> Result<Vec<f64>, RefineError>) {
    match of() {
        Ok(numbers) => assert!(numbers.iter().all(|x| x.is_finite()), "{what}: {numbers:?}"),
        Err(error) => {
            let elsewhere = ["upside down", "turned", "kilometers away", "beside", "in the camera"];
            let is_right =
                what.contains(FAULTS[0].0) && !elsewhere.iter().any(|w| what.ends_with(w));
            assert!(!is_right, "{what}: {error}");
        }
    }
}

/// All numbers of a posterior, and one that is none if it is not what it should be.
fn of_posterior(posterior: &Posterior) -> Vec<f64> {
    let mut all = vec![posterior.probability(), posterior.probability_within(1.0, 1.0)];
    let of = |p: f64| if (0.0..=1.0 + 1e-9).contains(&p) { p } else { f64::NAN };
    all.iter_mut().for_each(|p| *p = of(*p));
    let covariances = posterior.modes.iter().map(|h| h.covariance);
    for covariance in covariances.chain([posterior.cramer_rao_bound]) {
        all.extend(covariance.iter());
        let symmetric = (covariance - covariance.transpose()).norm() <= 1e-9 * covariance.norm();
        let least = covariance.symmetric_eigenvalues().min();
        all.push(if symmetric && least >= -1e-9 * covariance.norm() { 0.0 } else { f64::NAN });
    }
    all.extend(posterior.modes.iter().flat_map(|h| [of(h.weight), h.cost]));
    let weights: f64 = posterior.modes.iter().map(|h| h.weight).sum();
    all.push(if (weights - 1.0).abs() < 1e-6 { 0.0 } else { f64::NAN });
    all.extend(
        posterior.unobservable.iter().flat_map(|u| u.twist.iter().copied().chain([u.deviation])),
    );
    all.extend(posterior.inconsistencies.iter().map(|i| i.distance));
    all.extend(posterior.fit.iter().map(|fit| of(fit.probability)));
    all.extend(
        posterior
            .fit
            .iter()
            .flat_map(|fit| fit.consistency.iter().flat_map(|c| [c.log_scale, of(c.fault)])),
    );
    all.extend(posterior.scales.iter().flat_map(|(_, log, sigma)| [log, sigma]));
    all
}

fn of_pose(pose: &Isometry3<f64>) -> Vec<f64> {
    pose.rotation.coords.iter().chain(pose.translation.vector.iter()).copied().collect()
}

fn of_estimate(estimate: Estimate) -> Vec<f64> {
    let mut all = of_pose(estimate.t_cam_object());
    all.extend(estimate.posterior.iter().flat_map(of_posterior));
    all.extend(estimate.state.camera.parameters().iter());
    all.extend(estimate.state.joints.iter().copied().chain(of_pose(&estimate.state.t_cam_hand)));
    all.extend(
        estimate
            .trace
            .iterations
            .iter()
            .flat_map(|i| i.values.iter().chain(&i.weights).copied().chain([i.step])),
    );
    all
}

/// Places where an object may be said to be.
fn places() -> Vec<(&'static str, Isometry3<f64>)> {
    let truth = SCENE.truth;
    let turned = |axis: Vector3<f64>| truth * Isometry3::rotation(axis * std::f64::consts::PI);
    vec![
        ("truth", truth),
        ("initial", SCENE.initial),
        ("upside down", turned(Vector3::x())),
        ("turned", turned(Vector3::z())),
        ("kilometers away", Isometry3::translation(0.0, 0.0, 5e3) * truth),
        ("beside", Isometry3::translation(50.0, 0.0, 0.0) * truth),
        (
            "in the camera",
            Isometry3::translation(0.0, 0.0, -(truth * SCENE.object.center).z + 1e-9) * truth,
        ),
    ]
}

type Made = Result<Arc<dyn Factor>, RefineError>;

fn factors(frame: &PreparedFrame<'_>, state: &State) -> Vec<Made> {
    fn made<F: Factor + 'static>(factor: Result<F, RefineError>) -> Made {
        factor.map(|factor| Arc::new(factor) as _)
    }
    let touch = TouchModel::Taxels(NoiseModel::cauchy(3e-3, 8.0));
    let taxels = TactileSettings { touch, ..TactileSettings::default() };
    vec![
        made(ChamferDepthFactor::new(frame, &ChamferDepthSettings::default())),
        made(Ok(FreeSpaceFactor::new(frame, &FreeSpaceSettings::default()))),
        made(HandDepthFactor::new(frame, 500, &HandDepthSettings::default())),
        made(PenetrationFactor::new(frame, &PenetrationSettings::default())),
        made(PointToPlaneFactor::new(frame, &PointToPlaneSettings::default())),
        made(RenderingFactor::new(frame, &RenderingSettings::default())),
        made(StabilityFactor::new(frame, state, StabilitySettings::default())),
        made(SupportFactor::new(frame, &SupportSettings::default())),
        made(TactileFactor::new(frame, &TactileSettings::default())),
        made(TactileFactor::new(frame, &taxels)),
        made(GaussianPrior::independent(state.clone(), &PriorSettings::default())),
    ]
}

/// Costs and equations of a factor at equal hypotheses.
fn of_factor(factor: &dyn Factor, state: &State) -> Vec<f64> {
    let mut blocks = vec![Block::ObjectPose, Block::Camera];
    if !state.joints.is_empty() {
        blocks.extend([Block::HandPose, Block::Joints(state.joints.len())]);
    }
    let states = [state.clone(), state.clone()];
    let mut equations = vec![NormalEquations::new(&blocks); 2];
    let mut all = factor.linearize_all(&states, &mut equations);
    all.extend(factor.cost_all(&states));
    for equations in &equations {
        all.extend(equations.gradient().iter().chain(equations.hessian().iter()));
        let hessian = equations.hessian();
        let bent = all
            .iter()
            .all(|x| x.is_finite())
            .then(|| hessian.clone().symmetric_eigenvalues().min());
        all.push(if bent.is_some_and(|least| least < -1e-6 * hessian.norm()) {
            f64::NAN
        } else {
            0.0
        });
    }
    all
}

#[test]
fn factors_of_anything_seen_anywhere() {
    for (index, fault) in FAULTS.into_iter().enumerate() {
        let observation = observation(fault);
        let frame = PreparedFrame::new(&observation, &SCENE.object).unwrap();
        // Every place with what is as it is, and one more with each fault.
        let places = places();
        let some = places.iter().enumerate().filter(|(k, _)| index == 0 || k % 7 == index % 7);
        for (_, (place, pose)) in some {
            let Ok(state) = State::new(&frame, pose) else { continue };
            for factor in factors(&frame, &state) {
                let name = factor.as_ref().map_or("no factor", |factor| factor.name());
                let what = format!("{name}, {}, {place}", fault.0);
                assert_finite(&what, || Ok(of_factor(&*factor?, &state)));
            }
        }
    }
}

#[test]
fn methods_of_anything_seen() {
    let named =
        ["combined", "icp-best", "physics", "depth-best", "tactile", "rendering", "robust-icp"];
    let others = named.into_iter().cycle().map(|name| Method::named(name).unwrap());
    for (fault, other) in FAULTS[..QUICK].iter().zip(others) {
        let observation = observation(*fault);
        for mut method in [Method::default(), other] {
            method.set_iterations(1);
            assert_finite(fault.0, || {
                let frame = PreparedFrame::new(&observation, &SCENE.object)?;
                if let Method::Fused(fused) = &mut method {
                    fused.alternatives = Some(vec![SCENE.initial; 2]);
                }
                refine(&frame, &SCENE.initial, &method).map(of_estimate)
            });
        }
    }
    let weightless = observation(FAULTS[12]);
    let frame = PreparedFrame::new(&weightless, &SCENE.object).unwrap();
    let refused = refine(&frame, &SCENE.initial, &Method::combined());
    assert!(matches!(refused, Err(RefineError::Gravity { .. })));
}

#[test]
fn searches_of_one_hypothesis() {
    let few = SearchSettings {
        rotations: 1,
        placed: 1,
        turned: 1,
        seen: 1,
        last: 1,
        ..SearchSettings::default()
    };
    let search = PoseSearch::new(Arc::clone(&SCENE.object), few).unwrap();
    for fault in &FAULTS[..QUICK] {
        let observation = observation(*fault);
        assert_finite(fault.0, || {
            let frame = PreparedFrame::new(&observation, &SCENE.object)?;
            let found = search.find(&frame)?;
            let of = |f: &PoseCandidate| [of_pose(&f.t_cam_object), vec![f.score, f.weight]];
            Ok(found.iter().flat_map(of).flatten().collect())
        });
    }
}

#[test]
fn a_tracker_of_anything_at_any_time() {
    let settings = TrackerSettings { recovery: Recovery::Off, ..TrackerSettings::default() };
    let mut tracker = Tracker::new(Arc::clone(&SCENE.object), settings).unwrap();
    tracker.start_from(&SCENE.initial);
    let steps = [1.0, 1e-9, 0.5, 1e-3, 1e3].map(Duration::from_secs_f64);
    let mut faults: Vec<Fault> = FAULTS.to_vec();
    // What was seen before is seen again.
    faults.extend(FAULTS);
    // And a frame after ages.
    let count = faults.len() - 1;
    let ages = [Duration::from_secs(1_000_000_000)];
    let steps = steps.into_iter().cycle().take(count).chain(ages);
    let mut time = Duration::ZERO;
    for (fault, step) in faults.into_iter().zip(steps) {
        time += step;
        let observation = observation(fault);
        assert_finite(&format!("{}, {time:?}", fault.0), || {
            let tracked = tracker.push(observation, time)?;
            let posterior = tracked.posterior.iter().flat_map(of_posterior);
            Ok(of_pose(&tracked.t_cam_object).into_iter().chain(posterior).collect())
        });
    }
}

#[test]
fn errors_of_poses_of_nothing_and_of_a_vertex() {
    let camera = SCENE.frame.camera;
    let axis = ContinuousSymmetry { axis: Vector3::z_axis(), point: Point3::origin() };
    let flip = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
    let symmetric = Symmetries { discrete: vec![flip], continuous: vec![axis] };
    let behind = Isometry3::translation(0.0, 0.0, -3.0) * SCENE.truth;
    let mut poses: Vec<Isometry3<f64>> = places().into_iter().map(|(_, pose)| pose).collect();
    poses.extend([behind, Isometry3::identity(), Isometry3::translation(1e100, 0.0, 1e100)]);
    let clouds = [vec![], vec![Point3::origin()], vec![Point3::new(0.1, 0.0, 0.0); 3]];
    let mut rows = Vec::new();
    for (points, symmetries) in clouds.iter().flat_map(|points| {
        [Symmetries::default(), symmetric.clone()].map(|symmetries| (points, symmetries))
    }) {
        let model = ScoredModel::new(points.clone(), symmetries.clone());
        for (estimate, truth) in poses.iter().flat_map(|a| poses.iter().map(move |b| (a, b))) {
            assert_finite("score", || {
                let score = model.score(estimate, truth, &camera);
                assert_eq!(score.add_mm.is_none(), points.is_empty());
                let obj_id = points.len() as u32;
                rows.push(ScoredRow { scene_id: 1, im_id: 1, obj_id, score });
                let symmetric = oe_symmetric_deg(estimate, truth, &symmetries);
                let own = [pe_cm(estimate, truth), oe_deg(estimate, truth), symmetric];
                Ok(score.values().into_iter().flatten().chain(own).collect())
            });
        }
    }
    let failed = ScoredRow { score: PoseScore::default(), ..rows[0] };
    for rows in [&rows[..], &rows[..1], &[failed], &[]] {
        assert_finite("summary", || {
            let summary = summarize(rows);
            assert!(!summary.text(|_| String::new()).contains("NaN"));
            let all = summary.overall.iter().chain(summary.per_object.values().flatten());
            Ok(all.flatten().flat_map(|s| [s.mean, s.median]).collect())
        });
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn errors_of_any_poses(
        a in prop::array::uniform6(-1e3..1e3),
        b in prop::array::uniform6(-1e3..1e3),
        size in -12..6,
    ) {
        let pose = |[x, y, z, u, v, w]: [f64; 6]| {
            Isometry3::new(Vector3::new(x, y, z), Vector3::new(u, v, w))
        };
        let corner = Point3::new(1.0, -2.0, 0.5) * 10f64.powi(size);
        let model = ScoredModel::new(vec![corner, -corner], Symmetries::default());
        let score = model.score(&pose(a), &pose(b), &SCENE.frame.camera);
        prop_assert!(score.values().into_iter().flatten().all(f64::is_finite), "{score:?}");
    }
}
