//! Options from a file.

use crate::fixture::Workplace;

/// The program's options in effect.
fn printed(place: &Workplace, arguments: &str) -> toml::Table {
    place.succeed(&format!("{arguments} --print-config")).parse().unwrap()
}

#[test]
fn a_file_has_options_of_all_commands_and_the_command_line_wins() {
    let place = Workplace::empty();
    place.write(
        "prehend.toml",
        "color = \"never\"\n[refine]\ndataset = \"ds\"\nposes = \"p.csv\"\nout = \"o.csv\"\nseed = 4\nscene = [1, 2]\n\
         json = true\nterms = [\"depth\", \"rendering\"]\n[study]\nseed = 3\nposes = \"low=a.csv\"\n\
         [synth]\ncontact-area = [10, 20.5]\nlens = \"brown_conrady:-0.3,0.1,0.001,0,0\"\n[symmetry]\ntolerance = 0.01\n",
    );
    let config = "--config prehend.toml";
    let all = printed(&place, &format!("refine {config}"));
    let refine = &all["refine"];
    assert_eq!((all["color"].as_str(), refine["dataset"].as_str()), (Some("never"), Some("ds")));
    assert_eq!((refine["seed"].as_integer(), refine["json"].as_bool()), (Some(4), Some(true)));
    assert_eq!(refine["scene"], vec![1, 2].into());
    assert_eq!(refine["terms"], vec!["depth", "rendering"].into());
    // Defaults are in effect, too.
    assert_eq!(refine["device"].as_str(), Some("cpu"));
    // A list of the file is replaced, not continued, wherever the file is named.
    for line in [
        format!("{config} refine --scene 9 --seed 5"),
        format!("refine --scene 9 --seed 5 {config}"),
    ] {
        let refine = printed(&place, &line)["refine"].clone();
        assert_eq!((refine["seed"].as_integer(), &refine["scene"]), (Some(5), &vec![9].into()));
    }
    // An option that excludes others of the file takes their place.
    let refine = printed(&place, &format!("refine {config} --frame f.json"))["refine"].clone();
    assert_eq!(refine["frame"].as_str(), Some("f.json"));
    assert!(["dataset", "poses", "scene"].iter().all(|name| refine.get(name).is_none()));
    assert_eq!(refine["seed"].as_integer(), Some(4));
    let study = printed(&place, &format!("study confidence {config}"))["study"].clone();
    assert_eq!(study["poses"], vec!["low=a.csv"].into());
    assert_eq!(study["seed"].as_integer(), Some(3));
    let synth = printed(&place, &format!("synth --out d {config}"))["synth"].clone();
    assert_eq!(synth["contact-area"].as_array().unwrap().len(), 2);
    assert_eq!(synth["contact-area"][1].as_float(), Some(20.5));
    assert_eq!(synth["lens"].as_str(), Some("brown_conrady:-0.3,0.1,0.001,0,0"));
    let synth = printed(&place, "synth --out d --contact-area 30,50")["synth"].clone();
    assert_eq!(synth["contact-area"], vec![30, 50].into());
    let symmetry = printed(&place, &format!("symmetry --models m {config}"))["symmetry"].clone();
    assert_eq!(symmetry["tolerance"].as_float(), Some(0.01));
}

/// What is printed is a file that gives the same again, and names what it leaves open.
#[test]
fn printed_options_read_back() {
    let place = Workplace::empty();
    for line in [
        "-vv refine --frame f.json --threads 2 --rig 7 --color always",
        "initial --dataset a\\b --noise low --out \"o\" --object 1 --object 2 --seed 18446744073709551615",
        "track --dataset d --search --out o.csv --rate 12.5 --time --quiet",
        "synth --out 007 --mesh a.ply --mass 0.1 --mass 2 --sensor rig --sensor depth.noise=0.001",
        "study robustness --dataset d --out o.csv --sweeps depth-noise,visibility --shard 1/3",
    ] {
        let first = place.succeed(&format!("{line} --print-config"));
        place.write("printed.toml", &first);
        let mut command = line.split_whitespace().filter(|word| !word.starts_with('-'));
        let command = command.next().unwrap().to_owned();
        let command = if command == "study" { "study robustness".into() } else { command };
        let again = place.succeed(&format!("{command} --config printed.toml --print-config"));
        assert_eq!(first, again, "{line}");
    }
    let open = place.succeed("refine --print-config");
    assert!(open.contains("# dataset = DIR\n") && open.contains("[refine]\n"), "{open}");
}

