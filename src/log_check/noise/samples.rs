//! Samples of an IMU, gyroscope and accelerometer each with its own stamps, and their stationary stretches.

use nalgebra::Vector3;

use crate::flight_log::container::DecodedBlock;
use crate::flight_log::imu::filter::{Unmeasured, has_forces};
use crate::flight_log::log::relative_ns;
use crate::flight_log::messages::MessageKind;
use crate::flight_log::stamps::clock::StampClock;
use crate::flight_log::{FlightLog, messages};
use crate::geometry::seconds_from_ns;
use crate::log_check::imu::stationary::{SMOOTHING_NS, Stamped, StationaryTest, WINDOW_NS, Window};
use crate::log_check::statistics::median;
use crate::sensors::Rig;

/// Samples that are measurements, ordered by stamp.
#[derive(Clone, Debug, Default)]
pub(super) struct ImuSeries {
    pub(super) topic: String,
    pub(super) rates: Vec<Stamped>,
    pub(super) forces: Vec<Stamped>,
}

impl ImuSeries {
    /// Reads the IMU of the rig, or the first one of the log; `None` without any.
    pub(super) fn of(log: &FlightLog, rig: Option<&Rig>) -> Option<Self> {
        let topics = log.topics_of(&[MessageKind::Imu]);
        let named = rig.map(|rig| rig.imu.topic.clone()).filter(|topic| topics.contains(topic));
        let topic = named.or_else(|| topics.first().cloned())?;
        let apart = rig.and_then(|rig| rig.imu.accelerometer_topic.clone()).filter(|topic| topics.contains(topic));
        let force_topic = apart.unwrap_or_else(|| topic.clone());
        let clock = StampClock::of_rig(rig.is_some_and(|rig| rig.imu.use_log_time));
        let has_forces = has_forces(log, &force_topic);
        let mut series = Self { topic, ..Self::default() };
        let index = log.index();
        for block in &index.blocks {
            let decoded = DecodedBlock::decode(log.file(), block);
            for message in &decoded.messages {
                let Some(channel) = index.channels.get(&message.channel_id) else { continue };
                let (rate, force) = (channel.topic == series.topic, channel.topic == force_topic);
                if !rate && !force {
                    continue;
                }
                let Ok(imu) = messages::read_imu(decoded.bytes(&message.data)) else { continue };
                let stamp_ns = relative_ns(clock.stamp_ns(imu.stamp_ns, message.log_time_ns), log.epoch_ns());
                let (of_rate, of_force) = (&imu.angular_velocity_rad_per_s, &imu.specific_force_m_per_s2);
                let zero = has_forces.then_some(Unmeasured::ZeroForce);
                if (rate && force && Unmeasured::of(of_rate, of_force, has_forces).is_some())
                    || (force && Unmeasured::of_vector(of_force, zero).is_some())
                {
                    continue;
                }
                if rate {
                    series.rates.push((stamp_ns, imu.angular_velocity_rad_per_s));
                }
                if force {
                    series.forces.push((stamp_ns, imu.specific_force_m_per_s2));
                }
            }
        }
        series.order();
        Some(series)
    }

    /// Sorts the samples by stamp; samples that are not finite or repeat a stamp are removed.
    pub(super) fn order(&mut self) {
        for samples in [&mut self.rates, &mut self.forces] {
            let finite = |vector: &Vector3<f64>| vector.iter().all(|value| value.is_finite());
            samples.retain(|(_, vector)| finite(vector));
            samples.sort_by_key(|(stamp_ns, _)| *stamp_ns);
            samples.dedup_by_key(|(stamp_ns, _)| *stamp_ns);
        }
    }
}

/// Largest standard deviations of the smoothed angular rate (rad/s) and specific force (m/s²) in addition to noise; a
/// hovering vehicle exceeds them.
const MOTION: [f64; 2] = [0.003, 0.03];
/// Tolerance of the smoothed noise, in standard deviations.
const NOISE_SIGMAS: f64 = 2.0;
/// Largest change of the mean angular rate from window to window in addition to noise.
const RATE_STEP_RAD_PER_S: f64 = 0.004;
/// Largest change of the mean specific force from window to window: a tilt of 0.3°.
const FORCE_STEP_M_PER_S2: f64 = 0.05;
/// Tolerance of the difference of two means of noise, in standard deviations of one axis.
const STEP_SIGMAS: f64 = 4.0;
/// Minimum length of a stretch.
const SHORTEST_NS: i64 = 3_000_000_000;
/// Number of periods between two samples from which the interval is a gap.
const GAP_PERIODS: f64 = 1.5;

