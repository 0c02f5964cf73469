//! The HTML page of a report, from its content and figures.

use maud::{Markup, html};

use super::content::{ReportContent, ReportEvent, ReportFigure, RunContent};
use super::html::{document, figure, icon, list, list_in_columns, unbroken};
use super::rank_intervals::RankInterval;
use super::tables;
use crate::log_check::{Severity, Trust};
use crate::observability::Determination;
use crate::session::FlightParameter;
use crate::table::Medium::Page;
use crate::table::distinct;
use crate::text::{Named as _, counted};

pub(super) fn page(content: &ReportContent, figures: &[ReportFigure]) -> String {
    let title = format!("Flight report: {}", content.log);
    let body = html! {
        h1 { (title) }
        @for alike in content.runs.chunk_by(|one, next| one.summary.answer.remedy == next.summary.answer.remedy) {
            (answers(content, alike))
        }
        p.lead { (lead(content)) }
        (contents(content))
        h2 #results { "Results" }
        (tables::runs(content))
        (log_verdict(content))
        @if let Some(calibration) = tables::calibration(&content.runs) {
            h2 #calibration { "Calibration" }
            (calibration)
        }
        (grouped(figures))
        @for (index, run) in content.runs.iter().enumerate() {
            (run_section(index, run))
        }
        @if has_log_section(content) {
            h2 #log { "Log and rig" }
        }
        @if let Some(check) = &content.check {
            (tables::findings(check))
            (tables::topics(check))
        }
        @if !content.log_warnings.is_empty() {
            h3 { "Warnings of the log reader" }
            (list(&content.log_warnings))
        }
        h2 #origin { "Reproduction" }
        p { "Command" }
        pre { (content.command) }
        (tables::inputs(content))
        p {
            "Version: " (content.program) ". The same files, command and version give the same bytes. Files next to \
             this page: report.json and, for each run, trajectory.tum, covariance.csv, calibration.csv, rank.csv, information.csv, \
             frames.csv, rig.yaml and summary.json."
        }
    };
    format!("{}\n", document(&title, &body))
}

/// Answers of consecutive runs with one remedy.
fn answers(content: &ReportContent, runs: &[RunContent]) -> Markup {
    let remedy = runs.first().map_or("", |run| run.summary.answer.remedy.as_str());
    html! {
        p.answer {
            @for (place, run) in runs.iter().enumerate() {
                @if place > 0 { br; }
                (answer(content, run))
            }
            @if !remedy.is_empty() { br; "Remedy: " (remedy) }
        }
    }
}

/// Answer of a run: trust, cause and required accuracy in one sentence.
fn answer(content: &ReportContent, run: &RunContent) -> Markup {
    let found = &run.summary.answer;
    let unmet = found.requirement.as_ref().is_some_and(|it| it.met < it.parameters);
    let level = match found.trust {
        Trust::NotUsable => Severity::Error,
        Trust::Doubtful => Severity::Warning,
        Trust::Trusted if unmet => Severity::Warning,
        Trust::Trusted => Severity::Good,
    };
    // Not every font has the symbol of the sentence.
    let sentence = found.sentence.split_once(' ').map_or(found.sentence.as_str(), |(_, words)| words);
    html! {
        @if content.runs.len() > 1 { (run.label) ": " }
        (icon(level)) " "
        strong { (unbroken(sentence)) }
    }
}

fn has_log_section(content: &ReportContent) -> bool {
    content.check.is_some() || !content.log_warnings.is_empty()
}

/// The log, the rig and the runs in one sentence.
fn lead(content: &ReportContent) -> String {
    let runs: Vec<String> = content.runs.iter().map(|run| format!("{} ({})", run.label, run.summary.camera)).collect();
    let noun = if runs.len() == 1 { "run" } else { "runs" };
    format!(
        "Log of {} s, rig {}, {noun} {}. {}.",
        Page.fixed(content.duration_s, 1),
        content.rig,
        runs.join(", "),
        content.program
    )
}

/// Number of findings about log and rig; their section has them all.
fn log_verdict(content: &ReportContent) -> Markup {
    let findings = content.check.iter().flat_map(|check| &check.findings);
    let severities: Vec<Severity> = findings
        .map(|finding| finding.severity)
        .chain(content.log_warnings.iter().map(|_| Severity::Warning))
        .collect();
    let worst = severities.iter().max().copied().unwrap_or(Severity::Good);
    let count = |of: Severity, noun: &str| counted(severities.iter().filter(|severity| **severity == of).count(), noun);
    let counts = [(Severity::Error, "error"), (Severity::Warning, "warning"), (Severity::Note, "note")];
    let [errors, warnings, notes] = counts.map(|(severity, noun)| count(severity, noun));
    html! {
        p { (icon(worst)) " Log and rig: " (errors) ", " (warnings) " and " (notes) "." }
    }
}

