//! Structure of the crates: no modules that import each other in a circle, and a budget of lines each.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Lines of code of each crate at most, without blanks, comments and tests. More needs a reason in the commit that raises it.
const BUDGETS: [(&str, usize); 5] = [
    ("autodiff", 3_396),
    ("geometry", 14_939),
    ("sim", 16_567),
    ("render", 10_220),
    ("refine", 30_503),
];

type Imports = BTreeMap<String, BTreeSet<String>>;

/// Top-level modules of a crate by the ones that they import, tests left out.
fn imports(sources: &Path) -> io::Result<Imports> {
    let mut found = Imports::new();
    for file in rust_files(sources)? {
        let inner = file.strip_prefix(sources).unwrap_or(&file);
        let top = inner.iter().next().and_then(|name| name.to_str()).unwrap_or_default();
        let module = top.trim_end_matches(".rs").to_owned();
        let is_test = file.file_stem().is_some_and(|stem| stem == "tests");
        if ["lib", "bin", "main"].contains(&module.as_str()) || is_test {
            continue;
        }
        let text = fs::read_to_string(&file)?;
        let code: String = text
            .split("#[cfg(test)]\nmod ")
            .flat_map(|part| part.split("#[cfg(test)]\npub(crate) mod "))
            .next()
            .unwrap_or_default()
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .collect::<Vec<_>>()
            .join("\n");
        let of_module = found.entry(module.clone()).or_default();
        for part in code.split("crate::").skip(1) {
            let name: String =
                part.chars().take_while(|c| c.is_ascii_lowercase() || *c == '_').collect();
            if name != module && part[name.len()..].starts_with("::") {
                of_module.insert(name);
            }
        }
    }
    Ok(found)
}

fn rust_files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            files.extend(rust_files(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(files)
}

/// Modules that are left when those that import no others of them are taken away, one after the other: those in circles, and what imports these.
fn circles(mut imports: Imports) -> Imports {
    loop {
        let known: BTreeSet<String> = imports.keys().cloned().collect();
        let is_leaf = |of: &BTreeSet<String>| of.is_disjoint(&known);
        let leaves: Vec<String> =
            imports.iter().filter(|(_, of)| is_leaf(of)).map(|(name, _)| name.clone()).collect();
        if leaves.is_empty() {
            return imports;
        }
        leaves.iter().for_each(|leaf| drop(imports.remove(leaf)));
    }
}

#[test]
fn modules_of_refine_form_no_circle() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/refine/src");
    let imports = imports(&sources).unwrap();
    assert!(imports.len() > 10 && imports["factor"].contains("problem"), "{imports:?}");
    let left = circles(imports);
    assert!(left.is_empty(), "in a circle, or above one: {left:#?}");
}

/// Lines of a file that are neither blank, nor comments, nor of items for tests alone.
fn lines_of_code(text: &str) -> usize {
    let (mut count, mut depth) = (0, 0);
    let (mut of_tests, mut begun) = (false, false);
    for line in text.lines().map(str::trim) {
        of_tests |= line.starts_with("#[cfg(test)]");
        if !of_tests {
            count += usize::from(!line.is_empty() && !line.starts_with("//"));
            continue;
        }
        // To the end of the item: its last brace, or a semicolon outside of any.
        if line.starts_with("#[") {
            continue;
        }
        depth += line.matches('{').count() as i64 - line.matches('}').count() as i64;
        begun |= line.contains('{');
        if depth <= 0 && (begun || line.ends_with(';')) {
            (of_tests, begun, depth) = (false, false, 0);
        }
    }
    count
}

/// Files of modules that `file`, with that content, declares for tests alone.
fn files_of_test_modules<'a>(file: &'a Path, text: &'a str) -> impl Iterator<Item = PathBuf> + 'a {
    let stem = file.file_stem().unwrap_or_default();
    let is_root = ["lib", "main", "mod"].iter().any(|root| stem == *root);
    let folder = if is_root { file.with_file_name("") } else { file.with_extension("") };
    let declared = text.split("#[cfg(test)]\n").skip(1).filter_map(|rest| {
        let line = rest.lines().next()?.trim();
        line.strip_suffix(';')?.split_once("mod ").map(|(_, name)| name.to_owned())
    });
    declared.map(move |name| folder.join(name).with_extension("rs"))
}

#[test]
fn crates_keep_their_budgets_of_lines() {
    let mut above = Vec::new();
    for (name, budget) in BUDGETS {
        let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates").join(name).join("src");
        let files = rust_files(&sources).unwrap();
        let texts: Vec<String> =
            files.iter().map(|file| fs::read_to_string(file).unwrap()).collect();
        let declared = files.iter().zip(&texts);
        let of_tests: BTreeSet<PathBuf> =
            declared.flat_map(|(file, text)| files_of_test_modules(file, text)).collect();
        let mut lines = 0;
        for (file, text) in files.iter().zip(&texts) {
            let inner = file.strip_prefix(&sources).unwrap_or(file);
            let in_tests = inner.iter().any(|part| part == "tests");
            let is_code = !in_tests && !of_tests.contains(file);
            lines += if is_code { lines_of_code(text) } else { 0 };
        }
        assert!(lines > 1_000, "{name}: {lines} lines");
        println!("{name}: {lines} of {budget} lines");
        if lines > budget {
            above.push(format!("{name}: {lines} lines, budget {budget}"));
        }
    }
    assert!(above.is_empty(), "{above:?}");
}

#[test]
fn lines_are_counted_without_comments_and_tests() {
    let file = "//! A.\n\nuse a;\n#[cfg(test)]\nuse b;\nfn c() {\n    // d\n    e();\n}\n\
                #[cfg(test)]\nmod tests {\n    fn f() {\n    }\n}\nstruct G;\n";
    assert_eq!(lines_of_code(file), 5);
}

#[test]
fn modules_of_sim_form_no_circle() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/sim/src");
    let mut imports = imports(&sources).unwrap();
    // Those that name the whole crate.
    for module in ["guide", "prelude", "scenes"] {
        imports.remove(module);
    }
    assert!(imports.len() > 10 && imports["model"].contains("contact"), "{imports:?}");
    let left = circles(imports);
    assert!(left.is_empty(), "in a circle, or above one: {left:#?}");
}

#[test]
fn a_circle_is_found() {
    let of = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let imports = Imports::from([
        ("a".into(), of(&["b"])),
        ("b".into(), of(&["c"])),
        ("c".into(), of(&["b", "d"])),
        ("d".into(), of(&[])),
    ]);
    assert_eq!(circles(imports).into_keys().collect::<Vec<_>>(), ["a", "b", "c"]);
}
