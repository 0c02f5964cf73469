//! Gravity in the measurements of the accelerometer: its unit, its scale, and a change of them.

use super::stationary::Window;
use crate::faults::{Fault, FaultKind, Sentence, Subject};
use crate::files::rig::read::USUAL_GRAVITY_M_PER_S2;
use crate::geometry::seconds_from_ns;
use crate::log_check::report::{Area, Findings, Measurement, Severity};
use crate::log_check::statistics::{median, middle_range};
use crate::sensors::{ImuSample, Rig, STANDARD_GRAVITY_M_PER_S2};

/// Norm of the specific force below which it counts as unset in the message.
const NO_FORCE_M_PER_S2: f64 = 0.01;
/// Ratio of the specific force to gravity below which it does not contain gravity.
const NO_GRAVITY_RATIO: f64 = 0.3;
/// Factors by which a wrong range setting changes measurements.
const RANGE_FACTORS: [f64; 4] = [0.25, 0.5, 2.0, 4.0];
/// Relative error of the norm within which one of [`RANGE_FACTORS`] counts as found.
const RANGE_TOLERANCE: f64 = 0.03;
/// Bias of an accelerometer that is tolerated.
pub(in crate::log_check) const LARGEST_BIAS_M_PER_S2: f64 = 0.3;
/// Gravities of a rig that are usual, in m/s²: on the ground it lies between 9.78 and 9.83.
const USUAL_GRAVITIES: std::ops::RangeInclusive<f64> = 9.75..=9.85;
/// Difference of a norm from 1 within which it is gravity in g.
const UNIT_TOLERANCE: f64 = 0.2;
/// Differences of the measured norm from gravity, in m/s², from which they are noted, a warning and an error.
const GRAVITY_TOLERANCES: [f64; 3] = [0.2, 1.0, 2.0];
/// Largest range of the middle 80 % of the norms, as a ratio of their median, of forces that contain gravity.
const STEADY_RANGE: f64 = 0.5;
/// Minimum number of windows before and after a change, and the ratio of the norms from which it is one.
const MIN_CHANGE_WINDOWS: usize = 6;
const CHANGED_RATIO: f64 = 1.5;

/// Compares the norm of the specific force with gravity, while stationary if the vehicle ever is.
pub(super) fn check_gravity(
    samples: &[ImuSample],
    stationary: &[Window],
    rig: Option<&Rig>,
    other_topics: &[&String],
    findings: &mut Findings,
) {
    let gravity = rig.map_or(USUAL_GRAVITY_M_PER_S2, |rig| rig.gravity_m_per_s2);
    if !USUAL_GRAVITIES.contains(&gravity) {
        let evidence = format!("{gravity} m/s²; on the ground it lies between 9.78 and 9.83");
        findings.add(
            Severity::Warning,
            Area::Imu,
            "the rig's gravity is unusual",
            evidence,
            "set gravity for the place of the flight",
        );
    }
    let (measured, when) = if stationary.is_empty() {
        // If start and end velocity are equal, the mean specific force is gravity, measured in a tilting frame.
        let norms: Vec<f64> = samples.iter().map(|sample| sample.specific_force_m_per_s2.norm()).collect();
        (median(&norms), "median over the flight")
    } else {
        let norms: Vec<f64> = stationary.iter().map(|window| window.mean_force.norm()).collect();
        (median(&norms), "while stationary")
    };
    let difference = measured - gravity;
    let evidence = format!("|a| is {measured:.3} m/s² {when}, gravity {gravity:.3}: {difference:+.3} m/s²");
    if measured < NO_FORCE_M_PER_S2 {
        findings.exclude(Measurement::Accelerometer);
        let quoted: Vec<String> = other_topics.iter().map(|topic| format!("'{topic}'")).collect();
        let remedy = if quoted.is_empty() {
            "record the accelerometer, too".to_owned()
        } else {
            format!("name the accelerometer's topic in imu0.accelerometer_rostopic: one of {}", quoted.join(", "))
        };
        return findings.add(
            Severity::Error,
            Area::Imu,
            "the IMU's messages have no specific force",
            evidence,
            &remedy,
        );
    }
    let is_steady = stationary.is_empty() && has_steady_norm(samples);
    let near = |factor: &f64| {
        let expected = factor * gravity;
        (measured - expected).abs() < LARGEST_BIAS_M_PER_S2.max(RANGE_TOLERANCE * expected)
    };
    let [noted, large, unusable] = GRAVITY_TOLERANCES;
    let range_factor = RANGE_FACTORS.into_iter().find(near);
    let multiple = format!("the accelerometer measures {} times gravity", range_factor.unwrap_or(1.0));
    let is_scaled = is_steady || !stationary.is_empty();
    let (severity, title, remedy, fault) = if (measured - 1.0).abs() < UNIT_TOLERANCE && is_scaled {
        (
            Severity::Error,
            "accelerations are in g, not m/s²",
            "multiply by 9.80665 in the driver: sensor_msgs/Imu requires m/s²",
            Some(Fault::new(FaultKind::AccelerometerScale, &[STANDARD_GRAVITY_M_PER_S2])),
        )
    } else if measured < NO_GRAVITY_RATIO * gravity {
        (
            Severity::Error,
            "gravity is already removed from the accelerations",
            "record the raw accelerometer (specific force): linear accelerations of a filter cannot be used",
            Some(Fault::from(FaultKind::UnusableImu)),
        )
    } else if let Some(factor) = range_factor.filter(|_| is_scaled) {
        (
            Severity::Error,
            multiple.as_str(),
            "the range setting of the sensor and the scale of its driver differ: correct one of them",
            Some(Fault::new(FaultKind::AccelerometerScale, &[factor.recip()])),
        )
    } else if difference.abs() > unusable {
        (
            Severity::Error,
            "the accelerometer does not measure gravity",
            "check units, scale and IMU intrinsics in the driver: while stationary the norm must be gravity",
            None,
        )
    } else if difference.abs() > noted && !stationary.is_empty() {
        (
            if difference.abs() > large { Severity::Warning } else { Severity::Note },
            "the accelerometer has a large bias or scale error along gravity",
            "the estimator finds the bias once the vehicle moves; expect a slow start, or calibrate the IMU",
            None,
        )
    } else {
        return findings.good(Area::Imu, "the accelerometer measures gravity", evidence);
    };
    findings.add(severity, Area::Imu, title, evidence, remedy);
    findings.state_faults(fault);
    if severity == Severity::Error {
        findings.exclude(Measurement::Accelerometer);
    }
}

