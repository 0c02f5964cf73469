//! Every constant by which `faults/`, the rotations of `check` and `diagnose` decide has a row with its source in
//! docs/thresholds.md.

use std::collections::BTreeMap;

use super::imports::{is_test_file, source_files};

/// Folders, and files of others, whose constants have rows.
const DECIDE: [&str; 6] = [
    "faults/",
    "session/diagnosis/",
    "log_check/rotations/hypotheses/",
    "log_check/rotations/fit.rs",
    "log_check/rotations/data.rs",
    "log_check/extrinsics/hand_eye.rs",
];

/// Constants that are no numbers: tables, texts, columns of a fit.
const NOT_NUMBERS: [&str; 7] = ["TABLE", "CALIBRATE", "FACTORS", "BIAS", "OFFSET", "SCALE", "CHAIN"];

/// Values of the constants of a file by name, as written, each in one line.
fn constants(text: &str) -> Vec<(String, String)> {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let mut found = Vec::new();
    let mut lines = code.lines();
    while let Some(line) = lines.next() {
        let declared =
            line.strip_prefix("pub ").or_else(|| line.split_once(") ").map(|(_, rest)| rest)).unwrap_or(line);
        let declared = if line.starts_with("const ") { line } else { declared };
        let Some((name, rest)) = declared.strip_prefix("const ").and_then(|rest| rest.split_once(": ")) else {
            continue;
        };
        let mut text = rest.to_owned();
        while !text.ends_with(';') {
            let Some(next) = lines.next() else { break };
            text = format!("{text} {}", next.trim());
        }
        let value = text.split_once(" =").map_or("", |(_, value)| value.trim().trim_end_matches(';'));
        found.push((name.to_owned(), value.split_whitespace().collect::<Vec<_>>().join(" ")));
    }
    found
}

#[test]
fn numbers_that_decide_have_a_source() {
    let document = include_str!("../../docs/thresholds.md");
    let mut rows: BTreeMap<(String, String), (String, String)> = BTreeMap::new();
    for line in document.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
        let [file, name, value, _, _, source] = cells.as_slice() else { panic!("six cells in {line}") };
        let text = |cell: &str| cell.trim_matches('`').to_owned();
        assert!(["derived", "measured", "convention"].iter().any(|word| source.starts_with(word)), "{line}");
        rows.insert((text(file), text(name)), (text(value), (*source).to_owned()));
    }
    let mut wrong = Vec::new();
    for (file, text) in source_files() {
        if is_test_file(&file) || !DECIDE.iter().any(|place| file.starts_with(place)) {
            continue;
        }
        for (name, value) in constants(&text) {
            let is_parameter = file == "faults/table.rs" && name != "TABLE";
            let row = rows.remove(&(file.clone(), name.clone()));
            match row {
                Some((shown, _)) if shown == value => {}
                Some((shown, _)) => wrong.push(format!("{file}: {name} is {value}, not {shown}")),
                None if NOT_NUMBERS.contains(&&*name) && !is_parameter => {}
                None => wrong.push(format!("{file}: {name} = {value} has no row")),
            }
        }
    }
    wrong.extend(rows.keys().map(|(file, name)| format!("{file}: no constant {name}")));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
