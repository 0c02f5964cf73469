//! The tables of a report.

use maud::{Markup, html};

use super::InputFile;
use super::content::{ReportContent, RunContent};
use super::html::{icon, table, table_of_texts};
use crate::calibration::ChainDistance;
use crate::log_check::{CheckReport, Finding, Severity, TopicReport};
use crate::observability::Determination;
use crate::session::{CalibrationRow, FrameCounts, TrajectoryAccuracy, TrajectoryLane};
use crate::table::Medium::Page;
use crate::table::{Cell, Column, Tone, distinct};
use crate::text::Named as _;

/// Caption of the table of results.
const RESULTS: &str = "All runs; errors after alignment by yaw and position (RMSE)";
/// Its caption with the trajectory of `calibrate` instead of a ground truth.
const AGAINST_BATCH: &str = "All runs; errors after alignment by yaw and position (RMSE) are distances to the batch \
                             reference (dcvins calibrate --trajectory), which uses the same measurements and is not an \
                             independent ground truth";

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
        let text = |found: &TrajectoryAccuracy| {
            let [rmse_m, largest_m] = [found.ate_rmse_m, found.ate_max_m].map(|error_m| Page.fixed(error_m, 4));
            format!("{rmse_m} ({} %), max {largest_m}", Page.fixed(found.ate_percent_of_length, 2))
        };
        self.accuracy.map(text).or_else(missing)
    }

    fn frames_text(&self) -> Option<String> {
        let poses = || self.lane.map(|lane| format!("{} poses", lane.track.samples().len()));
        let frames = self.run.map(|run| &run.summary.frames);
        let text = |frames: &FrameCounts| {
            let from =
                frames.initialized_at_s.map_or_else(String::new, |at_s| format!(", from {} s", Page.fixed(at_s, 2)));
            format!("{} of {}{from}", frames.estimated, frames.total)
        };
        frames.map(text).or_else(poses)
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
        Row::page("within the required accuracy", ResultColumn::requirement_text),
        Row::page("position error (ATE), m (% of path)", ResultColumn::ate_text),
    ];
    rows.extend(lengths_m.into_iter().map(|length_m| {
        Row::page(format!("relative error over {length_m} m (RPE)"), move |it| {
            let relative = it.accuracy?.rpe.iter().find(|relative| relative.delta_m == length_m)?;
            let (translation_m, rotation_deg) = (relative.translation_rmse_m, relative.rotation_rmse_deg);
            Some(format!("{} m, {}°", Page.fixed(translation_m, 3), Page.fixed(rotation_deg, 2)))
        })
    }));
    rows.extend([
        Row::page("σ of the last position, m", move |it| decimals(it.run?.position_sigma_m, 4)),
        Row::page("NEES (6 when consistent)", move |it| decimals(it.run?.nees, 1)),
        Row::page("factor on σ by consistency", move |it| {
            decimals(it.run.map(|run| run.summary.calibration.sigma_scale), 2)
        }),
        Row::page("extrinsics error by the rig", |it| {
            it.run?.summary.calibration.chain_error_initial.as_ref().map(chain_error)
        }),
        Row::page("extrinsics error by the run", |it| {
            it.run?.summary.calibration.chain_error.as_ref().map(chain_error)
        }),
        Row::page("reprojection RMS, median, px", move |it| decimals(it.run?.reprojection_px, 2)),
        Row::page("estimated frames", ResultColumn::frames_text),
        Row::page("informed rank at the end", |it| {
            let rank = it.run?.summary.rank.as_ref()?;
            Some(format!("{} of {}", rank.rank_informed, rank.columns))
        }),
        Row::page("path length, m", |it| {
            let length_m = it.run.map(|run| run.summary.length_m).or_else(|| it.lane.map(|lane| lane.length_m));
            length_m.map(|length_m| Page.fixed(length_m, 1))
        }),
        Row::page("camera, parameterization or file", |it| {
            let of_run =
                |run: &RunContent| format!("{}, {}", run.summary.camera, run.summary.calibration.parameterization);
            it.run.map(of_run).or_else(|| it.lane.map(|lane| lane.source.clone()))
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
    table_of_texts(if content.truth_is_batch { AGAINST_BATCH } else { RESULTS }, headings, &texts)
}

/// For example `1.6 mm, 0.05°`.
fn chain_error(error: &ChainDistance) -> String {
    format!(
        "{} mm, {}°",
        Page.fixed(error.translation_mean_m * 1e3, 1),
        Page.fixed(error.rotation_mean_rad.to_degrees(), 2)
    )
}

/// Calibration parameters as rows, with the columns of each run side by side; `None` without calibration.
pub(super) fn calibration(runs: &[RunContent]) -> Option<Markup> {
    let calibrated: Vec<_> = runs.iter().filter(|run| !run.summary.calibration.estimability.is_empty()).collect();
    calibrated.first()?;
    let rows: Vec<Vec<CalibrationRow<'_>>> = calibrated.iter().map(|run| rows_of(run)).collect();
    let mut columns = CalibrationRow::columns();
    columns.retain(|column| column.is_shown(Page, rows.iter().flatten()));
    // The columns before the value are about the parameter, the others about the run.
    let of_parameter = columns.iter().position(|column| column.name == "value").unwrap_or_default();
    let mut several = of_several_runs();
    several.retain(|column| column.is_shown(Page, rows.iter().flatten()));
    let (of_parameter, of_run) = columns.split_at(of_parameter);
    let (of_parameter, of_run) =
        if calibrated.len() > 1 { (&of_parameter[..1], several.as_slice()) } else { (of_parameter, of_run) };
    let names = distinct(rows.iter().flatten().map(|row| row.flight.name.as_str()));
    let found = |name: &str| -> Vec<Option<&CalibrationRow<'_>>> {
        rows.iter().map(|of_run| of_run.iter().find(|row| row.flight.name == name)).collect()
    };
    Some(html! {
        p.rule {
            "Values at the end; pass: within the required accuracy; verdicts of the whole flight (" (Determination::RULE) ")."
        }
        table.calibration {
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

/// Columns of a run beside others: the verdicts in full are in the sections of the runs.
fn of_several_runs<'a>() -> Vec<Column<'a, CalibrationRow<'a>>> {
    type Cells<'a> = Column<'a, CalibrationRow<'a>>;
    let mut columns = CalibrationRow::columns();
    columns.retain(|column| column.name == "value");
    let verdict = |row: &CalibrationRow<'_>| {
        let text = row.flight.verdict.shown(Page);
        text.split_once(", ").map_or_else(|| text.clone(), |(mark, _)| mark.to_owned())
    };
    let error = |row: &CalibrationRow<'_>| {
        let sigma = row.flight.sigma.filter(|sigma| *sigma > 0.0)?;
        Some(format!("{} σ", Page.fixed((row.summary?.error? / sigma).abs(), 1)))
    };
    columns.extend([
        Cells::page("", verdict).tone(|row| row.flight.verdict.tone()),
        Cells::page("error", error).optional(),
    ]);
    columns
}

fn rows_of(run: &RunContent) -> Vec<CalibrationRow<'_>> {
    let summary = |name: &str| run.summary.calibration.parameters.iter().find(|it| it.name == name);
    let rows = run.summary.calibration.estimability.iter();
    rows.map(|flight| CalibrationRow { flight, summary: summary(&flight.name), waits_for_advice: false }).collect()
}

/// Row of one parameter; `None` for a run without it.
fn calibration_row<'a>(
    of_parameter: &[Column<'_, CalibrationRow<'a>>],
    of_run: &[Column<'_, CalibrationRow<'a>>],
    rows: &[Option<&CalibrationRow<'a>>],
) -> Markup {
    let common = |column: &Column<'_, CalibrationRow<'a>>| {
        rows.iter().flatten().next().map(|row| column.shown_text(row, Page)).unwrap_or_default()
    };
    let is_short = rows.len() > 1;
    html! {
        tr {
            @for (place, column) in of_parameter.iter().enumerate() {
                @if place == 0 { th scope="row" { (common(column)) } } @else { td.number { (common(column)) } }
            }
            @for row in rows {
                @for (place, column) in of_run.iter().enumerate() {
                    @let text = row.map(|row| column.shown_text(row, Page)).unwrap_or_default();
                    td.number[place == 0 || is_short] {
                        @if let Some(mark) = row.and_then(|row| mark_of(column.shown_tone(row))) { (icon(mark)) " " }
                        (text)
                    }
                }
            }
        }
    }
}

/// Icon of a tone that judges.
fn mark_of(tone: Tone) -> Option<Severity> {
    match tone {
        Tone::Good => Some(Severity::Good),
        Tone::Caution => Some(Severity::Warning),
        Tone::Bad => Some(Severity::Error),
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
            p.rule { "Checks without problems: " (good.join("; ")) "." }
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
