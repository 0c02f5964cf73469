//! White noise and vibration of an IMU, separated in its spectrum, and the white noise compared with the rig's
//! densities.
//!
//! White noise is the floor between the lines of a vibration: of the powers in all cells of a time–frequency plane, the
//! lowest tenth belongs to cells without motion and without a line, even if rotors and their harmonics cover half of
//! the plane. Powers of white noise in one cell have an exponential distribution, which gives the density from a
//! quantile.

use nalgebra::{Complex, Vector3};

use crate::geometry::seconds_from_ns;
use crate::log_check::report::{Area, Findings, Measurement, Severity};
use crate::log_check::statistics::percentile;
use crate::sensors::{ImuSample, Rig};

/// Length of a segment in seconds, rounded to a power of two of samples: rotors change their speed over longer ones.
const SEGMENT_S: f64 = 0.64;
/// Fewest samples of a segment.
const MIN_SEGMENT: usize = 32;
/// Number of segments that overlap at a sample.
const OVERLAP: usize = 4;
/// Relative difference of the duration of a segment from its samples over the rate from which it has a gap.
const GAP_RATIO: f64 = 0.2;
/// Maximum number of segments, distributed evenly over the log.
const MAX_SEGMENTS: usize = 600;
/// Upper frequency of the motion of vehicles and hands.
const MOTION_HZ: f64 = 10.0;
/// Upper frequency of motion for slow sensors, as a ratio of their rate.
const MOTION_RATE_RATIO: f64 = 0.1;
/// Upper end of the band of the floor as a ratio of the rate: sensor filters attenuate higher frequencies.
const FLOOR_RATE_RATIO: f64 = 0.3;
/// Quantile of the powers that determines the floor.
const FLOOR_QUANTILE: f64 = 0.1;
/// Lowest frequency of vibration, as a ratio of the upper frequency of motion.
const VIBRATION_MOTION_RATIO: f64 = 1.5;
/// Minimum ratio of the power of a line to the floor.
const LINE_RATIO: f64 = 20.0;
/// Ratio of the highest power of a line at which the line ends.
const LINE_EDGE: f64 = 0.05;
/// Lines weaker than this ratio of the strongest one are not reported.
const LINE_RMS_RATIO: f64 = 0.2;
/// Maximum number of reported lines.
const MAX_LINES: usize = 3;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VibrationLine {
    /// Mean frequency in the samples; a vibration above half the sample rate is aliased to another one.
    pub(crate) frequency_hz: f64,
    /// Lowest and highest frequency.
    pub(super) range_hz: (f64, f64),
    /// Root mean square of the vector, in the unit of the samples.
    pub(crate) rms: f64,
}

/// Spectrum of one sensor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spectrum {
    pub(crate) rate_hz: f64,
    /// Noise density per axis, in the unit of the samples per √Hz.
    pub(crate) density: f64,
    /// Frequencies from which the density was determined.
    pub(super) band_hz: (f64, f64),
    /// Root mean square of the signal above the frequencies of motion, white noise removed, in the unit of the samples.
    pub(super) vibration_rms: f64,
    /// Lines of the vibration, the strongest first.
    pub(crate) lines: Vec<VibrationLine>,
}

