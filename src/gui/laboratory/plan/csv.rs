//! Table of σ as comma-separated values.

use crate::files::csv_writer::{CsvWriter, number_cell};
use crate::observability::laboratory::{MotionPrediction, PlanTable};
use crate::text::Named as _;

/// One row per parameter; σ in radians and metres, empty columns without a log.
pub(super) fn csv_of(prediction: &MotionPrediction) -> String {
    let mut table = CsvWriter::new([
        "parameter",
        "unit",
        "prior_sigma",
        "log_sigma",
        "motion_sigma",
        "log_and_motion_sigma",
        "ratio",
        "verdict",
    ]);
    let sigma = |of: Option<&PlanTable>, index: usize| {
        of.map_or_else(String::new, |of| number_cell(of.parameters[index].sigma))
    };
    for (index, last) in prediction.result().parameters.iter().enumerate() {
        table.row([
            last.name.clone(),
            last.dimension.unit().to_owned(),
            number_cell(last.prior_sigma),
            sigma(prediction.flight.as_ref(), index),
            sigma(Some(&prediction.motion), index),
            sigma(prediction.both.as_ref(), index),
            number_cell(last.ratio),
            last.verdict.name().to_owned(),
        ]);
    }
    table.into_text()
}
