//! The page of a report, from its content and its pictures.

use super::ReportPicture;
use super::content::{ReportContent, RunContent};
use super::html::{element, escape, list, number, picture};
use super::tables;

/// Readable on a screen, and on A4 without cut tables and pictures.
const STYLE: &str = "\
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; max-width: 76rem; margin: 2rem auto; padding: 0 1.5rem; }
h1 { font-size: 1.7rem; margin-bottom: 0.2rem; }
h2 { font-size: 1.3rem; margin-top: 2.4rem; border-bottom: 1px solid #bbb; }
h3 { font-size: 1.05rem; margin-top: 1.6rem; }
p.lead { color: #444; margin-top: 0; }
pre { background: #f4f4f4; border: 1px solid #ddd; padding: 0.6rem 0.8rem; white-space: pre-wrap; overflow-wrap: anywhere; }
table { border-collapse: collapse; margin: 0.8rem 0 1.4rem; font-size: 0.92em; }
caption { text-align: left; color: #444; padding-bottom: 0.3rem; }
th, td { text-align: left; vertical-align: top; padding: 0.18rem 0.7rem 0.18rem 0; border-bottom: 1px solid #e2e2e2; overflow-wrap: anywhere; }
thead th { border-bottom: 1px solid #888; white-space: nowrap; }
tbody th { font-weight: 600; }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap; }
figure { margin: 0.8rem 0 1.4rem; }
figure img, figure svg { display: block; max-width: 100%; height: auto; border: 1px solid #ddd; }
figcaption { color: #444; font-size: 0.92em; }
nav li { display: inline; margin-right: 1.2rem; }
nav ul { padding: 0; }
@page { size: A4; margin: 14mm; }
@media print {
  body { font-size: 10px; max-width: none; margin: 0; padding: 0; }
  nav { display: none; }
  h2, h3, caption { break-after: avoid; }
  figure, tr, pre { break-inside: avoid; }
  figure img, figure svg { max-height: 120mm; width: auto; }
  thead { display: table-header-group; }
}
";

/// The whole page.
pub(super) fn page(content: &ReportContent, pictures: &[ReportPicture]) -> String {
    let title = format!("Flight report of {}", content.log);
    let mut body = element("h1", &title);
    body.extend(["<p class=\"lead\">", &escape(&lead(content)), "</p>\n"]);
    body.push_str(&contents(content));
    body.push_str("<h2 id=\"accuracy\">Accuracy</h2>\n");
    body.push_str(&tables::frames(content));
    body.push_str(&tables::accuracy(content));
    body.push_str(&pictures_of(pictures));
    for (index, run) in content.runs.iter().enumerate() {
        body.push_str(&run_section(index, run));
    }
    if content.check.is_some() || !content.log_warnings.is_empty() {
        body.push_str("<h2 id=\"log\">The log and its rig</h2>\n");
    }
    if let Some(check) = &content.check {
        body.push_str(&tables::findings(check));
        body.push_str(&tables::topics(check));
    }
    if !content.log_warnings.is_empty() {
        body.push_str(&element("h3", "Warnings while it was read"));
        body.push_str(&list(&content.log_warnings));
    }
    body.push_str("<h2 id=\"origin\">Origin</h2>\n<p>This report was made by</p>\n");
    body.push_str(&element("pre", &content.command));
    body.push_str(&tables::inputs(content));
    let origin = format!(
        "Made with {}. The same files, command and version give the same bytes. Beside this page lie report.json and, \
         for each run, trajectory.tum, calibration.csv, rank.csv, information.csv, frames.csv, rig.yaml and summary.json.",
        content.program
    );
    body.push_str(&element("p", &origin));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        escape(&title)
    )
}

/// The report in one sentence.
fn lead(content: &ReportContent) -> String {
    let runs: Vec<String> = content
        .runs
        .iter()
        .map(|run| match &run.summary.accuracy {
            Some(accuracy) => format!("{} {} m", run.label, number(accuracy.ate_rmse_m, 3)),
            None => run.label.clone(),
        })
        .collect();
    let what =
        if content.runs.iter().any(|run| run.summary.accuracy.is_some()) { "position error (rmse) of " } else { "" };
    format!("{} s, rig {}; {what}{}.", number(content.duration_s, 1), content.rig, runs.join(", "))
}

/// Links to the sections.
fn contents(content: &ReportContent) -> String {
    let mut links = vec!["<li><a href=\"#accuracy\">Accuracy</a></li>".to_owned()];
    for (index, run) in content.runs.iter().enumerate() {
        links.push(format!("<li><a href=\"#run-{index}\">{}</a></li>", escape(&run.label)));
    }
    if content.check.is_some() || !content.log_warnings.is_empty() {
        links.push("<li><a href=\"#log\">The log and its rig</a></li>".to_owned());
    }
    links.push("<li><a href=\"#origin\">Origin</a></li>".to_owned());
    format!("<nav><ul>\n{}\n</ul></nav>\n", links.join("\n"))
}

fn pictures_of(pictures: &[ReportPicture]) -> String {
    let mut text = String::new();
    let mut heading = "";
    for shown in pictures {
        if shown.heading != heading {
            heading = &shown.heading;
            text.push_str(&element("h2", heading));
        }
        text.push_str(&picture(&shown.caption, &shown.drawing));
    }
    text
}

fn run_section(index: usize, run: &RunContent) -> String {
    let mut text = format!("<h2 id=\"run-{index}\">Run {}</h2>\n", escape(&run.label));
    let calibration = &run.summary.calibration;
    if let (Some(first), Some(last)) = (&calibration.chain_error_initial, &calibration.chain_error) {
        let chain = format!(
            "Over the joint angles visited, the camera sits {} mm and {}° from the truth with the rig's values, and {} mm \
             and {}° at the end.",
            number(first.translation_mean_m * 1e3, 1),
            number(first.rotation_mean_rad.to_degrees(), 2),
            number(last.translation_mean_m * 1e3, 1),
            number(last.rotation_mean_rad.to_degrees(), 2),
        );
        text.push_str(&element("p", &chain));
    }
    if !calibration.parameters.is_empty() {
        text.push_str(&tables::calibration(run));
    }
    text.push_str(&element("h3", "Rank over time"));
    if run.rank_story.is_empty() {
        text.push_str(&element("p", "There was no linearization to analyse."));
    } else {
        let sentences: Vec<String> = run.rank_story.iter().map(super::RankSpell::sentence).collect();
        text.push_str(&list(&sentences));
        let known = run.summary.rank.iter().flat_map(|rank| &rank.known);
        let known: Vec<String> = known
            .map(|known| format!("{} (null in {} of {} steps)", known.reason, known.agreeing, known.steps))
            .collect();
        if !known.is_empty() {
            text.push_str(&element("p", "Known from the form of the chain, and measured:"));
            text.push_str(&list(&known));
        }
    }
    text.push_str(&element("h3", "Events and warnings"));
    if !run.events.is_empty() {
        text.push_str(&tables::events(run));
    }
    let frequent: Vec<String> = run.frequent_events.iter().map(|(kind, count)| format!("{kind} {count}")).collect();
    if !frequent.is_empty() {
        text.push_str(&element("p", &format!("Besides: {}.", frequent.join(", "))));
    }
    text.push_str(&list(&run.summary.warnings));
    text
}