/// Start and end of the stretches in the order of time, with the densities of the white noise of both sensors.
pub(super) fn stationary_stretches(
    rates: &[Stamped],
    forces: &[Stamped],
    densities: [f64; 2],
    (from_ns, to_ns): (i64, i64),
) -> Vec<(i64, i64)> {
    let test = StationaryTest::new(MOTION, densities, NOISE_SIGMAS);
    let step =
        |still: f64, density: f64| still.hypot(STEP_SIGMAS * density * (2.0 / seconds_from_ns(WINDOW_NS)).sqrt());
    let (rate_step, force_step) = (step(RATE_STEP_RAD_PER_S, densities[0]), step(FORCE_STEP_M_PER_S2, densities[1]));
    let mut stretches: Vec<Vec<Window>> = vec![Vec::new()];
    let mut start_ns = from_ns;
    while start_ns + WINDOW_NS <= to_ns {
        let window = test.window(rates, forces, start_ns);
        start_ns += WINDOW_NS;
        let follows = |before: &Window| {
            (before.mean_rate - window.mean_rate).amax() < rate_step
                && (before.mean_force - window.mean_force).amax() < force_step
        };
        let last = stretches.last_mut().expect("there is always a last stretch");
        if !window.stationary || last.last().is_some_and(|before| !follows(before)) {
            stretches.push(Vec::new());
        }
        if window.stationary {
            stretches.last_mut().expect("there is always a last stretch").push(window);
        }
    }
    let ends = stretches.iter().filter_map(|windows| {
        let (first, last) = (windows.first()?.range_ns.0, windows.last()?.range_ns.1);
        // Motion may have started within the adjacent windows.
        let begin_ns = if first > from_ns { first + SMOOTHING_NS } else { first };
        let end_ns = if last + WINDOW_NS <= to_ns { last - SMOOTHING_NS } else { last };
        (end_ns - begin_ns >= SHORTEST_NS).then_some((begin_ns, end_ns))
    });
    ends.collect()
}

/// Samples of the stretches, split at gaps, and their period in seconds.
pub(super) fn evenly_sampled(samples: &[Stamped], stretches: &[(i64, i64)]) -> (Vec<Vec<Vector3<f64>>>, f64) {
    let within = |range: &(i64, i64)| {
        let before = |time_ns: i64| samples.partition_point(|(stamp_ns, _)| *stamp_ns < time_ns);
        samples.get(before(range.0)..before(range.1)).unwrap_or_default()
    };
    let steps: Vec<f64> = stretches
        .iter()
        .flat_map(|range| within(range).windows(2))
        .map(|pair| seconds_from_ns(pair[1].0 - pair[0].0))
        .collect();
    let usual_s = median(&steps);
    let mut parts: Vec<Vec<Vector3<f64>>> = Vec::new();
    for range in stretches {
        let mut last_ns: Option<i64> = None;
        for (stamp_ns, vector) in within(range) {
            let gap = last_ns.is_none_or(|last| seconds_from_ns(stamp_ns - last) > GAP_PERIODS * usual_s);
            if gap {
                parts.push(Vec::new());
            }
            if let Some(part) = parts.last_mut() {
                part.push(*vector);
            }
            last_ns = Some(*stamp_ns);
        }
    }
    parts.retain(|part| part.len() as f64 * usual_s >= 0.5 * seconds_from_ns(SHORTEST_NS));
    // Stamps may jitter; the mean period is the period of the clock.
    let regular: Vec<f64> = steps.into_iter().filter(|step| *step <= GAP_PERIODS * usual_s).collect();
    let period_s = regular.iter().sum::<f64>() / regular.len().max(1) as f64;
    (parts, period_s)
}
