//! Noise of an IMU from the stationary stretches of a log, by the overlapping Allan deviation.

mod allan;
mod render;
mod samples;
mod terms;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;
use serde::Serialize;

use self::allan::{AllanPhase, AllanVariance, NoiseKind, confidence, counts, degrees_of_freedom, overlapping};
use self::samples::{ImuSeries, evenly_sampled, stationary_stretches};
use self::terms::Fit;
use super::imu::spectrum::{Spectrum, VibrationLine};
use super::imu::stationary::Stamped;
use crate::flight_log::FlightLog;
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::sensors::Rig;

/// Minimum total duration: with less data white noise would have an error of more than a few percent.
const SHORTEST_TOTAL_S: f64 = 10.0;
/// Points to which a vibration may contribute more than this ratio of the variance are excluded from the fit.
const VIBRATION_RATIO: f64 = 0.1;
/// Standard deviations of a limit at 95 %, one-sided.
const LIMIT_SIGMAS: f64 = 1.65;
/// A random walk `K` in addition to white noise `N` is identified in most stretches of this many `N/K` (tested).
const STRETCH_PER_RATIO: f64 = 20.0;
/// Ratio of the minimum of the deviation to the bias instability of flicker noise, `√(2 ln 2/π)`.
const FLICKER: f64 = 0.664;

/// Noise term in its own unit, or the reason that it is not identified.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NoiseTerm {
    /// `None` if not identified.
    pub value: Option<f64>,
    /// Standard deviation of the value.
    pub sigma: Option<f64>,
    /// Upper limit (95 %) of a term that is not identified.
    pub limit: Option<f64>,
    /// Reason that the term is not identified, with the remedy; empty otherwise.
    pub reason: String,
}

impl NoiseTerm {
    fn identified(value: f64, sigma: f64) -> Self {
        Self { value: Some(value), sigma: Some(sigma), ..Self::default() }
    }
}

/// Noise terms of one axis, or of all axes of a sensor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoiseTerms {
    /// Angle or velocity random walk `N`, which is the density of the white noise: unit/√Hz.
    pub white: NoiseTerm,
    /// Bias instability `B`, the minimum of the deviation divided by 0.664, in the unit of the samples.
    pub bias_instability: NoiseTerm,
    /// Rate or acceleration random walk `K`, the random walk of the bias: its unit is [`SensorNoise::walk_unit`].
    pub random_walk: NoiseTerm,
    /// Quantization `Q`, white noise of the integrated samples: unit·s.
    pub quantization: NoiseTerm,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AllanPoint {
    /// Averaging time, in seconds.
    pub tau_s: f64,
    /// In the unit of the samples.
    pub deviation: f64,
    /// Standard deviation of `deviation`, by the equivalent degrees of freedom.
    pub sigma: f64,
    /// Lower limit of the true deviation (68.3 % between the limits).
    pub low: f64,
    pub high: f64,
    /// Sum of the identified terms; `None` without any, and where a filter bends the curve.
    pub model: Option<f64>,
    /// True if vibration dominates; such points are not fitted.
    pub vibration: bool,
}

/// Allan deviation of one axis with its noise terms.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisNoise {
    /// Name of the axis: `x`, `y` or `z`.
    pub axis: &'static str,
    /// Ordered by averaging time.
    pub points: Vec<AllanPoint>,
    pub terms: NoiseTerms,
}

/// Noise densities of a rig for one sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GivenNoise {
    pub white: f64,
    pub random_walk: f64,
}

/// Allan deviation of one sensor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorNoise {
    /// Name of the sensor: `gyroscope` or `accelerometer`.
    pub sensor: &'static str,
    /// Unit of the samples.
    pub unit: &'static str,
    pub rate_hz: f64,
    /// Time covered by the used samples, in seconds.
    pub covered_s: f64,
    pub axes: Vec<AxisNoise>,
    /// Terms of the mean variance of the axes, as stated in a rig.
    pub terms: NoiseTerms,
    /// Lines of the vibration while stationary, as text.
    pub vibration: Vec<String>,
    /// Shorter averaging times are not fitted: a low-pass filter of the sensor bends the mean deviation there.
    pub filtered_below_s: Option<f64>,
    /// Noise densities of the rig.
    pub given: Option<GivenNoise>,
}

