//! Columns of the table of frames.

use super::job_result::JobResult;
use crate::estimator::FrameStateReport;
use crate::geometry::seconds_from_ns;
use crate::session::StepRecord;
use crate::table::Column;

type FrameColumn<'a> = Column<'a, FrameRow<'a>>;

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

    pub(super) fn columns() -> Vec<FrameColumn<'a>> {
        let columns = [
            FrameColumn::new("key", |row| row.key).means("", "key of the run"),
            FrameColumn::new("frame", |row| row.step.report.frame_index).means("", "number of the image"),
            FrameColumn::new("t_s", |row| seconds_from_ns(row.step.report.stamp_ns))
                .means("s", "stamp since the log began"),
            FrameColumn::new("estimated", |row| row.newest().is_some()).means("", "whether there is a pose"),
            FrameColumn::new("keyframe", |row| row.step.report.keyframe).means("", "whether it is a keyframe"),
            FrameColumn::new("x_m", |row| row.position(0)).means("m", "estimated position in the world"),
            FrameColumn::new("y_m", |row| row.position(1)).means("m", "estimated position in the world"),
            FrameColumn::new("z_m", |row| row.position(2)).means("m", "estimated position in the world"),
            FrameColumn::new("position_error_m", |row| row.error.map(|[error_m, _]| error_m))
                .means("m", "distance from the ground truth after the alignment of the whole run"),
            FrameColumn::new("rotation_error_rad", |row| row.error.map(|[_, angle_rad]| angle_rad))
                .means("rad", "angle to the ground truth after that alignment"),
            FrameColumn::new("reprojection_rms_px", |row| {
                row.newest().map(|_| row.step.report.reprojection_rms_after_px)
            })
            .means("px", "reprojection RMS after the solve"),
            FrameColumn::new("tracked", |row| row.step.tracks.features.len()).means("", "tracked features"),
            FrameColumn::new("rank_structural", |row| Some(row.step.rank.as_ref()?.rank_structural))
                .means("", "structural rank"),
            FrameColumn::new("rank_informed", |row| Some(row.step.rank.as_ref()?.rank_informed))
                .means("", "informed rank"),
            FrameColumn::new("step_ms", |row| row.step.report.times.step_ms).means("ms", "time of the step"),
        ];
        columns.into()
    }
}
