//! The calibration of each run over time, by parameter.

use std::collections::BTreeMap;

use crate::estimator::pose_columns;
use crate::gimbal::{NearestForm, ParameterId, Parameterization};
use crate::gui::derived::chain_values::{ParameterValues, parameter_values, principal_values, unwrap_towards};
use crate::gui::derived::follow::Follower;
use crate::sensors::Rig;
use crate::session::{RunRecord, StepRecord};

#[derive(Debug, Default)]
pub(crate) struct ParameterCurve {
    /// Value by step; NaN where the parameterization has no such parameter.
    pub(crate) values: Vec<f64>,
    /// Lower edge of the band of 3σ.
    pub(crate) lower: Vec<f64>,
    /// Upper edge of the band of 3σ.
    pub(crate) upper: Vec<f64>,
    /// Standard deviation by step.
    pub(crate) sigmas: Vec<f64>,
}

/// The calibration of one run over time.
#[derive(Debug, Default)]
pub(crate) struct CalibrationHistory {
    follower: Follower,
    pub(crate) stamps_ns: Vec<i64>,
    /// The parameters, in the order of their first appearance.
    pub(crate) parameters: Vec<(ParameterId, ParameterCurve)>,
    /// Changes when steps are removed.
    pub(crate) epoch: u64,
    /// Values of the last step, the reference for unwrapping angles.
    last: ParameterValues,
}

impl CalibrationHistory {
    /// Reads the steps that are new since the last call.
    pub(crate) fn read(&mut self, run: &RunRecord) {
        let new_steps = self.follower.new_steps(run);
        if new_steps.restarted {
            self.stamps_ns.clear();
            self.parameters.clear();
            self.last.clear();
            self.epoch += 1;
        }
        for step in new_steps.steps {
            self.push(step);
        }
    }

    fn push(&mut self, step: &StepRecord) {
        let calibration = &step.report.calibration;
        let row = self.stamps_ns.len();
        self.stamps_ns.push(step.report.stamp_ns);
        let mut values = principal_values(&calibration.parameters, &calibration.values);
        unwrap_towards(&mut values, &self.last);
        for (index, parameter) in calibration.parameters.iter().enumerate() {
            let known_place = self.parameters.iter().position(|(known, _)| known == parameter);
            let place = known_place.unwrap_or(self.parameters.len());
            if known_place.is_none() {
                self.parameters.push((*parameter, ParameterCurve::default()));
            }
            let history = &mut self.parameters[place].1;
            history.pad(row);
            let entry = |values: &[f64]| values.get(index).copied().unwrap_or(f64::NAN);
            let (value, sigma) = (values.get(parameter).copied().unwrap_or(f64::NAN), entry(&calibration.sigmas));
            history.values.push(value);
            history.sigmas.push(sigma);
            history.lower.push(value - 3.0 * sigma);
            history.upper.push(value + 3.0 * sigma);
        }
        for (_, history) in &mut self.parameters {
            history.pad(row + 1);
        }
        self.last = values;
    }

    pub(crate) fn parameter(&self, parameter: ParameterId) -> Option<&ParameterCurve> {
        self.parameters.iter().find(|(known, _)| *known == parameter).map(|(_, history)| history)
    }

    /// The row at or before a stamp.
    pub(crate) fn row_at(&self, stamp_ns: i64) -> Option<usize> {
        self.stamps_ns.partition_point(|stamp| *stamp <= stamp_ns).checked_sub(1)
    }
}

/// A run's calibration in the parameterization of another run.
#[derive(Debug, Default)]
pub(crate) struct ConvertedHistory {
    follower: Follower,
    target: Option<(Parameterization, NearestForm)>,
    pub(crate) stamps_ns: Vec<i64>,
    /// Values of the steps by parameter.
    pub(crate) values: BTreeMap<ParameterId, Vec<f64>>,
    /// Changes when steps are removed; differs from every epoch of a [`CalibrationHistory`].
    pub(crate) epoch: u64,
    last: ParameterValues,
}