fn contents(content: &ReportContent) -> Markup {
    html! {
        nav {
            ul {
                li { a href="#results" { "Results" } }
                @if content.runs.iter().any(|run| !run.summary.calibration.estimability.is_empty()) {
                    " " li { a href="#calibration" { "Calibration" } }
                }
                @for (index, run) in content.runs.iter().enumerate() {
                    " " li { a href={ "#run-" (index) } { (run.label) } }
                }
                @if has_log_section(content) {
                    " " li { a href="#log" { "Log and rig" } }
                }
                " " li { a href="#origin" { "Reproduction" } }
            }
        }
    }
}

/// The figures with their headings, numbered over all groups.
fn grouped(figures: &[ReportFigure]) -> Markup {
    let numbered: Vec<(usize, &ReportFigure)> = (1..).zip(figures).collect();
    html! {
        @for group in numbered.chunk_by(|(_, a), (_, b)| a.heading == b.heading) {
            @if let Some((_, first)) = group.first() {
                h2 { (first.heading) }
            }
            @for beside in group.chunk_by(|(_, a), (_, b)| a.half && b.half) {
                @if beside.len() > 1 {
                    div.pair { @for (number, shown) in beside { (figure(*number, shown)) } }
                } @else {
                    @for (number, shown) in beside { (figure(*number, shown)) }
                }
            }
        }
    }
}

fn run_section(index: usize, run: &RunContent) -> Markup {
    let frequent: Vec<String> = run.frequent_events.iter().map(|(kind, count)| format!("{kind} {count}")).collect();
    let why = why_lines(&run.summary.calibration.estimability);
    let events: Vec<String> = run.events.iter().map(ReportEvent::sentence).collect();
    html! {
        h2 id={ "run-" (index) } { "Run " (run.label) }
        @if let Some(found) = &run.observability {
            p { (icon(found.severity)) " " (unbroken(&found.text)) }
            (list_in_columns(&found.details))
        }
        @if !why.is_empty() {
            h3 { "Parameters that the flight alone does not determine" }
            (list_in_columns(&why))
        }
        (rank_section(run))
        h3 { "Events and warnings" }
        (list_in_columns(&events))
        @if !frequent.is_empty() {
            p { "Number of other events: " (frequent.join(", ")) "." }
        }
        (list(&run.summary.warnings))
    }
}

/// Reasons of the verdicts on parameters that the flight alone does not determine, with the time since when they hold; one
/// line for each motion or run that helps, and all redundant parameters with the same start in one.
fn why_lines(parameters: &[FlightParameter]) -> Vec<String> {
    let explained = || parameters.iter().filter(|parameter| !parameter.reason.is_empty());
    let verdict = |parameter: &FlightParameter| {
        let since =
            parameter.since_s().map_or_else(String::new, |since_s| format!(" since {} s", Page.fixed(since_s, 2)));
        format!("{}{since}", parameter.verdict.name())
    };
    let remedies = distinct(explained().map(|parameter| parameter.remedy.as_str()));
    let line = |remedy: &str| {
        let of_remedy: Vec<&FlightParameter> = explained().filter(|it| it.remedy == remedy).collect();
        let alike = of_remedy.chunk_by(|a, b| a.verdict == Determination::Redundant && verdict(a) == verdict(b));
        let reasons = alike.map(|parameters| {
            if let [parameter] = parameters {
                return format!("{}, {}: {}", parameter.name, verdict(parameter), parameter.reason);
            }
            let named = parameters.iter().map(|it| format!("{} ({})", it.name, it.reason));
            let verdict = parameters.first().map(|first| verdict(first)).unwrap_or_default();
            format!("{verdict}: {}", named.collect::<Vec<_>>().join(", "))
        });
        let helps = if remedy.is_empty() { String::new() } else { format!(" · {remedy}") };
        format!("{}{helps}", reasons.collect::<Vec<_>>().join("; "))
    };
    remedies.into_iter().map(line).collect()
}

fn rank_section(run: &RunContent) -> Markup {
    let sentences: Vec<String> = run.rank_intervals.iter().map(RankInterval::sentence).collect();
    let known = run.summary.rank.iter().flat_map(|rank| &rank.known);
    let known: Vec<String> = known
        .map(|known| format!("{} (confirmed in {} of {} steps)", known.reason, known.agreeing, known.steps))
        .collect();
    html! {
        h3 { "Rank over time" }
        @if sentences.is_empty() {
            p { "No rank analysis: no step of the run was linearized." }
        } @else {
            (list_in_columns(&sentences))
            @if !known.is_empty() {
                p { "Null directions of the parameterization in closed form, and the steps whose Jacobian confirms them:" }
                (list_in_columns(&known))
            }
        }
    }
}