impl Spectrum {
    /// Spectrum of samples that are ordered by stamp; `None` with too few samples.
    pub(crate) fn of(samples: &[(i64, Vector3<f64>)]) -> Option<Self> {
        let (first, last) = (samples.first()?.0, samples.last()?.0);
        let rate_hz = (samples.len() - 1) as f64 / seconds_from_ns(last - first).max(1e-9);
        let length = ((SEGMENT_S * rate_hz).log2().round().exp2() as usize).max(MIN_SEGMENT);
        let powers = segment_powers(samples, length, rate_hz);
        if powers.is_empty() {
            return None;
        }
        let step_hz = rate_hz / length as f64;
        let bin = |frequency_hz: f64| ((frequency_hz / step_hz).round() as usize).min(length / 2);
        let motion_hz = MOTION_HZ.min(MOTION_RATE_RATIO * rate_hz);
        let (low, high) = (bin(motion_hz), bin(FLOOR_RATE_RATIO * rate_hz));
        let cells: Vec<f64> =
            powers.iter().flat_map(|power| power.get(low..=high).unwrap_or_default()).copied().collect();
        let floor = percentile(&cells, FLOOR_QUANTILE) / -(1.0 - FLOOR_QUANTILE).ln();
        // Power of the whole vector, over all segments.
        let segments = powers.len() as f64 / 3.0;
        let mean: Vec<f64> =
            (0..=length / 2).map(|index| powers.iter().map(|power| power[index]).sum::<f64>() / segments).collect();
        let start = bin(VIBRATION_MOTION_RATIO * motion_hz);
        let lines = lines(&mean, start, 3.0 * floor, step_hz);
        let beyond: f64 = mean.iter().skip(start).map(|power| (power - 3.0 * floor).max(0.0) * step_hz).sum();
        Some(Self {
            rate_hz,
            // A one-sided power is twice the square of the density.
            density: (0.5 * floor).sqrt(),
            band_hz: (low as f64 * step_hz, high as f64 * step_hz),
            vibration_rms: if lines.is_empty() { 0.0 } else { beyond.sqrt() },
            lines,
        })
    }

    /// Density of white noise with the same variance as noise and vibration together.
    pub(super) fn density_with_vibration(&self) -> f64 {
        (self.density.powi(2) + self.vibration_rms.powi(2) / (3.0 * self.rate_hz)).sqrt()
    }
}

/// One-sided power densities of each segment and axis, by frequency from zero on.
fn segment_powers(samples: &[(i64, Vector3<f64>)], length: usize, rate_hz: f64) -> Vec<Vec<f64>> {
    let Some(room) = samples.len().checked_sub(length) else { return Vec::new() };
    let stride = (length / OVERLAP).max(room / MAX_SEGMENTS).max(1);
    let window: Vec<f64> = (0..length).map(|index| blackman_harris((index as f64 + 0.5) / length as f64)).collect();
    let energy: f64 = window.iter().map(|weight| weight * weight).sum();
    let mut powers = Vec::new();
    for begin in (0..=room).step_by(stride) {
        let segment = &samples[begin..begin + length];
        let span_s = seconds_from_ns(segment[length - 1].0 - segment[0].0);
        // Skipped: a gap would be a step of the signal.
        if (span_s * rate_hz / (length - 1) as f64 - 1.0).abs() > GAP_RATIO {
            continue;
        }
        for axis in 0..3 {
            let values: Vec<f64> = segment.iter().map(|(_, vector)| vector[axis]).collect();
            let mut signal: Vec<Complex<f64>> = without_trend(&values)
                .iter()
                .zip(&window)
                .map(|(value, weight)| Complex::new(value * weight, 0.0))
                .collect();
            transform(&mut signal);
            let power = |value: &Complex<f64>| 2.0 * value.norm_sqr() / (rate_hz * energy);
            powers.push(signal[..=length / 2].iter().map(power).collect());
        }
    }
    powers
}

/// Window of Blackman and Harris with four terms (sidelobes at −92 dB), at a position from 0 to 1.
fn blackman_harris(place: f64) -> f64 {
    let angle = std::f64::consts::TAU * place;
    0.358_75 - 0.488_29 * angle.cos() + 0.141_28 * (2.0 * angle).cos() - 0.011_68 * (3.0 * angle).cos()
}

/// Values minus their mean and linear trend.
fn without_trend(values: &[f64]) -> Vec<f64> {
    let middle = 0.5 * (values.len() as f64 - 1.0);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let centred = || values.iter().enumerate().map(|(index, value)| (index as f64 - middle, value - mean));
    let slope =
        centred().map(|(at, value)| at * value).sum::<f64>() / centred().map(|(at, _)| at * at).sum::<f64>().max(1.0);
    centred().map(|(at, value)| value - slope * at).collect()
}

