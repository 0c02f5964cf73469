//! Axes of the accelerometer against the axes of the gyroscope: while the IMU rotates, gravity must rotate the other way in
//! its frame. Exchanged or reversed axes of one sensor, or of both, show as a specific force that does not stay vertical.

use nalgebra::Vector3;

use super::ImuFacts;
use crate::faults::{Fault, FaultKind};
use crate::geometry::{SignedAxes, mean, seconds_from_ns};
use crate::log_check::report::{Area, Findings, Measurement, Severity};
use crate::sensors::ImuSample;

/// Length over which specific forces are averaged, in nanoseconds.
pub(crate) const WINDOW_NS: i64 = 250_000_000;
/// Minimum number of averaged specific forces.
const MIN_WINDOWS: usize = 12;
/// Length of the pieces in which the vertical is constant, in seconds: errors of the gyroscope's bias add up.
const PIECE_S: f64 = 10.0;
/// Windows whose accelerations count as one measurement.
const CORRELATED: f64 = 4.0;
/// Minimum variance of the specific force in the IMU frame as a ratio of its square: without tilting, all axes fit.
const MIN_TILT: f64 = 0.004;
/// Twice the logarithm of the odds from which other axes are reported.
const DECISIVE: f64 = 20.0;
/// Largest variance of the vertical, as a ratio of the square of the force, with which axes are believed.
const LARGEST_SCATTER: f64 = 0.05;

/// Largest ratio of the variance of the vertical to the variance of the specific force in the IMU frame.
const LARGEST_RATIO: f64 = 0.5;

/// Remedy for axes that differ.
pub(crate) const CORRECT_AXES: &str =
    "correct order and signs of the axes in the IMU's driver: both sensors need one right-handed frame";

/// Axes with the scatter of the specific force that they leave.
#[derive(Clone, Copy, Debug)]
struct Assumed {
    /// −1 for reversed angular rates.
    sign: f64,
    /// Maps specific forces to the axes of the gyroscope.
    axes: SignedAxes,
    /// Variance around the mean of each piece, as a ratio of the square of the force.
    scatter: f64,
}

/// Compares the axes of both sensors of the IMU; true if they agree.
pub(crate) fn check_imu_axes(imu_facts: &ImuFacts, findings: &mut Findings) -> bool {
    if !findings.can_compare(Measurement::Gyroscope) || !findings.can_compare(Measurement::Accelerometer) {
        return false;
    }
    let windows = windows(&imu_facts.samples);
    let square = windows.iter().map(|(_, force)| force.norm_squared()).sum::<f64>() / windows.len().max(1) as f64;
    let tilt = scatter(&windows) / square;
    if windows.len() < MIN_WINDOWS || tilt.is_nan() || tilt < MIN_TILT {
        return false;
    }
    let mut all = Vec::new();
    for sign in [1.0, -1.0] {
        let rates = imu_facts.gyroscope.changed(|rate| rate * sign);
        for axes in SignedAxes::all().filter(|axes| !axes.is_left_handed()) {
            let fixed = |(time_s, force): &(f64, Vector3<f64>)| {
                Some((*time_s, rates.orientation_at(*time_s)? * axes.apply(force)))
            };
            let fixed: Vec<(f64, Vector3<f64>)> = windows.iter().filter_map(fixed).collect();
            all.push(Assumed { sign, axes, scatter: scatter(&fixed) / square });
        }
    }
    let Some(given) = all.first().copied() else { return false };
    let Some(best) = all.iter().copied().min_by(|a, b| a.scatter.total_cmp(&b.scatter)) else { return false };
    let degrees = |assumed: Assumed| assumed.scatter.sqrt().to_degrees();
    let evidence = format!(
        "specific force rotated by the gyroscope scatters by {:.1}° around the vertical{}; in the IMU frame by {:.1}°",
        degrees(given),
        if best.scatter < given.scatter {
            format!(", by {:.1}° with the axes that fit best", degrees(best))
        } else {
            String::new()
        },
        tilt.sqrt().to_degrees()
    );
    let is_decisive = fits_decisively(windows.len(), best.scatter, given.scatter);
    // A multirotor keeps the specific force along a body axis: then no axes make it vertical.
    if !is_decisive || best.scatter > LARGEST_SCATTER.min(LARGEST_RATIO * tilt) {
        let agree = given.scatter < LARGEST_SCATTER && given.scatter < tilt;
        if agree {
            findings.good(Area::Imu, "accelerometer and gyroscope have the same axes", evidence);
        }
        return agree;
    }
    let title = match (best.sign > 0.0, best.axes.is_identity()) {
        (true, _) => other_accelerometer_axes(&best.axes.inverse().simpler()),
        (false, true) => "the axes of gyroscope and accelerometer form a left-handed frame".to_owned(),
        (false, false) => {
            format!("the axes of the gyroscope form a left-handed frame: {}", best.axes.negated().describe())
        }
    };
    findings.add(Severity::Error, Area::Imu, title, evidence, CORRECT_AXES);
    if best.sign > 0.0 {
        findings.state_faults([Fault::of_axes(FaultKind::AccelerometerAxes, best.axes.simpler())]);
    }
    findings.mark_by_pair(&[Measurement::Gyroscope, Measurement::Accelerometer]);
    findings.exclude(Measurement::Accelerometer);
    false
}

