//! Settings as files.

use std::time::Duration;

use prehend_refine::strategy::FusedSettings;
use prehend_refine::{Settings, SettingsError};

#[test]
fn settings_written_are_the_settings_read() {
    let mut settings = Settings::default();
    settings.estimator.prior.hand_translation = 5e-3;
    settings.tracker.budget = Some(Duration::from_millis(20));
    let text = settings.to_toml().unwrap();
    let read = Settings::from_toml(&text).unwrap();
    assert_eq!(read.to_toml().unwrap(), text);
    assert_eq!(read.estimator, settings.estimator);
    assert_eq!(read.tracker, settings.tracker);
}

#[cfg(feature = "cli")]
#[test]
fn a_document_says_what_settings_are() {
    let mut settings = Settings::default();
    let document = settings.document().unwrap();
    let read = Settings::from_toml(&document).unwrap();
    assert_eq!(read.to_toml().unwrap(), settings.to_toml().unwrap());
    // Whoever has no budget can leave it out.
    assert!(document.contains("\n# tracker.budget =\n"), "{document}");
    settings.tracker.budget = Some(Duration::from_secs(1));
    assert!(settings.document().unwrap().contains("\ntracker.budget = { "));
    let patches = "\n# models are exact.\nestimator.patches.sigma = 0.0007\n";
    assert!(document.contains(patches), "{document}");
    assert!(!document.contains("]("), "{document}");
}

#[test]
fn what_a_file_leaves_out_is_usual() {
    let file = "[estimator.scales]\ncommon = 0\nown = 0.0\nnoise = 0.0\n[estimator.prior]\njoints = 0.02\n\
                [tracker.gating]\nmax_sigma = 0.02\n[calibration.prior]\njoints = 0.01\n";
    let settings = Settings::from_toml(file).unwrap();
    let mut expected = FusedSettings::default();
    (expected.scales.common, expected.scales.own, expected.scales.noise) = (0.0, 0.0, 0.0);
    expected.prior.joints = 0.02;
    assert_eq!(settings.estimator, expected);
    assert_eq!(
        (settings.tracker.gating.max_sigma, settings.tracker.gating.cost_ratio),
        (0.02, 2.5)
    );
    // Not those of the estimator.
    let usual = Settings::default().calibration.prior;
    assert_eq!(settings.calibration.prior.hand_translation, usual.hand_translation);
    assert_eq!(settings.calibration.prior.joints, 0.01);
    let [search, tracker] = [settings.search().estimator, settings.tracker().search.estimator];
    assert_eq!([&search, &tracker, &settings.tracker().fused], [&expected; 3]);
    assert_eq!(settings.calibration().fused, expected);
}

#[test]
fn single_settings_are_set_by_their_paths() {
    let mut settings = Settings::default();
    for (path, value) in [
        ("estimator.patches.sigma", "1e-3"),
        ("estimator.depth.noise.sigma", "2e-3"),
        ("estimator.stages.3.points", "900"),
        ("estimator.modalities", "[\"depth\", \"touch\"]"),
        ("tracker.recovery", "near"),
        ("tracker.budget", "{ secs = 0, nanos = 20_000_000 }"),
        ("search.rotations", "500"),
    ] {
        settings.set(path, value).unwrap();
    }
    let Settings { estimator, search, tracker, .. } = &settings;
    assert_eq!((estimator.patches.sigma, estimator.depth.noise.sigma), (1e-3, 2e-3));
    assert_eq!((estimator.stages[3].points, estimator.stages.len()), (900, 4));
    assert_eq!((estimator.modalities.len(), search.rotations), (2, 500));
    assert_eq!(
        (tracker.recovery.name(), tracker.budget),
        ("near", Some(Duration::from_millis(20)))
    );
}

#[test]
fn what_is_no_setting_is_named() {
    let said = |text: &str| Settings::from_toml(text).unwrap_err().to_string();
    let unknown = said("[estimator.prior]\njoint = 0.02\n");
    assert!(
        unknown.starts_with("estimator.prior.joint: unknown field `joint`, expected"),
        "{unknown}"
    );
    let wrong = said("[search]\nrotations = \"many\"\n");
    assert!(wrong.starts_with("search.rotations: invalid type: string \"many\""), "{wrong}");
    for wrong in ["-1e-3", "nan", "-0.0"] {
        let said = said(&format!("[estimator.patches]\nsigma = {wrong}\n"));
        assert!(said.starts_with("estimator.patches.sigma: "), "{said}");
    }
    assert!(said("[search]\nrotations = -1\n").starts_with("search.rotations: -1 is not"));
    assert_eq!(said("\n[estimator\n").split(": ").next(), Some("line 2"));
    let mut settings = Settings::default();
    for path in ["", "estimator", "estimator.stages.9.points", "tracker.fused.views", "x"] {
        let refused = settings.set(path, "1");
        assert!(matches!(refused, Err(SettingsError::Value { .. })), "{path}: {refused:?}");
    }
    let file = Settings::load("no/settings.toml".as_ref()).unwrap_err();
    assert!(file.to_string().starts_with("no/settings.toml: "), "{file}");
}
