//! Consistency check: warns when the whitened residuals of a factor stay larger than their noise model allows.
//!
//! With a wrong time offset of some milliseconds, or with wrong fixed calibration values, the estimator does not fail: it
//! absorbs the error in trajectory and calibration. The encoder residuals and the residuals of the marginalization prior
//! then stay too large.

use super::column_groups::SuspectedParameter;
use crate::estimator::config::EstimatorConfig;
use crate::estimator::factors::FactorKind;
use crate::estimator::report::{ResidualSummary, StepWarning};
use crate::estimator::state::gimbal_imu_noise::GimbalImuNoise;
use crate::geometry::seconds_from_ns;
use crate::gimbal::{ParameterPart, Quantity};

/// Averaging time of the squared residuals, in nanoseconds. No warning is given earlier: single images, stops and
/// shocks are no inconsistency, and the values of the first window are always inaccurate.
const AVERAGED_NS: i64 = 4_000_000_000;
/// Interval between windows that are scored for sensor parameters while a mean exceeds its limit.
const SAMPLED_NS: i64 = 250_000_000;
/// Smallest change of χ² at which a sensor parameter is named as cause of an inconsistency: five standard deviations.
const SIGNIFICANT_CHI2: f64 = 25.0;
/// As [`SIGNIFICANT_CHI2`] for an IMU on the gimbal with errors that last longer than a window, as of aliased vibration:
/// such errors reach 60 in 4 s, axes that are off by 1.4° with a time offset of 10 ms 1,000.
const SIGNIFICANT_CHI2_OF_NOISY: f64 = 200.0;
/// Hysteresis: a warning ends when the mean falls to this fraction of its limit.
const RELEASE: f64 = 0.8;

/// Kind of factor whose residuals are monitored.
struct MonitoredFactor {
    factor: FactorKind,
    /// Limit of the mean squared whitened residual (χ²/dof) above which a warning is given.
    limit: f64,
    /// First words of the warning.
    inconsistency: &'static str,
}

/// Consistent encoder readings have χ²/dof 1. Most rows of the prior are fitted, so its χ²/dof is 0.1 to 0.45
/// (simulated and real logs) with a correct model; a camera time offset of 10 ms raises it to 2, an encoder time offset
/// of 20 ms to 1.2. Of the gimbal's IMU it is the variance of the noisiest axis relative to the rig's: 1 to 4.5 with a
/// correct model, most with the chain of the first windows; axes that are off by 1.4° and a time offset of 10 ms raise it to 80.
const MONITORED: [MonitoredFactor; 3] = [
    MonitoredFactor {
        factor: FactorKind::Encoder,
        limit: 1.6,
        inconsistency: "Encoder readings inconsistent with images and IMU",
    },
    MonitoredFactor {
        factor: FactorKind::MarginalizationPrior,
        limit: 0.7,
        inconsistency: "Marginalization prior inconsistent with the window",
    },
    MonitoredFactor {
        factor: FactorKind::GimbalImu,
        limit: 9.0,
        inconsistency: "IMU on the gimbal inconsistent with images, IMU and joint angles",
    },
];

/// Running means of [`MONITORED`].
#[derive(Clone, Debug, Default)]
pub(crate) struct ConsistencyMonitor {
    last_ns: Option<i64>,
    means: [Mean; MONITORED.len()],
    /// Scores of sensor parameters that are not estimated, combined over the windows since a mean exceeded its limit.
    suspected: Vec<SuspectedParameter>,
    /// Stamp of the last scored window.
    sampled_ns: Option<i64>,
}

#[derive(Clone, Debug, Default)]
struct Mean {
    value: f64,
    /// Time averaged so far, up to [`AVERAGED_NS`].
    over_ns: i64,
    /// Value at the start of the current warning. The warning repeats it, so that one inconsistency is one message.
    reported: Option<f64>,
    /// Suggested cause, constant during a warning.
    cause: Option<String>,
}

impl Mean {
    /// Adds a value that is valid for an interval.
    fn take(&mut self, value: f64, interval_ns: i64) {
        self.over_ns = (self.over_ns + interval_ns).min(AVERAGED_NS.max(interval_ns));
        self.value += (value - self.value) * interval_ns as f64 / self.over_ns as f64;
    }
}

impl ConsistencyMonitor {
    /// True if a mean exceeds its limit.
    fn is_suspicious(&self) -> bool {
        MONITORED.iter().zip(&self.means).any(|(monitored, mean)| mean.value > monitored.limit)
    }

