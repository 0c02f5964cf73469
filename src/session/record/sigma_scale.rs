//! Scale of the standard deviations of a run's calibration, from the changes of its own estimates.
//!
//! An estimate that uses more measurements than an earlier one differs from it by a random change with the variance
//! `σ₁² − σ₂²`, if both standard deviations are right (Hausman, Econometrica 46, 1978; for filters Bar-Shalom, Li and
//! Kirubarajan, 2001, section 5.4). The mean of the squared changes in these units is the squared scale. As in the tables
//! of the Particle Data Group it never makes a standard deviation smaller.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use super::step::StepRecord;
use crate::estimator::{CalibrationEstimate, StepReport};
use crate::geometry::Dimension;
use crate::gimbal::{ParameterId, ParameterPart, Parameterization};

/// Ratio of σ² to its value at the reference from which a change is counted: information has doubled.
const VARIANCE_RATIO: f64 = 0.5;
/// Weight of the expected value, one, in numbers of changes: few changes of correlated parameters determine no scale.
const EXPECTED_COUNT: f64 = 20.0;

/// Changes of the calibration parameters of a run since references at which they had twice the variance.
#[derive(Clone, Debug, Default)]
pub(super) struct SigmaScale {
    /// Restarts and parameterization to which the references belong.
    of: Option<(usize, Parameterization)>,
    /// Value and σ.
    references: BTreeMap<ParameterId, [f64; 2]>,
    /// Sum of the squared changes over their expected values.
    squares: f64,
    changes: usize,
}

impl SigmaScale {
    /// Scale after steps whose standard deviations are scaled.
    pub(super) fn of_steps(steps: &[Arc<StepRecord>]) -> Self {
        let mut scale = Self::default();
        for step in steps {
            scale.observe(&step.report);
        }
        scale
    }

    /// Reads the estimates of the next step.
    pub(super) fn observe(&mut self, report: &StepReport) {
        let calibration = &report.calibration;
        let of = Some((report.restarts, calibration.parameterization));
        if self.of != of {
            (self.of, self.references) = (of, BTreeMap::new());
        }
        self.forget_turned(calibration);
        for (index, (parameter, value)) in calibration.parameters.iter().zip(&calibration.values).enumerate() {
            let sigma = by_estimator(calibration, index);
            if !sigma.is_finite() || sigma <= 0.0 {
                continue;
            }
            let reference = self.references.entry(*parameter).or_insert([*value, sigma]);
            let [value_before, sigma_before] = *reference;
            let variance_before = sigma_before * sigma_before;
            if sigma * sigma > VARIANCE_RATIO * variance_before {
                continue;
            }
            let change = value - value_before;
            self.squares += change * change / (variance_before - sigma * sigma);
            self.changes += 1;
            *reference = [*value, sigma];
        }
    }

    /// Removes the references of blocks with an angle that is replaced by an equivalent one: a rotation vector near π then
    /// changes in all components.
    fn forget_turned(&mut self, calibration: &CalibrationEstimate) {
        let references = &self.references;
        let has_turned = |(parameter, value): (&ParameterId, &f64)| {
            let [value_before, _] = references.get(parameter)?;
            (parameter.dimension() == Dimension::Angle && (value - value_before).abs() > PI).then_some(parameter.part)
        };
        let turned: Vec<ParameterPart> =
            calibration.parameters.iter().zip(&calibration.values).filter_map(has_turned).collect();
        if !turned.is_empty() {
            self.references.retain(|parameter, _| !turned.contains(&parameter.part));
        }
    }

    /// Factor on standard deviations, at least 1.
    pub(super) fn factor(&self) -> f64 {
        ((EXPECTED_COUNT + self.squares) / (EXPECTED_COUNT + self.changes as f64)).max(1.0).sqrt()
    }
}

/// Scales the standard deviations of the measurements in an estimate as the estimator gives it; the prior's information
/// stays as it is.
pub(super) fn scale_sigmas(calibration: &mut CalibrationEstimate, factor: f64) {
    calibration.sigma_scale = factor;
    if factor > 1.0 {
        for index in 0..calibration.sigmas.len() {
            calibration.sigmas[index] = with_information(calibration, index, factor.powi(2).recip());
        }
    }
}

/// Standard deviation of a column before it was scaled.
fn by_estimator(calibration: &CalibrationEstimate, index: usize) -> f64 {
    if calibration.sigma_scale > 1.0 {
        return with_information(calibration, index, calibration.sigma_scale.powi(2));
    }
    calibration.sigmas.get(index).copied().unwrap_or(f64::NAN)
}