/// Discrete Fourier transform in place, by Cooley and Tukey; the length is a power of two.
fn transform(signal: &mut [Complex<f64>]) {
    let count = signal.len();
    let bits = count.trailing_zeros();
    for index in 0..count {
        let mirrored = index.reverse_bits() >> (usize::BITS - bits);
        if mirrored > index {
            signal.swap(index, mirrored);
        }
    }
    let mut half = 1;
    while half < count {
        let step = Complex::from_polar(1.0, -std::f64::consts::PI / half as f64);
        for block in signal.chunks_exact_mut(2 * half) {
            let (even, odd) = block.split_at_mut(half);
            let mut turn = Complex::new(1.0, 0.0);
            for (a, b) in even.iter_mut().zip(odd) {
                let (sum, rotated) = (*a, *b * turn);
                *a = sum + rotated;
                *b = sum - rotated;
                turn *= step;
            }
        }
        half *= 2;
    }
}

/// Strongest lines from index `start` on: their highest power exceeds the floor, and they do not belong to slower
/// motion.
fn lines(mean: &[f64], start: usize, floor: f64, step_hz: f64) -> Vec<VibrationLine> {
    let mut rest = mean.to_vec();
    let mut found: Vec<VibrationLine> = Vec::new();
    // Each iteration removes a line, or motion that extends into the band.
    while found.len() < MAX_LINES {
        let highest = (start..rest.len()).max_by(|a, b| rest[*a].total_cmp(&rest[*b]));
        let Some(peak) = highest.filter(|peak| rest[*peak] > LINE_RATIO * floor) else { break };
        let edge = LINE_EDGE * rest[peak];
        let below = (start..peak).rev().take_while(|index| rest[*index] > edge).count();
        let above = (peak + 1..rest.len()).take_while(|index| rest[*index] > edge).count();
        let (low, high) = (peak - below, peak + above);
        let power: f64 = rest[low..=high].iter().sum();
        let moment: f64 = (low..=high).map(|index| index as f64 * rest[index]).sum();
        rest[low..=high].fill(0.0);
        let line = VibrationLine {
            frequency_hz: moment / power * step_hz,
            range_hz: (low as f64 * step_hz, high as f64 * step_hz),
            rms: (power * step_hz).sqrt(),
        };
        if found.first().is_some_and(|strongest| line.rms < LINE_RMS_RATIO * strongest.rms) {
            break;
        }
        if low > start {
            found.push(line);
        }
    }
    found
}

/// Ratio of measured noise to the rig's from which it is reported.
const NOISE_TOO_SMALL: f64 = 3.0;
/// Ratio of the rig's noise to the measured one from which it is reported.
const NOISE_TOO_LARGE: f64 = 30.0;
/// Difference of the logarithms of a ratio and of √rate within which one density is confused with the noise of a sample.
const SAME_RATIO_LN: f64 = 0.3;

/// Ratio of vibration to the white noise of a sample from which it is reported.
const VIBRATION_RATIO: f64 = 3.0;

/// Compares white noise with the rig's densities, and reports vibration; `spectra` has the spectra of gyroscope and
/// accelerometer.
pub(super) fn check_noise(spectra: &[Option<Spectrum>; 2], rig: Option<&Rig>, findings: &mut Findings) {
    let noise = rig.map(|rig| &rig.imu.noise);
    let sensors = [
        (Measurement::Gyroscope, "gyroscope", noise.map(|noise| noise.gyroscope_noise_density), "rad/s"),
        (Measurement::Accelerometer, "accelerometer", noise.map(|noise| noise.accelerometer_noise_density), "m/s²"),
    ];
    for ((measurement, name, given, unit), spectrum) in sensors.into_iter().zip(spectra) {
        let Some(spectrum) = spectrum else { continue };
        report_vibration(name, spectrum, unit, "rotors", findings);
        // By a wrong unit, noise is wrong by the same factor.
        if let Some(given) = given.filter(|_| findings.can_compare(measurement)) {
            compare_density(name, spectrum, given, unit, findings);
        }
    }
}

