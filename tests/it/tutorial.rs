//! The numbers of the tutorial are those that the program gives for the sample log.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

const LOG: &str = "sample_logs/garden.mcap";

fn tutorial() -> String {
    fs::read_to_string("docs/tutorial.md").expect("the tutorial is in the repository")
}

/// Runs the program and returns its standard output.
fn dcvins(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    let output = command.env("DCVINS_CACHE_DIR", "").args(arguments).output().expect("the program starts");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The texts of a drawing, without arrows, which are shapes.
fn drawn_text(path: &Path) -> String {
    let drawing = fs::read_to_string(path).expect("the panel is drawn");
    let texts = drawing.split('<').filter_map(|element| element.split_once('>')).map(|(_, text)| text.trim());
    texts.filter(|text| !text.is_empty()).collect::<Vec<_>>().join(" ")
}

/// The part of a text between two others.
fn between<'a>(text: &'a str, before: &str, after: &str) -> &'a str {
    let (_, rest) = text.split_once(before).unwrap_or_else(|| panic!("the tutorial has '{before}'"));
    rest.split_once(after).unwrap_or_else(|| panic!("'{after}' follows '{before}'")).0
}

#[test]
fn the_rank_panel_shows_what_the_tutorial_quotes() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let drawing = folder.path().join("rank.svg");
    let path = drawing.to_str().expect("the path is text");
    dcvins(&["screenshot", LOG, "--at", "6", "--panel", "rank", "--size", "900x1000", "-o", path]);
    let (text, shown) = (tutorial(), drawn_text(&drawing));
    let expect = |quoted: &str| assert!(shown.contains(quoted), "the panel does not show '{quoted}': {shown}");
    let (informed, words) = between(&text, "- informed rank ", " directions").split_once(": ").expect("a number");
    let uninformed = ["no", "one", "two", "three", "four", "five"].iter().position(|word| *word == words);
    expect(&format!("Structural rank {}", between(&text, "- structural rank ", ":")));
    expect(&format!("informed rank {informed}: {} uninformed", uninformed.expect("a number in words")));
    let direction = between(&text, "least observable direction is `", "`");
    expect(&format!("{direction}, uninformed since {}", between(&text, "it has been uninformed since ", ";")));
    let suggested = between(&text, "the suggested excitation: \"", "\"");
    suggested.split(" → ").for_each(expect);
    let sigmas = between(suggested, "with pitch.d) ", " mm").replace("→", "to");
    assert!(text.contains(&format!("from {} mm.", sigmas.replace("  ", " "))), "the explanation has '{sigmas}'");
    let hover =
        dcvins(&["degeneracy", "--rig", "sample_logs/garden.rig.yaml", "--motion", "hover", "--form", "minimal"]);
    let rank = between(&text, "In hover the structural rank is ", " of 18");
    let printed = hover.lines().find_map(|line| line.strip_prefix("structural rank")).map(str::trim);
    assert_eq!(printed, Some(rank));
}

#[test]
fn the_runs_have_the_accuracy_of_the_tutorial() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let at = folder.path().to_str().expect("the path is text");
    dcvins(&["run", LOG, "--no-timing", "--out", at, "--run", "auto", "--run", "classical", "--run", "static"]);
    let text = tutorial();
    for run in ["auto", "classical", "static"] {
        let summary = fs::read_to_string(folder.path().join(run).join("summary.json")).expect("the run has a summary");
        let summary: Value = serde_json::from_str(&summary).expect("it is JSON");
        let number = |path: &str| summary.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path}"));
        let error = |when: &str| {
            let [length_m, angle_rad] = ["translation_mean_m", "rotation_mean_rad"]
                .map(|value| number(&format!("/calibration/chain_error{when}/{value}")));
            format!("{:.1} mm, {:.2}°", 1e3 * length_m, angle_rad.to_degrees())
        };
        let row = format!(
            "| `{run}` | {:.3} m | {} | {} | {} of {} |",
            number("/accuracy/ate_rmse_m"),
            error("_initial"),
            error(""),
            number("/rank/rank_structural"),
            number("/rank/columns")
        );
        assert!(text.contains(&row), "the tutorial lacks the row {row}");
        if run == "auto" {
            let until = format!("Until {:.2} s the run initializes", number("/frames/initialized_at_s"));
            assert!(text.contains(&until), "the tutorial lacks '{until}'");
        }
    }
}
