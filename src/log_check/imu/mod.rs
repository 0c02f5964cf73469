//! IMU: units, gravity, biases, noise, saturation, and the stationary intervals that show them.

mod alternation;
pub(super) mod axes;
mod frozen;
mod gravity;
pub(super) mod spectrum;
pub(super) mod stationary;
pub(super) mod unmeasured;

use nalgebra::Vector3;

use self::frozen::check_frozen;
pub(super) use self::gravity::LARGEST_BIAS_M_PER_S2;
use self::gravity::{check_change, check_gravity};
use self::spectrum::{Spectrum, check_noise};
use self::stationary::{Stamped, StationaryTest, WINDOW_NS, Window};
use self::unmeasured::check_unmeasured;
use super::report::{Area, Findings, Measurement, Severity};
use super::statistics::median;
use super::survey::Survey;
use super::survey::held::Held;
use crate::faults::{Fault, FaultKind};
use crate::geometry::{mean, seconds_from_ns};
use crate::sensors::{AngularRates, ImuSample, Rig};

/// Bias of a gyroscope that is noted.
const LARGE_BIAS_RAD_PER_S: f64 = 0.03;
/// Minimum number of samples of a checked IMU.
const MIN_SAMPLES: usize = 10;
/// Minimum number of samples of a window.
const MIN_WINDOW_SAMPLES: usize = 20;
/// Minimum numbers of peaks that end at the largest value and of samples there that are a saturation, and the smallest ratio
/// of these to the samples at the value next to it: coarse values repeat at any height.
const MIN_PEAKS: usize = 2;
const MIN_CLIPPED: usize = 3;
const NEXT_RATIO: usize = 2;
/// Smallest limits of a saturation, in rad/s and m/s²: smaller largest values are chance.
const SMALLEST_LIMITS: [f64; 2] = [1.0, 12.0];
/// Largest angular rate in rad/s: 2000 °/s, the widest range of consumer gyroscopes.
const LARGEST_RATE_RAD_PER_S: f64 = 35.0;
/// Repeated samples are reported above one in this many.
const REPEATED_ONE_IN: usize = 100;
/// Ratio of the log in which a vehicle is stationary that is a warning.
const MOSTLY_STATIONARY: f64 = 0.5;
/// Maximum number of listed stationary intervals.
const LISTED: usize = 6;
/// Longest stretch of equal samples of a driver that sends faster than the sensor measures.
const LONGEST_REPETITION: usize = 20;
/// Standard deviations of the smoothed angular rate (rad/s) and specific force (m/s²) of a stationary or hovering
/// vehicle, white noise removed.
const STATIONARY_MOTION: [f64; 2] = [0.012, 0.06];

/// IMU samples and quantities derived from them, for later checks.
#[derive(Clone, Debug, Default)]
pub(super) struct ImuFacts {
    /// Samples that are measurements, ordered by stamp.
    pub(super) samples: Vec<ImuSample>,
    /// Angular rates of the samples without bias.
    pub(super) gyroscope: AngularRates,
    /// Mean angular rate while stationary, in the IMU frame; `None` if the vehicle is never stationary.
    pub(super) gyroscope_bias_rad_per_s: Option<Vector3<f64>>,
    /// Time and mean specific force (IMU frame, m/s²) of a stationary window; without one, the middle and the mean of
    /// the log. The vector points up.
    pub(super) up: Option<(i64, Vector3<f64>)>,
    /// True if a comparison shows that both sensors have the same axes.
    pub(super) axes_agree: bool,
}

/// Checks units, gravity, biases, noise and saturation of the IMU, and finds stationary periods.
pub(super) fn check_imu(survey: &Survey, rig: Option<&Rig>, findings: &mut Findings) -> ImuFacts {
    check_unmeasured(survey, findings);
    let samples = survey.imu.clone();
    if samples.len() < MIN_SAMPLES {
        return ImuFacts { samples, ..ImuFacts::default() };
    }
    let rates: Vec<Stamped> =
        samples.iter().map(|sample| (sample.stamp_ns, sample.angular_velocity_rad_per_s)).collect();
    // Forces of a separate accelerometer topic are not interpolated: interpolation removes noise.
    let forces: Vec<Stamped> = if survey.accelerometer.is_empty() {
        samples.iter().map(|sample| (sample.stamp_ns, sample.specific_force_m_per_s2)).collect()
    } else {
        survey.accelerometer.clone()
    };
    let spectra = [Spectrum::of(&rates), Spectrum::of(&forces)];
    let windows = windows_of(&rates, &forces, &spectra);
    let stationary: Vec<Window> = windows.iter().filter(|window| window.stationary).copied().collect();
    let others: Vec<&String> =
        survey.imu_topics.iter().filter(|topic| survey.imu_topic.as_ref() != Some(*topic)).collect();
    check_gravity(&samples, &stationary, rig, &others, findings);
    if let Some(rig) = rig {
        check_change(&windows, rig, findings);
    }
    let gyroscope_bias = check_gyroscope_bias(&stationary, findings);
    if !check_held(&rates, &forces, findings) {
        check_repeated(&samples, findings);
        let sensors = [(&rates, Measurement::Gyroscope), (&forces, Measurement::Accelerometer)];
        for (sensor, (samples, measurement)) in sensors.into_iter().enumerate() {
            if alternation::check_alternation(samples, sensor, findings) {
                findings.exclude(measurement);
            }
        }
    }
    check_frozen(&rates, &forces, findings);
    check_clipping(&samples, findings);
    check_noise(&spectra, rig, findings);
    check_stationary(&windows, findings);
    let forces = || samples.iter().map(|sample| sample.specific_force_m_per_s2).collect::<Vec<_>>();
    let middle_ns = |(start_ns, end_ns): (i64, i64)| start_ns.midpoint(end_ns);
    let stationary_up =
        stationary.get(stationary.len() / 2).map(|window| (middle_ns(window.range_ns), window.mean_force));
    let up = stationary_up.unwrap_or_else(|| (samples[samples.len() / 2].stamp_ns, mean(&forces())));
    let bias = gyroscope_bias.unwrap_or_default();
    let unbiased = rates.iter().map(|(stamp_ns, rate)| (seconds_from_ns(*stamp_ns), rate - bias));
    let gyroscope = AngularRates::new(unbiased).bridging_gaps();
    ImuFacts { samples, gyroscope, gyroscope_bias_rad_per_s: gyroscope_bias, up: Some(up), axes_agree: false }
}

