//! Samples of two sources that take turns: every second one has another bias or another delay.

use nalgebra::Vector3;

use super::stationary::Stamped;
use crate::faults::FaultKind;
use crate::geometry::seconds_from_ns;
use crate::log_check::report::{Area, Findings, Severity};
use crate::log_check::statistics::median;

/// Minimum number of samples.
const MIN_SAMPLES: usize = 400;
/// Parts of the log, in each of which the sources must differ alike.
const PARTS: usize = 4;
/// Samples to either side over which a derivative is measured, an odd number: the other source has them, like the neighbours.
const HALF_SLOPE: usize = 5;
/// Part of the difference over the whole log that each part must have.
const ALIKE: f64 = 0.5;
/// Number of standard deviations from which a difference is one.
const SIGNIFICANT_SIGMAS: f64 = 10.0;
/// Smallest differences of the angular rates in rad/s and of the specific forces in m/s².
const SMALLEST: [f64; 2] = [0.01, 0.1];
/// Smallest difference of the delays in seconds.
const SMALLEST_DELAY_S: f64 = 0.003;

/// Difference between the samples with even and odd numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Difference {
    value: Vector3<f64>,
    /// Time by which the odd ones are later than the even ones, in seconds.
    delay_s: f64,
    /// Standard deviations per axis, and of the delay.
    value_sigma: f64,
    delay_sigma_s: f64,
}

impl Difference {
    /// True for values that differ, of sensor 0 or 1.
    fn is_value(&self, sensor: usize) -> bool {
        self.value.norm() > SMALLEST[sensor].max(SIGNIFICANT_SIGMAS * self.value_sigma)
    }
}

/// Reports a sensor, 0 for the gyroscope and 1 for the accelerometer, whose samples two sources take in turns; true if they do.
pub(super) fn check_alternation(samples: &[Stamped], sensor: usize, findings: &mut Findings) -> bool {
    let (name, unit) = [("gyroscope", "rad/s"), ("accelerometer", "m/s²")][sensor];
    let Some(found) = difference(samples, sensor) else { return false };
    let Difference { value, delay_s, .. } = found;
    let of_value = format!("({:+.3}, {:+.3}, {:+.3}) {unit}", value.x, value.y, value.z);
    let text = if found.is_value(sensor) {
        format!("they differ by {of_value}")
    } else {
        format!("one is {:.0} ms late", 1e3 * delay_s.abs())
    };
    let evidence = format!(
        "between samples with even and odd numbers: {of_value} ± {:.1e}, and {:.1} ± {:.1} ms",
        found.value_sigma,
        1e3 * delay_s,
        1e3 * found.delay_sigma_s
    );
    let title = format!("the samples of the {name} are those of two sources in turns: {text}");
    let remedy = "let one driver publish one sensor to this topic: two sensors, or two copies of a driver, write to it";
    findings.add(Severity::Error, Area::Imu, title, evidence, remedy);
    findings.state_faults([FaultKind::UnusableImu.into()]);
    true
}

/// Difference of every second sample that is one, and alike in all parts of the log.
fn difference(samples: &[Stamped], sensor: usize) -> Option<Difference> {
    if samples.len() < MIN_SAMPLES {
        return None;
    }
    let all = fit(samples)?;
    let parts: Vec<Difference> = samples.chunks(samples.len().div_ceil(PARTS)).filter_map(fit).collect();
    let is_value =
        all.is_value(sensor) && parts.iter().all(|part| part.value.dot(&all.value) > ALIKE * all.value.norm_squared());
    let is_delay = all.delay_s.abs() > SMALLEST_DELAY_S.max(SIGNIFICANT_SIGMAS * all.delay_sigma_s)
        && parts.iter().all(|part| part.delay_s * all.delay_s > ALIKE * all.delay_s.powi(2));
    (is_value || is_delay).then_some(all)
}

