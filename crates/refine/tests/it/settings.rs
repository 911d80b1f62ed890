//! Settings as files.

use prehend_refine::strategy::FusedSettings;
use prehend_refine::tracker::TrackerSettings;

#[test]
fn settings_written_are_the_settings_read() {
    let mut settings = TrackerSettings::default();
    settings.fused.prior.hand_translation = 5e-3;
    let text = toml::to_string(&settings).unwrap();
    assert_eq!(toml::from_str::<TrackerSettings>(&text).unwrap(), settings);
}

#[test]
fn what_a_file_leaves_out_is_usual() {
    let file = "[scales]\ncommon = 0.0\nown = 0.0\nnoise = 0.0\n[prior]\njoints = 0.02\n";
    let settings: FusedSettings = toml::from_str(file).unwrap();
    let mut expected = FusedSettings::default();
    (expected.scales.common, expected.scales.own, expected.scales.noise) = (0.0, 0.0, 0.0);
    expected.prior.joints = 0.02;
    assert_eq!(settings, expected);
    let tracker: TrackerSettings = toml::from_str("[gating]\nmax_sigma = 0.02\n").unwrap();
    assert_eq!((tracker.gating.max_sigma, tracker.gating.cost_ratio), (0.02, 2.5));
    let error = toml::from_str::<FusedSettings>("[prior]\njoint = 0.02\n").unwrap_err();
    assert!(error.to_string().contains("joint"), "{error}");
}
