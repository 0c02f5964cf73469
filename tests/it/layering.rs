//! The one-way order of the folders of `src/` and of the files in them, read from their imports.

use super::imports::{Imports, is_test_file, source_files};

/// Folders from the first to the last; each may use those before it. The table in `src/lib.rs` says what each promises.
const ORDER: [&str; 23] = [
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
    "interop",
    "report",
    "sweep",
    "desktop",
    "cli",
    "main",
];

/// Folders that must not import another one although it precedes them.
const UNKNOWN_TO: [(&str, &[&str]); 5] = [
    ("flight_log", &["optimization"]),
    ("frontend", &["flight_log"]),
    ("estimator", &["flight_log"]),
    ("calibration", &["flight_log"]),
    ("observability", &["flight_log"]),
];

/// The only folders that may open, read or write files.
const FILE_SYSTEM: [&str; 7] = ["flight_log", "export", "interop", "report", "sweep", "desktop", "cli"];

/// The only folders that may name the crates of the window; `export` draws its panels.
const WINDOW: [&str; 3] = ["gui", "export", "cli"];

/// One source file: the folder it belongs to and its text without comments.
struct Source {
    /// Path below `src`.
    name: String,
    folder: String,
    text: String,
    /// True if it contains tests only.
    test: bool,
}

fn sources() -> Vec<Source> {
    let sources: Vec<Source> = source_files()
        .into_iter()
        .map(|(name, text)| {
            let first = name.split('/').next().expect("a split has a first part");
            Source {
                folder: first.trim_end_matches(".rs").to_owned(),
                text: code_of(&text),
                test: is_test_file(&name),
                name,
            }
        })
        .collect();
    assert!(sources.len() > 300, "only {} source files found", sources.len());
    sources
}

/// The text without comments and without the inline test module at its end.
fn code_of(text: &str) -> String {
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    let lines = text[..end].lines().map(|line| line.find("//").map_or(line, |comment| &line[..comment]));
    lines.flat_map(|line| [line, "\n"]).collect()
}

/// Names directly after `crate::` or `dcvins::`, groups in braces included.
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

/// First names of the entries of a group, whose opening brace has already been read.
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
        sources.iter().filter(|source| !placed(source)).map(|source| source.name.clone()).collect();
    fail_on(&violations);
}

#[test]
fn imports_point_one_way() {
    let mut violations = Vec::new();
    for source in sources().iter().filter(|source| !source.test && source.folder != "lib") {
        let own = position(&source.folder).unwrap();
        for name in named_folders(&source.text) {
            if position(&name).is_some_and(|other| other > own) {
                violations.push(format!("{}: '{}' uses '{name}', which comes later", source.name, source.folder));
            }
            let unknown = UNKNOWN_TO.iter().filter(|(folder, _)| *folder == source.folder);
            if unknown.flat_map(|(_, names)| names.iter()).any(|unknown| *unknown == name) {
                violations.push(format!("{}: '{}' must not know '{name}'", source.name, source.folder));
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
                violations.push(format!("{}: names {word}", source.name));
            }
        };
        only_in(&WINDOW, &["egui", "wgpu"]);
        only_in(&FILE_SYSTEM, &["std::fs", "fs::read", "fs::write", "File::open", "File::create"]);
    }
    fail_on(&violations);
}

#[test]
fn circles_are_found_through_groups_parents_and_reexports() {
    let file = |name: &str, text: &str| (name.to_owned(), text.to_owned());
    let circles = |texts: &[(String, String)]| Imports::of(texts.to_vec()).circles();
    let parent = file("a/mod.rs", "mod b;\nmod c;\npub use c::C;");
    let tied = [
        file("lib.rs", "mod a;"),
        parent.clone(),
        file("a/b.rs", "use super::C;\npub struct B;\nfn text() -> &'static str { \"crate::a::c::C\" }"),
        file("a/c.rs", "use std::{fmt, fs};\nuse crate::a::{b::{self, D as E}};\npub struct C(b::B);"),
    ];
    assert_eq!(circles(&tied), [["a/b.rs -> a/c.rs: C", "a/c.rs -> a/b.rs: B, D"]]);

    let untied = [
        file("lib.rs", "mod a;"),
        parent,
        file("a/b.rs", "pub struct B;\n#[cfg(test)]\nmod tests {\n    use super::super::c::C;\n}"),
        file("a/c.rs", "use super::b::B;\npub struct C(B);\nmod inner {\n    use super::C;\n}"),
    ];
    assert_eq!(circles(&untied), Vec::<Vec<String>>::new());
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let circles = Imports::read().circles();
    let lines: Vec<String> = circles.iter().map(|circle| circle.join("\n")).collect();
    assert!(lines.is_empty(), "{} circles:\n{}", lines.len(), lines.join("\n\n"));
}