/// True if the norm of the specific force varies little around its median: it contains gravity, in whatever unit.
fn has_steady_norm(samples: &[ImuSample]) -> bool {
    let norms: Vec<f64> = samples.iter().map(|sample| sample.specific_force_m_per_s2.norm()).collect();
    middle_range(&norms) < STEADY_RANGE * median(&norms)
}

/// Reports a unit or scale of the accelerometer that changes at a time: before it the median norm is gravity, after it another
/// value, and neither varies much.
pub(super) fn check_change(windows: &[Window], rig: &Rig, findings: &mut Findings) {
    if !findings.can_compare(Measurement::Accelerometer) {
        return;
    }
    let norms: Vec<f64> = windows.iter().map(|window| window.mean_force.norm()).collect();
    let logarithms: Vec<f64> = norms.iter().map(|norm| norm.max(NO_FORCE_M_PER_S2).ln()).collect();
    let total: f64 = logarithms.iter().sum();
    let mut before = 0.0;
    let mut best = (0.0, 0);
    for place in 1..logarithms.len() {
        before += logarithms[place - 1];
        let [first, second] = [place, logarithms.len() - place].map(|count| count as f64);
        let explained = ((total - before) / second - before / first).powi(2) * first * second;
        if explained > best.0 && place.min(logarithms.len() - place) >= MIN_CHANGE_WINDOWS {
            best = (explained, place);
        }
    }
    let (first, second) = norms.split_at(best.1);
    if best.1 == 0 || [first, second].iter().any(|side| middle_range(side) > STEADY_RANGE * median(side)) {
        return;
    }
    let [sound, wrong] = [first, second].map(median);
    let [_, large, _] = GRAVITY_TOLERANCES;
    let unchanged = CHANGED_RATIO.recip()..CHANGED_RATIO;
    if (sound - rig.gravity_m_per_s2).abs() > large || unchanged.contains(&(wrong / sound)) {
        return;
    }
    let since_s = seconds_from_ns(windows[best.1].range_ns.0);
    let fault = Fault { since_s: Some(since_s), ..Fault::new(FaultKind::AccelerometerScale, &[sound / wrong]) };
    if !fault.is_possible() {
        return;
    }
    let Sentence { severity, statement, remedy } = Subject { rig, camera_key: "" }.sentence(&fault);
    let evidence = format!("|a| is {sound:.2} m/s² in the median before {since_s:.1} s, and {wrong:.2} m/s² after it");
    findings.add(severity, Area::Imu, statement, evidence, remedy);
    findings.state_faults([fault]);
    findings.mark_by_pair(&[Measurement::Accelerometer]);
    findings.exclude(Measurement::Accelerometer);
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use nalgebra::Vector3;

    use super::*;
    use crate::files::RigFile as _;
    use crate::log_check::tests::rig_text;

    /// Titles for windows of 0.5 s with these norms of the specific force.
    fn titles(norms: impl Iterator<Item = f64>) -> Vec<String> {
        let window = |(number, norm): (i64, f64)| Window {
            range_ns: (number * 500_000_000, (number + 1) * 500_000_000),
            stationary: false,
            mean_rate: Vector3::zeros(),
            mean_force: Vector3::new(0.0, 0.0, norm),
        };
        let windows: Vec<Window> = (0..).zip(norms).map(window).collect();
        let rig = Rig::from_yaml(&rig_text(), Path::new("some.rig.yaml")).unwrap();
        let mut findings = Findings::default();
        check_change(&windows, &rig, &mut findings);
        findings.list.into_iter().map(|finding| finding.title).collect()
    }

    #[test]
    fn a_unit_that_changes_is_named_with_its_time() {
        let sound = |number: i32| 9.8 + 0.6 * f64::from(number).sin();
        assert_eq!(titles((0..40).map(sound)), Vec::<String>::new());
        let changed = (0..40).map(|number| if number < 24 { sound(number) } else { sound(number) / 9.80665 });
        assert_eq!(titles(changed), ["specific forces are in g from about 12.0 s on"]);
        // A flight with large accelerations after a hover changes no unit.
        let aerobatic =
            (0..40).map(|number| if number < 24 { sound(number) } else { 20.0 + 12.0 * f64::from(number).sin() });
        assert_eq!(titles(aerobatic), Vec::<String>::new());
    }
}
