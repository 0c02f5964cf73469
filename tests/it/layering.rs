//! The one-way order of the folders of `src/`, read from their imports.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders from the first to the last; each may use those before it. The table in `src/lib.rs` says what each promises.
const ORDER: [&str; 19] = [
    "text",
    "geometry",
    "camera",
    "gimbal",
    "sensors",
    "optimization",
    "flight_log",
    "frontend",
    "simulation",
    "estimator",
    "observability",
    "calibration",
    "log_check",
    "session",
    "study",
    "gui",
    "export",
    "cli",
    "main",
];

/// Folders that must not name another one although it comes before them.
const UNKNOWN_TO: [(&str, &[&str]); 5] = [
    ("flight_log", &["optimization"]),
    ("frontend", &["flight_log"]),
    ("estimator", &["flight_log"]),
    ("calibration", &["flight_log"]),
    ("observability", &["flight_log"]),
];

/// The only folders that may open, read or write files.
const FILE_SYSTEM: [&str; 3] = ["flight_log", "export", "cli"];

/// The only folders that may name the crates of the window; `export` draws its panels.
const WINDOW: [&str; 3] = ["gui", "export", "cli"];

/// One source file: the folder it belongs to and its text without comments.
struct Source {
    path: PathBuf,
    folder: String,
    text: String,
    /// Whether it holds tests only.
    test: bool,
}

fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut open = vec![root.clone()];
    let mut sources = Vec::new();
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).expect("the folder can be listed") {
            let path = entry.expect("the entry can be read").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let inside = path.strip_prefix(&root).expect("the file is below the root");
                let first = inside.components().next().expect("the path has a name").as_os_str().to_string_lossy();
                let test = inside.iter().any(|part| {
                    let part = part.to_string_lossy();
                    part.starts_with("tests") || part.ends_with("_tests.rs")
                });
                let text = code_of(&fs::read_to_string(&path).expect("the source is UTF-8"));
                sources.push(Source { folder: first.trim_end_matches(".rs").to_owned(), text, test, path });
            }
        }
    }
    sources.sort_by(|a, b| a.path.cmp(&b.path));
    assert!(sources.len() > 300, "only {} source files found", sources.len());
    sources
}

/// The text without comments and without the inline test module at its end.
fn code_of(text: &str) -> String {
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    let lines = text[..end].lines().map(|line| line.find("//").map_or(line, |comment| &line[..comment]));
    lines.flat_map(|line| [line, "\n"]).collect()
}

/// Names that stand directly behind `crate::` or `dcvins::`, groups in braces included.
fn named_folders(text: &str) -> Vec<String> {
    let mut names = Vec::new();
    for root in ["crate::", "dcvins::"] {
        for (at, _) in text.match_indices(root) {
            let rest = &text[at + root.len()..];
            if let Some(group) = rest.strip_prefix('{') {
                names.extend(first_names_of_group(group));
            } else {
                names.push(first_name(rest));
            }
        }
    }
    names
}

fn first_name(text: &str) -> String {
    text.chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect()
}

/// The first names of the entries of a group, whose opening brace has been read.
fn first_names_of_group(group: &str) -> Vec<String> {
    let mut names = Vec::new();
    let (mut depth, mut entry) = (0_usize, String::new());
    for letter in group.chars() {
        match letter {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => names.push(first_name(std::mem::take(&mut entry).trim())),
            _ if depth == 0 => entry.push(letter),
            _ => {}
        }
    }
    names.push(first_name(entry.trim()));
    names
}

fn position(folder: &str) -> Option<usize> {
    ORDER.iter().position(|name| *name == folder)
}

fn fail_on(violations: &[String]) {
    assert!(violations.is_empty(), "{}:\n{}", violations.len(), violations.join("\n"));
}

#[test]
fn groups_of_imports_are_read() {
    let text = "use crate::{gimbal::{Chain, Link}, camera, geometry::so3};\nfn f() { crate::session::start() }";
    assert_eq!(named_folders(text), ["gimbal", "camera", "geometry", "session"]);
}

#[test]
fn every_folder_has_its_place_in_the_order() {
    let sources = sources();
    let placed = |source: &Source| source.folder == "lib" || position(&source.folder).is_some();
    let violations: Vec<String> =
        sources.iter().filter(|source| !placed(source)).map(|source| source.path.display().to_string()).collect();
    fail_on(&violations);
}

#[test]
fn imports_point_one_way() {
    let mut violations = Vec::new();
    for source in sources().iter().filter(|source| !source.test && source.folder != "lib") {
        let own = position(&source.folder).unwrap();
        for name in named_folders(&source.text) {
            if position(&name).is_some_and(|other| other > own) {
                violations.push(format!(
                    "{}: '{}' uses '{name}', which comes later",
                    source.path.display(),
                    source.folder
                ));
            }
            let unknown = UNKNOWN_TO.iter().filter(|(folder, _)| *folder == source.folder);
            if unknown.flat_map(|(_, names)| names.iter()).any(|unknown| *unknown == name) {
                violations.push(format!("{}: '{}' must not know '{name}'", source.path.display(), source.folder));
            }
        }
    }
    fail_on(&violations);
}

#[test]
fn only_some_folders_name_the_window_and_the_file_system() {
    let mut violations = Vec::new();
    for source in sources().iter().filter(|source| !source.test && source.folder != "lib") {
        let mut only_in = |folders: &[&str], words: &[&str]| {
            let named = words.iter().find(|word| source.text.contains(**word));
            if let Some(word) = named.filter(|_| !folders.contains(&source.folder.as_str())) {
                violations.push(format!("{}: names {word}", source.path.display()));
            }
        };
        only_in(&WINDOW, &["egui", "wgpu"]);
        only_in(&FILE_SYSTEM, &["std::fs", "fs::read", "fs::write", "File::open", "File::create"]);
    }
    fail_on(&violations);
}
