//! Joint angles from batches of encoder readings, over many draws of their noise.

use super::joint_angles::{EncoderAverage, nominal_joint_sigma_rad};
use crate::geometry::{SplitMix64, ns_from_seconds, seconds_from_ns};
use crate::sensors::{JointAngles, JointSample};

const IMAGE_NS: i64 = 50_000_000;
const READING_NS: i64 = 5_000_000;
const SIGMA_RAD: f64 = 0.01;

/// Seeded normal noise (Box–Muller).
struct Noise(SplitMix64);

impl Noise {
    fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.next_unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.0.next_unit()).cos()
    }
}

/// Angles at images of 20 Hz from readings of 200 Hz, `read` at each stamp, over `seconds`; with the stamps.
fn play(seconds: i64, sigma_rad: f64, mut read: impl FnMut(i64) -> Option<f64>) -> Vec<(i64, Option<JointAngles>)> {
    let mut average = EncoderAverage::new(sigma_rad, IMAGE_NS / 2);
    let mut readings = (0..seconds * 200).map(|number| 2_000_000 + number * READING_NS);
    let mut previous = None;
    (0..seconds * 20 - 1)
        .map(|number| {
            let stamp_ns = 13_000_000 + number * IMAGE_NS;
            while average.needs_readings(stamp_ns) {
                let Some(at) = readings.next() else { break };
                if let Some(angle) = read(at) {
                    average.push(JointSample { stamp_ns: at, angles_rad: vec![angle] });
                }
            }
            let angles = average.at(stamp_ns, previous);
            previous = Some(stamp_ns);
            (stamp_ns, angles)
        })
        .collect()
}

/// Root mean square of the errors, and of the reported standard deviations, starting at the tenth second.
fn errors(played: &[(i64, Option<JointAngles>)], ground_truth: impl Fn(f64) -> f64) -> (f64, f64) {
    let (mut squares, mut variances, mut count) = (0.0, 0.0, 0.0);
    for (stamp_ns, angles) in &played[200..] {
        let angles = angles.as_ref().unwrap();
        squares += (angles.angles_rad[0] - ground_truth(seconds_from_ns(*stamp_ns))).powi(2);
        variances += angles.sigmas_rad[0].powi(2);
        count += 1.0;
    }
    (f64::sqrt(squares / count), f64::sqrt(variances / count))
}

/// Joint motion as under a stabilizing controller: up to 1.3 rad/s and 8 rad/s².
fn swing(time_s: f64) -> f64 {
    0.2 * (6.3 * time_s).sin() + 0.4 * (0.9 * time_s).cos()
}

#[test]
fn white_noise_is_averaged_down_as_predicted() {
    for sigma in [0.12, 0.0087, 0.0009] {
        let mut noise = Noise::new(3);
        let played = play(120, sigma, |at| Some(swing(seconds_from_ns(at)) + sigma * noise.normal()));
        let (error, stated) = errors(&played, swing);
        // Ten readings, and a little more for the curvature that they do not constrain.
        let (lower, upper) = (sigma / 10_f64.sqrt(), sigma * (9.0 / 40.0_f64).sqrt());
        let nominal = nominal_joint_sigma_rad(sigma, 200.0, 20.0);
        assert!((stated / nominal - 1.0).abs() < 0.12, "{sigma}: {stated} against {nominal}");
        assert!(stated > 0.99 * lower && stated < 1.15 * upper, "{sigma}: {stated} of {lower} to {upper}");
        // 2000 errors determine σ to 2 %; the prior on the curvature may overstate it a little.
        assert!(error < 1.06 * stated && error > 0.8 * stated, "{sigma}: {error} against {stated}");
    }
}

#[test]
fn a_slow_error_keeps_its_variance() {
    // Half of the variance is an error that keeps its value for seconds.
    let mut noise = Noise::new(5);
    let mut slow = 0.0;
    let played = play(300, SIGMA_RAD, |at| {
        if at % ns_from_seconds(2.0) < READING_NS {
            slow = SIGMA_RAD * 0.5_f64.sqrt() * noise.normal();
        }
        Some(swing(seconds_from_ns(at)) + slow + SIGMA_RAD * 0.5_f64.sqrt() * noise.normal())
    });
    let (error, stated) = errors(&played, swing);
    let expected = SIGMA_RAD * (0.5_f64 + 0.05).sqrt();
    assert!((error / expected - 1.0).abs() < 0.15, "{error} of {expected}");
    assert!(stated > 0.9 * expected && stated <= SIGMA_RAD, "{stated} of {expected}");
}

#[test]
fn correlated_noise_does_not_count_as_white() {
    // First-order low-pass noise of 25 ms: consecutive readings are correlated.
    let mut noise = Noise::new(6);
    let keep = (-5.0_f64 / 25.0).exp();
    let mut level = 0.0;
    let played = play(200, SIGMA_RAD, |at| {
        level = keep * level + SIGMA_RAD * (1.0 - keep * keep).sqrt() * noise.normal();
        Some(swing(seconds_from_ns(at)) + level)
    });
    let (error, stated) = errors(&played, swing);
    assert!(error > 0.6 * SIGMA_RAD, "{error}: this noise hardly averages out");
    assert!(stated > 0.95 * error, "{stated} stated, {error} found");
}