/// Windows of a log from its angular rates and specific forces, both ordered by stamp.
fn windows_of(rates: &[Stamped], forces: &[Stamped], spectra: &[Option<Spectrum>; 2]) -> Vec<Window> {
    let densities = spectra.each_ref().map(|spectrum| spectrum.as_ref().map_or(0.0, |spectrum| spectrum.density));
    let test = StationaryTest::new(STATIONARY_MOTION, densities, 1.0);
    let mut windows = Vec::new();
    let mut begin = 0;
    while begin < rates.len() {
        let start_ns = rates[begin].0;
        let end = rates.partition_point(|(stamp_ns, _)| *stamp_ns < start_ns + WINDOW_NS);
        if end - begin >= MIN_WINDOW_SAMPLES && rates.len() > end {
            windows.push(test.window(rates, forces, start_ns));
        }
        begin = end;
    }
    windows
}

fn check_gyroscope_bias(stationary: &[Window], findings: &mut Findings) -> Option<Vector3<f64>> {
    if stationary.is_empty() {
        return None;
    }
    let rates: Vec<Vector3<f64>> = stationary.iter().map(|window| window.mean_rate).collect();
    // The median of each axis is insensitive to slow rotation in some of the windows.
    let axis = |index: usize| median(&rates.iter().map(|rate| rate[index]).collect::<Vec<_>>());
    let bias = Vector3::new(axis(0), axis(1), axis(2));
    let evidence = format!("({:+.4}, {:+.4}, {:+.4}) rad/s while stationary or hovering", bias.x, bias.y, bias.z);
    if bias.norm() > LARGE_BIAS_RAD_PER_S {
        let remedy = "calibrate the gyroscope before the flight, unless the vehicle rotated slowly all the time";
        findings.add(Severity::Note, Area::Imu, "the gyroscope's bias is large", evidence, remedy);
    } else {
        findings.good(Area::Imu, "the gyroscope's bias is small", evidence);
    }
    Some(bias)
}

/// Reports held values of gyroscope and accelerometer; true if both are held in common.
fn check_held(rates: &[Stamped], forces: &[Stamped], findings: &mut Findings) -> bool {
    let [held_rates, held_forces] = [rates, forces].map(Held::of);
    let both = held_rates.filter(|_| held_rates == held_forces);
    if let Some(both) = both {
        both.report(Area::Imu, "the IMU", "holds its", findings);
    }
    let sensors = [
        ("the gyroscope", Measurement::Gyroscope, held_rates),
        ("the accelerometer", Measurement::Accelerometer, held_forces),
    ];
    for (name, measurement, held) in sensors {
        let Some(held) = held else { continue };
        if both.is_none() {
            held.report(Area::Imu, name, "holds its", findings);
        }
        if held.is_late() {
            findings.exclude(measurement);
        }
    }
    both.is_some()
}

