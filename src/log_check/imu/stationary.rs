//! Stationary windows of an IMU: angular rate and specific force vary little below the frequencies of vibration.

use nalgebra::Vector3;

use crate::geometry::{mean, seconds_from_ns, standard_deviation};

/// Stamp and vector in the IMU frame.
pub(crate) type Stamped = (i64, Vector3<f64>);

/// Length of the windows that are classified as stationary or moving.
pub(crate) const WINDOW_NS: i64 = 500_000_000;
/// Half width of the Hann window that separates motion from vibration and white noise: frequencies below 4 Hz remain.
pub(crate) const SMOOTHING_NS: i64 = 125_000_000;
/// Step of the smoothed signal.
const SMOOTHED_STEP_NS: i64 = 31_250_000;
/// Upper bound of the mean angular rate, bias included.
const MEAN_RATE_RAD_PER_S: f64 = 0.08;

/// Window of length [`WINDOW_NS`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    pub(crate) range_ns: (i64, i64),
    pub(crate) stationary: bool,
    pub(crate) mean_rate: Vector3<f64>,
    pub(crate) mean_force: Vector3<f64>,
}

/// Upper bounds of the standard deviation of a stationary IMU's smoothed angular rate and specific force.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StationaryTest {
    limits: [f64; 2],
}

impl StationaryTest {
    /// Test of angular rate (rad/s) and specific force (m/s²) with the tolerated motion of each, in addition to
    /// `noise_sigmas` standard deviations of the smoothed white noise of these densities.
    pub(crate) fn new(motion: [f64; 2], densities: [f64; 2], noise_sigmas: f64) -> Self {
        let limit = |sensor: usize| motion[sensor].hypot(noise_sigmas * smoothed_white(densities[sensor]).sqrt());
        Self { limits: [limit(0), limit(1)] }
    }

    /// Window of samples that are ordered by stamp.
    pub(crate) fn window(&self, rates: &[Stamped], forces: &[Stamped], start_ns: i64) -> Window {
        let range_ns = (start_ns, start_ns + WINDOW_NS);
        let mean_of = |samples: &[Stamped]| {
            mean(&within(samples, range_ns).iter().map(|(_, vector)| *vector).collect::<Vec<_>>())
        };
        let (mean_rate, mean_force) = (mean_of(rates), mean_of(forces));
        let stationary = smoothed_deviation(rates, range_ns) < self.limits[0]
            && smoothed_deviation(forces, range_ns) < self.limits[1]
            && mean_rate.norm() < MEAN_RATE_RAD_PER_S;
        Window { range_ns, stationary, mean_rate, mean_force }
    }
}

/// Variance of a smoothed vector of white noise of this density per axis. A Hann window of width `w` averages noise to a
/// bandwidth of `1.5 / w`.
fn smoothed_white(density: f64) -> f64 {
    3.0 * density * density * 1.5 / seconds_from_ns(2 * SMOOTHING_NS)
}

fn within(samples: &[Stamped], (start_ns, end_ns): (i64, i64)) -> &[Stamped] {
    let before = |time_ns: i64| samples.partition_point(|(stamp_ns, _)| *stamp_ns < time_ns);
    samples.get(before(start_ns)..before(end_ns)).unwrap_or_default()
}

/// Norm of the standard deviation of the smoothed signal within a range of time; infinite without samples.
fn smoothed_deviation(samples: &[Stamped], (start_ns, end_ns): (i64, i64)) -> f64 {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return f64::INFINITY };
    let mut smoothed = Vec::new();
    let mut centre_ns = start_ns.max(first.0 + SMOOTHING_NS);
    while centre_ns < end_ns.min(last.0 - SMOOTHING_NS) {
        let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
        for (stamp_ns, vector) in within(samples, (centre_ns - SMOOTHING_NS, centre_ns + SMOOTHING_NS)) {
            let place = (stamp_ns - centre_ns) as f64 / SMOOTHING_NS as f64;
            let weight = 0.5 + 0.5 * (std::f64::consts::PI * place).cos();
            sum += vector * weight;
            weights += weight;
        }
        if weights > 0.0 {
            smoothed.push(sum / weights);
        }
        centre_ns += SMOOTHED_STEP_NS;
    }
    if smoothed.is_empty() { f64::INFINITY } else { standard_deviation(&smoothed).norm() }
}
