//! Columns of tables with a row per step: frames, ranks, and the calibration over time.

use super::run::RunRecord;
use super::step::StepRecord;
use crate::estimator::StageTimes;
use crate::gimbal::{ParameterId, ParameterNames, Singularity};
use crate::observability::RankReport;
use crate::sensors::Rig;
use crate::table::{Column, ColumnType, Stamp, distinct};

/// A column of steps.
pub type StepColumn<'a> = Column<'a, StepRecord>;
/// A column of steps with their rank.
pub type RankColumn<'a> = Column<'a, (&'a StepRecord, &'a RankReport)>;

impl StepRecord {
    pub fn stamp_column<'a>() -> StepColumn<'a> {
        StepColumn::new("t_s", |step| Stamp(step.report.stamp_ns)).means("s", "stamp since the log began")
    }

    /// Counts, residuals, iterations, stage times and events; without `timing` the times are empty, so that two runs
    /// give the same bytes.
    pub fn frame_columns<'a>(timing: bool) -> Vec<StepColumn<'a>> {
        let counts = [
            Self::stamp_column(),
            StepColumn::new("frame", |step| step.report.frame_index).means("", "number of the image"),
            StepColumn::new("log_time_s", |step| Stamp(step.log_time_ns)).means("s", "log time since the log began"),
            StepColumn::new("phase", |step| step.report.phase.name()).means("", "initializing or tracking"),
            StepColumn::new("tracked", |step| step.tracks.statistics.tracked).means("", "features continued"),
            StepColumn::new("new", |step| step.tracks.statistics.detected).means("", "features detected"),
            StepColumn::new("lost", |step| step.tracks.statistics.lost).means("", "features lost"),
            StepColumn::new("rejected", |step| step.tracks.statistics.rejected)
                .means("", "features rejected by RANSAC"),
            StepColumn::new("inliers", |step| step.report.counts.inliers())
                .means("", "features in the solve, not rejected"),
            StepColumn::new("keyframe", |step| usize::from(step.report.keyframe)).means("", "1 for a keyframe"),
            StepColumn::new("reprojection_rms_before_px", |step| step.report.reprojection_rms_before_px)
                .means("px", "reprojection RMS before the solve"),
            StepColumn::new("reprojection_rms_after_px", |step| step.report.reprojection_rms_after_px)
                .means("px", "reprojection RMS after the solve"),
            StepColumn::new("iterations", |step| step.report.iterations.len()).means("", "solver iterations"),
        ];
        let times = StageTimes::STAGES.iter().map(|stage| {
            let value = move |step: &Self| timing.then(|| format!("{:.3}", (stage.time_ms)(&step.report.times)));
            let mut column = StepColumn::new(format!("{}_ms", stage.key), value).means("ms", stage.meaning);
            column.cell_type = ColumnType::Number;
            column
        });
        let texts = [
            StepColumn::new("events", |step| {
                let events = step.report.events.iter().map(|event| format!("{:?}: {}", event.kind, event.message));
                events.collect::<Vec<_>>().join("; ")
            })
            .means("", "KIND: text, separated by semicolons"),
            StepColumn::new("warnings", |step| {
                step.report.warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
            })
            .means("", "texts, separated by semicolons"),
        ];
        counts.into_iter().chain(times).chain(texts).collect()
    }