/// Checks saturation: several peaks of one axis end at exactly the largest value, and few samples have the value next to it.
fn check_clipping(samples: &[ImuSample], findings: &mut Findings) {
    let vector = |sample: &ImuSample, gyroscope: bool| {
        if gyroscope { sample.angular_velocity_rad_per_s } else { sample.specific_force_m_per_s2 }
    };
    let mut largest = [0.0_f64; 2];
    let mut clipped = false;
    for (sensor, (name, unit)) in [("gyroscope", "rad/s"), ("accelerometer", "m/s²")].into_iter().enumerate() {
        let of_sensor = |sample: &ImuSample| vector(sample, sensor == 0);
        for axis in 0..3 {
            let value = |sample: &ImuSample| of_sensor(sample)[axis].abs();
            let limit = samples.iter().map(value).fold(0.0, f64::max);
            largest[sensor] = largest[sensor].max(limit);
            // A value that is held is one measurement.
            let measured: Vec<f64> = samples
                .chunk_by(|one, other| of_sensor(one) == of_sensor(other))
                .filter_map(|equal| equal.first().map(value))
                .collect();
            let peaks = measured.chunk_by(|one, other| (*one >= limit) == (*other >= limit));
            let peaks = peaks.filter(|peak| peak.first().is_some_and(|value| *value >= limit)).count();
            let hits = measured.iter().filter(|value| **value >= limit).count();
            let next = measured.iter().copied().filter(|value| *value < limit).fold(0.0, f64::max);
            let near = measured.iter().filter(|value| **value == next).count();
            let is_limit = peaks >= MIN_PEAKS && hits >= MIN_CLIPPED && hits >= NEXT_RATIO * near;
            if !is_limit || hits >= samples.len() / 2 || limit <= SMALLEST_LIMITS[sensor] {
                continue;
            }
            clipped = true;
            let title = format!("the {name} saturates on {}", ["x", "y", "z"][axis]);
            let evidence = format!("{hits} samples of {peaks} peaks at exactly ±{limit:.4} {unit}");
            let remedy =
                "set a wider range in the sensor, or reduce vibration: clipped samples bias the preintegration";
            findings.add(Severity::Warning, Area::Imu, title, evidence, remedy);
            findings.state_interval(samples.iter().filter(|it| value(it) >= limit).map(|it| it.stamp_ns));
        }
    }
    let evidence = format!("largest values {:.2} rad/s and {:.1} m/s²", largest[0], largest[1]);
    if largest[0] > LARGEST_RATE_RAD_PER_S {
        let remedy = "check the unit: sensor_msgs/Imu requires rad/s, and 35 rad/s is 2000 °/s";
        findings.add(Severity::Error, Area::Imu, "angular velocities appear to be in degrees", evidence, remedy);
        findings.state_faults([Fault::new(FaultKind::GyroscopeScale, &[std::f64::consts::PI / 180.0])]);
        findings.exclude(Measurement::Gyroscope);
    } else if !clipped {
        findings.good(Area::Imu, "the IMU does not saturate", evidence);
    }
}

/// Reports samples that repeat the one before.
fn check_repeated(samples: &[ImuSample], findings: &mut Findings) {
    let equal = |one: &ImuSample, other: &ImuSample| {
        one.angular_velocity_rad_per_s == other.angular_velocity_rad_per_s
            && one.specific_force_m_per_s2 == other.specific_force_m_per_s2
    };
    // A simulated sensor without noise repeats its values for as long as nothing moves.
    let stretches = samples.chunk_by(equal).filter(|equal| equal.len() <= LONGEST_REPETITION);
    let repeated: usize = stretches.map(|equal| equal.len() - 1).sum();
    if repeated * REPEATED_ONE_IN > samples.len() {
        let evidence = format!("{repeated} of {} samples equal the previous one in all six values", samples.len());
        let remedy = "the driver sends faster than the sensor measures, or fills gaps: send each measurement once";
        findings.add(Severity::Warning, Area::Imu, "IMU samples repeat", evidence, remedy);
    }
}

/// Finds periods in which the vehicle is stationary or hovers: such motion neither initializes nor calibrates.
fn check_stationary(windows: &[Window], findings: &mut Findings) {
    let total_s = windows.len() as f64 * seconds_from_ns(WINDOW_NS);
    let mut periods: Vec<(i64, i64)> = Vec::new();
    for (start_ns, end_ns) in windows.iter().filter(|window| window.stationary).map(|window| window.range_ns) {
        match periods.last_mut().filter(|last| start_ns - last.1 < WINDOW_NS / 2) {
            Some(last) => last.1 = end_ns,
            None => periods.push((start_ns, end_ns)),
        }
    }
    periods.retain(|(begin, end)| end - begin >= 2 * WINDOW_NS);
    let stationary_s: f64 = periods.iter().map(|(begin, end)| seconds_from_ns(end - begin)).sum();
    if periods.is_empty() {
        let title = "the vehicle is never stationary";
        let remedy = "initialization needs motion; biases cannot be measured directly";
        return findings.add(
            Severity::Note,
            Area::Motion,
            title,
            format!("no stationary interval of 1 s in {total_s:.0} s"),
            remedy,
        );
    }
    let listed: Vec<String> = periods
        .iter()
        .take(LISTED)
        .map(|(begin, end)| format!("{:.1}–{:.1} s", seconds_from_ns(*begin), seconds_from_ns(*end)))
        .collect();
    let evidence = format!("{stationary_s:.1} of {total_s:.1} s: {}", listed.join(", "));
    let remedy = "scale and calibration are unobservable there; initialization needs motion";
    let severity = if stationary_s > MOSTLY_STATIONARY * total_s { Severity::Warning } else { Severity::Note };
    findings.add(severity, Area::Motion, "the vehicle is stationary or hovers", evidence, remedy);
}
