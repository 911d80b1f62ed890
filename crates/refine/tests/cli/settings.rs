//! Settings from a file, and their page.

use std::path::Path;

use crate::fixture::Workplace;

/// `docs/SETTINGS.md` has the output of `prehend settings`; `PREHEND_WRITE_GOLDEN=1` puts it there.
#[test]
fn the_page_has_all_settings() {
    let printed = Workplace::empty().succeed("settings");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/SETTINGS.md");
    let page = std::fs::read_to_string(&file).unwrap();
    let (before, rest) = page.split_once("```toml\n").unwrap();
    let (kept, after) = rest.split_once("```").unwrap();
    if std::env::var_os("PREHEND_WRITE_GOLDEN").is_some() {
        let page = format!("{before}```toml\n{printed}```{after}");
        return std::fs::write(file, page).unwrap();
    }
    assert!(kept == printed, "docs/SETTINGS.md is not what `prehend settings` prints");
}

#[test]
fn a_run_takes_its_settings_from_a_file_and_records_them() {
    let place = Workplace::new();
    place.write("settings.toml", "[estimator.hypotheses]\nrestart_angle = 0.3\n");
    let printed = place.succeed("settings --settings settings.toml --set tracker.recovery=near");
    let printed: toml::Table = printed.parse().unwrap();
    assert_eq!(printed["estimator"]["hypotheses"]["restart_angle"].as_float(), Some(0.3));
    assert_eq!(printed["tracker"]["recovery"].as_str(), Some("near"));
    let stages = "--set estimator.stages.0.hypotheses=2 --set estimator.views=false";
    let refine = "refine --dataset ds --poses ds/init.csv --image 0 --json";
    let told = place.succeed(&format!(
        "{refine} --settings settings.toml {stages} --noise joints=0.02rad --out a.csv"
    ));
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    let settings: toml::Table = told["settings"].as_str().unwrap().parse().unwrap();
    assert_eq!(settings["hypotheses"]["restart_angle"].as_float(), Some(0.3));
    assert_eq!(settings["stages"][0]["hypotheses"].as_integer(), Some(2));
    assert_eq!(settings["views"].as_bool(), Some(false));
    assert_eq!(settings["prior"]["joints"].as_float(), Some(0.02));
    // What was printed is a file that has the same effect.
    let file = place.succeed(&format!("settings --settings settings.toml {stages}"));
    place.write("printed.toml", &file);
    place.succeed(&format!("{refine} --settings printed.toml --noise joints=0.02rad --out b.csv"));
    assert_eq!(place.read("a.csv"), place.read("b.csv"));
}

#[test]
fn what_is_wrong_with_settings_is_named() {
    let place = Workplace::empty();
    place.write("a.toml", "[estimator.patches]\nsgima = 1e-3\n");
    place.write("b.toml", "[search]\nrotations");
    for (options, expected) in [
        (
            "--settings a.toml",
            "error: a.toml: estimator.patches.sgima: unknown field `sgima`, expected",
        ),
        ("--settings b.toml", "error: b.toml: line 2: "),
        ("--settings none.toml", "error: none.toml: "),
        (
            "--set search.points=many",
            "error: --set search.points=many: search.points: invalid type",
        ),
        ("--set search", "not of the form NAME=VALUE"),
        ("--set tracker.gain=-1", "tracker.gain: -1 is not a number from zero on"),
    ] {
        let said = place.prehend(&format!("settings {options}"));
        assert_eq!((said.code, said.out.as_str()), (1, ""), "{options}");
        assert!(said.err.contains(expected), "{options}: {}", said.err);
    }
    for (method, setting) in [
        ("icp", "estimator.views=false"),
        // Of which a heuristic has the renderer's mode alone.
        ("combined", "estimator.views=false"),
        ("combined", "tracker.gating.max_sigma=0.02"),
    ] {
        let said =
            place.prehend(&format!("refine --frame f.json --method {method} --set {setting}"));
        let expected = format!("is of the fused method, not of {method}");
        assert!(said.err.contains(&expected), "{}", said.err);
    }
}
