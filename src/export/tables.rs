//! The CSV tables of a run, one row per frame.

use std::fmt::Write as _;

use crate::estimator::{Event, Motion};
use crate::geometry::seconds_from_ns;
use crate::gimbal::{ParameterId, ParameterNames, Singularity};
use crate::sensors::Rig;
use crate::session::{RunRecord, StepRecord};

/// Why writing into a text needs no error of its own.
pub(super) const INTO_STRING: &str = "writing into a string cannot fail";

/// Seconds since the log began with all their nanoseconds.
fn seconds_text(stamp_ns: i64) -> String {
    format!("{:.9}", seconds_from_ns(stamp_ns))
}

fn push_cell(text: &mut String, cell: &str) {
    text.push(',');
    if cell.contains([',', '"', '\n']) {
        text.push('"');
        text.push_str(&cell.replace('"', "\"\""));
        text.push('"');
    } else {
        text.push_str(cell);
    }
}

fn push_number(text: &mut String, number: f64) {
    if number.is_finite() {
        write!(text, ",{number}").expect(INTO_STRING);
    } else {
        text.push(',');
    }
}

/// `calibration.csv`: each parameter and its sigma, then the joint angles. A chart switch changes the parameters, so
/// the columns are those of all charts, and a cell is empty while another chart is in use.
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
    let mut text = "t_s".to_owned();
    for parameter in &columns {
        let (name, unit) = (names.name(*parameter), parameter.dimension().unit());
        write!(text, ",{name}_{unit},{name}_sigma_{unit}").expect(INTO_STRING);
    }
    for joint in &joints {
        write!(text, ",{joint}_rad").expect(INTO_STRING);
    }
    text.push('\n');
    for step in run.steps.iter().filter(|step| step.report.newest().is_some()) {
        let calibration = &step.report.calibration;
        text.push_str(&seconds_text(step.report.stamp_ns));
        for parameter in &columns {
            let index = calibration.parameters.iter().position(|known| known == parameter);
            for series in [&calibration.values, &calibration.sigmas] {
                push_number(&mut text, index.and_then(|index| series.get(index)).copied().unwrap_or(f64::NAN));
            }
        }
        let angles = step.report.newest().map_or(&[][..], |newest| &newest.joint_angles_rad);
        for index in 0..joints.len() {
            push_number(&mut text, angles.get(index).copied().unwrap_or(f64::NAN));
        }
        text.push('\n');
    }
    text
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
    let mut text =
        "t_s,columns,rank_structural,rank_informed,deficit_parameterization,deficit_joints,deficit_absorbed,\
                    deficit_motion,known_directions,known_agreeing,false_gain,reference,structural_threshold,informed_threshold"
            .to_owned();
    for singularity in &margins {
        let name = names.singularity(*singularity);
        write!(text, ",margin_{}", name.replace([' ', ','], "_")).expect(INTO_STRING);
    }
    for index in 1..=columns {
        write!(text, ",singular_value_{index}").expect(INTO_STRING);
    }
    for index in 1..=columns {
        write!(text, ",singular_value_with_priors_{index}").expect(INTO_STRING);
    }
    text.push('\n');
    for (step, rank) in ranked {
        text.push_str(&seconds_text(step.report.stamp_ns));
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
        for count in counts {
            write!(text, ",{count}").expect(INTO_STRING);
        }
        for number in [rank.false_gain(), rank.reference, rank.structural_threshold, rank.informed_threshold] {
            push_number(&mut text, number);
        }
        for singularity in &margins {
            let margin = rank.margins.iter().find(|(known, _)| known == singularity);
            push_number(&mut text, margin.map_or(f64::NAN, |(_, margin)| *margin));
        }
        for series in [&rank.singular_values, &rank.singular_values_with_priors] {
            for index in 0..columns {
                push_number(&mut text, series.get(index).copied().unwrap_or(f64::NAN));
            }
        }
        text.push('\n');
    }
    text
}

/// `information.csv`: for each step and parameter how fast the image narrows it, and which motion that is owed to, in bits
/// per second; zeros where the image does not become a keyframe.
pub(super) fn information_csv(run: &RunRecord, rig: &Rig) -> String {
    let (names, joints) = (rig.parameter_names(), rig.joint_names());
    let told = || run.steps.iter().filter_map(|step| Some((step, step.gain()?)));
    let count = told().map(|(_, (_, gain))| gain.joints).max().unwrap_or(0);
    let mut text = "t_s,keyframe,interval_s,parameter,bits_per_s".to_owned();
    for motion in Motion::all(count) {
        write!(text, ",{}", motion.name(&joints).replace(' ', "_")).expect(INTO_STRING);
    }
    text.push_str(",earlier\n");
    for (step, (rank, gain)) in told().filter(|(_, (rank, gain))| rank.parameters.len() == gain.columns()) {
        for (column, parameter) in rank.parameters.iter().enumerate() {
            text.push_str(&seconds_text(step.report.stamp_ns));
            write!(text, ",{}", u8::from(step.report.keyframe)).expect(INTO_STRING);
            push_number(&mut text, gain.interval_s);
            write!(text, ",{}", names.name(*parameter)).expect(INTO_STRING);
            push_number(&mut text, gain.bits_per_s(column));
            let parts: Vec<f64> = gain.by_motion_per_s(column).collect();
            for motion in 0..6 + count {
                push_number(&mut text, parts.get(motion).copied().unwrap_or(f64::NAN));
            }
            push_number(&mut text, gain.earlier_per_s(column));
            text.push('\n');
        }
    }
    text
}

/// `frames.csv`: counts, residuals, iterations, stage times and events. Without `timing` the time cells stay empty, so
/// that two runs give the same bytes.
pub(super) fn frames_csv(run: &RunRecord, timing: bool) -> String {
    let mut text = "t_s,frame,log_time_s,phase,tracked,new,lost,rejected,inliers,keyframe,reprojection_rms_before_px,\
                    reprojection_rms_after_px,iterations,frontend_ms,optimize_ms,linearize_ms,report_ms,marginalize_ms,\
                    observability_ms,step_ms,events,warnings\n"
        .to_owned();
    for step in &run.steps {
        let report = &step.report;
        let statistics = &step.tracks.statistics;
        text.push_str(&seconds_text(report.stamp_ns));
        let phase = report.phase.name();
        let inliers = report.counts.inliers();
        write!(
            text,
            ",{},{},{phase},{},{},{},{},{inliers},{}",
            report.frame_index,
            seconds_text(step.log_time_ns),
            statistics.tracked,
            statistics.detected,
            statistics.lost,
            statistics.rejected,
            u8::from(report.keyframe),
        )
        .expect(INTO_STRING);
        push_number(&mut text, report.reprojection_rms_before_px);
        push_number(&mut text, report.reprojection_rms_after_px);
        write!(text, ",{}", report.iterations.len()).expect(INTO_STRING);
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
        for time_ms in stages_ms {
            if timing {
                write!(text, ",{time_ms:.3}").expect(INTO_STRING);
            } else {
                text.push(',');
            }
        }
        push_cell(&mut text, &report.events.iter().map(event_text).collect::<Vec<_>>().join("; "));
        push_cell(&mut text, &report.warnings.join("; "));
        text.push('\n');
    }
    text
}

fn event_text(event: &Event) -> String {
    format!("{:?}: {}", event.kind, event.message)
}
