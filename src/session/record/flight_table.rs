//! Calibration table of a run, and its summary.

use super::flight_parameter::FlightParameter;
use super::flight_verdicts::{FlightVerdicts, flight_advice};
use super::recording::Recording;
use super::run::RunRecord;
use crate::observability::Determination;
use crate::text::Named as _;

/// Calibration table of a run after its last step: the same for window, report and files.
pub fn flight_table(recording: &Recording, run: &RunRecord) -> Vec<FlightParameter> {
    let verdicts = FlightVerdicts::of_run(run);
    let improvable = verdicts.verdicts().any(|(_, verdict)| verdict.is_improvable());
    let ranked = verdicts.ranked_step().filter(|_| improvable);
    let advice = ranked.and_then(|step| flight_advice(step, &recording.rig, &run.camera_key));
    verdicts.table(&recording.rig.parameter_names(), advice.as_ref())
}

/// Number of parameters by verdict: `18 parameters: 13 determined, 5 weakly determined`.
pub fn flight_headline(rows: &[FlightParameter]) -> String {
    let counted = Determination::all().filter_map(|verdict| {
        let count = rows.iter().filter(|row| row.verdict == verdict).count();
        (count > 0).then(|| format!("{count} {}", verdict.name()))
    });
    let noun = if rows.len() == 1 { "parameter" } else { "parameters" };
    format!("{} {noun}: {}", rows.len(), counted.collect::<Vec<_>>().join(", "))
}

/// Parameter with the largest ratio of posterior and prior σ among those that another flight could improve.
pub fn least_determined(rows: &[FlightParameter]) -> Option<&FlightParameter> {
    let improvable = rows.iter().filter(|row| row.verdict.is_improvable());
    improvable.max_by(|a, b| a.ratio.unwrap_or(0.0).total_cmp(&b.ratio.unwrap_or(0.0)))
}
