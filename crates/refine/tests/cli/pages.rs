//! Completions and manual pages.

use std::fs;
use std::path::Path;

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

/// Commands of which `docs/COMMAND.md` has the options.
const COMMANDS: [&str; 12] = [
    "refine",
    "initial",
    "track",
    "eval",
    "check",
    "calibrate",
    "study",
    "synth",
    "export",
    "info",
    "settings",
    "symmetry",
];

/// A command's help as Markdown: what it does, its usage, a table of options by heading.
fn markdown(name: &str, help: &str) -> String {
    let cell = |text: &str| {
        text.replace('|', "\\|").replace("<br>", "\n").replace('<', "\\<").replace('\n', "<br>")
    };
    let (about, rest) = help.split_once("Usage: ").unwrap();
    let (usage, rest) = rest.split_once("\n\n").unwrap();
    let mut page = format!("\n## {name}\n\n{}\n\n```text\n{usage}\n```\n", about.trim());
    let mut rows: Vec<(String, Vec<String>)> = Vec::new();
    let flush = |page: &mut String, rows: &mut Vec<(String, Vec<String>)>| {
        for (option, text) in rows.drain(..) {
            let (option, text) = (option.replace('|', "\\|"), cell(&text.concat()));
            *page += &format!("| `{option}` | {} |\n", text.trim_start_matches("<br>").trim());
        }
    };
    let mut is_new = false;
    for line in rest.lines() {
        let indent = line.len() - line.trim_start().len();
        match (line.trim(), indent) {
            ("", _) => is_new = true,
            (heading, 0) => {
                flush(&mut page, &mut rows);
                page += &format!("\n| {} | |\n|---|---|\n", heading.trim_end_matches(':'));
            }
            (option, 1..=6) => {
                // Commands with short texts have them beside the option.
                let (option, text) = option.split_once("  ").unwrap_or((option, ""));
                rows.push((option.to_owned(), vec![text.trim().to_owned()]));
                is_new = false;
            }
            (text, _) => {
                // Lists and paragraphs keep their lines.
                let is_item = is_new || text.starts_with(['-', '[']) || text.contains("  ");
                if let Some((_, lines)) = rows.last_mut() {
                    lines.push(format!("{}{}", if is_item { "<br>" } else { " " }, text));
                }
                is_new = false;
            }
        }
    }
    flush(&mut page, &mut rows);
    page
}

/// `docs/COMMAND.md` has the options that the commands print; `PREHEND_WRITE_GOLDEN=1` puts them there.
#[test]
fn the_page_has_all_options() {
    let place = Workplace::empty();
    let mut page = "# Options of the command\n\nPrinted by `prehend COMMAND --help`; \
                    `prehend COMMAND -h` is short.\n"
        .to_owned();
    for name in COMMANDS {
        let help = place.succeed(&format!("{name} --help"));
        // What all have is said once, by `prehend --help`.
        let own = help.split("\nAll commands:").next().unwrap_or(&help);
        page += &markdown(name, own);
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/COMMAND.md");
    if std::env::var_os("PREHEND_WRITE_GOLDEN").is_some() {
        return fs::write(file, page).unwrap();
    }
    assert!(fs::read_to_string(&file).unwrap() == page, "docs/COMMAND.md is another");
}