impl ConvertedHistory {
    /// Reads the steps that are new since the last call, or all steps if the parameterization has changed.
    ///
    /// Steps before tracking are skipped: their calibration is the rig's. Of several equivalent values of the classical
    /// parameterization it takes those nearest to the rig's, as a classical run does.
    pub(crate) fn read(&mut self, run: &RunRecord, rig: &Rig, target: Parameterization) {
        const APART: u64 = 1 << 63;
        if self.target.as_ref().is_none_or(|(known, _)| *known != target) {
            self.follower = Follower::default();
            let estimate = run.steps.first().map(|first| &first.report.calibration);
            let conversion = estimate.and_then(|estimate| run.conversion_for(rig, estimate, target));
            self.target = conversion.map(|conversion| (target, conversion));
            self.forget();
        }
        let Some((_, conversion)) = &self.target else { return };
        let conversion = conversion.clone();
        let new_steps = self.follower.new_steps(run);
        if new_steps.restarted {
            self.forget();
        }
        self.epoch |= APART;
        for step in new_steps.steps {
            let row = self.stamps_ns.len();
            self.stamps_ns.push(step.report.stamp_ns);
            let calibration = &step.report.calibration;
            let mut values = parameter_values(&calibration.classical, &conversion);
            let rigid = calibration.further_cameras.iter();
            values.extend(rigid.flat_map(|camera| pose_columns(camera.number, &camera.base_from_camera)));
            unwrap_towards(&mut values, &self.last);
            for (parameter, value) in &values {
                let column = self.values.entry(*parameter).or_default();
                column.resize(row, f64::NAN);
                column.push(*value);
            }
            self.last = values;
        }
    }

    fn forget(&mut self) {
        self.stamps_ns.clear();
        self.values.clear();
        self.last.clear();
        self.epoch += 1;
    }
}

impl ParameterCurve {
    /// An angle plus the multiple of 2π that brings it nearest to the last value: the values of a history are
    /// continuous and may leave (−π, π]. Other quantities are returned unchanged.
    pub(super) fn unwrap_near(&self, parameter: ParameterId, value: f64) -> f64 {
        let last = self.values.iter().rev().find(|known| known.is_finite());
        last.map_or(value, |last| last + parameter.principal_value(value - last))
    }

    fn pad(&mut self, rows: usize) {
        for column in [&mut self.values, &mut self.sigmas, &mut self.lower, &mut self.upper] {
            column.resize(rows.max(column.len()), f64::NAN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::ParameterNames;
    use crate::gui::samples::{first_tracked_frame, sample_recording_of};

    fn id(name: &str) -> ParameterId {
        ParameterNames::default().parse(name).unwrap()
    }

    #[test]
    fn columns_stay_aligned_when_names_come_and_go() {
        let mut recording = sample_recording_of(60, &["auto"]);
        let run = &mut recording.runs[0];
        for step in &mut run.steps[55..] {
            let step = std::sync::Arc::make_mut(step);
            step.report.calibration.parameters[0] = id("EC.rx");
        }
        let mut history = CalibrationHistory::default();
        history.read(run);
        assert_eq!(history.parameters.len(), 19);
        assert!(history.parameters.iter().all(|(_, parameter)| parameter.values.len() == 60));
        let renamed = history.parameter(id("EC.rx")).unwrap();
        assert!(renamed.values[54].is_nan() && renamed.values[55].is_finite());
        assert!(history.parameter(id("I.rx")).unwrap().values[59].is_nan());
        assert_eq!(history.row_at(-1), None);
    }

    #[test]
    fn another_run_is_converted_to_the_same_columns() {
        let recording = sample_recording_of(first_tracked_frame() + 30, &["auto", "classical"]);
        let mut converted = ConvertedHistory::default();
        converted.read(&recording.runs[1], &recording.rig, Parameterization::Minimal);
        let mut own = CalibrationHistory::default();
        own.read(&recording.runs[0]);
        for (name, parameter) in &own.parameters {
            let (theirs, ours) = (converted.values[name].last().unwrap(), parameter.values.last().unwrap());
            assert!((theirs - ours).abs() < 0.02, "{name:?}: {theirs} and {ours}");
        }
        let epoch = converted.epoch;
        converted.read(&recording.runs[1], &recording.rig, Parameterization::Classical);
        assert_ne!(converted.epoch, epoch);
        assert!(converted.values.contains_key(&id("IB.rz")));
    }

    /// The estimate of the angle is beyond −180°, its ground truth just below 180°.
    #[test]
    fn the_ground_truth_is_shown_on_the_turn_of_the_values() {
        let history = ParameterCurve { values: vec![-3.145, -3.15, f64::NAN], ..ParameterCurve::default() };
        let shown = history.unwrap_near(id("I.rx"), 3.13);
        assert!((shown - (3.13 - std::f64::consts::TAU)).abs() < 1e-12, "{shown}");
        let length = ParameterCurve { values: vec![-3.15], ..ParameterCurve::default() };
        assert!((length.unwrap_near(id("I.tx"), 3.13) - 3.13).abs() < 1e-12);
        assert_eq!(ParameterCurve::default().unwrap_near(id("I.rx"), 3.13), 3.13);
    }
}
