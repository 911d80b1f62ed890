//! Colors and levels of messages.

use crate::fixture::Workplace;

/// A dataset that is warned of.
fn place() -> Workplace {
    let place = Workplace::new();
    place.edit_json("ds/models/models_info.json", |info| {
        info["5"].as_object_mut().unwrap().remove("mass_kg");
    });
    place
}

const CHECK: &str = "check --dataset ds --poses ds/init.csv --image 0 --report look";

/// Standard error of a check with these options and this variable.
fn told(place: &Workplace, options: &str, variable: (&str, &str)) -> String {
    let mut command = place.command(&format!("{CHECK} {options}"));
    let output = command.env_remove("NO_COLOR").env(variable.0, variable.1).output().unwrap();
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn levels_choose_what_is_told() {
    let place = place();
    let told = |options: &str, level: &str| told(&place, options, ("PREHEND_LOG", level));
    let warned = |text: &str| text.contains("warning: object 5: the object's mass");
    let debugged = |text: &str| text.contains("debug: cache folder");
    assert!(warned(&told("", "")) && !debugged(&told("", "")));
    assert_eq!(told("--quiet", ""), "");
    assert_eq!(told("--log-level error", "debug"), "");
    assert_eq!(told("", "error"), "");
    assert!(debugged(&told("", "DEBUG")) && debugged(&told("-vv", "error")));
    assert!(!debugged(&told("-v", "")));
    assert!(warned(&told("--log-level warn", "error")));
    let said = told("", "loud");
    assert_eq!(said, "error: PREHEND_LOG: expected error, warn, info or debug, found \"loud\"\n");
    let said = told("--log-level loud", "");
    assert!(said.contains("invalid value 'loud' for '--log-level <LEVEL>'"), "{said}");
    let said = told("--quiet --verbose", "");
    assert!(said.contains("cannot be used with"), "{said}");
}

#[test]
fn colors_are_for_terminals_or_asked_for() {
    let place = place();
    let told = |options: &str, variable: (&str, &str)| told(&place, options, variable);
    let colored = |text: &str| text.contains('\u{1b}');
    let none = ("PREHEND_LOG", "");
    assert!(!colored(&told("", none)));
    let always = told("--color always", none);
    assert!(colored(&always) && always.contains("warning:"), "{always}");
    assert!(!colored(&told("--color never", ("CLICOLOR_FORCE", "1"))));
    assert!(colored(&told("", ("CLICOLOR_FORCE", "1"))));
    let both = |options: &str| {
        let mut command = place.command(&format!("{CHECK} {options}"));
        let output = command.env("CLICOLOR_FORCE", "1").env("NO_COLOR", "1").output().unwrap();
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(!colored(&both("")));
    assert!(colored(&both("--color always")));
    // What clap says obeys, too, and so does the help.
    assert!(colored(&told("--color always --sede", none)) && !colored(&told("--sede", none)));
    assert!(!colored(&told("--color never --sede", ("CLICOLOR_FORCE", "1"))));
    assert!(!colored(&both("--sede")));
    assert!(place.succeed("--color always refine --help").contains('\u{1b}'));
}
