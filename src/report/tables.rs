//! The tables of a report.

use maud::{Markup, html};

use super::InputFile;
use super::content::{ReportContent, RunContent};
use super::html::{icon, list_in_columns, table, table_of_texts};
use super::verdict::{StatementLevel, chain_error};
use crate::log_check::{CheckReport, Finding, Severity, TopicReport};
use crate::observability::Determination;
use crate::session::{CalibrationRow, TrajectoryAccuracy, TrajectoryLane};
use crate::table::Medium::Page;
use crate::table::{Cell, Column, Tone, distinct};
use crate::text::Named as _;

/// Run of the program, or trajectory of another one, in the table of results.
struct ResultColumn<'a> {
    label: &'a str,
    run: Option<&'a RunContent>,
    lane: Option<&'a TrajectoryLane>,
    accuracy: Option<&'a TrajectoryAccuracy>,
    /// Reason why there is no accuracy.
    missing: Option<&'a str>,
}

impl<'a> ResultColumn<'a> {
    /// All runs, then all trajectories, which are the same in every summary.
    fn all(content: &'a ReportContent) -> Vec<Self> {
        let runs = content.runs.iter().map(|run| Self {
            label: &run.label,
            run: Some(run),
            lane: None,
            accuracy: run.summary.accuracy.as_ref(),
            missing: run.summary.accuracy_missing.as_deref(),
        });
        let lanes = content.runs.first().map_or(&[][..], |run| &run.summary.trajectories);
        let trajectories = lanes.iter().map(|lane| Self {
            label: &lane.label,
            run: None,
            lane: Some(lane),
            accuracy: lane.evaluation.accuracy.as_ref(),
            missing: lane.accuracy_missing.as_deref(),
        });
        runs.chain(trajectories).collect()
    }

    fn ate_text(&self) -> Option<String> {
        let missing = || self.missing.map(str::to_owned);
        self.accuracy.map(|accuracy| Page.fixed(accuracy.ate_rmse_m, 4)).or_else(missing)
    }

    fn requirement_text(&self) -> Option<String> {
        let requirement = self.run?.summary.answer.requirement.as_ref()?;
        Some(format!("{} of {} ({})", requirement.met, requirement.parameters, requirement.required))
    }
}

/// Results of all runs side by side: a column for each run and each trajectory of another program.
pub(super) fn runs(content: &ReportContent) -> Markup {
    type Row<'a> = Column<'a, ResultColumn<'a>>;
    let results = ResultColumn::all(content);
    let relatives = results.iter().filter_map(|it| it.accuracy).flat_map(|found| &found.rpe);
    let mut lengths_m: Vec<f64> = relatives.map(|relative| relative.delta_m).collect();
    lengths_m.sort_by(f64::total_cmp);
    lengths_m.dedup();
    let decimals = |value: Option<f64>, decimals: usize| value.map(|value| Page.fixed(value, decimals));
    let mut rows = vec![
        Row::page("trust", |it| it.run.map(|run| run.summary.answer.trust.name())),
        Row::page("parameters within the required accuracy", ResultColumn::requirement_text),
        Row::page("position error (ATE, RMSE), m", ResultColumn::ate_text),
        Row::page("% of the path", move |it| decimals(it.accuracy.map(|found| found.ate_percent_of_length), 3)),
        Row::page("median, m", move |it| decimals(it.accuracy.map(|found| found.ate_median_m), 4)),
        Row::page("largest, m", move |it| decimals(it.accuracy.map(|found| found.ate_max_m), 4)),
    ];
    rows.extend(lengths_m.into_iter().map(|length_m| {
        Row::page(format!("relative pose error over {length_m} m (RPE, RMSE)"), move |it| {
            let relative = it.accuracy?.rpe.iter().find(|relative| relative.delta_m == length_m)?;
            let (translation_m, rotation_deg) = (relative.translation_rmse_m, relative.rotation_rmse_deg);
            Some(format!("{} m, {}°", Page.fixed(translation_m, 3), Page.fixed(rotation_deg, 2)))
        })
    }));
    rows.extend([
        Row::page("σ of the last position, m", move |it| decimals(it.run?.position_sigma_m, 4)),
        Row::page("squared error over covariance (NEES, 6 when consistent)", move |it| decimals(it.run?.nees, 1)),
        Row::page("factor on σ by the run's consistency", move |it| {
            decimals(it.run.map(|run| run.summary.calibration.sigma_scale), 2)
        }),
        Row::page("extrinsics error by the rig", |it| {
            it.run?.summary.calibration.chain_error_initial.as_ref().map(chain_error)
        }),
        Row::page("extrinsics error by the run", |it| {
            it.run?.summary.calibration.chain_error.as_ref().map(chain_error)
        }),
        Row::page("reprojection residual (median of RMS), px", move |it| decimals(it.run?.reprojection_px, 2)),
        Row::page("estimated frames", |it| {
            let poses = || it.lane.map(|lane| format!("{} poses", lane.track.samples().len()));
            let frames = it.run.map(|run| &run.summary.frames);
            frames.map(|frames| format!("{} of {}", frames.estimated, frames.total)).or_else(poses)
        }),
        Row::page("initialized at, s", move |it| {
            let at_s = decimals(it.run?.summary.frames.initialized_at_s, 2);
            Some(at_s.unwrap_or_else(|| "never".to_owned()))
        }),
        Row::page("keyframes, restarts", |it| {
            it.run.map(|run| format!("{}, {}", run.summary.frames.keyframes, run.summary.frames.restarts))
        }),
        Row::page("informed rank at the end", |it| {
            let rank = it.run?.summary.rank.as_ref()?;
            Some(format!("{} of {}", rank.rank_informed, rank.columns))
        }),
        Row::page("path length, m", |it| {
            let length_m = it.run.map(|run| run.summary.length_m).or_else(|| it.lane.map(|lane| lane.length_m));
            length_m.map(|length_m| Page.fixed(length_m, 1))
        }),
        Row::page("parameterization", |it| it.run.map(|run| run.summary.calibration.parameterization.clone())),
        Row::page("camera; file or topic", |it| {
            it.run.map(|run| run.summary.camera.clone()).or_else(|| it.lane.map(|lane| lane.source.clone()))
        }),
    ]);
    let shown = rows.iter().filter(|row| results.iter().any(|result| row.cell(result) != Cell::Empty));
    let texts = shown.map(|row| {
        let heading = row.heading(Page).unwrap_or_default().to_owned();
        let cells = results.iter().map(|result| row.shown_text(result, Page));
        std::iter::once(heading).chain(cells).collect()
    });
    let texts: Vec<Vec<String>> = texts.collect();
    let headings = std::iter::once("").chain(results.iter().map(|result| result.label));
    table_of_texts("All runs; errors after alignment by yaw and position", headings, &texts)
}

