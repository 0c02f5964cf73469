//! Information gain about the calibration over an interval of a run.

use super::RankReport;
use crate::estimator::{InformationGain, Motion};
use crate::gimbal::ParameterId;

/// Information gain over several steps.
#[derive(Clone, Debug, PartialEq)]
pub struct InformationRate {
    /// Total duration of the steps, in seconds.
    pub duration_s: f64,
    /// Motions in the order of the entries of [`ParameterRate::by_motion`].
    pub motions: Vec<Motion>,
    /// Information rates in column order.
    pub parameters: Vec<ParameterRate>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct ParameterRate {
    pub parameter: ParameterId,
    /// Gain in bits per second: one bit halves the standard deviation.
    pub bits_per_s: f64,
    /// Contribution of each motion; a negative one reduces the contributions of others.
    pub by_motion: Vec<f64>,
    /// Remaining contribution: images that confirm earlier images outside the window.
    pub earlier: f64,
}

/// Sums the gains of steps, each with the report of its columns; `None` without gains.
pub fn information_rate<'a>(
    steps: impl IntoIterator<Item = (&'a RankReport, &'a InformationGain)>,
) -> Option<InformationRate> {
    let mut rate: Option<InformationRate> = None;
    for (rank, gain) in steps {
        let rate = rate.get_or_insert_with(|| InformationRate {
            duration_s: 0.0,
            motions: Motion::all(gain.joints).collect(),
            parameters: Vec::new(),
        });
        if rate.motions.len() != 6 + gain.joints || rank.parameters.len() != gain.columns() {
            continue;
        }
        rate.duration_s += gain.interval_s;
        for (column, parameter) in rank.parameters.iter().enumerate() {
            let place = rate.parameters.iter().position(|known| known.parameter == *parameter).unwrap_or_else(|| {
                let by_motion = vec![0.0; rate.motions.len()];
                rate.parameters.push(ParameterRate { parameter: *parameter, bits_per_s: 0.0, by_motion, earlier: 0.0 });
                rate.parameters.len() - 1
            });
            let sum = &mut rate.parameters[place];
            sum.bits_per_s += gain.bits_per_s(column) * gain.interval_s;
            sum.earlier += gain.earlier_per_s(column) * gain.interval_s;
            for (sum, part) in sum.by_motion.iter_mut().zip(gain.by_motion_per_s(column)) {
                *sum += part * gain.interval_s;
            }
        }
    }
    let mut rate = rate.filter(|rate| rate.duration_s > 0.0)?;
    for parameter in &mut rate.parameters {
        parameter.bits_per_s /= rate.duration_s;
        parameter.earlier /= rate.duration_s;
        parameter.by_motion.iter_mut().for_each(|part| *part /= rate.duration_s);
    }
    Some(rate)
}

impl InformationRate {
    /// Sum over all parameters, in bits per second.
    pub fn total(&self) -> f64 {
        self.parameters.iter().map(|parameter| parameter.bits_per_s).sum()
    }

    /// Sum over all parameters by motion, in bits per second.
    pub fn by_motion(&self) -> Vec<f64> {
        let of = |motion: usize| self.parameters.iter().map(|parameter| parameter.by_motion[motion]).sum();
        (0..self.motions.len()).map(of).collect()
    }

    /// Motion with the largest positive contribution to one parameter (or to all) and that contribution; `None`
    /// without one.
    pub fn leading(&self, parameter: Option<usize>) -> Option<(Motion, f64)> {
        let parts = parameter.map_or_else(|| self.by_motion(), |index| self.parameters[index].by_motion.clone());
        let parts = self.motions.iter().copied().zip(parts);
        parts.filter(|(_, part)| *part > 0.0).max_by(|a, b| a.1.total_cmp(&b.1))
    }
}