impl SensorNoise {
    pub fn density_unit(&self) -> String {
        format!("{}/√Hz", self.unit)
    }

    pub fn walk_unit(&self) -> &'static str {
        if self.sensor == "gyroscope" { "rad/s²/√Hz" } else { "m/s³/√Hz" }
    }
}

/// Noise of an IMU while stationary.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AllanReport {
    pub log: String,
    /// Name of the rig; `None` without one.
    pub rig: Option<String>,
    pub topic: String,
    /// Start and end of the stationary stretches, in seconds since the log's start.
    pub stretches_s: Vec<(f64, f64)>,
    /// Total length of the stretches, in seconds.
    pub stationary_s: f64,
    /// Gyroscope and accelerometer; empty if the stretches are too short.
    pub sensors: Vec<SensorNoise>,
}

impl AllanReport {
    /// True if the stretches are long enough.
    pub fn is_measured(&self) -> bool {
        !self.sensors.is_empty()
    }

    /// Length of the longest stretch, in seconds.
    pub fn longest_s(&self) -> f64 {
        self.stretches_s.iter().map(|(begin, end)| end - begin).fold(0.0, f64::max)
    }
}

/// Measures the noise of a log's IMU in its stationary stretches between two times in seconds since the log's start.
///
/// Without a rig the IMU is the log's only one, or the first one by name; `None` without any.
pub fn measure_noise(log: &FlightLog, rig: Option<&Rig>, span_s: (f64, f64)) -> Option<AllanReport> {
    let series = ImuSeries::of(log, rig)?;
    let report = measure(&series, rig, span_s);
    Some(AllanReport { log: log.path().display().to_string(), ..report })
}

fn measure(series: &ImuSeries, rig: Option<&Rig>, (from_s, to_s): (f64, f64)) -> AllanReport {
    let span_ns = (
        ns_from_seconds(from_s).max(series.rates.first().map_or(0, |first| first.0)),
        ns_from_seconds(to_s).min(series.rates.last().map_or(0, |last| last.0)),
    );
    let density = |samples: &[Stamped]| Spectrum::of(samples).map_or(0.0, |spectrum| spectrum.density);
    let densities = [density(&series.rates), density(&series.forces)];
    let stretches = stationary_stretches(&series.rates, &series.forces, densities, span_ns);
    let seconds = |(begin, end): &(i64, i64)| (seconds_from_ns(*begin), seconds_from_ns(*end));
    let stretches_s: Vec<(f64, f64)> = stretches.iter().map(seconds).collect();
    let stationary_s: f64 = stretches_s.iter().map(|(begin, end)| end - begin).sum();
    let noise = rig.map(|rig| rig.imu.noise);
    let sensor = |name, unit, samples: &[Stamped], given| sensor_noise(name, unit, samples, &stretches, given);
    let sensors = if stationary_s < SHORTEST_TOTAL_S {
        Vec::new()
    } else {
        let gyroscope = noise
            .map(|noise| GivenNoise { white: noise.gyroscope_noise_density, random_walk: noise.gyroscope_random_walk });
        let accelerometer = noise.map(|noise| GivenNoise {
            white: noise.accelerometer_noise_density,
            random_walk: noise.accelerometer_random_walk,
        });
        vec![
            sensor("gyroscope", "rad/s", &series.rates, gyroscope),
            sensor("accelerometer", "m/s²", &series.forces, accelerometer),
        ]
    };
    AllanReport {
        log: String::new(),
        rig: rig.map(|rig| rig.name.clone()),
        topic: series.topic.clone(),
        stretches_s,
        stationary_s,
        sensors,
    }
}

