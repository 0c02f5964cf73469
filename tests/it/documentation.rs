//! Every section of `docs/mathematics.md` that code, tests or the README cite exists there.

use std::fs;
use std::path::{Path, PathBuf};

const DOCUMENT: &str = "docs/mathematics.md";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All Rust files below a folder, in order of their paths.
fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).expect("the folder can be listed");
    let mut entries: Vec<PathBuf> = entries.map(|entry| entry.expect("the entry can be read").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The text without line breaks and comment markers, so that a citation may be wrapped.
fn unwrapped(text: &str) -> String {
    let lines = text.lines().map(|line| line.trim_start().trim_start_matches(['/', '!']).trim());
    lines.collect::<Vec<_>>().join(" ")
}

/// The section numbers of every citation, each with the text that follows the document's name.
fn citations(text: &str) -> Vec<(Vec<u32>, String)> {
    let mut citations = Vec::new();
    for after in text.split(DOCUMENT).skip(1) {
        let numbers = after.strip_prefix(", section").map(|rest| rest.strip_prefix('s').unwrap_or(rest));
        let words = numbers.unwrap_or_default().split_whitespace();
        let numbers = words
            .map(|word| word.trim_matches(|letter: char| !letter.is_ascii_digit() && !letter.is_alphabetic()))
            .filter(|word| *word != "and")
            .map_while(|word| word.parse().ok())
            .collect();
        citations.push((numbers, after.chars().take(30).collect()));
    }
    citations
}

#[test]
fn cited_sections_of_the_mathematics_exist() {
    let document = fs::read_to_string(root().join(DOCUMENT)).unwrap();
    let headings: Vec<u32> =
        document.lines().filter_map(|line| line.strip_prefix("## ")?.split_once(". ")?.0.parse().ok()).collect();
    assert_eq!(headings, (1..=10).collect::<Vec<u32>>(), "sections are numbered from 1");
    let mut files = Vec::new();
    for folder in ["src", "tests", "benches"] {
        rust_files(&root().join(folder), &mut files);
    }
    let mut cited = 0;
    for path in files.iter().filter(|path| !path.ends_with("tests/it/documentation.rs")) {
        for (numbers, after) in citations(&unwrapped(&fs::read_to_string(path).unwrap())) {
            assert!(!numbers.is_empty(), "{}: '{DOCUMENT}{after}' names no section", path.display());
            for number in numbers {
                assert!(headings.contains(&number), "{}: {DOCUMENT} has no section {number}", path.display());
                cited += 1;
            }
        }
    }
    assert!(cited >= 15, "only {cited} citations were found");
}

#[test]
fn citations_are_read() {
    let check = |text: &str, expected: &[u32]| {
        let found: Vec<u32> = citations(&unwrapped(text)).into_iter().flat_map(|(numbers, _)| numbers).collect();
        assert_eq!(found, expected, "{text}");
    };
    check("/// by docs/mathematics.md, section 7 (! where", &[7]);
    check("//! by the rule (docs/mathematics.md,\n//! section 8).", &[8]);
    check("agree with docs/mathematics.md, sections 7 and 9", &[7, 9]);
    check("docs/mathematics.md, section 4. docs/mathematics.md, section 5", &[4, 5]);
    check("see docs/mathematics.md for more", &[]);
}

#[test]
fn links_of_the_readme_lead_somewhere() {
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let links = readme.split("](").skip(1).filter_map(|rest| rest.split_once(')').map(|(target, _)| target));
    for target in links.filter(|target| !target.starts_with("http") && !target.starts_with('#')) {
        let path = target.split('#').next().unwrap_or_default();
        assert!(root().join(path).exists(), "README.md links to '{path}'");
    }
}
