//! The tables of a report.

use maud::{Markup, html};

use super::content::{ReportContent, RunContent};
use super::html::{is_number, list_in_columns, table, unbroken};
use super::numbers::{MS_PER_S, number, shown_unit};
use crate::log_check::{CheckReport, Severity};
use crate::observability::Determination;
use crate::session::{FlightParameter, ParameterSummary, TrajectoryLane};
use crate::text::Named as _;

/// Frame counts of each run.
pub(super) fn frames(content: &ReportContent) -> Markup {
    let rows: Vec<Vec<String>> = content
        .runs
        .iter()
        .map(|run| {
            let frames = &run.summary.frames;
            vec![
                run.label.clone(),
                run.summary.camera.clone(),
                frames.total.to_string(),
                frames.estimated.to_string(),
                frames.keyframes.to_string(),
                frames.initialized_at_s.map_or_else(|| "never".to_owned(), |time_s| number(time_s, 2)),
                frames.restarts.to_string(),
                number(run.summary.length_m, 1),
            ]
        })
        .collect();
    let header =
        ["run", "camera", "images", "estimated frames", "keyframes", "initialized at, s", "restarts", "path length, m"];
    table("Frames and path length", &header, &rows)
}

/// Trajectory errors of each run, and of each trajectory of another program.
pub(super) fn accuracy(content: &ReportContent) -> Markup {
    let mut header =
        ["run", "ATE RMSE, m", "mean, m", "median, m", "max, m", "RMSE, % of length"].map(str::to_owned).to_vec();
    // All runs have relative errors over the same lengths, as far as their paths are long enough.
    let mut lengths_m: Vec<f64> = Vec::new();
    // The trajectories are the same in every summary.
    let trajectories = content.runs.first().map_or(&[][..], |run| &run.summary.trajectories);
    let of_runs = content.runs.iter().map(|run| (&run.label, &run.summary.accuracy, &run.summary.accuracy_missing));
    let of_trajectories =
        trajectories.iter().map(|lane| (&lane.label, &lane.evaluation.accuracy, &lane.accuracy_missing));
    let all: Vec<_> = of_runs.chain(of_trajectories).collect();
    for relative in all.iter().filter_map(|&(_, accuracy, _)| accuracy.as_ref()).flat_map(|found| &found.rpe) {
        if !lengths_m.contains(&relative.delta_m) {
            lengths_m.push(relative.delta_m);
        }
    }
    lengths_m.sort_by(f64::total_cmp);
    header.extend(lengths_m.iter().map(|length_m| format!("RPE over {length_m} m")));
    let rows: Vec<Vec<String>> = all
        .into_iter()
        .map(|(label, accuracy, missing)| {
            let Some(accuracy) = accuracy else {
                return vec![label.clone(), missing.clone().unwrap_or_default()];
            };
            let mut row = vec![
                label.clone(),
                number(accuracy.ate_rmse_m, 4),
                number(accuracy.ate_mean_m, 4),
                number(accuracy.ate_median_m, 4),
                number(accuracy.ate_max_m, 4),
                number(accuracy.ate_percent_of_length, 3),
            ];
            for length_m in &lengths_m {
                let relative = accuracy.rpe.iter().find(|relative| relative.delta_m == *length_m);
                row.push(relative.map_or_else(String::new, |relative| {
                    format!("{} m, {}°", number(relative.translation_rmse_m, 3), number(relative.rotation_rmse_deg, 2))
                }));
            }
            row
        })
        .collect();
    table(
        "Absolute trajectory error (ATE) after alignment by yaw and position; relative pose error (RPE, RMSE)",
        &header,
        &rows,
    )
}

/// Trajectories of other programs, `None` if there are none.
pub(super) fn trajectories(content: &ReportContent) -> Option<Markup> {
    let lanes = &content.runs.first()?.summary.trajectories;
    let row = |lane: &TrajectoryLane| {
        let poses = lane.track.samples().len().to_string();
        vec![lane.label.clone(), lane.source.clone(), poses, number(lane.length_m, 1)]
    };
    let rows: Vec<Vec<String>> = lanes.iter().map(|lane| row(lane)).collect();
    let caption = "Trajectories of other programs: poses only, without calibration, features and residuals";
    (!rows.is_empty()).then(|| table(caption, &["trajectory", "file or topic", "poses", "path length, m"], &rows))
}

