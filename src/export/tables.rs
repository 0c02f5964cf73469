//! The CSV tables of a run, one row per frame.

use std::sync::Arc;

use crate::estimator::{InformationGain, Motion};
use crate::gimbal::ParameterNames;
use crate::observability::RankReport;
use crate::sensors::Rig;
use crate::session::{RunRecord, StepRecord};
use crate::table::{Column, Stamp, csv};

/// `calibration.csv`: each parameter and its σ, then the joint angles and the factor in σ. A switch of the parameterization changes the
/// parameters: there are columns for all parameterizations of the run, empty while another one is in use.
pub(super) fn calibration_csv(run: &RunRecord, rig: &Rig) -> String {
    let mut columns = vec![StepRecord::stamp_column()];
    columns.extend(run.parameter_columns(rig).flat_map(|(_, columns)| columns));
    columns.extend(run.joint_columns(rig));
    columns.push(Column::new("sigma_scale", |step: &StepRecord| step.report.calibration.sigma_scale));
    let estimated = run.steps.iter().filter(|step| step.report.newest().is_some());
    csv(&columns, estimated.map(Arc::as_ref))
}

/// `rank.csv`: ranks, deficit by cause, thresholds, margins and singular values.
pub(super) fn rank_csv(run: &RunRecord, names: &ParameterNames) -> String {
    csv(&run.rank_columns(names), run.ranked())
}

/// Information gain of a step in one parameter.
struct GainRow<'a> {
    step: &'a StepRecord,
    rank: &'a RankReport,
    gain: &'a InformationGain,
    column: usize,
}

type GainColumn<'a> = Column<'a, GainRow<'a>>;

/// `information.csv`: information gain of each step and parameter, in total and by motion, in bits per second; zero for
/// images that do not become keyframes.
pub(super) fn information_csv(run: &RunRecord, rig: &Rig) -> String {
    let informed = || run.steps.iter().filter_map(|step| Some((step, step.gain()?)));
    let joints = informed().map(|(_, (_, gain))| gain.joints).max().unwrap_or(0);
    let whole = informed().filter(|(_, (rank, gain))| rank.parameters.len() == gain.columns());
    let rows = whole
        .flat_map(|(step, (rank, gain))| (0..gain.columns()).map(move |column| GainRow { step, rank, gain, column }));
    csv(&information_columns(rig, joints), rows)
}

fn information_columns<'a>(rig: &Rig, joints: usize) -> Vec<GainColumn<'a>> {
    let (names, joint_names) = (rig.parameter_names(), rig.joint_names());
    let mut columns = vec![
        GainColumn::new("t_s", |row| Stamp(row.step.report.stamp_ns)).means("s", "stamp since the log began"),
        GainColumn::new("keyframe", |row| usize::from(row.step.report.keyframe)).means("", "1 for a keyframe"),
        GainColumn::new("interval_s", |row| row.gain.interval_s).means("s", "time since the previous step"),
        GainColumn::new("parameter", move |row| names.name(row.rank.parameters[row.column])).means("", "name"),
        GainColumn::new("bits_per_s", |row| row.gain.bits_per_s(row.column)).means(
            "bit/s",
            "information gain of the image; one bit halves σ; zero where the frame does not become a keyframe",
        ),
    ];
    columns.extend(GainColumn::each(
        Motion::all(joints).enumerate(),
        |(_, motion)| motion.name(&joint_names).replace(' ', "_"),
        |row, (index, _)| row.gain.by_motion_per_s(row.column).nth(*index),
    ));
    columns.push(
        GainColumn::new("earlier", |row| row.gain.earlier_per_s(row.column))
            .means("bit/s", "contribution of images that have left the window"),
    );
    columns
}

/// `frames.csv`: counts, residuals, iterations, stage times and events. Without `timing` the time cells are empty, so
/// that two runs give the same bytes.
pub(super) fn frames_csv(run: &RunRecord, timing: bool) -> String {
    csv(&StepRecord::frame_columns(timing), run.steps.iter().map(Arc::as_ref))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::documented_tests::documented;

    #[test]
    fn the_documents_list_the_columns() {
        let document = include_str!("../../docs/formats.md");
        let (frames, ranks) = (StepRecord::frame_columns(true), StepRecord::rank_columns());
        let rig = crate::gui::samples::sample_recording_of(1, &["auto"]).rig;
        for table in [documented(&frames), documented(&ranks), documented(&information_columns(&rig, 0))] {
            assert!(document.contains(&table), "docs/formats.md lacks the table:\n{table}");
        }
    }
}
