//! The HTML page of a report, from its content and figures.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::ReportFigure;
use super::content::{ReportContent, RunContent};
use super::html::{figure, list, number};
use super::{RankInterval, tables};

/// Style sheet for screens and for A4, where tables and figures are not split between pages.
const STYLE: &str = include_str!("../../../assets/report/style.css");

/// The whole page.
pub(super) fn page(content: &ReportContent, figures: &[ReportFigure]) -> String {
    let title = format!("Flight report of {}", content.log);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (title) }
                p.lead { (lead(content)) }
                (contents(content))
                h2 #accuracy { "Accuracy" }
                (tables::frames(content))
                (tables::accuracy(content))
                (grouped(figures))
                @for (index, run) in content.runs.iter().enumerate() {
                    (run_section(index, run))
                }
                @if has_log_section(content) {
                    h2 #log { "The log and its rig" }
                }
                @if let Some(check) = &content.check {
                    (tables::findings(check))
                    (tables::topics(check))
                }
                @if !content.log_warnings.is_empty() {
                    h3 { "Warnings while it was read" }
                    (list(&content.log_warnings))
                }
                h2 #origin { "Origin" }
                p { "This report was made by" }
                pre { (content.command) }
                (tables::inputs(content))
                p {
                    "Made with " (content.program) ". The same files, command and version give the same bytes. Beside this \
                     page lie report.json and, for each run, trajectory.tum, calibration.csv, rank.csv, information.csv, \
                     frames.csv, rig.yaml and summary.json."
                }
            }
        }
    };
    format!("{}\n", page.into_string())
}

fn has_log_section(content: &ReportContent) -> bool {
    content.check.is_some() || !content.log_warnings.is_empty()
}

/// Summary of the report in one sentence.
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
fn contents(content: &ReportContent) -> Markup {
    html! {
        nav {
            ul {
                li { a href="#accuracy" { "Accuracy" } }
                @for (index, run) in content.runs.iter().enumerate() {
                    " " li { a href={ "#run-" (index) } { (run.label) } }
                }
                @if has_log_section(content) {
                    " " li { a href="#log" { "The log and its rig" } }
                }
                " " li { a href="#origin" { "Origin" } }
            }
        }
    }
}

fn grouped(figures: &[ReportFigure]) -> Markup {
    html! {
        @for group in figures.chunk_by(|a, b| a.heading == b.heading) {
            @if let Some(first) = group.first() {
                h2 { (first.heading) }
            }
            @for shown in group {
                (figure(&shown.caption, &shown.drawing))
            }
        }
    }
}

fn run_section(index: usize, run: &RunContent) -> Markup {
    let calibration = &run.summary.calibration;
    let frequent: Vec<String> = run.frequent_events.iter().map(|(kind, count)| format!("{kind} {count}")).collect();
    html! {
        h2 id={ "run-" (index) } { "Run " (run.label) }
        @if let (Some(first), Some(last)) = (&calibration.chain_error_initial, &calibration.chain_error) {
            p {
                "Over the joint angles visited, the camera sits " (number(first.translation_mean_m * 1e3, 1)) " mm and "
                (number(first.rotation_mean_rad.to_degrees(), 2)) "° from the truth with the rig's values, and "
                (number(last.translation_mean_m * 1e3, 1)) " mm and " (number(last.rotation_mean_rad.to_degrees(), 2))
                "° at the end."
            }
        }
        @if !calibration.parameters.is_empty() {
            (tables::calibration(run))
        }
        (rank_section(run))
        h3 { "Events and warnings" }
        @if !run.events.is_empty() {
            (tables::events(run))
        }
        @if !frequent.is_empty() {
            p { "Besides: " (frequent.join(", ")) "." }
        }
        (list(&run.summary.warnings))
    }
}

fn rank_section(run: &RunContent) -> Markup {
    let sentences: Vec<String> = run.rank_intervals.iter().map(RankInterval::sentence).collect();
    let known = run.summary.rank.iter().flat_map(|rank| &rank.known);
    let known: Vec<String> =
        known.map(|known| format!("{} (null in {} of {} steps)", known.reason, known.agreeing, known.steps)).collect();
    html! {
        h3 { "Rank over time" }
        @if sentences.is_empty() {
            p { "There was no linearization to analyse." }
        } @else {
            (list(&sentences))
            @if !known.is_empty() {
                p { "Known from the form of the chain, and measured:" }
                (list(&known))
            }
        }
    }
}
