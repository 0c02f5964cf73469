//! The tables of a report.

use maud::{Markup, html};

use super::content::{ReportContent, RunContent};
use super::html::{list, table};
use super::numbers::{MS_PER_S, number, shown_unit};
use super::verdict::ParameterVerdict;
use crate::log_check::{CheckReport, Severity};
use crate::session::{EstimabilitySummary, ParameterSummary, TrajectoryLane};

/// Number of columns of the calibration table before the prior: name, unit, values and σ.
const VALUE_COLUMNS: usize = 5;

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

/// Calibration of one run in degrees, millimetres and milliseconds.
pub(super) fn calibration(run: &RunContent) -> Markup {
    let parameters = &run.summary.calibration.parameters;
    let with_ground_truth = parameters.iter().any(|parameter| parameter.ground_truth.is_some());
    let mut header = vec!["parameter", "unit", "rig", "final", "± σ", "prior ± σ", "informed"];
    if with_ground_truth {
        header.extend(["ground truth", "error", "error / σ"]);
    }
    let row = |(parameter, verdict): (&ParameterSummary, &ParameterVerdict)| {
        let mut row = calibration_row(parameter, with_ground_truth);
        let (_, scale, decimals) = shown_unit(parameter.dimension);
        let prior =
            verdict.prior_sigma.map_or_else(String::new, |sigma| format!("±{}", number(sigma * scale, decimals)));
        let informed = if verdict.informed { "yes" } else { "no" };
        row.splice(VALUE_COLUMNS..VALUE_COLUMNS, [prior, informed.to_owned()]);
        row
    };
    let rows: Vec<Vec<String>> = parameters.iter().zip(&run.verdict.parameters).map(row).collect();
    let caption =
        format!("Calibration of run {}, parameterization {}", run.label, run.summary.calibration.parameterization);
    table(&caption, &header, &rows)
}

/// Estimability of the parameters of one run, in groups.
pub(super) fn estimability(run: &RunContent) -> Markup {
    let header = ["parameter", "group", "unit", "final", "± σ", "prior ± σ", "σ / prior", "verdict", "reason"];
    let row = |parameter: &EstimabilitySummary| {
        let (unit, scale, decimals) = shown_unit(parameter.dimension);
        let sigma = |sigma: Option<f64>| sigma.map_or_else(String::new, |sigma| number(sigma * scale, decimals));
        vec![
            parameter.name.clone(),
            parameter.group.to_owned(),
            unit.to_owned(),
            number(parameter.value * scale, decimals),
            sigma(parameter.sigma),
            sigma(parameter.prior_sigma),
            parameter.ratio.map_or_else(String::new, |ratio| number(ratio, 3)),
            parameter.verdict.to_owned(),
            parameter.reason.clone(),
        ]
    };
    let rows: Vec<Vec<String>> = run.estimability.iter().map(row).collect();
    let caption = format!(
        "What the flight determines, run {}: known with σ below 0.3 of the prior, not from this flight from 0.9 on; \
         directions are those of the last window",
        run.label
    );
    table(&caption, &header, &rows)
}

fn calibration_row(parameter: &ParameterSummary, with_ground_truth: bool) -> Vec<String> {
    let (unit, scale, decimals) = shown_unit(parameter.dimension);
    let shown = |value: f64| number(value * scale, decimals);
    let sigma = parameter.sigma.map_or_else(String::new, |sigma| format!("±{}", number(sigma * scale, decimals)));
    let mut row = vec![parameter.name.clone(), unit.to_owned(), shown(parameter.initial), shown(parameter.last), sigma];
    if with_ground_truth {
        row.push(parameter.ground_truth.map_or_else(String::new, shown));
        row.push(parameter.error.map_or_else(String::new, shown));
        let ratio = parameter.error.zip(parameter.sigma).filter(|(_, sigma)| *sigma > 0.0);
        row.push(ratio.map_or_else(String::new, |(error, sigma)| number(error / sigma, 1)));
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
            (list(&good))
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
        let check = |dimension: Dimension, expected: [&str; 8]| {
            let name = "parameter".to_owned();
            let (ground_truth, error, sigma) = (Some(0.5), Some(-0.25), Some(0.125));
            let parameter = ParameterSummary { name, dimension, initial: 0.0, last: 0.25, sigma, ground_truth, error };
            assert_eq!(calibration_row(&parameter, true), expected);
            assert_eq!(calibration_row(&parameter, false), expected[..5]);
        };
        check(Dimension::Angle, ["parameter", "°", "0.000", "14.324", "±7.162", "28.648", "−14.324", "−2.0"]);
        check(Dimension::Length, ["parameter", "mm", "0.00", "250.00", "±125.00", "500.00", "−250.00", "−2.0"]);
        check(Dimension::Time, ["parameter", "ms", "0.000", "250.000", "±125.000", "500.000", "−250.000", "−2.0"]);
    }
}
