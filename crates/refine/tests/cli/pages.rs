//! Completions and manual pages.

use std::fs;

use crate::fixture::Workplace;

#[test]
fn every_shell_has_completions() {
    let place = Workplace::empty();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = place.succeed(&format!("completions {shell}"));
        for word in ["calibrate", "robustness", "no-checkpoint", "settings"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    let said = place.prehend("completions cmd");
    assert!(said.code == 1 && said.err.contains("possible values: bash"), "{}", said.err);
}

#[test]
fn every_command_has_a_manual_page() {
    let place = Workplace::empty();
    let page = place.succeed("man");
    assert!(page.contains(".TH prehend 1") && page.contains("prehend\\-refine(1)"), "{page}");
    assert_eq!(place.succeed("man --out share/man1"), "");
    for name in ["prehend", "prehend-refine", "prehend-study", "prehend-info"] {
        let page = place.read(&format!("share/man1/{name}.1"));
        assert!(page.contains(&format!(".TH {name} 1")) && page.contains(".SH OPTIONS"), "{name}");
    }
    assert!(place.read("share/man1/prehend-refine.1").contains("\\-\\-no\\-checkpoint"));
    fs::write(place.path("file"), "").unwrap();
    let said = place.prehend("man --out file");
    assert!(said.code == 1 && said.err.starts_with("error: file: "), "{}", said.err);
}
