//! The CSV tables of a run, one row per frame.

use crate::estimator::Motion;
use crate::files::csv_writer::{CsvWriter, number_cell, seconds_cell};
use crate::gimbal::{ParameterId, ParameterNames, Singularity};
use crate::sensors::Rig;
use crate::session::{RunRecord, StepRecord};

/// `calibration.csv`: each parameter and its σ, then the joint angles. A switch of the parameterization changes the
/// parameters: there are columns for all parameterizations of the run, empty while another one is in use.
pub(super) fn calibration_csv(run: &RunRecord, rig: &Rig) -> String {
    let names = rig.parameter_names();
    let mut columns: Vec<ParameterId> = Vec::new();
    for step in &run.steps {
        let calibration = &step.report.calibration;
        for parameter in &calibration.parameters {
            if !columns.contains(parameter) {
                columns.push(*parameter);
            }
        }
    }
    let joints = joint_names(run, rig);
    let mut header = vec!["t_s".to_owned()];
    for parameter in &columns {
        let (name, unit) = (names.name(*parameter), parameter.dimension().unit());
        header.extend([format!("{name}_{unit}"), format!("{name}_sigma_{unit}")]);
    }
    header.extend(joints.iter().map(|joint| format!("{joint}_rad")));
    let mut table = CsvWriter::new(header);
    for step in run.steps.iter().filter(|step| step.report.newest().is_some()) {
        let calibration = &step.report.calibration;
        let mut row = vec![seconds_cell(step.report.stamp_ns)];
        for parameter in &columns {
            let index = calibration.parameters.iter().position(|known| known == parameter);
            let series = [&calibration.values, &calibration.sigmas];
            row.extend(series.map(|series| optional_cell(index.and_then(|index| series.get(index)))));
        }
        let angles = step.report.newest().map_or(&[][..], |newest| &newest.joint_angles_rad);
        row.extend((0..joints.len()).map(|index| optional_cell(angles.get(index))));
        table.row(row);
    }
    table.into_text()
}

pub(super) fn optional_cell(number: Option<&f64>) -> String {
    number.map_or_else(String::new, |number| number_cell(*number))
}

fn joint_names(run: &RunRecord, rig: &Rig) -> Vec<String> {
    let count =
        run.steps.iter().filter_map(|step| step.report.newest()).map(|newest| newest.joint_angles_rad.len()).max();
    let mut names = rig.joint_names();
    names.truncate(count.unwrap_or(0));
    names
}

/// `rank.csv`: ranks, deficit by cause, thresholds, margins and singular values.
pub(super) fn rank_csv(run: &RunRecord, names: &ParameterNames) -> String {
    let ranked: Vec<(&StepRecord, _)> =
        run.steps.iter().filter_map(|step| step.rank.as_ref().map(|rank| (step.as_ref(), rank))).collect();
    let columns = ranked.iter().map(|(_, rank)| rank.parameters.len()).max().unwrap_or(0);
    let mut margins: Vec<Singularity> = Vec::new();
    for (singularity, _) in ranked.iter().flat_map(|(_, rank)| &rank.margins) {
        if !margins.contains(singularity) {
            margins.push(*singularity);
        }
    }
    let mut header = [
        "t_s",
        "columns",
        "rank_structural",
        "rank_informed",
        "deficit_parameterization",
        "deficit_joints",
        "deficit_absorbed",
        "deficit_motion",
        "known_directions",
        "known_agreeing",
        "false_gain",
        "reference",
        "structural_threshold",
        "informed_threshold",
    ]
    .map(str::to_owned)
    .to_vec();
    header.extend(margins.iter().map(|it| format!("margin_{}", names.singularity(*it).replace([' ', ','], "_"))));
    header.extend((1..=columns).map(|index| format!("singular_value_{index}")));
    header.extend((1..=columns).map(|index| format!("singular_value_with_priors_{index}")));
    let mut table = CsvWriter::new(header);
    for (step, rank) in ranked {
        let mut row = vec![seconds_cell(step.report.stamp_ns)];
        let counts = [
            rank.parameters.len(),
            rank.rank_structural,
            rank.rank_informed,
            rank.deficit_parameterization,
            rank.deficit_joints,
            rank.deficit_absorbed,
            rank.deficit_motion,
            rank.known.len(),
            rank.known_agreeing(),
        ];
        row.extend(counts.map(|count| count.to_string()));
        let numbers = [rank.spurious_gain(), rank.reference, rank.structural_threshold, rank.informed_threshold];
        row.extend(numbers.map(number_cell));
        for singularity in &margins {
            let margin = rank.margins.iter().find(|(known, _)| known == singularity);
            row.push(optional_cell(margin.map(|(_, margin)| margin)));
        }
        for series in [&rank.singular_values, &rank.singular_values_with_priors] {
            row.extend((0..columns).map(|index| optional_cell(series.get(index))));
        }
        table.row(row);
    }
    table.into_text()
}