    /// Ranks, deficit by cause and thresholds.
    pub fn rank_columns<'a>() -> Vec<RankColumn<'a>> {
        let columns = [
            RankColumn::new("t_s", |(step, _)| Stamp(step.report.stamp_ns)).means("s", "stamp since the log began"),
            RankColumn::new("columns", |(_, rank)| rank.parameters.len()).means("", "calibration columns"),
            RankColumn::new("rank_structural", |(_, rank)| rank.rank_structural).means("", "structural rank"),
            RankColumn::new("rank_informed", |(_, rank)| rank.rank_informed).means("", "informed rank"),
            RankColumn::new("deficit_parameterization", |(_, rank)| rank.deficit_parameterization)
                .means("", "rank deficit by redundant parameters"),
            RankColumn::new("deficit_joints", |(_, rank)| rank.deficit_joints)
                .means("", "rank deficit by joints that did not move"),
            RankColumn::new("deficit_absorbed", |(_, rank)| rank.deficit_absorbed)
                .means("", "rank deficit absorbed by free joint angles"),
            RankColumn::new("deficit_motion", |(_, rank)| rank.deficit_motion)
                .means("", "rank deficit by insufficient motion of the vehicle"),
            RankColumn::new("known_directions", |(_, rank)| rank.known.len())
                .means("", "null directions of the parameterization in closed form"),
            RankColumn::new("known_agreeing", |(_, rank)| rank.known_agreeing())
                .means("", "number of these that are null in this step"),
            RankColumn::new("false_gain", |(_, rank)| rank.spurious_gain()).means(
                "",
                "spurious information: information of the priors on lost directions; 1 corresponds to σ of 10° or 3 cm",
            ),
            RankColumn::new("reference", |(_, rank)| rank.reference).means("", "norm of the scaled columns"),
            RankColumn::new("structural_threshold", |(_, rank)| rank.structural_threshold)
                .means("", "singular value from which a direction counts for the structural rank"),
            RankColumn::new("informed_threshold", |(_, rank)| rank.informed_threshold)
                .means("", "singular value from which a direction counts for the informed rank"),
        ];
        columns.into()
    }
}

impl RunRecord {
    /// Calibration parameters of all parameterizations of the run.
    pub fn parameters(&self) -> Vec<ParameterId> {
        distinct(self.steps.iter().flat_map(|step| &step.report.calibration.parameters).copied())
    }

    /// Steps with their rank.
    pub fn ranked(&self) -> impl Iterator<Item = (&StepRecord, &RankReport)> {
        self.steps.iter().filter_map(|step| Some((step.as_ref(), step.rank.as_ref()?)))
    }

    /// Value and σ of each parameter; empty in steps of another parameterization.
    pub fn parameter_columns<'a>(&self, rig: &Rig) -> impl Iterator<Item = (ParameterId, [StepColumn<'a>; 2])> {
        let names = rig.parameter_names();
        self.parameters().into_iter().map(move |parameter| {
            let (name, unit) = (names.name(parameter), parameter.dimension().unit());
            let start = self.start_value(parameter);
            let value = move |step: &StepRecord| {
                let value = step.report.calibration.value_of(parameter)?;
                Some(start.map_or(value, |start| parameter.value_near(start, value)))
            };
            let sigma = move |step: &StepRecord| step.report.calibration.sigma_of(parameter);
            let sigma_name = format!("{name}_sigma_{unit}");
            (parameter, [StepColumn::new(format!("{name}_{unit}"), value), StepColumn::new(sigma_name, sigma)])
        })
    }

    /// Columns of the joint angles of the newest frame, one for each joint of the rig, in radians.
    pub fn joint_columns<'a>(&self, rig: &Rig) -> impl Iterator<Item = StepColumn<'a>> {
        let newest = self.steps.iter().filter_map(|step| step.report.newest());
        let count = newest.map(|newest| newest.joint_angles_rad.len()).max().unwrap_or(0);
        StepColumn::each(
            rig.joint_names().into_iter().take(count).enumerate(),
            |(_, joint)| format!("{joint}_rad"),
            |step, (index, _)| step.report.newest()?.joint_angles_rad.get(*index).copied(),
        )
    }

    /// [`StepRecord::rank_columns`], then margins and singular values.
    pub fn rank_columns<'a>(&'a self, names: &ParameterNames) -> Vec<RankColumn<'a>> {
        let margins: Vec<Singularity> = distinct(self.ranked().flat_map(|(_, rank)| &rank.margins).map(|(it, _)| *it));
        let count = self.ranked().map(|(_, rank)| rank.parameters.len()).max().unwrap_or(0);
        let mut columns = StepRecord::rank_columns();
        columns.extend(RankColumn::each(
            margins,
            |margin| format!("margin_{}", names.singularity(*margin).replace([' ', ','], "_")),
            |(_, rank), margin| rank.margins.iter().find(|(known, _)| known == margin).map(|(_, margin)| *margin),
        ));
        columns.extend(RankColumn::each(
            0..count,
            |index| format!("singular_value_{}", index + 1),
            |(_, rank), index| rank.singular_values.get(*index).copied(),
        ));
        columns.extend(RankColumn::each(
            0..count,
            |index| format!("singular_value_with_priors_{}", index + 1),
            |(_, rank), index| rank.singular_values_with_priors.get(*index).copied(),
        ));
        columns
    }
}
