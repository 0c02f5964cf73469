//! Every constant by which `faults/`, `check` and `diagnose` decide has a row with its source in docs/thresholds.md.

use std::collections::BTreeMap;

use super::imports::{is_test_file, source_files};

/// Folders and files whose constants have rows.
const DECIDE: [&str; 6] = [
    "faults/",
    "session/diagnosis/",
    "session/misfit/",
    "session/result/answer.rs",
    "session/result/truth.rs",
    "log_check/",
];

/// Constants whose digits decide nothing: a table with rows of its own, columns of fits and of a text, neutral values.
const NOT_NUMBERS: [&str; 8] = ["TABLE", "BIAS", "OFFSET", "SCALE", "CHAIN", "UNKNOWNS", "NONE", "UNEXPLAINED"];

/// Values of the constants of a file and of its functions by name, as written, each in one line; texts and constants
/// without a digit are omitted.
fn constants(text: &str) -> Vec<(String, String)> {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let mut found = Vec::new();
    let mut lines = code.lines();
    while let Some(line) = lines.next() {
        let line = line.trim_start();
        let public = line.strip_prefix("pub ").or_else(|| line.strip_prefix("pub(")?.split_once(") ").map(|it| it.1));
        let Some(declared) = public.unwrap_or(line).strip_prefix("const ") else { continue };
        let Some((name, rest)) = declared.split_once(": ") else { continue };
        let mut text = rest.to_owned();
        while !text.ends_with(';') {
            let Some(next) = lines.next() else { break };
            text = format!("{text} {}", next.trim());
        }
        let (kind, value) = text.split_once(" =").unwrap_or_default();
        if kind != "&str" && value.contains(|character: char| character.is_ascii_digit()) {
            let value = value.trim().trim_end_matches(';');
            found.push((name.to_owned(), value.split_whitespace().collect::<Vec<_>>().join(" ")));
        }
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

/// Numbers that a condition may contain: signs, halves, small counts, a formula of NIST SP 1065, bits of a pixel.
const INLINE: [&str; 10] = ["0", "0.0", "0.5", "1", "1.0", "1.5", "2", "3", "3.0", "16"];

#[test]
fn conditions_of_check_and_diagnose_compare_with_named_numbers() {
    let mut wrong = Vec::new();
    for (file, text) in source_files() {
        if is_test_file(&file) || !["log_check/", "session/diagnosis/"].iter().any(|place| file.starts_with(place)) {
            continue;
        }
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        for line in code.lines().map(|line| line.split("//").next().unwrap_or_default()) {
            let right = [" < ", " > ", " <= ", " >= "].into_iter().flat_map(|sign| line.split(sign).skip(1));
            for side in right {
                let side = side.trim_start_matches('-');
                let end = side.find(|it: char| !it.is_ascii_alphanumeric() && it != '.' && it != '_');
                let number = side[..end.unwrap_or(side.len())].trim_end_matches('.');
                if number.starts_with(|it: char| it.is_ascii_digit()) && !INLINE.contains(&number) {
                    wrong.push(format!("{file}: {}", line.trim()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "name these numbers:\n{}", wrong.join("\n"));
}