/// Reports frequencies and amplitudes of a vibration of the IMU on the gimbal.
pub(crate) fn check_gimbal_vibration(samples: &[ImuSample], findings: &mut Findings) {
    let of = |value: fn(&ImuSample) -> Vector3<f64>| -> Vec<(i64, Vector3<f64>)> {
        samples.iter().map(|sample| (sample.stamp_ns, value(sample))).collect()
    };
    let sensors = [
        ("gyroscope of the IMU on the gimbal", of(|it| it.angular_velocity_rad_per_s), "rad/s"),
        ("accelerometer of the IMU on the gimbal", of(|it| it.specific_force_m_per_s2), "m/s²"),
    ];
    for (name, samples, unit) in sensors {
        if let Some(spectrum) = Spectrum::of(&samples) {
            report_vibration(name, &spectrum, unit, "servos", findings);
        }
    }
}

/// Reports frequencies and amplitudes of a vibration that exceeds the white noise.
fn report_vibration(name: &str, spectrum: &Spectrum, unit: &str, source: &str, findings: &mut Findings) {
    let white_rms = spectrum.density * (3.0 * spectrum.rate_hz).sqrt();
    if spectrum.lines.is_empty() || spectrum.vibration_rms < VIBRATION_RATIO * white_rms {
        return;
    }
    let line = |line: &self::VibrationLine| {
        let (low, high) = line.range_hz;
        format!("{:.3} {unit} at {:.0} Hz ({low:.0} to {high:.0})", line.rms, line.frequency_hz)
    };
    let lines: Vec<String> = spectrum.lines.iter().map(line).collect();
    let evidence =
        format!("{:.3} {unit} RMS, white noise {white_rms:.3}: {}", spectrum.vibration_rms, lines.join(", "));
    let remedy = format!(
        "isolate the IMU from the {source}; the noise densities need not cover a vibration, which averages out between two \
         images unless it is clipped or aliased to a low frequency"
    );
    findings.add(Severity::Note, Area::Imu, format!("vibration on the {name}"), evidence, remedy);
}

