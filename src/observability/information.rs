//! How fast images narrow the calibration, over a stretch of a flight.

use super::RankReport;
use crate::estimator::{InformationGain, Motion};
use crate::gimbal::ParameterId;

/// The gain of information over some steps.
#[derive(Clone, Debug, PartialEq)]
pub struct InformationRate {
    /// Length of the steps together, in seconds.
    pub duration_s: f64,
    /// The motions of the columns of [`ParameterRate::by_motion`].
    pub motions: Vec<Motion>,
    /// Each parameter, in the order of the columns.
    pub parameters: Vec<ParameterRate>,
}

/// One parameter's gain.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterRate {
    /// Which.
    pub parameter: ParameterId,
    /// In bits per second: one bit halves the standard deviation.
    pub bits_per_s: f64,
    /// Of these, the part of each motion; a negative one takes away what others bring.
    pub by_motion: Vec<f64>,
    /// The rest: what images add by confirming earlier ones that have left the window.
    pub earlier: f64,
}

/// Sums up the gains of steps, each with the columns that it is of; `None` where there are none.
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
    /// Of all parameters together, in bits per second.
    pub fn total(&self) -> f64 {
        self.parameters.iter().map(|parameter| parameter.bits_per_s).sum()
    }

    /// Of all parameters together by motion, in bits per second.
    pub fn by_motion(&self) -> Vec<f64> {
        let of = |motion: usize| self.parameters.iter().map(|parameter| parameter.by_motion[motion]).sum();
        (0..self.motions.len()).map(of).collect()
    }

    /// The motion that brings most of one parameter (or of all of them) and its part; `None` where none brings anything.
    pub fn leading(&self, parameter: Option<usize>) -> Option<(Motion, f64)> {
        let parts = parameter.map_or_else(|| self.by_motion(), |index| self.parameters[index].by_motion.clone());
        let parts = self.motions.iter().copied().zip(parts);
        parts.filter(|(_, part)| *part > 0.0).max_by(|a, b| a.1.total_cmp(&b.1))
    }
}
