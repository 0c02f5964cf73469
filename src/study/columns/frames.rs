//! Columns of the table of frames.

use super::column::Column;
use super::job_result::JobResult;
use crate::estimator::FrameStateReport;
use crate::geometry::seconds_from_ns;
use crate::session::StepRecord;

/// One image of a run.
pub(super) struct FrameRow<'a> {
    key: &'a str,
    step: &'a StepRecord,
    /// Position error in metres and angle in radians after the alignment of the whole run.
    error: Option<[f64; 2]>,
}

impl<'a> FrameRow<'a> {
    /// The images of a run; none of a job without a run.
    pub(super) fn all(result: &JobResult<'a>) -> Vec<Self> {
        let Some(run) = &result.run else { return Vec::new() };
        let row = |step: &'a StepRecord| Self { key: result.key, step, error: run.record.aligned_error(step) };
        run.record.steps.iter().map(|step| row(step)).collect()
    }

    fn newest(&self) -> Option<&FrameStateReport> {
        self.step.report.newest()
    }

    fn position(&self, axis: usize) -> Option<f64> {
        Some(self.newest()?.world_from_imu.translation_m[axis])
    }

    pub(super) const COLUMNS: &'a [Column<Self>] = &[
        Column::text("key", "key of the run", |row| Some(row.key.to_owned())),
        Column::count("frame", "number of the image", |row| Some(row.step.report.frame_index)),
        Column::number("t_s", "s", "stamp since the log began", |row| Some(seconds_from_ns(row.step.report.stamp_ns))),
        Column::flag("estimated", "whether there is a pose", |row| Some(row.newest().is_some())),
        Column::flag("keyframe", "whether it is a keyframe", |row| Some(row.step.report.keyframe)),
        Column::number("x_m", "m", "estimated position in the world", |row| row.position(0)),
        Column::number("y_m", "m", "estimated position in the world", |row| row.position(1)),
        Column::number("z_m", "m", "estimated position in the world", |row| row.position(2)),
        Column::number(
            "position_error_m",
            "m",
            "distance from the ground truth after the alignment of the whole run",
            |row| row.error.map(|[error_m, _]| error_m),
        ),
        Column::number("rotation_error_rad", "rad", "angle to the ground truth after that alignment", |row| {
            row.error.map(|[_, angle_rad]| angle_rad)
        }),
        Column::number("reprojection_rms_px", "px", "reprojection RMS after the solve", |row| {
            row.newest().map(|_| row.step.report.reprojection_rms_after_px)
        }),
        Column::count("tracked", "tracked features", |row| Some(row.step.tracks.features.len())),
        Column::count("rank_structural", "structural rank", |row| Some(row.step.rank.as_ref()?.rank_structural)),
        Column::count("rank_informed", "informed rank", |row| Some(row.step.rank.as_ref()?.rank_informed)),
        Column::number("step_ms", "ms", "time of the step", |row| Some(row.step.report.times.step_ms)),
    ];
}