fn sensor_noise(
    sensor: &'static str,
    unit: &'static str,
    samples: &[Stamped],
    stretches: &[(i64, i64)],
    given: Option<GivenNoise>,
) -> SensorNoise {
    let (parts, period_s) = evenly_sampled(samples, stretches);
    let phases = [0, 1, 2].map(|axis| {
        let of_part = |part: &Vec<Vector3<f64>>| {
            let values: Vec<f64> = part.iter().map(|vector| vector[axis]).collect();
            AllanPhase::of(&values, period_s)
        };
        parts.iter().map(of_part).collect::<Vec<_>>()
    });
    let longest = parts.iter().map(Vec::len).max().unwrap_or(0);
    let variances = phases.each_ref().map(|phases| {
        counts(longest).into_iter().filter_map(|count| overlapping(phases, count, period_s)).collect::<Vec<_>>()
    });
    let within = |(stamp_ns, _): &&Stamped| stretches.iter().any(|(from, to)| (*from..*to).contains(stamp_ns));
    let still: Vec<Stamped> = samples.iter().filter(within).copied().collect();
    let lines = Spectrum::of(&still).map_or_else(Vec::new, |spectrum| spectrum.lines);
    let mean: Vec<AllanVariance> = (0..variances[0].len())
        .map(|index| {
            let sum: f64 = variances.iter().map(|axis| axis[index].variance).sum();
            AllanVariance { variance: sum / 3.0, ..variances[0][index] }
        })
        .collect();
    let shaken: Vec<bool> = mean.iter().map(|point| is_shaken(point, &lines)).collect();
    let longest_s = longest as f64 * period_s;
    let axes = ["x", "y", "z"].into_iter().zip(phases.iter().zip(&variances)).map(|(axis, (phases, variances))| {
        let fit = Fit::of(variances, &shaken, phases, 1);
        AxisNoise {
            axis,
            points: points(variances, &shaken, phases, fit.as_ref()),
            terms: noise_terms(variances, fit.as_ref(), (phases, 1), longest_s, given),
        }
    });
    let fit = Fit::of(&mean, &shaken, &phases[0], 3);
    let line = |line: &VibrationLine| format!("{:.0} Hz ({:.2e} {unit} RMS)", line.frequency_hz, line.rms);
    SensorNoise {
        sensor,
        unit,
        rate_hz: if period_s > 0.0 { 1.0 / period_s } else { 0.0 },
        covered_s: parts.iter().map(|part| part.len() as f64 * period_s).sum(),
        axes: axes.collect(),
        terms: noise_terms(&mean, fit.as_ref(), (&phases[0], 3), longest_s, given),
        vibration: lines.iter().map(line).collect(),
        filtered_below_s: fit.as_ref().and_then(|fit| fit.filtered_below_s),
        given,
    }
}

/// True if lines of a vibration contribute to the mean variance of the axes at an averaging time: at most
/// `2 rms²/(π f τ)²` for a sine of frequency `f`.
fn is_shaken(point: &AllanVariance, lines: &[VibrationLine]) -> bool {
    let most = |line: &VibrationLine| {
        let periods = std::f64::consts::PI * line.frequency_hz * point.tau_s;
        2.0 * (line.rms / periods.max(1.0)).powi(2)
    };
    lines.iter().map(most).sum::<f64>() > VIBRATION_RATIO * 3.0 * point.variance
}

fn points(variances: &[AllanVariance], shaken: &[bool], phases: &[AllanPhase], fit: Option<&Fit>) -> Vec<AllanPoint> {
    let point = |(variance, shaken): (&AllanVariance, &bool)| {
        let kind = fit.map_or(NoiseKind::White, |fit| fit.dominant(variance.tau_s));
        let freedom = degrees_of_freedom(phases, variance.count, kind).max(1.0);
        let deviation = variance.variance.sqrt();
        let (low, high) = confidence(deviation, freedom);
        AllanPoint {
            tau_s: variance.tau_s,
            deviation,
            sigma: deviation / (2.0 * freedom).sqrt(),
            low,
            high,
            model: fit.filter(|fit| fit.covers(variance.tau_s)).map(|fit| fit.variance(variance.tau_s).sqrt()),
            vibration: *shaken,
        }
    };
    variances.iter().zip(shaken).map(point).collect()
}

