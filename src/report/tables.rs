//! The tables of a report.

use std::sync::Arc;

use maud::{Markup, html};

use super::InputFile;
use super::content::{ReportContent, ReportEvent, RunContent};
use super::html::{cells, is_number, list_in_columns, table, table_of_texts, unbroken};
use crate::log_check::{CheckReport, Finding, Severity, TopicReport};
use crate::observability::Determination;
use crate::session::{CalibrationRow, TrajectoryAccuracy, TrajectoryLane};
use crate::table::Column;
use crate::table::Medium::Page;

/// Frame counts of each run.
pub(super) fn frames(content: &ReportContent) -> Markup {
    type RunColumn<'a> = Column<'a, RunContent>;
    let initialized = |run: &RunContent| {
        run.summary.frames.initialized_at_s.map_or_else(|| "never".to_owned(), |time_s| Page.fixed(time_s, 2))
    };
    let columns = [
        RunColumn::page("run", |run| run.label.clone()),
        RunColumn::page("camera", |run| run.summary.camera.clone()),
        RunColumn::page("images", |run| run.summary.frames.total),
        RunColumn::page("estimated frames", |run| run.summary.frames.estimated),
        RunColumn::page("keyframes", |run| run.summary.frames.keyframes),
        RunColumn::page("initialized at, s", initialized),
        RunColumn::page("restarts", |run| run.summary.frames.restarts),
        RunColumn::page("path length, m", |run| Page.fixed(run.summary.length_m, 1)),
    ];
    table("Frames and path length", &columns, &content.runs)
}

/// Trajectory errors of each run, and of each trajectory of another program.
pub(super) fn accuracy(content: &ReportContent) -> Markup {
    /// Of a label and its accuracy.
    type AccuracyColumn<'a> = Column<'a, (&'a String, &'a TrajectoryAccuracy)>;
    // The trajectories are the same in every summary.
    let trajectories = content.runs.first().map_or(&[][..], |run| &run.summary.trajectories);
    let of_runs = content.runs.iter().map(|run| (&run.label, &run.summary.accuracy, &run.summary.accuracy_missing));
    let of_trajectories =
        trajectories.iter().map(|lane| (&lane.label, &lane.evaluation.accuracy, &lane.accuracy_missing));
    let all: Vec<_> = of_runs.chain(of_trajectories).collect();
    // All runs have relative errors over the same lengths, as far as their paths are long enough.
    let relatives = all.iter().filter_map(|&(_, accuracy, _)| accuracy.as_ref()).flat_map(|found| &found.rpe);
    let mut lengths_m: Vec<f64> = relatives.map(|relative| relative.delta_m).collect();
    lengths_m.sort_by(f64::total_cmp);
    lengths_m.dedup();
    let mut columns = vec![
        AccuracyColumn::page("run", |(label, _)| (*label).clone()),
        AccuracyColumn::page("ATE RMSE, m", |(_, accuracy)| Page.fixed(accuracy.ate_rmse_m, 4)),
        AccuracyColumn::page("mean, m", |(_, accuracy)| Page.fixed(accuracy.ate_mean_m, 4)),
        AccuracyColumn::page("median, m", |(_, accuracy)| Page.fixed(accuracy.ate_median_m, 4)),
        AccuracyColumn::page("max, m", |(_, accuracy)| Page.fixed(accuracy.ate_max_m, 4)),
        AccuracyColumn::page("RMSE, % of length", |(_, accuracy)| Page.fixed(accuracy.ate_percent_of_length, 3)),
    ];
    columns.extend(lengths_m.into_iter().map(|length_m| {
        AccuracyColumn::page(format!("RPE over {length_m} m"), move |(_, accuracy)| {
            let relative = accuracy.rpe.iter().find(|relative| relative.delta_m == length_m)?;
            let (translation_m, rotation_deg) = (relative.translation_rmse_m, relative.rotation_rmse_deg);
            Some(format!("{} m, {}°", Page.fixed(translation_m, 3), Page.fixed(rotation_deg, 2)))
        })
    }));
    let mut rows = Vec::new();
    for (label, accuracy, missing) in all {
        rows.push(match accuracy {
            Some(accuracy) => cells(&columns, &(label, accuracy)),
            None => vec![label.clone(), missing.clone().unwrap_or_default()],
        });
    }
    table_of_texts(
        "Absolute trajectory error (ATE) after alignment by yaw and position; relative pose error (RPE, RMSE)",
        columns.iter().filter_map(|column| column.heading(Page)),
        &rows,
    )
}

/// Trajectories of other programs, `None` if there are none.
pub(super) fn trajectories(content: &ReportContent) -> Option<Markup> {
    type LaneColumn<'a> = Column<'a, Arc<TrajectoryLane>>;
    let lanes = &content.runs.first()?.summary.trajectories;
    let columns = [
        LaneColumn::page("trajectory", |lane| lane.label.clone()),
        LaneColumn::page("file or topic", |lane| lane.source.clone()),
        LaneColumn::page("poses", |lane| lane.track.samples().len()),
        LaneColumn::page("path length, m", |lane| Page.fixed(lane.length_m, 1)),
    ];
    let caption = "Trajectories of other programs: poses only, without calibration, features and residuals";
    (!lanes.is_empty()).then(|| table(caption, &columns, lanes))
}