#[test]
fn steps_of_a_coarse_encoder_keep_their_variance() {
    // Steps of 2°: uniform errors of 0.58°; the joint moves from one to the next in seconds.
    let step = 2_f64.to_radians();
    let ground_truth = |time_s: f64| 0.01 * time_s;
    let played = play(60, step / 12_f64.sqrt(), |at| Some((ground_truth(seconds_from_ns(at)) / step).round() * step));
    let (error, stated) = errors(&played, ground_truth);
    assert!(stated > 0.95 * error, "{stated} stated, {error} found");
    assert!(stated > 0.9 * step / 12_f64.sqrt());
}

#[test]
fn a_slew_and_a_reversal_are_followed() {
    // 200°/s back and forth, reversed with 60 rad/s²: six times the prior on the curvature.
    const ACCELERATION: f64 = 60.0;
    let mut angles = vec![0.0];
    for millisecond in 0..120_000 {
        let rate_at = |ms: i32| {
            let phase = f64::from(ms.rem_euclid(1200)) * 1e-3;
            (ACCELERATION * ((phase - 0.6).abs() - 0.3)).clamp(-200_f64.to_radians(), 200_f64.to_radians())
        };
        angles.push(angles[millisecond as usize] + 0.5e-3 * (rate_at(millisecond) + rate_at(millisecond + 1)));
    }
    let ground_truth = |time_s: f64| angles[(time_s * 1e3).round() as usize];
    let mut noise = Noise::new(7);
    for sigma in [0.0087, 0.0009] {
        let played = play(120, sigma, |at| Some(ground_truth(seconds_from_ns(at)) + sigma * noise.normal()));
        let bend = ACCELERATION * 0.025_f64.powi(2) / 6.0;
        for (stamp_ns, angles) in &played[200..] {
            let angles = angles.as_ref().unwrap();
            let error = (angles.angles_rad[0] - ground_truth(seconds_from_ns(*stamp_ns))).abs();
            assert!(error < bend + 4.5 * angles.sigmas_rad[0], "{error} at {stamp_ns}");
        }
        // On average over reversals and constant rates the bias vanishes.
        let (error, stated) = errors(&played, ground_truth);
        assert!(error < 1.3 * stated, "{sigma}: {error} against {stated}");
    }
}

#[test]
fn wrapped_angles_are_averaged_unwrapped() {
    let ground_truth = |time_s: f64| std::f64::consts::PI + 0.05 * (3.0 * time_s).sin();
    let mut noise = Noise::new(8);
    let played = play(30, SIGMA_RAD, |at| {
        let angle = ground_truth(seconds_from_ns(at)) + SIGMA_RAD * noise.normal();
        Some(angle.sin().atan2(angle.cos()))
    });
    for (stamp_ns, angles) in &played[40..] {
        let angles = angles.as_ref().unwrap();
        let error = angles.angles_rad[0] - ground_truth(seconds_from_ns(*stamp_ns));
        assert!(error.sin().abs() < 5.0 * angles.sigmas_rad[0] && error.cos() > 0.9, "{error}");
    }
}

#[test]
fn the_sigmas_reflect_gaps_a_late_start_and_an_early_end() {
    let mut noise = Noise::new(9);
    let played = play(30, SIGMA_RAD, |at| {
        let time_s = seconds_from_ns(at);
        let there = (5.0..12.0).contains(&time_s) || (12.08..20.0).contains(&time_s) || (21.0..28.0).contains(&time_s);
        there.then(|| swing(time_s) + SIGMA_RAD * noise.normal())
    });
    let at = |time_s: f64| played.iter().find(|(stamp_ns, _)| *stamp_ns >= ns_from_seconds(time_s)).unwrap();
    for (stamp_ns, angles) in &played {
        let time_s = seconds_from_ns(*stamp_ns);
        let Some(angles) = angles else { continue };
        let error = (angles.angles_rad[0] - swing(time_s)).abs();
        assert!(error < 5.0 * angles.sigmas_rad[0], "{error} of {:?} at {time_s}", angles.sigmas_rad);
    }
    assert!(at(4.0).1.is_none() && at(20.5).1.is_none() && at(29.0).1.is_none());
    // Before the noise is measured the rig's σ holds, later a smaller one, next to a gap a larger one.
    assert!(at(5.05).1.as_ref().unwrap().sigmas_rad[0] >= SIGMA_RAD);
    assert!(at(8.0).1.as_ref().unwrap().sigmas_rad[0] < 0.5 * SIGMA_RAD);
    assert!(at(12.03).1.as_ref().unwrap().sigmas_rad[0] >= SIGMA_RAD);
    assert!(at(20.05).1.as_ref().unwrap().sigmas_rad[0] > SIGMA_RAD);
}

#[test]
fn slow_encoders_are_interpolated() {
    let mut number = 0;
    let played = play(30, SIGMA_RAD, |at| {
        number += 1;
        (number % 8 == 0).then(|| 0.3 * seconds_from_ns(at))
    });
    for (stamp_ns, angles) in &played[5..] {
        let angles = angles.as_ref().unwrap();
        assert!((angles.angles_rad[0] - 0.3 * seconds_from_ns(*stamp_ns)).abs() < 1e-9);
        assert!(angles.sigmas_rad[0] >= SIGMA_RAD);
    }
}
