//! The one-way order of the folders of `src/` and of the files in them, read from their imports.

use super::imports::{Imports, ROOTS, is_test_file, source_files};

/// Folders from the first to the last; each may use those before it. The table in `src/lib.rs` says what each promises.
const ORDER: [&str; 28] = [
    "text",
    "geometry",
    "table",
    "camera",
    "gimbal",
    "sensors",
    "faults",
    "optimization",
    "files",
    "flight_log",
    "frontend",
    "simulation",
    "simulated_log",
    "estimator",
    "observability",
    "calibration",
    "log_check",
    "session",
    "study",
    "painting",
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
const UNKNOWN_TO: [(&str, &[&str]); 6] = [
    ("files", &["optimization"]),
    ("flight_log", &["optimization"]),
    ("frontend", &["files", "flight_log"]),
    ("estimator", &["files", "flight_log"]),
    ("calibration", &["files", "flight_log"]),
    ("observability", &["files", "flight_log"]),
];

/// The only folders that may open, read or write files.
const FILE_SYSTEM: [&str; 8] = ["files", "flight_log", "export", "interop", "report", "sweep", "desktop", "cli"];

/// The only folders that may name the crates of the window; `painting` paints its frames, `export` draws its panels.
const WINDOW: [&str; 4] = ["painting", "gui", "export", "cli"];

/// Circles between the files and subfolders of one folder that are still there, as `folder: child child …`.
const KNOWN_CIRCLES: &[&str] = &[];

/// Loose files that use a subfolder of their folder although files in subfolders use them.
const KNOWN_ARROWS_UP: &[&str] = &["gui/determination.rs", "gui/events.rs", "gui/findings.rs", "gui/panel.rs"];

/// Folders or files with others that they must not import, as docs/architecture.md states under "Invariants".
const MUST_NOT_IMPORT: &[(&str, &[&str])] = &[
    // Values, column order and first estimates; no other folder of the estimator.
    ("estimator/state", &["estimator"]),
    // A factor depends on states and measurements, not on the window.
    ("estimator/factors", &["estimator/window", "estimator/problem", "estimator/start", "estimator/report"]),
    // Creates no events and does not decide which frames and features are in the window.
    ("estimator/problem", &["estimator/report", "estimator/window", "estimator/start", "estimator/initialization"]),
    // Depends neither on the window nor on the configuration.
    ("estimator/initialization", &["estimator/window", "estimator/config", "estimator/start", "estimator/problem"]),
    ("estimator/window", &["estimator/estimator", "estimator/start", "estimator/explain"]),
    // A report never refers to the estimator or the window.
    ("estimator/report", &["estimator/estimator", "estimator/window", "estimator/start", "estimator/explain"]),
    // Blocks of the Jacobian come from the report alone.
    ("estimator/explain", &["estimator/estimator", "estimator/window", "estimator/start", "estimator/config"]),
    // The analysis gets a linearization, a chain and joint angles, not the estimator.
    ("observability/analysis", &["estimator/estimator", "estimator/window", "estimator/report", "estimator/factors"]),
    ("observability", &["estimator/estimator", "estimator/start"]),
    // Runs no estimator.
    ("log_check", &["estimator", "observability", "calibration", "simulation", "simulated_log"]),
    ("session/plan", &["session/record", "session/engine", "session/diagnosis", "session/playback"]),
    ("session/misfit", &["session/record", "session/engine", "session/diagnosis", "session/playback"]),
    // No thread and no estimator.
    ("session/record", &["session/engine", "session/diagnosis", "session/playback", "estimator/estimator"]),
    ("session/result", &["session/engine", "session/diagnosis", "session/playback", "estimator/estimator"]),
    ("session/engine", &["session/diagnosis", "session/playback"]),
    ("session/diagnosis", &["session/playback"]),
    ("session/breakpoints", &["session/engine", "session/diagnosis", "session/playback"]),
    // A panel reads the record and runs no estimator; files go through a trait.
    ("gui", &["estimator/packed", "session/engine/threads", "session/engine/run_engine"]),
    ("interop", &["session", "estimator"]),
    // Figures are handed in.
    ("report", &["gui", "estimator"]),
    ("desktop", &["session", "estimator"]),
];

/// Imports that break an invariant and are still there, as `from -> to`.
const KNOWN_BREACHES: &[&str] = &[];

/// Folders whose files must not name these words outside comments and tests.
const MUST_NOT_NAME: &[(&str, &[&str])] = &[
    ("session/record/", &["std::thread", "thread::spawn", "Mutex", "channel("]),
    ("estimator/", &["std::thread", "Instant::now", "SystemTime"]),
    ("simulation/", &["Instant::now", "SystemTime"]),
    ("simulated_log/", &["Instant::now", "SystemTime"]),
];

/// One source file: the folder it belongs to and its text without comments.
struct Source {
    /// Path below `src`.
    name: String,
    folder: String,
    text: String,
    /// True if it contains tests only.
    test: bool,
}

/// True for the root of a crate, which declares or re-exports folders.
fn is_root(source: &Source) -> bool {
    source.name == "lib.rs" || ROOTS.contains(&source.name.as_str()) && source.name != "main.rs"
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

/// Fails on findings that are not among the known ones, and on known ones that are gone.
fn fail_on_difference<'a>(found: impl Iterator<Item = (&'a str, &'a [String])>, known: &[&str]) {
    let mut gone: Vec<&str> = known.to_vec();
    let mut violations = Vec::new();
    for (key, imports) in found {
        if known.contains(&key) {
            gone.retain(|known| *known != key);
        } else {
            violations.push(format!("{key}\n    {}", imports.join("\n    ")));
        }
    }
    violations.extend(gone.iter().map(|known| format!("{known}: gone, remove it from the list")));
    fail_on(&violations);
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
    let placed = |source: &Source| is_root(source) || position(&source.folder).is_some();
    let violations: Vec<String> =
        sources.iter().filter(|source| !placed(source)).map(|source| source.name.clone()).collect();
    fail_on(&violations);
}

#[test]
fn imports_point_one_way() {
    let mut violations = Vec::new();
    for source in sources().iter().filter(|source| !source.test && !is_root(source)) {
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
    for source in sources().iter().filter(|source| !source.test && !is_root(source)) {
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

#[test]
fn siblings_and_arrows_up_are_found() {
    let file = |name: &str, text: &str| (name.to_owned(), text.to_owned());
    let imports = Imports::of(vec![
        file("lib.rs", "mod a;"),
        file("a/mod.rs", "mod b;\nmod c;\nmod ground;\nmod roof;"),
        file("a/b/mod.rs", "mod d;\nuse super::c::C;\npub struct B(C);"),
        file("a/b/d.rs", "use crate::a::{ground::Ground, roof::Roof};\npub struct D(Ground, Roof);"),
        file("a/c.rs", "use super::b::d::D;\npub struct C;\nfn f(_: D) {}"),
        file("a/ground.rs", "pub struct Ground;"),
        file("a/roof.rs", "use super::c::C;\npub struct Roof(C);"),
    ]);
    let circles = imports.sibling_circles();
    let expected = ["a/b/mod.rs -> a/c.rs: C", "a/b/d.rs -> a/roof.rs: Roof", "a/c.rs -> a/b/d.rs: D"];
    assert_eq!(circles.keys().collect::<Vec<_>>(), ["a: b c.rs roof.rs"]);
    assert!(expected.iter().all(|line| circles["a: b c.rs roof.rs"].iter().any(|found| found == line)), "{circles:?}");
    let arrows = imports.arrows_up();
    assert_eq!(arrows["a/roof.rs"], ["a/b/d.rs -> a/roof.rs: Roof"]);
    assert!(!arrows.contains_key("a/ground.rs"), "{arrows:?}");
    assert_eq!(imports.against(&[("a/b", &["a/c", "b"])]), ["a/b/mod.rs -> a/c.rs: C"]);
    assert_eq!(imports.against(&[("a/b", &["a"])]).len(), 3);
}

/// Each file and each subfolder of a folder is one node, to which all imports of its files belong.
#[test]
fn the_files_and_subfolders_of_a_folder_have_an_order() {
    let imports = Imports::read();
    let circles = imports.sibling_circles();
    fail_on_difference(circles.iter().map(|(key, lines)| (key.as_str(), lines.as_slice())), KNOWN_CIRCLES);
}

/// A file in a subfolder may use a loose file of the folders around it only if this is on the ground floor there: it
/// uses no subfolder, neither itself nor through other loose files. So a reader knows of each loose file whether the
/// subfolders are built on it or it on them.
#[test]
fn subfolders_use_only_the_ground_floor_of_the_folders_around_them() {
    let imports = Imports::read();
    let arrows = imports.arrows_up();
    fail_on_difference(arrows.iter().map(|(key, lines)| (*key, lines.as_slice())), KNOWN_ARROWS_UP);
}

#[test]
fn folders_keep_their_invariants() {
    let breaches = Imports::read().against(MUST_NOT_IMPORT);
    let found = breaches.iter().map(|line| (line.split(':').next().unwrap_or(line), std::slice::from_ref(line)));
    fail_on_difference(found, KNOWN_BREACHES);
    let mut named = Vec::new();
    for source in sources().iter().filter(|source| !source.test) {
        let rules = MUST_NOT_NAME.iter().filter(|(folder, _)| source.name.starts_with(folder));
        let words = rules.flat_map(|(_, words)| words.iter()).filter(|word| source.text.contains(**word));
        named.extend(words.map(|word| format!("{}: names {word}", source.name)));
    }
    fail_on(&named);
}

#[test]
fn every_source_file_is_declared_by_its_parent() {
    let files = source_files();
    let text_of = |name: &str| files.iter().find(|(file, _)| file == name).map(|(_, text)| text);
    let declared = |name: &str| {
        let path = name.strip_suffix("/mod.rs").or_else(|| name.strip_suffix(".rs")).expect("it is a Rust file");
        let (parents, module) = match path.rsplit_once('/') {
            Some((parent, module)) => {
                (vec![format!("{parent}.rs"), format!("{parent}/mod.rs"), format!("{parent}/lib.rs")], module)
            }
            None => (["lib.rs"].into_iter().chain(ROOTS).map(str::to_owned).collect(), path),
        };
        parents.iter().filter_map(|parent| text_of(parent)).any(|text| text.contains(&format!("mod {module};")))
    };
    let orphans: Vec<String> = files
        .iter()
        .map(|(name, _)| name.clone())
        .filter(|name| !name.ends_with("lib.rs") && !ROOTS.contains(&name.as_str()) && !declared(name))
        .collect();
    fail_on(&orphans);
}