/// Terms of a fit, and the reasons that others are missing.
fn noise_terms(
    variances: &[AllanVariance],
    fit: Option<&Fit>,
    (phases, axes): (&[AllanPhase], usize),
    longest_s: f64,
    given: Option<GivenNoise>,
) -> NoiseTerms {
    let Some((fit, last)) = fit.zip(variances.last()) else {
        let reason = "vibration covers all averaging times, or the stretches are too short".to_owned();
        let missing = NoiseTerm { reason, ..NoiseTerm::default() };
        return NoiseTerms {
            white: missing.clone(),
            bias_instability: missing.clone(),
            random_walk: missing.clone(),
            quantization: missing,
        };
    };
    let identified = |kind: NoiseKind| fit.term(kind).map(|found| NoiseTerm::identified(found.value, found.sigma));
    let freedom = |point: &AllanVariance| {
        degrees_of_freedom(phases, point.count, fit.dominant(point.tau_s)).max(1.0) * axes as f64
    };
    let white = identified(NoiseKind::White).unwrap_or_else(|| NoiseTerm {
        reason: "no averaging time at which the deviation falls with the slope −1/2".to_owned(),
        ..NoiseTerm::default()
    });
    let high = |point: &AllanVariance| point.variance * (1.0 + LIMIT_SIGMAS * (2.0 / freedom(point)).sqrt());
    let falls = format!(
        "the deviation still falls at the longest averaging time ({:.2} s, a quarter of {longest_s:.0} s)",
        last.tau_s
    );
    let random_walk = identified(NoiseKind::RandomWalk).unwrap_or_else(|| {
        let other = fit.variance(last.tau_s);
        let excess = (high(last) - other).max(high(last) - last.variance);
        let limit = (3.0 * excess / last.tau_s).sqrt();
        let wanted = |walk: f64| STRETCH_PER_RATIO * white.value.unwrap_or(0.0) / walk.max(f64::MIN_POSITIVE);
        let need = match given {
            Some(given) if wanted(given.random_walk) > longest_s => {
                format!(
                    "the rig's {:.1e} would show in one stretch of {:.0} s",
                    given.random_walk,
                    wanted(given.random_walk)
                )
            }
            _ => format!("a stretch of {:.0} s would show a tenth of this limit", 10.0 * longest_s),
        };
        NoiseTerm {
            limit: Some(limit),
            reason: format!("no slope of +1/2 up to τ = {:.2} s; {need}", last.tau_s),
            ..NoiseTerm::default()
        }
    });
    let flattens = random_walk.value.is_some() || fit.term(NoiseKind::Flicker).is_some();
    let covered = variances.iter().filter(|point| fit.covers(point.tau_s));
    let lowest = covered.min_by(|a, b| fit.variance(a.tau_s).total_cmp(&fit.variance(b.tau_s))).unwrap_or(last);
    let bias_instability = if flattens {
        let value = fit.variance(lowest.tau_s).sqrt() / FLICKER;
        NoiseTerm::identified(value, value / (2.0 * freedom(lowest)).sqrt())
    } else {
        let reason = format!("{falls}: {}", stretch_for_minimum(&white, given, longest_s));
        NoiseTerm { limit: Some(high(last).sqrt() / FLICKER), reason, ..NoiseTerm::default() }
    };
    let quantization = identified(NoiseKind::Quantization).unwrap_or_else(|| NoiseTerm {
        reason: "no slope of −1 at short averaging times: below the white noise".to_owned(),
        ..NoiseTerm::default()
    });
    NoiseTerms { white, bias_instability, random_walk, quantization }
}

/// Text with the stretch length that shows the minimum: eight times the averaging time at which the rig's random walk
/// equals white noise.
fn stretch_for_minimum(white: &NoiseTerm, given: Option<GivenNoise>, longest_s: f64) -> String {
    let minimum_s =
        white.value.zip(given).map(|(white, given)| 3.0_f64.sqrt() * white / given.random_walk.max(f64::MIN_POSITIVE));
    match minimum_s.map(|minimum_s| 2.0 * 4.0 * minimum_s).filter(|needed_s| *needed_s > longest_s) {
        Some(needed_s) => format!("the rig's random walk requires one stretch of {needed_s:.0} s"),
        None => format!("this requires a stretch longer than {longest_s:.0} s"),
    }
}
