//! Interrupted runs, resumed, end as if nothing had happened.

use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::fixture::Workplace;

const REFINE: &str = "refine --dataset ds --poses init.csv --method combined --iterations 3 --out r.csv --details r.npz";
const JOURNAL: &str = "r.csv.journal";

/// Six initial poses of two images.
fn workplace() -> Workplace {
    let place = Workplace::new();
    let poses = place.read("ds/init.csv");
    let (header, rows) = poses.split_once('\n').unwrap();
    // The same image several times asks for as many masks, of which there is one: each has a scene of its own.
    let mut text = format!("{header}\n{rows}");
    for scene in 2..=3 {
        place.copy("ds/test/000001", &format!("ds/test/00000{scene}"));
        for row in rows.lines() {
            text += &format!("{scene}{}\n", row.strip_prefix('1').unwrap());
        }
    }
    place.write("init.csv", &text);
    place
}

/// Runs until the journal holds some frames, then kills the process. `out` is what the process writes.
fn kill_midway(place: &Workplace, arguments: &str, journal: &str, out: &str) -> String {
    let start = Instant::now();
    let mut child = place.command(arguments).stdout(Stdio::null()).spawn().unwrap();
    loop {
        let text = std::fs::read_to_string(place.path(journal)).unwrap_or_default();
        if text.lines().count() >= 3 {
            child.kill().unwrap();
        }
        if let Some(status) = child.try_wait().unwrap() {
            if place.path(journal).exists() && !status.success() {
                return place.read(journal);
            }
            // On a busy machine it may end before it can be killed.
            place.remove(out);
            child = place.command(arguments).stdout(Stdio::null()).spawn().unwrap();
        }
        assert!(start.elapsed() < Duration::from_secs(300));
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_killed_refinement_resumes_wherever_its_journal_ends() {
    let place = workplace();
    place.succeed(REFINE);
    let whole = place.read("r.csv");
    let table = std::fs::read(place.path("r.npz")).unwrap();
    assert!(!place.path(JOURNAL).exists());
    assert_eq!(place.read("r.csv.times.csv").lines().count(), 7);
    assert!(place.poses("r.csv").iter().all(|row| row.time == -1.0));

    place.remove("r.csv");
    let journal = kill_midway(&place, &format!("{REFINE} --threads 1"), JOURNAL, "r.csv");
    assert!(!place.path("r.csv").exists());
    let kept = place.path("kept");
    std::fs::write(&kept, &journal).unwrap();
    let header = journal.find('\n').unwrap();
    // Within the header, after it, within a line, after one, and as it was left; and with any number of threads.
    let second = header + 1 + journal[header + 1..].find('\n').unwrap();
    for (threads, end) in [
        (1, 0),
        (2, header / 2),
        (3, header + 1),
        (1, second - 9),
        (2, second + 1),
        (2, journal.len()),
    ] {
        place.write(JOURNAL, &journal[..end]);
        place.succeed(&format!("{REFINE} --threads {threads}"));
        assert_eq!(place.read("r.csv"), whole, "cut at {end}");
        assert!(std::fs::read(place.path("r.npz")).unwrap() == table, "cut at {end}");
        assert!(!place.path(JOURNAL).exists());
    }
    // Frames that are in the journal are not refined again.
    let mut lines: Vec<String> = journal.lines().map(str::to_owned).collect();
    let mut first: serde_json::Value = serde_json::from_str(&lines[1]).unwrap();
    first["entry"]["pose"]["translation_m"][0] = 9.0.into();
    lines[1] = first.to_string();
    place.write(JOURNAL, &(lines.join("\n") + "\n"));
    place.succeed(REFINE);
    assert_ne!(place.read("r.csv"), whole);

    // Another run's journal is left alone, unless told otherwise.
    place.write(JOURNAL, &journal);
    let said = place.prehend(&format!("{REFINE} --seed 7"));
    assert_eq!(said.code, 1);
    assert!(said.err.contains("another run") && said.err.contains("seed: 0 | 7"), "{}", said.err);
    let said = place.prehend(&REFINE.replace("--iterations 3", "--iterations 4"));
    assert!(
        said.err.contains("iterations: 3") && said.err.contains("iterations: 4"),
        "{}",
        said.err
    );
    assert_eq!(place.read(JOURNAL), journal);
    place.succeed(&format!("{REFINE} --seed 7 --restart"));
    assert!(!place.path(JOURNAL).exists());
}

#[test]
fn histories_and_pages_survive_too() {
    let place = workplace();
    let command = format!("{REFINE} --json --report page --threads 1");
    let told = |text: String| {
        let mut told: serde_json::Value = serde_json::from_str(&text).unwrap();
        for frame in told["frames"].as_array_mut().unwrap() {
            assert!(frame.as_object_mut().unwrap().remove("seconds").unwrap().is_number());
        }
        told
    };
    let whole = told(place.succeed(&command));
    let page = place.read("page/index.html");
    place.remove("page");
    kill_midway(&place, &command, JOURNAL, "r.csv");
    assert_eq!(told(place.succeed(&command)), whole);
    assert_eq!(place.read("page/index.html"), page);
    assert_eq!(page.matches("data:image/jpeg").count(), 12);
}

#[test]
fn times_are_in_the_results_if_asked_for() {
    let place = workplace();
    place.succeed(&format!("{REFINE} --time"));
    assert!(place.poses("r.csv").iter().all(|row| row.time > 0.0));
}

#[test]
fn a_killed_study_resumes() {
    let place = workplace();
    let study = |out: &str| {
        format!("study noise --dataset ds --poses low=init.csv --iterations 2 --out {out}")
    };
    let whole = place.succeed(&study("whole.csv"));
    let kept = kill_midway(&place, &study("part.csv"), "part.csv", "part.csv");
    assert_eq!(place.succeed(&study("part.csv")), whole);
    let rows = |name: &str| crate::study::rows(&place, name);
    assert_eq!(
        crate::study::without_times(rows("part.csv")),
        crate::study::without_times(rows("whole.csv"))
    );
    // Whole rows are kept as they were, run times included.
    let part = place.read("part.csv");
    let whole_rows = kept.split_inclusive('\n').filter(|line| line.ends_with('\n'));
    assert!(whole_rows.clone().count() >= 3);
    assert!(whole_rows.into_iter().all(|row| part.contains(row)));
    let said = place.prehend(&study("part.csv").replace("--iterations 2", "--iterations 3"));
    assert!(
        said.code == 1 && said.err.contains("another run") && said.err.contains("settings: "),
        "{}",
        said.err
    );
    assert_eq!(place.read("part.csv"), part);
}

#[test]
fn a_killed_search_resumes() {
    let place = workplace();
    place.remove("init.csv");
    place.remove("ds/test/000003");
    let search = |out: &str| format!("initial --dataset ds --search --out {out}");
    place.succeed(&search("whole.csv"));
    assert!(!place.path("whole.csv.journal").exists());
    let journal = kill_midway(&place, &search("part.csv"), "part.csv.journal", "part.csv");
    assert!(!place.path("part.csv").exists());
    let said = place.prehend(&format!("{} --scene 1", search("part.csv")));
    assert!(said.code == 1 && said.err.contains("another run"), "{}", said.err);
    assert_eq!(place.read("part.csv.journal"), journal);
    place.succeed(&search("part.csv"));
    for file in ["", ".hypotheses.csv"] {
        assert_eq!(place.read(&format!("part.csv{file}")), place.read(&format!("whole.csv{file}")));
    }
    assert!(!place.path("part.csv.journal").exists());
}

#[test]
fn a_damaged_table_is_refused() {
    let place = workplace();
    let study = "study noise --dataset ds --poses low=init.csv --iterations 2 --out s.csv";
    place.succeed(study);
    place.replace("s.csv", "\nnoise,ds,", "\nnoise,ds");
    let said = place.prehend(study);
    assert!(said.code == 1 && said.err.contains("s.csv: line 2 is damaged"), "{}", said.err);
    place.succeed(&format!("{study} --restart"));
}

#[cfg(unix)]
#[test]
fn two_that_make_one_dataset_are_kept_apart() {
    let place = Workplace::empty();
    std::fs::create_dir(place.path("made")).unwrap();
    let held = std::fs::File::open(place.path("made")).unwrap();
    held.try_lock().unwrap();
    let synth = "synth --objects 061_foam_brick --frames 1 --out made";
    let said = place.prehend(synth);
    assert!(
        said.code == 1 && said.err.contains("made: another process is at work on it"),
        "{}",
        said.err
    );
    drop(held);
    place.succeed(synth);
}