    /// Adds the residuals of a solved window and returns the warnings of this step; `scores` returns the window's
    /// scores of time offsets, readout times and intrinsics that are not estimated.
    pub(crate) fn observe(
        &mut self,
        stamp_ns: i64,
        (residuals, gimbal_imu): (&[ResidualSummary], &GimbalImuNoise),
        config: &EstimatorConfig,
        scores: impl Fn() -> Vec<SuspectedParameter>,
    ) -> Vec<StepWarning> {
        let Some(last_ns) = self.last_ns.replace(stamp_ns) else { return Vec::new() };
        if !self.is_suspicious() {
            self.suspected.clear();
        } else if self.sampled_ns.is_none_or(|sampled_ns| stamp_ns - sampled_ns >= SAMPLED_NS) {
            self.sampled_ns = Some(stamp_ns);
            for score in scores() {
                match self.suspected.iter_mut().find(|known| known.parameter == score.parameter) {
                    Some(known) => known.add(&score),
                    None => self.suspected.push(score),
                }
            }
        }
        let mut warnings = Vec::new();
        for (monitored, mean) in MONITORED.iter().zip(&mut self.means) {
            let mean_square = match monitored.factor {
                FactorKind::GimbalImu => gimbal_imu.largest_variance(),
                factor => {
                    let summary = residuals.iter().find(|summary| summary.factor == factor);
                    summary.and_then(ResidualSummary::mean_square)
                }
            };
            let Some(mean_square) = mean_square else { continue };
            mean.take(mean_square, stamp_ns - last_ns);
            let limit = if mean.reported.is_some() { RELEASE * monitored.limit } else { monitored.limit };
            let inconsistent = mean.over_ns >= AVERAGED_NS && mean.value > limit;
            mean.reported = inconsistent.then(|| mean.reported.unwrap_or(mean.value));
            let Some(value) = mean.reported else {
                mean.cause = None;
                continue;
            };
            let suspected = &self.suspected;
            let found = || match monitored.factor {
                FactorKind::GimbalImu => cause_of_gimbal_imu(suspected, gimbal_imu, config),
                _ => cause(suspected, config),
            };
            let cause = mean.cause.get_or_insert_with(found);
            warnings.push(StepWarning {
                factor: monitored.factor,
                inconsistency: monitored.inconsistency,
                mean_square: value,
                limit: monitored.limit,
                averaged_s: seconds_from_ns(AVERAGED_NS),
                cause: cause.clone(),
            });
        }
        warnings
    }
}

/// Cause of an inconsistency: the axes or the clock of the gimbal's IMU, a rolling shutter or wrong intrinsics if they
/// explain the windows better than any time offset of cameras and encoders, else unknown.
fn cause(suspected: &[SuspectedParameter], config: &EstimatorConfig) -> String {
    let strongest = suspected.iter().max_by(|one, other| one.chi2().total_cmp(&other.chi2()));
    let Some(found) = strongest.filter(|it| it.chi2() > SIGNIFICANT_CHI2) else { return UNKNOWN_CAUSE.to_owned() };
    if found.parameter.part == ParameterPart::GimbalImu {
        return "orientation or time offset of the IMU on the gimbal not as in the rig: try gimbal-imu-axes=on (dcvins check \
                measures both)"
            .to_owned();
    }
    let number = found.parameter.part.camera();
    let rigid = config.further_cameras.iter().find(|camera| usize::from(camera.number) == number);
    let camera = rigid.map_or("the camera", |rigid| &rigid.key);
    let intrinsics = match found.parameter.quantity {
        Quantity::Readout => {
            return format!(
                "rolling shutter of {camera} not modelled (a readout explains the residuals better than a time offset does): \
                 try readout=on, or set the readout in the rig (dcvins check measures it)"
            );
        }
        Quantity::Fx | Quantity::Fy => "focal length",
        Quantity::Cx | Quantity::Cy => "principal point",
        Quantity::K1 | Quantity::K2 => "distortion",
        _ => return UNKNOWN_CAUSE.to_owned(),
    };
    format!(
        "intrinsics of {camera} inconsistent with its images (another {intrinsics} explains the residuals better than a time \
         offset or a readout does): try intrinsics=on"
    )
}

/// As [`cause`], of an IMU on the gimbal that is noisier than in the rig: without a parameter that explains the windows far
/// better, its errors are vibration.
fn cause_of_gimbal_imu(suspected: &[SuspectedParameter], noise: &GimbalImuNoise, config: &EstimatorConfig) -> String {
    if suspected.iter().any(|it| it.chi2() > SIGNIFICANT_CHI2_OF_NOISY) {
        return cause(suspected, config);
    }
    let [gyroscope, accelerometer] = noise.factors().map(|it| format!("{:.0}, {:.0}, {:.0}", it.x, it.y, it.z));
    format!(
        "vibration, which its sample rate does not resolve, as of servos: it has less weight, by a noise of the gyroscope \
         of {gyroscope} times the rig's and of the accelerometer of {accelerometer} times (x, y, z); filter or damp it, or sample it faster"
    )
}

/// Text for an inconsistency that no single parameter explains: a guess would send the reader the wrong way.
const UNKNOWN_CAUSE: &str = "cause unknown: see dcvins check, and dcvins diagnose, which compares the causes";
