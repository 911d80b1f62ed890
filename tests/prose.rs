//! Style of the pages: short sentences and paragraphs, and the field's words.

use std::path::{Path, PathBuf};
use std::{fs, io};

/// Longest sentence, and longest paragraph or list item \[words\].
const SENTENCE: usize = 35;
const PARAGRAPH: usize = 90;

/// Phrases for which the field has a term, with that term.
const PHRASES: [(&str, &str); 16] = [
    ("so many", "a number, or N"),
    ("manieth", "every Nth"),
    ("let off", "excluded"),
    ("ring false", "stuck, biased"),
    ("rings false", "stuck, biased"),
    ("known beforehand", "prior"),
    ("what is said of", "nominal, prior"),
    ("is said to be", "nominal, stated"),
    ("of one's own", "custom, user-defined"),
    ("as well as poses are", "with the accuracy of poses"),
    ("told apart", "distinguished"),
    ("what others call", "the term itself"),
    ("is nobody's", "belongs to no object"),
    ("nobody knows", "unknown"),
    ("makes energy", "is not passive"),
    ("sight of", "view, observation"),
];

/// Pages that people read.
fn pages() -> io::Result<Vec<PathBuf>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let named = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "python/README.md"];
    let mut pages: Vec<PathBuf> = named.iter().map(|name| root.join(name)).collect();
    for folder in ["docs", "docs/guide"] {
        for entry in fs::read_dir(root.join(folder))? {
            let path = entry?.path();
            if path.extension().is_some_and(|extension| extension == "md") {
                pages.push(path);
            }
        }
    }
    pages.sort();
    Ok(pages)
}

/// Paragraphs and list items of a page, without code, formulas, tables and headings.
fn paragraphs(page: &str) -> Vec<String> {
    let (mut all, mut text, mut fenced) = (Vec::new(), String::new(), false);
    for line in page.lines().map(str::trim).chain([""]) {
        let is_fence = line.starts_with("```");
        fenced ^= is_fence;
        let is_prose = !(fenced
            || is_fence
            || line.is_empty()
            || line.starts_with(['|', '#', '<'])
            || line.contains("]: "));
        let is_item = line.starts_with("- ")
            || line.split_once(". ").is_some_and(|(n, _)| n.parse::<u32>().is_ok());
        if !is_prose || is_item {
            all.extend(Some(std::mem::take(&mut text)).filter(|text| !text.is_empty()));
        }
        if is_prose {
            text += line;
            text.push(' ');
        }
    }
    all
}

/// Words of each sentence, a formula being one. A sentence ends where a capital letter or a bold word follows its mark.
fn sentences(paragraph: &str) -> Vec<Vec<&str>> {
    let mut all: Vec<Vec<&str>> = vec![Vec::new()];
    let mut formula = false;
    let outside = |word: &&str| {
        let within = formula;
        formula ^= word.matches('$').count() % 2 == 1;
        !within
    };
    let mut words = paragraph.split_whitespace().filter(outside).peekable();
    while let Some(word) = words.next() {
        if let Some(last) = all.last_mut() {
            last.push(word);
        }
        let ends = word.trim_end_matches(['*', ')', '"']).ends_with(['.', '!', '?', ':']);
        let begins =
            |next: &&str| next.starts_with(|c: char| c.is_uppercase() || "*`[".contains(c));
        if ends && words.peek().is_some_and(begins) {
            all.push(Vec::new());
        }
    }
    all
}

#[test]
fn pages_are_in_short_sentences_and_standard_terms() {
    let mut faults = Vec::new();
    for path in pages().unwrap() {
        let page = fs::read_to_string(&path).unwrap();
        let name = path.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap_or(&path).display();
        for paragraph in paragraphs(&page) {
            let begin: String = paragraph.chars().take(60).collect();
            let count = paragraph.split_whitespace().count();
            if count > PARAGRAPH {
                faults.push(format!("{name}: a paragraph of {count} words: {begin}"));
            }
            for sentence in sentences(&paragraph).iter().filter(|s| s.len() > SENTENCE) {
                let (count, begin) = (sentence.len(), sentence[..8].join(" "));
                faults.push(format!("{name}: a sentence of {count} words: {begin}"));
            }
            let lower = paragraph.to_lowercase();
            let found = PHRASES.iter().filter(|(phrase, _)| lower.contains(phrase));
            faults.extend(
                found.map(|(phrase, term)| format!("{name}: {phrase:?} is {term}: {begin}")),
            );
        }
    }
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn prose_is_found() {
    let page = "# A\nOne two. Three\nfour: `five` six.\n\n| a |\n```\ncode\n```\n- item\n- other";
    assert_eq!(paragraphs(page), ["One two. Three four: `five` six. ", "- item ", "- other "]);
    let lengths: Vec<usize> =
        sentences("One two. Three four: `five` six.").iter().map(Vec::len).collect();
    assert_eq!(lengths, [2, 2, 2]);
}
