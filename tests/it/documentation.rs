//! The documents agree with the program: cited sections and linked headings exist, commands and options are those that
//! it offers.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use dcvins::session::{ForkChanges, ParameterizationChoice, RunSpec};
use dcvins::simulation::Disturbances;
use dcvins::text::Named;

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
    // A path in quotes is no citation.
    for after in text.split(DOCUMENT).skip(1).filter(|after| !after.starts_with('"')) {
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
    assert_eq!(headings, (1..=11).collect::<Vec<u32>>(), "sections are numbered from 1");
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

/// All documents for readers.
fn documents() -> Vec<PathBuf> {
    let folder = fs::read_dir(root().join("docs")).expect("the folder can be listed");
    let mut paths: Vec<PathBuf> = folder.map(|entry| entry.expect("the entry can be read").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    paths.extend(["README.md", "assets/README.md", "sample_logs/README.md"].map(|name| root().join(name)));
    paths.sort();
    paths
}

/// The anchors of a document's headings, as forges make them; the second of two equal headings ends in `-1`.
fn anchors(text: &str) -> Vec<String> {
    let mut anchors: Vec<String> = Vec::new();
    for heading in headings(text) {
        let letters = heading.to_lowercase().replace(' ', "-");
        let plain: String =
            letters.chars().filter(|letter| letter.is_alphanumeric() || "-_".contains(*letter)).collect();
        let earlier = anchors.iter().filter(|anchor| **anchor == plain).count();
        anchors.push(if earlier == 0 { plain } else { format!("{plain}-{earlier}") });
    }
    anchors
}

/// The headings of a document, without those inside of code blocks.
fn headings(text: &str) -> impl Iterator<Item = &str> {
    let mut code = false;
    text.lines().filter_map(move |line| {
        code ^= line.starts_with("```");
        line.strip_prefix('#').filter(|_| !code).map(|rest| rest.trim_start_matches('#').trim())
    })
}

#[test]
fn links_of_the_documents_lead_somewhere() {
    let mut followed = 0;
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        let links = text.split("](").skip(1).filter_map(|rest| rest.split_once(')').map(|(target, _)| target));
        for target in links.filter(|target| !target.starts_with("http")) {
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let linked = if path.is_empty() { document.clone() } else { document.parent().unwrap().join(path) };
            let shown = document.display();
            assert!(linked.exists(), "{shown} links to '{target}', which does not exist");
            if !anchor.is_empty() {
                let anchors = anchors(&fs::read_to_string(&linked).unwrap());
                assert!(anchors.iter().any(|known| known == anchor), "{shown} links to '{target}': no such heading");
            }
            followed += 1;
        }
    }
    assert!(followed >= 40, "only {followed} links were found");
}

#[test]
fn the_readme_is_short() {
    let bytes = fs::metadata(root().join("README.md")).unwrap().len();
    assert!(bytes <= 8_000, "README.md has {bytes} bytes: move what is not needed at first sight to docs/");
}

/// What `dcvins COMMAND --help` prints; without a command, the list of the commands.
fn help(command: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_dcvins")).env("DCVINS_CACHE_DIR", "").args(command).arg("--help").output();
    String::from_utf8(output.expect("the program runs").stdout).expect("help is text")
}

/// The names of the commands that a help lists.
fn commands(text: &str) -> Vec<String> {
    let listed = text.split("Commands:").nth(1).unwrap_or_default().lines().skip(1);
    let names = listed.take_while(|line| !line.trim().is_empty()).filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

/// The long options in a text, `--out` of `--out DIR`.
fn options(text: &str) -> BTreeSet<String> {
    let starts = text.split("--").skip(1).zip(text.split("--"));
    let starts =
        starts.filter(|(_, before)| !before.ends_with(|letter: char| letter.is_alphanumeric() || letter == '-'));
    let names = starts
        .map(|(after, _)| after.chars().take_while(|letter| letter.is_ascii_lowercase() || "-_".contains(*letter)));
    let names = names.map(|name| name.collect::<String>().trim_end_matches('-').to_owned());
    names.filter(|name| !name.is_empty()).map(|name| format!("--{name}")).collect()
}

#[test]
fn commands_and_options_are_those_of_the_program() {
    let documented = fs::read_to_string(root().join("docs/commands.md")).unwrap();
    let manual_page = fs::read_to_string(root().join("assets/linux/dcvins.1")).unwrap();
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let common = ["--help", "--version"].map(str::to_owned);
    let mut known = BTreeSet::from(common.clone());
    let listed = commands(&help(&[]));
    assert!(listed.len() > 5, "the help lists the commands: {listed:?}");
    for command in listed {
        assert!(documented.contains(&format!("\n## {command}\n")), "docs/commands.md has no section '{command}'");
        assert!(readme.contains(&format!("`dcvins {command}")), "README.md does not list '{command}'");
        assert!(manual_page.contains(&format!("\n.B {command}\n")), "the manual page does not list '{command}'");
        let text = help(&[&command]);
        let mut offered = options(&text);
        for inner in commands(&text) {
            offered.extend(options(&help(&[&command, &inner])));
        }
        let lacks = |option: &&String| !documented.contains(*option) && !common.contains(option);
        let missing: Vec<&String> = offered.iter().filter(lacks).collect();
        assert!(missing.is_empty(), "docs/commands.md lacks options of {command}: {missing:?}");
        known.extend(offered);
    }
    // Options of other programs in the examples.
    known.extend(["--release", "--test", "--ignored"].map(str::to_owned));
    let unknown: Vec<String> = options(&documented).into_iter().filter(|option| !known.contains(option)).collect();
    assert!(unknown.is_empty(), "docs/commands.md names options that no command has: {unknown:?}");
}

/// Checks that a document holds a table with exactly these rows.
fn has_table(document: &str, head: &str, rows: &[String]) {
    let text = fs::read_to_string(root().join(document)).unwrap();
    let table = text.split_once(&format!("\n{head}\n| --- | --- |\n")).map(|(_, rest)| rest);
    let table = table.unwrap_or_else(|| panic!("{document} has no table '{head}'"));
    let documented: Vec<&str> = table.lines().take_while(|line| line.starts_with('|')).collect();
    let rows_text = rows.join("\n");
    assert_eq!(documented, rows, "{document} differs from the definitions, whose rows are:\n{rows_text}");
}

#[test]
fn tables_of_keys_are_those_of_the_definitions() {
    let run = RunSpec::default();
    let names = ParameterizationChoice::all().map(|choice| {
        let default = if choice == run.parameterization { " (default)" } else { "" };
        format!("| `{}`{default} | {} |", choice.name(), choice.meaning())
    });
    has_table("docs/commands.md", "| name | parameterization of the gimbal chain |", &names.collect::<Vec<_>>());
    let rows: Vec<String> = RunSpec::KEYS.iter().map(|key| key.document_row(&run)).collect();
    has_table("docs/commands.md", "| key | meaning |", &rows);
    let rows: Vec<String> = Disturbances::KEYS.iter().map(|key| key.document_row(&Disturbances::default())).collect();
    has_table("docs/commands.md", "| disturbance | effect |", &rows);
    let parameterization = "| `classical`, `minimal`, … | another parameterization of the same chain |".to_owned();
    let keys = ForkChanges::KEYS.iter().map(|key| key.document_row(&ForkChanges::default()));
    let rows: Vec<String> = std::iter::once(parameterization).chain(keys).collect();
    has_table("docs/manual.md", "| change | meaning |", &rows);
}
