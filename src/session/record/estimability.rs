//! Estimability of the calibration parameters of a run.

use serde::Serialize;

use super::recording::Recording;
use super::run::RunRecord;
use crate::geometry::Dimension;
use crate::gimbal::{ParameterGroup, ParameterId, Quantity};
use crate::observability::{Estimability, ParameterEstimability, estimability};
use crate::text::Named as _;

/// A calibration parameter and its estimability from the flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EstimabilitySummary {
    pub name: String,
    /// `chain`, `camera`, `IMU` or `clocks`.
    pub group: &'static str,
    /// Serialized as its unit.
    #[serde(rename = "unit")]
    pub dimension: Dimension,
    pub value: f64,
    pub sigma: Option<f64>,
    pub prior_sigma: Option<f64>,
    /// Posterior divided by prior standard deviation.
    pub ratio: Option<f64>,
    pub verdict: &'static str,
    /// Null or weak direction of the last window, or correlation, that explains a large ratio; empty without one.
    pub reason: String,
    #[serde(skip)]
    pub estimability: Estimability,
}

/// The verdicts at the end of a run, in groups.
pub fn estimability_summary(recording: &Recording, run: &RunRecord) -> Vec<EstimabilitySummary> {
    let Some(last) = run.steps.last() else { return Vec::new() };
    let rank = run.steps.iter().rev().find_map(|step| step.rank.as_ref());
    let names = recording.rig.parameter_names();
    let finite = |value: f64| Some(value).filter(|value| value.is_finite());
    let summary = |row: ParameterEstimability| EstimabilitySummary {
        name: names.name(row.parameter),
        group: row.parameter.group().name(),
        dimension: row.parameter.dimension(),
        value: row.value,
        sigma: finite(row.sigma),
        prior_sigma: finite(row.prior_sigma),
        ratio: finite(row.ratio()),
        verdict: row.estimability.name(),
        estimability: row.estimability,
        reason: row.reason,
    };
    estimability(&last.report.calibration, rank, &names).into_iter().map(summary).collect()
}

/// As [`estimability_summary`] for a run that estimates a shutter or the intrinsics of a sensor, else empty.
pub(super) fn sensor_estimability(recording: &Recording, run: &RunRecord) -> Vec<EstimabilitySummary> {
    let of_sensor = |parameter: &ParameterId| {
        let group = parameter.group();
        parameter.quantity == Quantity::Readout || matches!(group, ParameterGroup::Camera | ParameterGroup::Imu)
    };
    let last = run.steps.last();
    if last.is_some_and(|step| step.report.calibration.parameters.iter().any(of_sensor)) {
        estimability_summary(recording, run)
    } else {
        Vec::new()
    }
}