/// True if the accelerations of as many windows fit far better with a variance than with the given one.
pub(crate) fn fits_decisively(windows: usize, variance: f64, given: f64) -> bool {
    windows as f64 / CORRELATED * (given / variance).ln() >= DECISIVE
}

/// Title of a finding on an accelerometer that records these axes of the gyroscope.
pub(crate) fn other_accelerometer_axes(recorded: &SignedAxes) -> String {
    format!("the axes of the accelerometer differ from the gyroscope's: {}", recorded.describe())
}

/// Mean specific forces of consecutive windows at their middles, in seconds.
fn windows(samples: &[ImuSample]) -> Vec<(f64, Vector3<f64>)> {
    let Some(first_ns) = samples.first().map(|sample| sample.stamp_ns) else { return Vec::new() };
    let number = |sample: &ImuSample| (sample.stamp_ns - first_ns) / WINDOW_NS;
    let window = |samples: &[ImuSample]| {
        let forces: Vec<Vector3<f64>> = samples.iter().map(|sample| sample.specific_force_m_per_s2).collect();
        let middle_ns = first_ns + number(&samples[0]) * WINDOW_NS + WINDOW_NS / 2;
        (seconds_from_ns(middle_ns), mean(&forces))
    };
    samples.chunk_by(|a, b| number(a) == number(b)).map(window).collect()
}

/// Mean squared distance of the vectors from the mean of their piece.
fn scatter(vectors: &[(f64, Vector3<f64>)]) -> f64 {
    let Some((first_s, _)) = vectors.first() else { return f64::NAN };
    let piece = |time_s: f64| ((time_s - first_s) / PIECE_S).floor();
    let sums = vectors.chunk_by(|a, b| piece(a.0) == piece(b.0)).map(|piece| {
        let forces: Vec<Vector3<f64>> = piece.iter().map(|(_, force)| *force).collect();
        let mean = mean(&forces);
        forces.iter().map(|force| (force - mean).norm_squared()).sum::<f64>()
    });
    sums.sum::<f64>() / vectors.len() as f64
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::geometry::so3;
    use crate::sensors::AngularRates;

    /// Severe findings for a vehicle that tilts about all axes, whose driver changes angular rates and specific forces.
    fn titles(change: impl Fn(Vector3<f64>, Vector3<f64>) -> (Vector3<f64>, Vector3<f64>)) -> Vec<String> {
        let rate_at = |time_s: f64| Vector3::new(0.7 * (1.1 * time_s).sin(), 0.6 * (1.6 * time_s).cos(), 0.3);
        let mut world_from_imu = UnitQuaternion::identity();
        let mut samples = Vec::new();
        for number in 0..3000_i32 {
            let time_s = f64::from(number) * 0.005;
            let acceleration = Vector3::new(0.5 * (0.9 * time_s).sin(), 0.4 * (1.2 * time_s).cos(), 9.81);
            let (rate, force) = change(rate_at(time_s), world_from_imu.inverse() * acceleration);
            samples.push(ImuSample {
                stamp_ns: i64::from(number) * 5_000_000,
                angular_velocity_rad_per_s: rate,
                specific_force_m_per_s2: force,
                unmeasured_s: 0.0,
            });
            world_from_imu *= so3::exp(&(rate_at(time_s + 0.0025) * 0.005));
        }
        let rates = samples.iter().map(|it| (seconds_from_ns(it.stamp_ns), it.angular_velocity_rad_per_s));
        let gyroscope = AngularRates::new(rates);
        let mut findings = Findings::default();
        check_imu_axes(&ImuFacts { samples, gyroscope, ..ImuFacts::default() }, &mut findings);
        findings.list.into_iter().filter(|it| it.severity != Severity::Good).map(|it| it.title).collect()
    }

    #[test]
    fn exchanged_axes_of_either_sensor_are_named() {
        let swapped = |vector: Vector3<f64>| Vector3::new(vector.y, vector.x, vector.z);
        assert_eq!(titles(|rate, force| (rate, force)), Vec::<String>::new());
        assert_eq!(
            titles(|rate, force| (swapped(rate), swapped(force))),
            ["the axes of gyroscope and accelerometer form a left-handed frame"]
        );
        assert_eq!(
            titles(|rate, force| (rate, swapped(force))),
            ["the axes of the accelerometer differ from the gyroscope's: x and y swapped"]
        );
        assert_eq!(
            titles(|rate, force| (swapped(rate), force)),
            ["the axes of the gyroscope form a left-handed frame: x and y swapped"]
        );
        assert_eq!(
            titles(|rate, force| (Vector3::new(rate.y, -rate.x, rate.z), Vector3::new(force.y, -force.x, force.z))),
            Vec::<String>::new()
        );
    }
}
