//! The Python module of the wheel: its options are those of the program; its tests and the notebook run with Python.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Largest notebook with its outputs, in bytes.
const MAX_NOTEBOOK_BYTES: u64 = 300_000;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn help(command: &str) -> String {
    let program = Command::new(env!("CARGO_BIN_EXE_dcvins")).args([command, "--help"]).output();
    String::from_utf8(program.expect("the program starts").stdout).expect("help is text")
}

/// Names of the keyword arguments of all calls of `options(…)` or `_draw(…)` in a Python source, as long options.
fn options_of(source: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for start in ["= options(", "*options(", "_draw(\n"] {
        for call in source.split(start).skip(1) {
            let mut depth = 1;
            let end = call.find(|letter| {
                depth += i32::from(letter == '(') - i32::from(letter == ')');
                depth == 0
            });
            let arguments = &call[..end.expect("the call ends")];
            let keywords = arguments.split(',').filter_map(|argument| argument.split_once('='));
            let is_name = |name: &&str| name.chars().all(|letter| letter.is_ascii_lowercase() || letter == '_');
            let keywords = keywords.map(|(name, _)| name.trim()).filter(is_name);
            names.extend(keywords.map(|name| format!("--{}", name.trim_end_matches('_').replace('_', "-"))));
        }
    }
    names
}

#[test]
fn options_of_the_module_are_those_of_the_program() {
    let files = [
        ("_run.py", "run"),
        ("_figures.py", "screenshot"),
        ("_check.py", "check"),
        ("_evaluate.py", "evaluate"),
        ("_simulate.py", "simulate"),
        ("_study.py", "sweep"),
        ("_calibration.py", "calibrate"),
    ];
    let mut count = 0;
    for (file, command) in files {
        let source = fs::read_to_string(root().join("assets/python/dcvins").join(file)).unwrap();
        let help = help(command);
        for option in options_of(&source) {
            // Before a value, before one that can be left out, or without one.
            let is_listed = [" ", "[", "\n"].iter().any(|after| help.contains(&format!("{option}{after}")));
            assert!(is_listed, "{file}: {option}");
            count += 1;
        }
    }
    assert!(count >= 60, "only {count} options were found");
}

#[test]
fn keyword_arguments_are_read_as_options() {
    let found = options_of("    given = options(rig=rig, size=f(a, b), from_=low, no_timing=not timing)\n    x(y=1)");
    assert_eq!(found, ["--rig", "--size", "--from", "--no-timing"].map(str::to_owned).into());
}

#[test]
fn the_notebook_has_outputs_and_is_small() {
    let path = root().join("docs/notebook.ipynb");
    assert!(fs::metadata(&path).unwrap().len() <= MAX_NOTEBOOK_BYTES);
    let notebook: serde_json::Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let cells = notebook["cells"].as_array().unwrap();
    let outputs: Vec<_> = cells.iter().filter_map(|cell| cell["outputs"].as_array()).flatten().collect();
    assert!(outputs.iter().all(|output| output["output_type"] != "error"), "a cell failed");
    for kind in ["image/svg+xml", "image/png", "text/html"] {
        assert!(outputs.iter().any(|output| output["data"].get(kind).is_some()), "no output is {kind}");
    }
}

/// Runs a Python program with the module and the program of this build; fails without the interpreter.
fn python(arguments: &[&str]) {
    let interpreter = std::env::var_os("DCVINS_PYTHON").map_or_else(|| PathBuf::from("python3"), PathBuf::from);
    let cache = tempfile::tempdir().expect("a temporary folder");
    let output = Command::new(&interpreter)
        .args(arguments)
        .current_dir(root())
        .env("DCVINS", env!("CARGO_BIN_EXE_dcvins"))
        .env("DCVINS_CACHE_DIR", cache.path())
        .env("PYTHONPATH", root().join("assets/python"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap_or_else(|error| panic!("cannot start {}: {error}", interpreter.display()));
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Run by `.ci/run`, which installs the packages, or by
/// `DCVINS_PYTHON=python3 cargo test --release --test it -- --ignored python`.
#[test]
#[ignore = "needs Python 3.9 with numpy and pandas"]
fn the_module_passes_its_tests() {
    python(&["-W", "error::ResourceWarning", "-m", "unittest", "discover", "-s", "tests/python"]);
}

#[test]
#[ignore = "needs Python 3.9 with numpy, pandas and matplotlib"]
fn the_notebook_computes_its_outputs() {
    python(&["tests/python/notebook.py", "docs/notebook.ipynb"]);
}