/// Calibration parameters as rows, with the columns of each run side by side; `None` without calibration.
pub(super) fn calibration(runs: &[RunContent]) -> Option<Markup> {
    let calibrated: Vec<_> = runs.iter().filter(|run| !run.estimability.is_empty()).collect();
    calibrated.first()?;
    let rows: Vec<Vec<CalibrationRow<'_>>> = calibrated.iter().map(|run| rows_of(run)).collect();
    let mut columns = CalibrationRow::columns();
    columns.retain(|column| column.is_shown(Page, rows.iter().flatten()));
    // The columns before the value are about the parameter, the others about the run.
    let of_parameter = columns.iter().position(|column| column.name == "value").unwrap_or_default();
    let (of_parameter, of_run) = columns.split_at(of_parameter);
    let names = distinct(rows.iter().flatten().map(|row| row.flight.name.as_str()));
    let found = |name: &str| -> Vec<Option<&CalibrationRow<'_>>> {
        rows.iter().map(|of_run| of_run.iter().find(|row| row.flight.name == name)).collect()
    };
    Some(html! {
        p.rule {
            "Values at the end; pass: within the required accuracy; verdicts of the whole flight (" (Determination::RULE) ")."
        }
        table.calibration.narrow[calibrated.len() > 2] {
            thead {
                @if calibrated.len() > 1 {
                    tr {
                        th colspan=(of_parameter.len()) {}
                        @for run in &calibrated { th colspan=(of_run.len()) scope="colgroup" { (run.label) } }
                    }
                }
                tr {
                    @for column in of_parameter { th scope="col" { (column.heading(Page).unwrap_or_default()) } }
                    @for _ in &calibrated {
                        @for column in of_run { th scope="col" { (column.heading(Page).unwrap_or_default()) } }
                    }
                }
            }
            tbody {
                @for name in names {
                    (calibration_row(of_parameter, of_run, &found(name)))
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

/// Row of one parameter; `None` for a run without it.
fn calibration_row<'a>(
    of_parameter: &[Column<'_, CalibrationRow<'a>>],
    of_run: &[Column<'_, CalibrationRow<'a>>],
    rows: &[Option<&CalibrationRow<'a>>],
) -> Markup {
    // Values of the rig differ between the parameterizations.
    let common = |column: &Column<'_, CalibrationRow<'a>>| {
        let texts: Vec<String> = rows.iter().flatten().map(|row| column.shown_text(row, Page)).collect();
        distinct(texts).join("; ")
    };
    html! {
        tr {
            @for (place, column) in of_parameter.iter().enumerate() {
                @if place == 0 { th scope="row" { (common(column)) } } @else { td.number { (common(column)) } }
            }
            @for row in rows {
                @for (place, column) in of_run.iter().enumerate() {
                    @let text = row.map(|row| column.shown_text(row, Page)).unwrap_or_default();
                    @let class = if place == 0 { "number first" } else { "" };
                    td class=(class) {
                        @if let Some(mark) = row.and_then(|row| mark_of(column.shown_tone(row))) { (icon(mark)) " " }
                        (text)
                    }
                }
            }
        }
    }
}

/// Icon of a tone that judges.
fn mark_of(tone: Tone) -> Option<StatementLevel> {
    match tone {
        Tone::Good => Some(StatementLevel::Good),
        Tone::Caution => Some(StatementLevel::Warning),
        Tone::Bad => Some(StatementLevel::Error),
        Tone::Strong | Tone::Plain | Tone::Weak | Tone::Accent => None,
    }
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
    let good: Vec<String> = good.iter().map(|found| found.title.clone()).collect();
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