/// Calibration parameters of all runs: values, verdicts of the flight, and below them reasons and what helps; `None`
/// without calibration.
pub(super) fn calibration(runs: &[RunContent]) -> Option<Markup> {
    let calibrated: Vec<_> = runs.iter().filter(|run| !run.estimability.is_empty()).collect();
    calibrated.first()?;
    let all: Vec<CalibrationRow<'_>> = calibrated.iter().flat_map(|run| rows_of(run)).collect();
    let mut columns = CalibrationRow::columns();
    columns.retain(|column| column.is_shown(Page, all.iter()));
    Some(html! {
        p.rule {
            "Values at the end; verdicts of the whole flight (" (Determination::RULE)
            "). Below a parameter that is not determined: the reason, and what helps."
        }
        table.calibration {
            thead { tr { @for column in &columns { th scope="col" { (column.heading(Page).unwrap_or_default()) } } } }
            @for run in calibrated {
                tbody.run {
                    tr {
                        th colspan=(columns.len()) scope="rowgroup" {
                            "Calibration of run " (run.label) ", parameterization " (run.summary.calibration.parameterization)
                            ", σ × " (Page.fixed(run.summary.calibration.sigma_scale, 2)) " by its consistency"
                        }
                    }
                }
                @for row in rows_of(run) {
                    (calibration_rows(&columns, &row))
                }
            }
        }
    })
}

fn rows_of(run: &RunContent) -> Vec<CalibrationRow<'_>> {
    let summary = |name: &str| run.summary.calibration.parameters.iter().find(|it| it.name == name);
    let rows = run.estimability.iter();
    rows.map(|flight| CalibrationRow { flight, summary: summary(&flight.name), waits_for_advice: false }).collect()
}

/// The rows of one parameter, which stay on one page.
fn calibration_rows<'a>(columns: &[Column<'_, CalibrationRow<'a>>], row: &CalibrationRow<'a>) -> Markup {
    let cells = cells(columns, row);
    let texts = [row.flight.reason.as_str(), row.flight.remedy.as_str()];
    let why: Vec<&str> = texts.into_iter().filter(|text| !text.is_empty()).collect();
    let name_rows = if why.is_empty() { 1 } else { 2 };
    html! {
        tbody {
            tr {
                th scope="row" rowspan=(name_rows) { (row.flight.name) }
                @for cell in &cells[1..] {
                    @if is_number(cell) { td.number { (cell) } } @else { td { (cell) } }
                }
            }
            @if !why.is_empty() {
                tr.why { td colspan=(cells.len() - 1) { (unbroken(&why.join(" · "))) } }
            }
        }
    }
}

pub(super) fn events(run: &RunContent) -> Markup {
    type EventColumn<'a> = Column<'a, ReportEvent>;
    let times = |event: &ReportEvent| (event.times > 1).then(|| format!("{} consecutive frames", event.times));
    let columns = [
        EventColumn::page("time, s", |event| Page.fixed(event.time_s, 2)),
        EventColumn::page("event", |event| event.kind.clone()),
        EventColumn::page("message", |event| event.message.clone()),
        EventColumn::page("", times),
    ];
    table(&format!("Events of run {}", run.label), &columns, &run.events)
}

/// Findings of `check` about the log and its rig, most severe first; checks without a problem as a list.
pub(super) fn findings(check: &CheckReport) -> Markup {
    type FindingColumn<'a> = Column<'a, &'a Finding>;
    let (good, others): (Vec<_>, Vec<_>) = check.findings.iter().partition(|found| found.severity == Severity::Good);
    let columns = [
        FindingColumn::page("severity", |found| found.severity.label()),
        FindingColumn::page("area", |found| found.area.label()),
        FindingColumn::page("finding", |found| format!("{}: {}", found.title, found.evidence)),
        FindingColumn::page("remedy", |found| found.remedy.clone()),
    ];
    let good: Vec<String> = good.iter().map(|found| format!("{}: {}", found.title, found.evidence)).collect();
    html! {
        @if others.is_empty() {
            p { "No problems found in the log and the rig." }
        } @else {
            (table("Problems of the log and the rig (dcvins check)", &columns, &others))
        }
        @if !good.is_empty() {
            p { "Checks without problems:" }
            (list_in_columns(&good))
        }
    }
}

pub(super) fn topics(check: &CheckReport) -> Markup {
    type TopicColumn<'a> = Column<'a, TopicReport>;
    let columns = [
        TopicColumn::page("topic", |topic| topic.topic.clone()),
        TopicColumn::page("type", |topic| topic.schema.clone()),
        TopicColumn::page("role", |topic| topic.role.clone()),
        TopicColumn::page("messages", |topic| topic.count),
        TopicColumn::page("rate, Hz", |topic| Page.fixed(topic.rate_hz, 1)),
        TopicColumn::page("stamps, s", |topic| {
            format!("{} to {}", Page.fixed(topic.first_s, 2), Page.fixed(topic.last_s, 2))
        }),
        TopicColumn::page("median delay, ms", |topic| topic.latency_s.map(|latency_s| Page.fixed(latency_s * 1e3, 1))),
    ];
    table("Topics", &columns, &check.topics)
}

pub(super) fn inputs(content: &ReportContent) -> Markup {
    type InputColumn<'a> = Column<'a, InputFile>;
    let columns = [
        InputColumn::page("file", |input| input.name.clone()),
        InputColumn::page("bytes", |input| input.bytes),
        InputColumn::page("SHA-256", |input| input.sha256.clone()),
    ];
    table("Input files", &columns, &content.inputs)
}
