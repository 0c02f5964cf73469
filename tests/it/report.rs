//! `report`: one self-contained page, the same bytes twice.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Writes a report on the beginning of the sample log in a separate folder, so that the command line is the same.
fn report(folder: &Path, threads: &str) -> (String, String) {
    fs::create_dir_all(folder).expect("the folder can be made");
    for name in ["garden.mcap", "garden.rig.yaml", "garden.truth.yaml"] {
        let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs").join(name);
        fs::copy(sample, folder.join(name)).expect("the sample can be copied");
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.current_dir(folder).env("RAYON_NUM_THREADS", threads);
    command.args(["report", "garden.mcap", "-o", "out", "--duration", "5", "--at", "4.2"]);
    command.args(["--run", "auto", "--run", "classical:name=old"]);
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = |name: &str| fs::read_to_string(folder.join("out").join(name)).expect("the file was written");
    (text("report.html"), text("report.json"))
}

/// Checks that the page begins with the answers and one table of all runs, and that one table has every parameter.
fn check_verdict(page: &str, report: &Value) {
    let figures = page.find("<figure").unwrap_or(page.len());
    let table = |begin: &str| {
        let parts: Vec<&str> = page.split(begin).collect();
        assert_eq!(parts.len(), 2, "one table {begin}");
        assert!(parts[0].len() < figures, "the table comes before the figures");
        &parts[1][..parts[1].find("</table>").expect("the table ends")]
    };
    let (results, rows) = (table("All runs; errors after alignment"), table("<table class=\"calibration"));
    let mut marks = [0; 2];
    for run in report["runs"].as_array().expect("a list") {
        let observability = run["observability"]["text"].as_str().expect("a text");
        assert_eq!(page.matches(observability).count(), 1, "{observability}");
        let label = run["label"].as_str().expect("a text");
        for table in [results, rows] {
            assert_eq!(table.matches(&format!(">{label}</th>")).count(), 1, "{label} in {table}");
        }
        let sentence = run["summary"]["answer"]["sentence"].as_str().expect("a text");
        let (_, words) = sentence.split_once(' ').expect("a symbol and words");
        assert!(page.find(words).is_some_and(|at| at < figures), "{words}");
        let parameters = run["summary"]["calibration"]["estimability"].as_array().expect("a list");
        assert_eq!(parameters.len(), run["summary"]["calibration"]["columns"].as_u64().expect("a count") as usize);
        for parameter in parameters {
            let named = format!(">{}</th>", parameter["name"].as_str().expect("a text"));
            assert_eq!(rows.matches(&named).count(), 1, "{named} in {rows}");
            let reason = parameter["reason"].as_str().expect("a text");
            assert!(page.contains(&reason.replace('<', "&lt;")), "{reason}");
            let number = |key: &str| parameter[key].as_f64();
            let (sigma, required) = (number("sigma").expect("a number"), number("required").expect("a number"));
            let by_sigma = if number("flight_sigma").is_some_and(|alone| alone <= required) {
                "determined"
            } else if sigma <= required {
                "given"
            } else if sigma <= 3.0 * required {
                "weakly determined"
            } else {
                "not determined"
            };
            assert!(number("flight_sigma").is_none_or(|alone| alone >= 0.999 * sigma), "{parameter}");
            let verdict = parameter["verdict"].as_str().expect("a text");
            assert!(verdict == by_sigma || verdict == "redundant" && by_sigma != "determined", "{parameter}");
            let is_met = ["determined", "given"].contains(&verdict);
            marks[usize::from(is_met)] += usize::from(verdict != "redundant");
            assert_eq!(is_met, parameter["cause"].is_null(), "{parameter}");
            assert_eq!(is_met, parameter["reason"] == "", "{parameter}");
            assert!(parameter["since_s"].as_f64().expect("a number") > 0.0, "{parameter}");
        }
        let redundant = parameters.iter().filter(|parameter| parameter["verdict"] == "redundant").count();
        assert_eq!(redundant > 0, label == "old", "only the classical parameterization has redundant columns");
    }
    let counts = ["fail</td>", "pass</td>"].map(|mark| rows.matches(mark).count());
    assert_eq!(counts, marks, "parameters that fail and pass in {rows}");
    assert!(page.contains("Suggested excitation: "));
    let findings = report["check"]["findings"].as_array().expect("a list");
    let notes = findings.iter().filter(|finding| finding["severity"] == "note").count();
    let counts = format!("Log and rig: 0 errors, 0 warnings and {notes} notes.");
    assert!(page.find(&counts).is_some_and(|at| at < figures), "{counts}");
}

/// Checks that every figure has a number, in order, and states its time.
fn check_captions(page: &str, count: usize) {
    let captions: Vec<&str> = page.split("<figcaption>").skip(1).collect();
    assert_eq!(captions.len(), count);
    for (number, caption) in (1..).zip(captions) {
        let caption = &caption[..caption.find("</figcaption>").expect("the caption ends")];
        assert!(caption.starts_with(&format!("<b>Figure {number}. ")), "{caption}");
        let title = &caption[..caption.find("</b>").expect("the title ends")];
        assert!(title.contains(" s") && caption.len() > title.len() + 80, "{caption}");
    }
}

/// Checks that all letters are those of ordinary text fonts: Latin, Greek, general punctuation, superscripts and
/// subscripts, and mathematical operators.
fn check_glyphs(page: &str) {
    let ordinary = |letter: char| {
        matches!(letter, '\n' | ' '..='~' | '\u{a0}'..='\u{ff}' | 'Α'..='ω' | '\u{2010}'..='\u{2030}'
            | '\u{2070}'..='\u{208e}' | '∂' | '−' | '√' | '∞' | '≈' | '≠' | '≤' | '≥' | '∅')
    };
    let others: std::collections::BTreeSet<char> = page.chars().filter(|letter| !ordinary(*letter)).collect();
    assert!(others.is_empty(), "not every font has {others:?}");
}

#[test]
fn a_report_holds_everything_and_has_the_same_bytes_twice() {
    let folder = tempfile::tempdir().unwrap();
    let (page, json) = report(&folder.path().join("first"), "2");
    let again = report(&folder.path().join("second"), "1");
    assert!(page == again.0 && json == again.1, "two reports differ");

    // The page is self-contained: no address is requested.
    for reference in ["http:", "https:", "src=\"/", "<script", "<link"] {
        assert!(!page.contains(reference), "the page holds '{reference}'");
    }
    let report: Value = serde_json::from_str(&json).unwrap();
    for text in [
        "dcvins report garden.mcap -o out --duration 5 --at 4.2 --run auto --run classical:name=old",
        report["inputs"][0]["sha256"].as_str().unwrap(),
        "garden.truth.yaml",
        "initialized from motion",
    ] {
        assert!(page.contains(text), "'{text}' is missing");
    }
    // Images and the scene are pixels, plots are lines and texts.
    let images = [page.matches("src=\"data:image/png;base64,iVBOR").count(), page.matches("\"><svg width=").count()];
    assert_eq!(images, if cfg!(feature = "gui") { [2, 7] } else { [0, 0] });
    check_verdict(&page.replace('\u{a0}', " "), &report);
    check_captions(&page, images.iter().sum());
    check_glyphs(&page);
    assert_eq!(page.contains("informed rank over time, of 24"), cfg!(feature = "gui"), "plots hold their texts");
    // Findings of `check` about the log are included.
    let findings = report["check"]["findings"].as_array().unwrap();
    assert!(findings.len() > 5 && page.contains("Log and rig"), "{findings:?}");
    for finding in findings {
        assert!(page.contains(finding["title"].as_str().unwrap()), "{finding}");
    }

    // The numbers are those of the summaries, and the classical parameterization is reported to lose six columns.
    for (run, columns, lost) in [(0, 18, 0), (1, 24, 6)] {
        let run = &report["runs"][run];
        let ate_m = run["summary"]["accuracy"]["ate_rmse_m"].as_f64().unwrap();
        assert!(page.contains(&format!(">{ate_m:.4} (")), "the error {ate_m} is missing");
        let last = run["rank_story"].as_array().unwrap().last().unwrap();
        assert_eq!((last["columns"].as_u64(), last["lost"][0].as_u64()), (Some(columns), Some(lost)), "{last}");
    }
    assert!(page.contains("structural rank 18 of 24 (deficit: 6 parameterization"));
    let out = folder.path().join("first/out");
    for name in ["auto/summary.json", "auto/calibration.csv", "auto/trajectory.tum"] {
        assert!(out.join(name).is_file(), "{name} is missing");
    }
}
