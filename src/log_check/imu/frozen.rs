//! Axes of the IMU that keep one value while it moves.

use super::stationary::Stamped;
use crate::faults::FaultKind;
use crate::geometry::seconds_from_ns;
use crate::log_check::report::{Area, Findings, Severity};
use crate::log_check::statistics::white_sigma;

/// Shortest time for which an axis keeps its value, in seconds.
const FROZEN_S: f64 = 1.0;
/// Range of another axis in that time by which the IMU moves, in rad/s and m/s².
const MOVING: [f64; 2] = [0.2, 1.0];
/// Largest part of the samples outside that repeat the value before, and smallest standard deviation of the white noise outside, in
/// rad/s and m/s²: a simulated sensor without noise keeps its values for as long as nothing moves.
const REPEATED: f64 = 0.05;
const SMALLEST_NOISE: [f64; 2] = [2e-4, 2e-3];

/// Samples of an axis with one value.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Frozen {
    axis: usize,
    value: f64,
    from_ns: i64,
    to_ns: i64,
}

/// Reports axes of gyroscope and accelerometer that keep one value while another axis changes.
pub(super) fn check_frozen(rates: &[Stamped], forces: &[Stamped], findings: &mut Findings) {
    let sensors = [rates, forces];
    for (sensor, (name, unit)) in [("gyroscope", "rad/s"), ("accelerometer", "m/s²")].into_iter().enumerate() {
        let found = (0..3).filter_map(|axis| frozen(sensors[sensor], axis, SMALLEST_NOISE[sensor]));
        let found: Vec<Frozen> = found.filter(|it| moves(&sensors, sensor, it)).collect();
        let Some(first) = found.first() else { continue };
        let axes: Vec<&str> = found.iter().map(|it| ["x", "y", "z"][it.axis]).collect();
        let subject = if axes.len() == 3 {
            format!("the {name} freezes")
        } else {
            format!("{} of the {name} {}", axes.join(" and "), if axes.len() == 1 { "freezes" } else { "freeze" })
        };
        let values: Vec<String> = found.iter().map(|it| format!("{:+.3}", it.value)).collect();
        let log_end_ns = sensors[sensor].last().map_or(0, |(stamp_ns, _)| *stamp_ns);
        let [from_s, to_s] = [first.from_ns, first.to_ns].map(seconds_from_ns);
        let lasts = first.to_ns < log_end_ns;
        let when = if lasts { format!("from {from_s:.1} to {to_s:.1} s") } else { format!("from {from_s:.1} s on") };
        let title = format!("{subject} at {} {unit} {when}", values.join(", "));
        let evidence = "other axes of the IMU change in this time";
        let remedy = "check sensor and driver: a register that is not read again, or an axis that is not connected";
        findings.add(Severity::Error, Area::Imu, title, evidence, remedy);
        findings.state_faults([FaultKind::UnusableImu.into()]);
        findings.state_times(Some(from_s), lasts.then_some(to_s));
    }
}

/// Longest stretch in which an axis keeps its value; `None` if it is short, or if values repeat outside of it as well or have less
/// noise than this there.
fn frozen(samples: &[Stamped], axis: usize, smallest_noise: f64) -> Option<Frozen> {
    let runs: Vec<&[Stamped]> = samples.chunk_by(|one, other| one.1[axis] == other.1[axis]).collect();
    let longest = *runs.iter().max_by_key(|run| run.len())?;
    let (first, last) = (longest.first()?, longest.last()?);
    let outside = samples.len() - longest.len();
    let repeated = outside - (runs.len() - 1);
    let is_long = seconds_from_ns(last.0 - first.0) >= FROZEN_S && (repeated as f64) < REPEATED * outside as f64;
    let beyond = samples.iter().filter(|(at_ns, _)| *at_ns < first.0 || *at_ns > last.0);
    let is_noisy = || white_sigma(&beyond.map(|(_, value)| value[axis]).collect::<Vec<_>>(), false) > smallest_noise;
    (is_long && is_noisy()).then_some(Frozen { axis, value: first.1[axis], from_ns: first.0, to_ns: last.0 })
}

/// True if another axis of the IMU changes while this one does not.
fn moves(sensors: &[&[Stamped]; 2], of_sensor: usize, frozen: &Frozen) -> bool {
    (0..2).flat_map(|sensor| (0..3).map(move |axis| (sensor, axis))).any(|(sensor, axis)| {
        let within = sensors[sensor].iter().filter(|(at_ns, _)| (frozen.from_ns..=frozen.to_ns).contains(at_ns));
        let values = within.map(|(_, vector)| vector[axis]);
        let [low, high] =
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
        (sensor, axis) != (of_sensor, frozen.axis) && high - low > MOVING[sensor]
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::log_check::tests::Noise;

    /// Titles for an IMU over 20 s whose angular rates are changed.
    fn titles(change: impl Fn(f64, &mut Vector3<f64>)) -> Vec<String> {
        let mut noise = Noise(9);
        let (mut rates, mut forces) = (Vec::new(), Vec::new());
        for number in 0..4000_i64 {
            let time_s = number as f64 * 0.005;
            let wave = Vector3::new((1.3 * time_s).sin(), (1.9 * time_s).cos(), (0.7 * time_s).sin());
            let mut rate = wave * 0.4 + noise.vector() * 0.003;
            change(time_s, &mut rate);
            rates.push((number * 5_000_000, rate));
            forces.push((number * 5_000_000, wave * 2.0 + Vector3::new(0.0, 0.0, 9.81) + noise.vector() * 0.02));
        }
        let mut findings = Findings::default();
        check_frozen(&rates, &forces, &mut findings);
        findings.list.into_iter().map(|finding| finding.title).collect()
    }

    #[test]
    fn axes_that_keep_their_value_are_named_with_their_time() {
        assert_eq!(titles(|_, _| ()), Vec::<String>::new());
        let sensor = titles(|time_s, rate| {
            if (12.0..14.0).contains(&time_s) {
                *rate = Vector3::new(0.1, -0.2, 0.3);
            }
        });
        assert_eq!(sensor, ["the gyroscope freezes at +0.100, -0.200, +0.300 rad/s from 12.0 to 14.0 s"]);
        let axis = titles(|time_s, rate| rate.y = if time_s < 12.0 { rate.y } else { 0.0 });
        assert_eq!(axis, ["y of the gyroscope freezes at +0.000 rad/s from 12.0 s on"]);
        // A simulated sensor without noise does not rotate for a while.
        let planar = titles(|time_s, rate| *rate = Vector3::new(0.0, 0.0, (0.7 * time_s.max(5.0)).sin()));
        assert_eq!(planar, Vec::<String>::new());
    }
}