/// Standard deviation of a column with a multiple of the information that it has beyond the prior's.
fn with_information(calibration: &CalibrationEstimate, index: usize, multiple: f64) -> f64 {
    let sigma = calibration.sigmas.get(index).copied().unwrap_or(f64::NAN);
    let prior = calibration.prior_sigmas.get(index).map_or(0.0, |sigma| sigma.powi(2).recip());
    let gained = sigma.powi(2).recip() - prior;
    if gained.is_finite() && gained > 0.0 { (prior + multiple * gained).sqrt().recip() } else { sigma }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SplitMix64;
    use crate::session::record::RunRecord;
    use crate::session::tests::memory::estimated;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    /// Prior σ, and σ of one measurement of a parameter.
    const PRIOR: f64 = 10.0;
    const MEASURED: f64 = 0.1;

    /// Steps of a run in which each parameter is measured once per step; errors of the measurements are `inflation` times
    /// their σ.
    fn steps(inflation: f64) -> Vec<StepRecord> {
        let flight = synthetic_tracks(&SyntheticOptions { duration_s: 2.5, ..SyntheticOptions::default() });
        let sample = estimated(&flight, "auto");
        let sample = sample.steps.last().unwrap();
        let mut random = SplitMix64::new(1);
        // Sum of twelve uniform numbers: variance 1.
        let mut normal = || (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
        let mut sums = vec![0.0; sample.report.calibration.parameters.len()];
        let step = |number: usize| {
            let mut step = StepRecord::clone(sample);
            let calibration = &mut step.report.calibration;
            let information = number as f64 / MEASURED.powi(2) + PRIOR.powi(-2);
            for (index, sum) in sums.iter_mut().enumerate() {
                *sum += inflation * MEASURED * normal();
                calibration.values[index] = *sum / MEASURED.powi(2) / information;
                (calibration.sigmas[index], calibration.prior_sigmas[index]) = (information.sqrt().recip(), PRIOR);
            }
            calibration.sigma_scale = 1.0;
            step
        };
        (1..=64).map(step).collect()
    }

    fn run_of(steps: Vec<StepRecord>) -> RunRecord {
        let mut run = RunRecord::new("auto".parse().unwrap(), "cam0".to_owned());
        for step in steps {
            run.push(step);
        }
        run
    }

    #[test]
    fn the_scale_is_the_factor_by_which_noise_exceeds_its_model() {
        let factor = |inflation: f64| run_of(steps(inflation)).steps.last().unwrap().report.calibration.sigma_scale;
        // Fewer than 18 × 6 changes, and the weight of the expected value, leave 2.8 of a factor of 3.
        assert_eq!(factor(0.9), 1.0);
        assert!((factor(1.0) - 1.0).abs() < 0.1, "{}", factor(1.0));
        assert!((factor(3.0) - 2.8).abs() < 0.3, "{}", factor(3.0));
    }

    #[test]
    fn measurements_are_scaled_and_the_prior_is_not() {
        let given = steps(3.0);
        let run = run_of(given.clone());
        let (given, scaled) =
            (&given.last().unwrap().report.calibration, &run.steps.last().unwrap().report.calibration);
        assert!((scaled.sigmas[0] / given.sigmas[0] / scaled.sigma_scale - 1.0).abs() < 1e-3);
        assert!((by_estimator(scaled, 0) / given.sigmas[0] - 1.0).abs() < 1e-12);
        let mut loose = given.clone();
        loose.sigmas[0] = 0.999 * PRIOR;
        scale_sigmas(&mut loose, 10.0);
        assert!(loose.sigmas[0] > 0.999 * PRIOR && loose.sigmas[0] < PRIOR);
        // The sign of a rotation vector near π is no change of the rotation.
        let mut turned = StepRecord::clone(run.steps.last().unwrap());
        let mut scale = SigmaScale::of_steps(&run.steps);
        let (counted, factor) = (scale.changes, scale.factor());
        let calibration = &mut turned.report.calibration;
        let angles = calibration.parameters.iter().zip(&mut calibration.values);
        angles.filter(|(id, _)| id.dimension() == Dimension::Angle).for_each(|(_, value)| *value += 2.0 * PI);
        calibration.sigmas.iter_mut().for_each(|sigma| *sigma *= 0.5);
        scale.observe(&turned.report);
        assert!(scale.changes < counted + turned.report.calibration.parameters.len());
        assert!(scale.factor() < 2.0 * factor, "{}", scale.factor());
        // A fork goes on with the scale of its parent.
        assert!((factor / scaled.sigma_scale - 1.0).abs() < 1e-9, "{factor}");
    }
}
