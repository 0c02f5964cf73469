//! Tables of a study from the results of its jobs; columns of the tables of parameters and of frames.

use super::job_result::JobResult;
use crate::estimator::FrameStateReport;
use crate::geometry::seconds_from_ns;
use crate::session::{FlightParameter, ParameterSummary, StepRecord};
use crate::study::table::{StudyColumn, StudyTable};
use crate::table::Column;
use crate::text::Named as _;

/// Table of runs without a row.
pub fn runs_table() -> StudyTable {
    table(JobResult::columns(), &[])
}

/// Table of parameters without a row.
pub fn parameters_table() -> StudyTable {
    table(ParameterRow::columns(), &[])
}

/// Table of frames without a row.
pub fn frames_table() -> StudyTable {
    table(FrameRow::columns(), &[])
}

fn table<Row>(columns: Vec<Column<'_, Row>>, rows: &[Row]) -> StudyTable {
    let filled = columns.into_iter().map(|column| {
        let mut filled = StudyColumn::new(&column.name, column.cell_type, column.unit, &column.meaning);
        for row in rows {
            filled.values.push(column.cell(row));
        }
        filled
    });
    StudyTable::new(filled.collect()).expect("columns have one length and different names")
}

#[derive(Clone, Debug, PartialEq)]
pub struct StudyTables {
    /// One row per run.
    pub runs: StudyTable,
    /// One row per run and calibration parameter.
    pub parameters: StudyTable,
    /// One row per run and frame; empty unless the plan requests it.
    pub frames: StudyTable,
}

impl Default for StudyTables {
    fn default() -> Self {
        Self { runs: runs_table(), parameters: parameters_table(), frames: frames_table() }
    }
}

impl StudyTables {
    /// The rows of one job, including the rows of its frames if `with_frames`.
    pub fn of(result: &JobResult<'_>, with_frames: bool) -> Self {
        let frames = if with_frames { FrameRow::all(result) } else { Vec::new() };
        Self {
            runs: table(JobResult::columns(), std::slice::from_ref(result)),
            parameters: table(ParameterRow::columns(), &ParameterRow::all(result)),
            frames: table(FrameRow::columns(), &frames),
        }
    }
}

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
            FrameColumn::new("tracked", |row| row.step.tracks.count).means("", "tracked features"),
            FrameColumn::new("rank_structural", |row| Some(row.step.rank.as_ref()?.rank_structural))
                .means("", "structural rank"),
            FrameColumn::new("rank_informed", |row| Some(row.step.rank.as_ref()?.rank_informed))
                .means("", "informed rank"),
            FrameColumn::new("step_ms", |row| row.step.report.times.step_ms).means("ms", "time of the step"),
        ];
        columns.into()
    }
}

type ParameterColumn<'a> = Column<'a, ParameterRow<'a>>;

/// One calibration parameter of a run.
pub(super) struct ParameterRow<'a> {
    result: &'a JobResult<'a>,
    parameter: &'a ParameterSummary,
    /// Verdict of the whole flight on the parameter.
    verdict: Option<&'a FlightParameter>,
}

impl<'a> ParameterRow<'a> {
    /// The parameters of a run; none of a job without a run.
    pub(super) fn all(result: &'a JobResult<'a>) -> Vec<Self> {
        let calibrations = result.run.iter().map(|run| &run.summary.calibration);
        let rows = calibrations.flat_map(|calibration| {
            calibration.parameters.iter().map(|parameter| {
                let verdict = calibration.estimability.iter().find(|row| row.name == parameter.name);
                Self { result, parameter, verdict }
            })
        });
        rows.collect()
    }

    pub(super) fn columns() -> Vec<ParameterColumn<'a>> {
        let columns = [
            ParameterColumn::new("key", |row| row.result.key).means("", "key of the run"),
            ParameterColumn::new("log", |row| row.result.job.log.name()).means("", "as in the table of runs"),
            ParameterColumn::new("disturbance", |row| row.result.job.disturbance.clone())
                .means("", "as in the table of runs"),
            ParameterColumn::new("perturbation", |row| row.result.job.perturbation.name.clone())
                .means("", "as in the table of runs"),
            ParameterColumn::new("seed", |row| row.result.seed()).means("", "as in the table of runs"),
            ParameterColumn::new("run", |row| row.result.job.subject.to_string()).means("", "as in the table of runs"),
            ParameterColumn::new("parameter", |row| row.parameter.name.clone()).means("", "name of the parameter"),
            ParameterColumn::new("unit", |row| row.parameter.dimension.unit())
                .means("", "unit of the following values"),
            ParameterColumn::new("initial", |row| row.parameter.initial).means("", "value in the rig"),
            ParameterColumn::new("final", |row| row.parameter.last).means("", "value at the end"),
            ParameterColumn::new("sigma", |row| row.parameter.sigma)
                .means("", "posterior standard deviation at the end"),
            ParameterColumn::new("truth", |row| row.parameter.ground_truth).means("", "ground-truth value"),
            ParameterColumn::new("error", |row| row.parameter.error).means("", "final minus truth"),
            ParameterColumn::new("ratio", |row| row.verdict?.ratio).means("", "sigma over prior sigma at the end"),
            ParameterColumn::new("verdict", |row| Some(row.verdict?.verdict.name().to_owned())).means(
                "",
                "determined, given, weakly determined, not determined, redundant or unknown, from the whole flight",
            ),
        ];
        columns.into()
    }
}