/// Least squares of the differences between samples and the means of their neighbours, with the sign of their number, by a
/// constant and the derivative.
fn fit(samples: &[Stamped]) -> Option<Difference> {
    let first_ns = samples.first()?.0;
    let steps: Vec<f64> = samples.windows(2).map(|pair| seconds_from_ns(pair[1].0 - pair[0].0)).collect();
    let step_s = median(&steps);
    // Numbers by the stamps: missing samples do not exchange even and odd ones.
    let number = |stamp_ns: i64| (seconds_from_ns(stamp_ns - first_ns) / step_s).round() as i64;
    let row = |near: &[Stamped]| {
        let [(first_ns, first), (_, before), (at_ns, at), (_, after), (last_ns, last)] =
            [0, HALF_SLOPE - 1, HALF_SLOPE, HALF_SLOPE + 1, 2 * HALF_SLOPE].map(|place| near[place]);
        let is_regular = number(last_ns) - number(first_ns) == 2 * HALF_SLOPE as i64;
        let sign = if number(at_ns) % 2 == 0 { 1.0 } else { -1.0 };
        let slope = (last - first) / seconds_from_ns(last_ns - first_ns);
        is_regular.then(|| (slope, (at - (before + after) * 0.5) * sign))
    };
    let rows: Vec<(Vector3<f64>, Vector3<f64>)> = samples.windows(2 * HALF_SLOPE + 1).filter_map(row).collect();
    let count = rows.len() as f64;
    // A constant of each axis beside the common delay.
    let (mut square, mut product) = (0.0, 0.0);
    let mean = rows.iter().map(|(_, difference)| difference).sum::<Vector3<f64>>() / count;
    let mean_slope = rows.iter().map(|(slope, _)| slope).sum::<Vector3<f64>>() / count;
    for (slope, difference) in &rows {
        let slope = slope - mean_slope;
        square += slope.norm_squared();
        product += slope.dot(&(difference - mean));
    }
    if count < 0.5 * samples.len() as f64 || square <= 0.0 {
        return None;
    }
    let delay_s = product / square;
    let value = mean - mean_slope * delay_s;
    let left =
        rows.iter().map(|(slope, difference)| (difference - value - slope * delay_s).norm_squared()).sum::<f64>();
    let sigma = (left / (3.0 * count)).sqrt();
    Some(Difference { value, delay_s, value_sigma: sigma / count.sqrt(), delay_sigma_s: sigma / square.sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log_check::tests::Noise;

    /// Titles for a gyroscope whose samples with odd numbers are changed.
    fn titles(odd: impl Fn(f64) -> Vector3<f64>) -> Vec<String> {
        let mut noise = Noise(5);
        let samples: Vec<Stamped> = (0..2000_i64)
            .map(|number| {
                let time_s = number as f64 * 0.005;
                let rate = if number % 2 == 0 { rate_at(time_s) } else { odd(time_s) };
                (number * 5_000_000, rate + noise.vector() * 0.003)
            })
            .collect();
        let mut findings = Findings::default();
        check_alternation(&samples, 0, &mut findings);
        findings.list.into_iter().map(|finding| finding.title).collect()
    }

    fn rate_at(time_s: f64) -> Vector3<f64> {
        Vector3::new(0.7 * (1.1 * time_s).sin(), 0.6 * (1.6 * time_s).cos(), 0.3 * (2.3 * time_s).sin())
    }

    #[test]
    fn two_sources_that_take_turns_are_named() {
        assert_eq!(titles(rate_at), Vec::<String>::new());
        let biased = titles(|time_s| rate_at(time_s) - Vector3::new(0.06, 0.0, -0.04));
        assert!(
            biased[0].ends_with("two sources in turns: they differ by (+0.060, +0.000, -0.040) rad/s"),
            "{biased:?}"
        );
        let late = titles(|time_s| rate_at(time_s - 0.04));
        let delay_ms = late[0].split(' ').rev().nth(2).and_then(|word| word.parse::<f64>().ok());
        assert!(late[0].ends_with("ms late") && (delay_ms.unwrap() - 40.0).abs() < 2.0, "{late:?}");
    }
}