/// Calibration parameters of all runs in degrees, millimetres and milliseconds: values, verdicts of the flight, and
/// below them reasons and what helps; `None` without calibration.
pub(super) fn calibration(runs: &[RunContent]) -> Option<Markup> {
    let calibrated = || runs.iter().filter(|run| !run.estimability.is_empty());
    calibrated().next()?;
    let parameters = |run: &RunContent| run.summary.calibration.parameters.clone();
    let with_ground_truth = calibrated().flat_map(parameters).any(|parameter| parameter.ground_truth.is_some());
    let mut header = vec!["parameter", "rig", "final ± 1 σ", "σ / prior σ", "verdict", "since, s"];
    if with_ground_truth {
        header.push("error (multiple of σ)");
    }
    let columns = header.len();
    Some(html! {
        p.rule {
            "Values at the end; verdicts of the whole flight (" (Determination::RULE)
            "). Below a parameter that is not determined: the reason, and what helps."
        }
        table.calibration {
            thead { tr { @for cell in &header { th scope="col" { (cell) } } } }
            @for run in calibrated() {
                tbody.run {
                    tr {
                        th colspan=(columns) scope="rowgroup" {
                            "Calibration of run " (run.label) ", parameterization " (run.summary.calibration.parameterization)
                        }
                    }
                }
                @for verdict in &run.estimability {
                    (calibration_rows(run, verdict, with_ground_truth))
                }
            }
        }
    })
}

/// The rows of one parameter, which stay on one page.
fn calibration_rows(run: &RunContent, verdict: &FlightParameter, with_ground_truth: bool) -> Markup {
    let parameter = run.summary.calibration.parameters.iter().find(|parameter| parameter.name == verdict.name);
    let cells = calibration_row(verdict, parameter, with_ground_truth);
    let why: Vec<&str> =
        [verdict.reason.as_str(), verdict.remedy.as_str()].into_iter().filter(|text| !text.is_empty()).collect();
    let name_rows = if why.is_empty() { 1 } else { 2 };
    html! {
        tbody {
            tr {
                th scope="row" rowspan=(name_rows) { (verdict.name) }
                @for cell in &cells {
                    @if is_number(cell) { td.number { (cell) } } @else { td { (cell) } }
                }
            }
            @if !why.is_empty() {
                tr.why { td colspan=(cells.len()) { (unbroken(&why.join(" · "))) } }
            }
        }
    }
}

/// Cells of a parameter after its name.
fn calibration_row(
    verdict: &FlightParameter,
    parameter: Option<&ParameterSummary>,
    with_ground_truth: bool,
) -> Vec<String> {
    let (unit, scale, decimals) = shown_unit(verdict.dimension);
    let shown = |value: f64| number(value * scale, decimals);
    let unit = if unit.is_empty() || unit == "°" { unit.to_owned() } else { format!(" {unit}") };
    let sigma = verdict.sigma.map_or_else(String::new, |sigma| format!(" ± {}", shown(sigma)));
    let mut row = vec![
        parameter.map_or_else(String::new, |parameter| shown(parameter.initial)),
        format!("{}{sigma}{unit}", shown(verdict.value)),
        verdict.ratio.map_or_else(String::new, |ratio| number(ratio, 3)),
        verdict.verdict.name().to_owned(),
        verdict.since_s().map_or_else(String::new, |since_s| number(since_s, 2)),
    ];
    if with_ground_truth {
        let error = parameter.and_then(|parameter| parameter.error);
        let ratio = error.zip(verdict.sigma).filter(|(_, sigma)| *sigma > 0.0);
        let ratio =
            ratio.map_or_else(String::new, |(error, sigma)| format!(" ({} σ)", number((error / sigma).abs(), 1)));
        row.push(error.map_or_else(String::new, |error| format!("{}{unit}{ratio}", shown(error))));
    }
    row
}

