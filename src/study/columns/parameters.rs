//! Columns of the table of parameters.

use super::column::Column;
use super::job_result::JobResult;
use crate::session::{FlightParameter, ParameterSummary};
use crate::text::Named as _;

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

    pub(super) const COLUMNS: &'a [Column<Self>] = &[
        Column::text("key", "key of the run", |row| Some(row.result.key.to_owned())),
        Column::text("log", "as in the table of runs", |row| Some(row.result.job.log.name().to_owned())),
        Column::text("disturbance", "as in the table of runs", |row| Some(row.result.job.disturbance.clone())),
        Column::text("perturbation", "as in the table of runs", |row| Some(row.result.job.perturbation.name.clone())),
        Column::count("seed", "as in the table of runs", |row| row.result.seed()),
        Column::text("run", "as in the table of runs", |row| Some(row.result.job.subject.to_string())),
        Column::text("parameter", "name of the parameter", |row| Some(row.parameter.name.clone())),
        Column::text("unit", "unit of the following values", |row| Some(row.parameter.dimension.unit().to_owned())),
        Column::number("initial", "", "value in the rig", |row| Some(row.parameter.initial)),
        Column::number("final", "", "value at the end", |row| Some(row.parameter.last)),
        Column::number("sigma", "", "posterior standard deviation at the end", |row| row.parameter.sigma),
        Column::number("truth", "", "ground-truth value", |row| row.parameter.ground_truth),
        Column::number("error", "", "final minus truth", |row| row.parameter.error),
        Column::number("ratio", "", "sigma over prior sigma at the end", |row| row.verdict?.ratio),
        Column::text(
            "verdict",
            "determined, weakly determined, not determined or redundant, from the whole flight",
            |row| Some(row.verdict?.verdict.name().to_owned()),
        ),
    ];
}
