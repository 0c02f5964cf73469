//! Columns of the table of parameters.

use super::job_result::JobResult;
use crate::session::{FlightParameter, ParameterSummary};
use crate::table::Column;
use crate::text::Named as _;

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
            ParameterColumn::new("verdict", |row| Some(row.verdict?.verdict.name().to_owned()))
                .means("", "determined, weakly determined, not determined or redundant, from the whole flight"),
        ];
        columns.into()
    }
}
