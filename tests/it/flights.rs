//! Calibration over several flights: `--prior`, and the useful part of a log by `dcvins excerpt`.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn garden() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap").to_string_lossy().into_owned()
}

/// Runs the program in a folder and checks its exit code and words of its standard error.
fn dcvins(folder: &Path, arguments: &[&str], code: i32, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "").current_dir(folder).args(arguments);
    let output = command.output().expect("the program starts");
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {complaint}");
    for word in words {
        assert!(complaint.contains(word), "{arguments:?} should say '{word}': {complaint}");
    }
    output
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).expect("the file is there")).expect("it is JSON")
}

fn sigmas(folder: &Path, flight: usize) -> Vec<(String, f64)> {
    let posterior = json(&folder.join("posterior.json"));
    let sigmas = posterior["flights"][flight]["sigmas"].as_object().expect("σ by name");
    sigmas.iter().map(|(name, sigma)| (name.clone(), sigma.as_f64().expect("a number"))).collect()
}

#[test]
fn a_run_starts_from_the_posterior_of_another_one() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let (at, garden) = (folder.path(), garden());
    dcvins(
        at,
        &["run", &garden, "--run", "minimal", "--duration", "6", "--no-check", "--no-timing", "-o", "a"],
        0,
        &[],
    );
    let second =
        ["run", &garden, "--run", "minimal", "--start", "4", "--no-check", "--no-timing", "--prior", "a/minimal", "-o"];
    let printed = dcvins(at, &[&second[..], &["b"]].concat(), 0, &[]).stdout;
    let printed = String::from_utf8_lossy(&printed);
    for words in ["0: rig", "1: garden.mcap (minimal)", "2: garden.mcap (minimal)"] {
        assert!(printed.contains(words), "'{words}' is missing: {printed}");
    }
    let (a, b) = (at.join("a/minimal"), at.join("b/minimal"));
    let (rig, first, last) = (sigmas(&b, 0), sigmas(&b, 1), sigmas(&b, 2));
    assert_eq!((rig.len(), first.len(), last.len()), (18, 18, 18));
    assert_eq!(first, sigmas(&a, 1), "the history is carried");
    for ((name, first), (_, last)) in first.iter().zip(&last) {
        assert!(last < &(1.02 * first), "{name}: {first} → {last}");
    }
    dcvins(at, &[&second[..], &["c"]].concat(), 0, &[]);
    let text = |name: &str| fs::read(at.join(name)).expect("the file is there");
    assert!(text("b/minimal/posterior.json") == text("c/minimal/posterior.json"), "the files differ");

    // Other commands start from it, too.
    let shot = ["screenshot", &garden, "--run", "minimal", "--start", "4", "--panel", "convergence", "--prior"];
    dcvins(at, &[&shot[..], &["a/minimal", "-o", "shot.png"]].concat(), 0, &[]);
    dcvins(at, &[&shot[..], &["none", "-o", "none.png"]].concat(), 1, &["OUT/NAME", "posterior.json"]);

    // A saved session keeps it.
    dcvins(at, &[&shot[..], &["a/minimal", "--prior-growth", "2", "--csv", "-o", "direct.png"]].concat(), 0, &[]);
    let session = |prior: &Path| {
        let session = serde_json::json!({
            "session_version": 2,
            "log": { "path": &garden, "bytes": 0, "crc32": 0 },
            "prior": { "folder": prior, "growth": 2.0 },
            "start_s": 4.0,
            "duration_s": null,
            "runs": ["minimal"],
            "forks": [],
            "breakpoints": [],
            "cursor_ns": 0,
            "layout": null,
        });
        fs::write(at.join("kept.session.json"), session.to_string()).expect("it can be written");
    };
    let kept = ["screenshot", "kept.session.json", "--panel", "convergence", "--csv", "-o", "kept.png"];
    session(&a);
    dcvins(at, &kept, 0, &[]);
    assert!(text("direct.csv") == text("kept.csv"), "the session starts from another calibration");
    for command in ["view", "screenshot"] {
        dcvins(at, &[command, "kept.session.json", "--run", "minimal", "-o", "x.png"], 1, &["leave --run out"]);
        dcvins(at, &[command, "kept.session.json", "--prior", "a/minimal", "-o", "x.png"], 1, &["leave --prior out"]);
    }
    session(&at.join("none"));
    dcvins(at, &kept, 1, &["OUT/NAME", "posterior.json"]);

    // A rig that was edited later is another mechanism than that of the covariance.
    let rig = fs::read_to_string(a.join("rig.yaml")).expect("the rig");
    let edited = rig.replacen("\n    d: 0.", "\n    d: 0.1", 1);
    assert_ne!(rig, edited);
    fs::write(a.join("rig.yaml"), edited).expect("it can be written");
    dcvins(at, &[&second[..], &["d"]].concat(), 1, &["rig.yaml beside it", "posterior.json"]);
    fs::write(a.join("posterior.json"), "{\"posterior_version\": 1}").expect("it can be written");
    dcvins(at, &[&second[..], &["d"]].concat(), 1, &["missing field", "posterior.json"]);
    fs::remove_file(a.join("posterior.json")).expect("it can be removed");
    dcvins(at, &[&second[..], &["d"]].concat(), 1, &["OUT/NAME", "posterior.json"]);
    dcvins(at, &[&second[..], &["d", "--prior-growth", "0.5"]].concat(), 2, &["1 to 1000"]);
}

#[test]
fn an_excerpt_is_a_log_that_runs_and_says_what_it_loses() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let (at, garden) = (folder.path(), garden());
    let short = ["excerpt", &garden, "--seconds", "5", "--out", "part"];
    let printed = dcvins(at, &short, 0, &[]).stdout;
    let printed = String::from_utf8_lossy(&printed);
    let index = json(&at.join("part/excerpt.json"));
    let stretches = index["stretches"].as_array().expect("a list");
    let length = |stretch: &Value| stretch["end_s"].as_f64().unwrap() - stretch["start_s"].as_f64().unwrap();
    assert!((stretches.iter().map(length).sum::<f64>() - 5.0).abs() < 1e-3);
    let parameters = index["parameters"].as_array().expect("a list");
    assert_eq!(parameters.len(), 18);
    let achieved = |parameter: &Value| parameter["achieved_ratio"].as_f64().expect("a run over the stretches");
    let largest = parameters.iter().map(achieved).fold(0.0, f64::max);
    let verdict = if largest <= 1.1 { "every σ is within 10 %" } else { "do not keep every σ within 10 %" };
    assert!(printed.contains(verdict), "{largest}: {printed}");
    assert!(parameters.iter().all(|parameter| parameter["predicted_ratio"].as_f64().unwrap() > 0.99));
    dcvins(at, &short, 1, &["--force"]);
    dcvins(at, &["run", "part/garden-1.mcap", "--run", "minimal", "-o", "results"], 0, &[]);
    dcvins(at, &["excerpt", &garden, "--seconds", "0.5", "-o", "none"], 1, &["0.5 s", "initialization"]);
    assert!(!at.join("none").exists());
}