pub(super) fn events(run: &RunContent) -> Markup {
    let rows: Vec<Vec<String>> = run
        .events
        .iter()
        .map(|event| {
            let times = if event.times > 1 { format!("{} consecutive frames", event.times) } else { String::new() };
            vec![number(event.time_s, 2), event.kind.clone(), event.message.clone(), times]
        })
        .collect();
    table(&format!("Events of run {}", run.label), &["time, s", "event", "message", ""], &rows)
}

/// Findings of `check` about the log and its rig, most severe first; checks without a problem as a list.
pub(super) fn findings(check: &CheckReport) -> Markup {
    let (good, others): (Vec<_>, Vec<_>) = check.findings.iter().partition(|found| found.severity == Severity::Good);
    let rows: Vec<Vec<String>> = others
        .iter()
        .map(|found| {
            let what = format!("{}: {}", found.title, found.evidence);
            vec![found.severity.label().to_owned(), found.area.label().to_owned(), what, found.remedy.clone()]
        })
        .collect();
    let good: Vec<String> = good.iter().map(|found| format!("{}: {}", found.title, found.evidence)).collect();
    html! {
        @if rows.is_empty() {
            p { "No problems found in the log and the rig." }
        } @else {
            (table("Problems of the log and the rig (dcvins check)", &["severity", "area", "finding", "remedy"], &rows))
        }
        @if !good.is_empty() {
            p { "Checks without problems:" }
            (list_in_columns(&good))
        }
    }
}

pub(super) fn topics(check: &CheckReport) -> Markup {
    let rows: Vec<Vec<String>> = check
        .topics
        .iter()
        .map(|topic| {
            vec![
                topic.topic.clone(),
                topic.schema.clone(),
                topic.role.clone(),
                topic.count.to_string(),
                number(topic.rate_hz, 1),
                format!("{} to {}", number(topic.first_s, 2), number(topic.last_s, 2)),
                topic.latency_s.map_or_else(String::new, |latency_s| number(latency_s * MS_PER_S, 1)),
            ]
        })
        .collect();
    table("Topics", &["topic", "type", "role", "messages", "rate, Hz", "stamps, s", "median delay, ms"], &rows)
}

pub(super) fn inputs(content: &ReportContent) -> Markup {
    let row = |input: &super::InputFile| vec![input.name.clone(), input.bytes.to_string(), input.sha256.clone()];
    let rows: Vec<Vec<String>> = content.inputs.iter().map(row).collect();
    table("Input files", &["file", "bytes", "SHA-256"], &rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Dimension;

    #[test]
    fn every_unit_is_shown_as_people_read_it() {
        let check = |dimension: Dimension, expected: [&str; 3]| {
            let name = "parameter".to_owned();
            let (ground_truth, error, sigma) = (Some(0.5), Some(-0.25), Some(0.125));
            let summary = ParameterSummary {
                name: name.clone(),
                dimension,
                initial: 0.0,
                last: 0.25,
                sigma,
                ground_truth,
                error,
            };
            let verdict = FlightParameter {
                parameter: crate::gimbal::ParameterId::timeshift(0),
                name,
                group: "clocks",
                dimension,
                value: 0.25,
                sigma,
                prior_sigma: Some(0.25),
                ratio: Some(0.5),
                verdict: Determination::WeaklyDetermined,
                since_ns: Some(1_500_000_000),
                cause: None,
                reason: "motion".to_owned(),
                remedy: String::new(),
            };
            let [rig, last, error] = expected;
            let verdicts = ["0.500", "weakly determined", "1.50"];
            let expected = [&[rig, last], &verdicts[..], &[error]].concat();
            assert_eq!(calibration_row(&verdict, Some(&summary), true), expected);
            assert_eq!(calibration_row(&verdict, None, false).len(), expected.len() - 1);
        };
        check(Dimension::Angle, ["0.000", "14.324 ± 7.162°", "−14.324° (2.0 σ)"]);
        check(Dimension::Length, ["0.00", "250.00 ± 125.00 mm", "−250.00 mm (2.0 σ)"]);
        check(Dimension::Time, ["0.000", "250.000 ± 125.000 ms", "−250.000 ms (2.0 σ)"]);
    }
}