/// `information.csv`: information gain of each step and parameter, in total and by motion, in bits per second; zero for
/// images that do not become keyframes.
pub(super) fn information_csv(run: &RunRecord, rig: &Rig) -> String {
    let (names, joints) = (rig.parameter_names(), rig.joint_names());
    let informed = || run.steps.iter().filter_map(|step| Some((step, step.gain()?)));
    let count = informed().map(|(_, (_, gain))| gain.joints).max().unwrap_or(0);
    let mut header = ["t_s", "keyframe", "interval_s", "parameter", "bits_per_s"].map(str::to_owned).to_vec();
    header.extend(Motion::all(count).map(|motion| motion.name(&joints).replace(' ', "_")));
    header.push("earlier".to_owned());
    let mut table = CsvWriter::new(header);
    for (step, (rank, gain)) in informed().filter(|(_, (rank, gain))| rank.parameters.len() == gain.columns()) {
        for (column, parameter) in rank.parameters.iter().enumerate() {
            let mut row = vec![
                seconds_cell(step.report.stamp_ns),
                u8::from(step.report.keyframe).to_string(),
                number_cell(gain.interval_s),
                names.name(*parameter),
                number_cell(gain.bits_per_s(column)),
            ];
            let parts: Vec<f64> = gain.by_motion_per_s(column).collect();
            row.extend((0..6 + count).map(|motion| optional_cell(parts.get(motion))));
            row.push(number_cell(gain.earlier_per_s(column)));
            table.row(row);
        }
    }
    table.into_text()
}

/// `frames.csv`: counts, residuals, iterations, stage times and events. Without `timing` the time cells are empty, so
/// that two runs give the same bytes.
pub(super) fn frames_csv(run: &RunRecord, timing: bool) -> String {
    let mut table = CsvWriter::new([
        "t_s",
        "frame",
        "log_time_s",
        "phase",
        "tracked",
        "new",
        "lost",
        "rejected",
        "inliers",
        "keyframe",
        "reprojection_rms_before_px",
        "reprojection_rms_after_px",
        "iterations",
        "frontend_ms",
        "optimize_ms",
        "linearize_ms",
        "report_ms",
        "marginalize_ms",
        "observability_ms",
        "step_ms",
        "events",
        "warnings",
    ]);
    for step in &run.steps {
        let report = &step.report;
        let statistics = &step.tracks.statistics;
        let mut row = vec![
            seconds_cell(report.stamp_ns),
            report.frame_index.to_string(),
            seconds_cell(step.log_time_ns),
            report.phase.name().to_owned(),
            statistics.tracked.to_string(),
            statistics.detected.to_string(),
            statistics.lost.to_string(),
            statistics.rejected.to_string(),
            report.counts.inliers().to_string(),
            u8::from(report.keyframe).to_string(),
            number_cell(report.reprojection_rms_before_px),
            number_cell(report.reprojection_rms_after_px),
            report.iterations.len().to_string(),
        ];
        let times = &report.times;
        let stages_ms = [
            times.frontend_ms,
            times.optimize_ms,
            times.linearize_ms,
            times.report_ms,
            times.marginalize_ms,
            times.observability_ms,
            times.step_ms,
        ];
        row.extend(stages_ms.map(|time_ms| if timing { format!("{time_ms:.3}") } else { String::new() }));
        let events = report.events.iter().map(|event| format!("{:?}: {}", event.kind, event.message));
        row.push(events.collect::<Vec<_>>().join("; "));
        row.push(report.warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "));
        table.row(row);
    }
    table.into_text()
}