fn compare_density(name: &str, spectrum: &Spectrum, given: f64, unit: &str, findings: &mut Findings) {
    let (measured, rate_hz, (low_hz, high_hz)) = (spectrum.density, spectrum.rate_hz, spectrum.band_hz);
    let ratio = measured / given;
    let evidence = format!(
        "{measured:.2e} {unit}/√Hz measured between {low_hz:.0} and {high_hz:.0} Hz at {rate_hz:.0} Hz, {given:.2e} in the rig"
    );
    // A density confused with the noise of one sample differs by √rate.
    let discrete = |ratio: f64| (ratio.ln() - 0.5 * rate_hz.ln()).abs() < SAME_RATIO_LN;
    let field = format!("imu0.{name}_noise_density");
    // A density may include vibration on purpose.
    let excess = given / spectrum.density_with_vibration();
    if ratio > NOISE_TOO_SMALL {
        let hint = if discrete(ratio) { " (it appears to have been divided by √rate twice)" } else { "" };
        let remedy =
            format!("raise {field} to {:.1e}{hint}; estimators need 2 to 10 times the measured value", 2.0 * measured);
        let title = format!("{name} noise in the rig is {ratio:.1} times too small");
        findings.add(Severity::Warning, Area::Imu, title, evidence, remedy);
    } else if excess > NOISE_TOO_LARGE || (measured > 0.0 && discrete(excess)) {
        let hint =
            if discrete(excess) { ": it appears to be the noise of one sample; divide it by √rate" } else { "" };
        let remedy = format!("{field} is a continuous-time density in {unit}/√Hz{hint}");
        let title = format!("{name} noise in the rig is {excess:.0} times too large");
        findings.add(Severity::Note, Area::Imu, title, evidence, remedy);
    } else {
        findings.good(Area::Imu, format!("{name} noise agrees with the rig"), evidence);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SplitMix64;

    const RATE_HZ: f64 = 200.0;

    fn samples(seconds: f64, value: impl Fn(f64, &mut SplitMix64) -> Vector3<f64>) -> Vec<(i64, Vector3<f64>)> {
        let mut random = SplitMix64::new(5);
        let count = (seconds * RATE_HZ) as i64;
        (0..count).map(|index| (index * 5_000_000, value(index as f64 / RATE_HZ, &mut random))).collect()
    }

    /// White noise with a density of 0.01 per √Hz.
    fn white(random: &mut SplitMix64) -> Vector3<f64> {
        let normal = |random: &mut SplitMix64| (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
        Vector3::from_fn(|_, _| 0.01 * RATE_HZ.sqrt() * normal(random))
    }

    #[test]
    fn the_density_of_white_noise_is_found_below_motion_and_vibration() {
        let check = |vibration: f64, motion: f64, tolerance: f64| {
            let spectrum = Spectrum::of(&samples(20.0, |time_s, random| {
                let phase = std::f64::consts::TAU * (70.0 * time_s + 3.0 * (0.9 * time_s).sin());
                let line = vibration * (phase.sin() + 0.5 * (2.0 * phase).sin());
                white(random) + Vector3::new(line, 0.3 * line, motion * (4.0 * time_s).sin())
            }));
            let density = spectrum.unwrap().density;
            assert!((density / 0.01 - 1.0).abs() < tolerance, "vibration {vibration}, motion {motion}: {density}");
        };
        check(0.0, 0.0, 0.05);
        check(0.0, 3.0, 0.05);
        check(1.0, 3.0, 0.3);
        check(10.0, 3.0, 0.4);
    }

    #[test]
    fn a_vibration_is_named_by_frequency_and_amplitude() {
        let quiet =
            Spectrum::of(&samples(20.0, |time_s, random| white(random) + Vector3::repeat((4.0 * time_s).sin())));
        let quiet = quiet.unwrap();
        assert!(quiet.lines.is_empty() && quiet.vibration_rms == 0.0, "{:?}", quiet.lines);
        let line = |time_s: f64| 2.0 * (std::f64::consts::TAU * 63.0 * time_s).sin();
        let shaken =
            Spectrum::of(&samples(20.0, |time_s, random| white(random) + Vector3::x() * line(time_s))).unwrap();
        let [line] = shaken.lines.as_slice() else { panic!("{:?}", shaken.lines) };
        assert!((line.frequency_hz - 63.0).abs() < 0.5, "{line:?}");
        assert!((line.rms / 2_f64.sqrt() - 1.0).abs() < 0.02, "{line:?}");
        assert!((shaken.vibration_rms / 2_f64.sqrt() - 1.0).abs() < 0.02, "{}", shaken.vibration_rms);
    }

    #[test]
    fn the_transform_is_that_of_the_definition() {
        let mut random = SplitMix64::new(1);
        let signal: Vec<Complex<f64>> = (0..32).map(|_| Complex::new(random.next_unit(), random.next_unit())).collect();
        let mut fast = signal.clone();
        transform(&mut fast);
        for (frequency, found) in fast.iter().enumerate() {
            let term = |(index, value): (usize, &Complex<f64>)| {
                value * Complex::from_polar(1.0, -std::f64::consts::TAU * (frequency * index) as f64 / 32.0)
            };
            let expected: Complex<f64> = signal.iter().enumerate().map(term).sum();
            assert!((found - expected).norm() < 1e-12);
        }
    }
}
