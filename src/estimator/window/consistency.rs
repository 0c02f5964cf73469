//! Whether what is measured contradicts what is believed: residuals that stay larger than their noise allows.
//!
//! A time offset of some milliseconds, or a chain that is fixed at wrong values, does not stop the estimator: it bends
//! trajectory and calibration to make the best of it. What it cannot hide is that encoder readings, and what earlier images
//! told, then disagree with the images in the window.

use crate::estimator::{EstimatorConfig, FactorKind, ResidualSummary};

/// Residuals are averaged over this time, in nanoseconds, before anything is said: an image, a stop or a jolt by itself
/// contradicts nothing, and the first window's values are wrong by right.
const AVERAGED_NS: i64 = 4_000_000_000;
/// Once said, it is said until the mean has come down to this share of its limit.
const RELEASE: f64 = 0.8;

/// A kind of factor whose residuals are watched.
struct MonitoredFactor {
    factor: FactorKind,
    /// Largest mean of its squared whitened residuals.
    limit: f64,
    /// What a larger one means.
    inconsistency: &'static str,
}

/// Encoder readings that agree leave 1. Most of the prior's rows are fitted, so that it leaves 0.1 to 0.45 (simulated and
/// real logs) where the model holds; a camera's clock that is 10 ms off makes that 2, encoders 20 ms late 1.2.
const MONITORED: [MonitoredFactor; 2] = [
    MonitoredFactor {
        factor: FactorKind::Encoder,
        limit: 1.6,
        inconsistency: "joint angles contradict images and inertial sensor by more than the encoders' noise allows",
    },
    MonitoredFactor {
        factor: FactorKind::MarginalizationPrior,
        limit: 0.7,
        inconsistency: "what earlier images told contradicts the images in the window by more than their noise allows",
    },
];

/// The running means, one for each of [`MONITORED`].
#[derive(Clone, Debug, Default)]
pub(crate) struct ConsistencyMonitor {
    last_ns: Option<i64>,
    means: [Mean; MONITORED.len()],
}

#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    value: f64,
    /// Time that it is the mean of.
    over_ns: i64,
    inconsistent: bool,
}

impl Mean {
    /// Takes in a value that stands for an interval.
    fn take(&mut self, value: f64, interval_ns: i64) {
        self.over_ns = (self.over_ns + interval_ns).min(AVERAGED_NS.max(interval_ns));
        self.value += (value - self.value) * interval_ns as f64 / self.over_ns as f64;
    }
}

impl ConsistencyMonitor {
    /// Takes in the residuals of a solved window; what contradicts, in words, for as long as it does.
    pub(crate) fn observe(
        &mut self,
        stamp_ns: i64,
        residuals: &[ResidualSummary],
        config: &EstimatorConfig,
    ) -> Vec<String> {
        let Some(last_ns) = self.last_ns.replace(stamp_ns) else { return Vec::new() };
        let mut warnings = Vec::new();
        for (watched, mean) in MONITORED.iter().zip(&mut self.means) {
            let summary = residuals.iter().find(|summary| summary.factor == watched.factor);
            let Some(mean_square) = summary.and_then(ResidualSummary::mean_square) else { continue };
            mean.take(mean_square, stamp_ns - last_ns);
            let limit = if mean.inconsistent { RELEASE * watched.limit } else { watched.limit };
            mean.inconsistent = mean.over_ns >= AVERAGED_NS && mean.value > limit;
            if mean.inconsistent {
                warnings.push(warning_text(watched, config));
            }
        }
        warnings
    }
}

/// What contradicts what, and what to try.
fn warning_text(watched: &MonitoredFactor, config: &EstimatorConfig) -> String {
    let options = [("calibrate=on", config.calibrate), ("timeshift=on", config.estimate_timeshift)];
    let tries: Vec<&str> = options.into_iter().filter(|(_, on)| !on).map(|(option, _)| option).collect();
    let tries = if tries.is_empty() { String::new() } else { format!("; try {}", tries.join(" and ")) };
    format!("{}: clocks, calibration or noise are not as the rig says{tries}", watched.inconsistency)
}