#[test]
fn a_run_takes_its_options_from_the_file() {
    let place = Workplace::new();
    place.write(
        "prehend.toml",
        "[refine]\ndataset = \"ds\"\nposes = \"ds/init.csv\"\nmethod = \"combined\"\niterations = 2\nimage = 0\nout = \"r.csv\"\n",
    );
    let told = place.succeed("refine --config prehend.toml");
    assert!(told.starts_with("1 poses refined in "), "{told}");
    place.succeed(
        "refine --dataset ds --poses ds/init.csv --method combined --iterations 2 --image 0 --out s.csv",
    );
    assert_eq!(place.read("r.csv"), place.read("s.csv"));
}

#[test]
fn a_fault_of_the_file_names_file_and_key() {
    let place = Workplace::empty();
    for (text, command, expected) in [
        ("speed = 1", "refine", "speed: there is no such option of all commands"),
        ("[refine]\nseeed = 1", "check", "refine.seeed: there is no such option of `refine`"),
        ("[study]\nx = 1", "check", "study.x: there is no such option of `study`"),
        ("[refin]\nseed = 1", "refine", "refin: there is no such command"),
        ("config = \"b.toml\"", "refine", "config: there is no such option"),
        ("[refine]\nhelp = true", "refine", "refine.help: there is no such option"),
        ("[refine]\nseed = [1]", "check", "refine.seed: takes one value, not a list"),
        ("[refine]\nseed = 1979-05-27", "check", "refine.seed: must be text or a number"),
        ("[refine]\njson = 1", "check", "refine.json: must be true or false"),
        ("verbose = true", "check", "verbose: must be a count"),
        ("[refine]\nseed = -1", "refine", "refine.seed: invalid value '-1' for '--seed <N>'"),
        ("[refine]\nmethod = \"magic\"", "refine", "refine.method: invalid value 'magic'"),
        ("color = \"red\"", "refine", "color: invalid value 'red' for '--color <WHEN>'"),
        ("[refine]\nframe = \"f\"\nposes = \"p\"", "refine", "cannot be used with"),
        ("[refine]\nseed", "refine", "line 2: "),
    ] {
        place.write("a.toml", text);
        let said = place.prehend(&format!("{command} --config a.toml"));
        assert_eq!((said.code, said.out.as_str()), (1, ""), "{text}");
        assert!(said.err.starts_with("error: a.toml: "), "{text}: {}", said.err);
        assert!(said.err.contains(expected), "{text}: {}", said.err);
    }
    let said = place.prehend("refine --config none.toml");
    assert!(said.code == 1 && said.err.starts_with("error: none.toml: "), "{}", said.err);
    // The command line's own faults are told as ever.
    place.write("a.toml", "[refine]\nseed = 1\n");
    let said = place.prehend("refine --config a.toml --frame f.json --sede 1");
    assert!(
        said.code == 1 && said.err.starts_with("error: unexpected argument '--sede'"),
        "{}",
        said.err
    );
    let said = place.prehend("refine --config a.toml");
    assert!(said.code == 1 && said.err.contains("--dataset <DIR>"), "{}", said.err);
}

/// Options of the file do not become words behind `--`.
#[test]
fn positions_behind_dashes_stay_what_they_are() {
    let place = Workplace::empty();
    place.write("a.toml", "[info]\njson = true\n");
    let said = place.prehend("info --config a.toml -- --odd");
    assert!(said.code == 1 && said.err.contains("--odd"), "{}", said.err);
    assert!(!said.err.contains("unexpected argument"), "{}", said.err);
}
