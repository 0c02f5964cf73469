//! Identification of known noise densities.

use nalgebra::Vector3;

use super::samples::ImuSeries;
use super::{AllanReport, NoiseTerm, measure};
use crate::geometry::{SplitMix64, ns_from_seconds};
use crate::sensors::{ImuIntrinsics, ImuNoise, ImuRig, RequiredAccuracy, Rig};

const RATE_HZ: f64 = 100.0;

/// Normal random number, by Box and Muller.
pub(super) fn normal(random: &mut SplitMix64) -> f64 {
    let radius = (-2.0 * (1.0 - random.next_unit()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.next_unit()).cos()
}

/// White noise, random walk, quantization step, a line of 30 Hz and the time constant of a low-pass filter of one sensor.
#[derive(Clone, Copy, Default)]
struct Truth {
    white: f64,
    walk: f64,
    step: f64,
    line: f64,
    filter_s: f64,
}

const GYROSCOPE: Truth = Truth { white: 3e-4, walk: 2e-4, step: 0.0, line: 0.0, filter_s: 0.0 };
const ACCELEROMETER: Truth = Truth { white: 4e-3, walk: 2e-3, step: 0.0, line: 0.0, filter_s: 0.0 };

fn series(seed: u64, parts_s: &[(f64, f64)], moving: bool, gyroscope: Truth, accelerometer: Truth) -> ImuSeries {
    let mut random = SplitMix64::new(seed);
    let mut series = ImuSeries { topic: "/imu".into(), ..ImuSeries::default() };
    let end_s = parts_s.last().unwrap().1;
    let mut biases = [Vector3::zeros(); 2];
    let mut sums = [Vector3::zeros(); 2];
    let mut filtered = [Vector3::zeros(); 2];
    for index in 0..(end_s * RATE_HZ) as i64 {
        let time_s = index as f64 / RATE_HZ;
        let still = parts_s.iter().any(|(from, to)| (*from..*to).contains(&time_s));
        let motion = if still || !moving { 0.0 } else { (3.0 * time_s).sin() };
        for (sensor, truth) in [gyroscope, accelerometer].into_iter().enumerate() {
            let bias: &mut Vector3<f64> = &mut biases[sensor];
            *bias += Vector3::from_fn(|_, _| normal(&mut random)) * (truth.walk / RATE_HZ.sqrt());
            let white = Vector3::from_fn(|_, _| normal(&mut random)) * (truth.white * RATE_HZ.sqrt());
            let line = Vector3::repeat(truth.line * (std::f64::consts::TAU * 30.0 * time_s).sin());
            let passed = if truth.filter_s > 0.0 { 1.0 - (-1.0 / (RATE_HZ * truth.filter_s)).exp() } else { 1.0 };
            let noise: &mut Vector3<f64> = &mut filtered[sensor];
            *noise += (white - *noise) * passed;
            let mut value = *bias + *noise + line + Vector3::repeat(motion);
            if truth.step > 0.0 {
                // Integral in whole steps, as output by integrating sensors.
                let sum: &mut Vector3<f64> = &mut sums[sensor];
                let before = sum.map(|entry| (entry / truth.step).round());
                *sum += value / RATE_HZ;
                value = (sum.map(|entry| (entry / truth.step).round()) - before) * (truth.step * RATE_HZ);
            }
            let stamp_ns = ns_from_seconds(time_s);
            match sensor {
                0 => series.rates.push((stamp_ns, value)),
                _ => series.forces.push((stamp_ns, value + Vector3::z() * 9.81)),
            }
        }
    }
    series.order();
    series
}

fn report(seed: u64, seconds: f64, gyroscope: Truth, accelerometer: Truth) -> AllanReport {
    let series = series(seed, &[(0.0, seconds)], false, gyroscope, accelerometer);
    measure(&series, Some(&rig()), (0.0, f64::MAX / 1e10))
}

fn rig() -> Rig {
    Rig {
        name: "test".into(),
        gravity_m_per_s2: 9.81,
        imu: ImuRig {
            topic: "/imu".into(),
            accelerometer_topic: None,
            use_log_time: false,
            frame_id: "imu".into(),
            rate_hz: RATE_HZ,
            noise: ImuNoise {
                accelerometer_noise_density: 0.004,
                accelerometer_random_walk: 2e-3,
                gyroscope_noise_density: 3e-4,
                gyroscope_random_walk: 2e-6,
            },
            intrinsics: ImuIntrinsics::default(),
        },
        gimbal_imu: None,
        cameras: Vec::new(),
        gimbal: None,
        ground_truth_topic: None,
        ground_truth_use_log_time: false,
        ground_truth_lever_arm: None,
        required_accuracy: RequiredAccuracy::default(),
        assumed: Vec::new(),
    }
}

/// Error of a term in standard deviations.
fn score(term: &NoiseTerm, truth: f64) -> f64 {
    let (value, sigma) = (term.value.expect(&term.reason), term.sigma.unwrap());
    (value - truth) / sigma
}

#[test]
fn known_terms_are_found_within_their_standard_deviations() {
    let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0);
    for seed in 1..=6 {
        let report = report(seed, 200.0, GYROSCOPE, ACCELEROMETER);
        for (sensor, truth) in report.sensors.iter().zip([GYROSCOPE, ACCELEROMETER]) {
            for (term, truth) in [(&sensor.terms.white, truth.white), (&sensor.terms.random_walk, truth.walk)] {
                let score = score(term, truth);
                worst = worst.max(score.abs());
                squares += score * score;
                count += 1;
            }
            assert_eq!(sensor.terms.quantization.value, None);
            assert!(sensor.terms.white.sigma.unwrap() < 0.04 * truth.white, "{:?}", sensor.terms.white);
        }
    }
    let mean = squares / f64::from(count);
    assert!(worst < 3.5 && (0.2..1.8).contains(&mean), "mean square {mean:.2}, worst {worst:.2}");
}

#[test]
fn a_term_that_does_not_show_is_limited_with_the_stretch_that_it_takes() {
    let weak = Truth { walk: 2e-6, ..GYROSCOPE };
    let report = report(3, 60.0, weak, ACCELEROMETER);
    let walk = &report.sensors[0].terms.random_walk;
    assert_eq!(walk.value, None);
    assert!(walk.limit.is_some_and(|limit| limit > 2e-6 && limit < 2e-4), "{walk:?}");
    // 20 N/K: 3000 s.
    assert!(walk.reason.contains("the rig's 2.0e-6 would show in one stretch of "), "{}", walk.reason);
    assert!(report.sensors[0].terms.bias_instability.value.is_none());
    let lines = report.rig_lines();
    assert!(lines.contains("gyroscope_random_walk: 2.000e-6  # rad/s²/√Hz, as before"), "{lines}");
    assert!(lines.contains("accelerometer_random_walk: "), "{lines}");
}

#[test]
fn the_stretch_that_is_asked_for_shows_the_random_walk() {
    // White noise and random walk with 20 N/K = 100 s.
    let truth = Truth { white: 3e-4, walk: 6e-5, ..Truth::default() };
    let shown = |seconds: f64| {
        (1..=8)
            .filter(|seed| report(*seed, seconds, truth, ACCELEROMETER).sensors[0].terms.random_walk.value.is_some())
            .count()
    };
    let (with, without) = (shown(110.0), shown(20.0));
    assert!(with >= 6 && without <= 1, "{with} of 8 in 110 s, {without} of 8 in 20 s");
}

#[test]
fn quantization_is_a_slope_of_minus_one() {
    // Far below the increments between samples: otherwise the errors of two sums would be correlated.
    let step = 6e-5;
    let coarse = Truth { white: 3e-4, walk: 0.0, step, ..Truth::default() };
    let report = report(5, 120.0, coarse, ACCELEROMETER);
    // Uniform over a step: σ = step/√12.
    let found = report.sensors[0].terms.quantization.value.unwrap();
    assert!((found / (step / 12_f64.sqrt()) - 1.0).abs() < 0.1, "{found}");
    let white = report.sensors[0].terms.white.value.unwrap();
    assert!((white / 3e-4 - 1.0).abs() < 0.1, "{white}");
}

#[test]
fn vibration_does_not_count_as_noise() {
    let shaken = Truth { line: 0.1, walk: 2e-4, ..ACCELEROMETER };
    let report = report(7, 120.0, GYROSCOPE, shaken);
    let accelerometer = &report.sensors[1];
    assert!(accelerometer.vibration[0].starts_with("30 Hz"), "{:?}", accelerometer.vibration);
    assert!(accelerometer.axes[0].points[0].vibration && !accelerometer.axes[0].points.last().unwrap().vibration);
    let white = accelerometer.terms.white.value.unwrap();
    assert!((white / ACCELEROMETER.white - 1.0).abs() < 0.2, "{white}");
}

#[test]
fn a_low_pass_filter_is_no_bias_instability() {
    let smooth = Truth { filter_s: 0.06, walk: 1e-5, ..GYROSCOPE };
    for seed in 1..=4 {
        let report = report(seed, 120.0, smooth, ACCELEROMETER);
        let [gyroscope, accelerometer] = &report.sensors[..] else { panic!("{:?}", report.sensors) };
        assert!(gyroscope.filtered_below_s.is_some_and(|below_s| below_s < 1.0), "{:?}", gyroscope.filtered_below_s);
        assert_eq!(accelerometer.filtered_below_s, None);
        let white = gyroscope.terms.white.value.unwrap();
        assert!((white / smooth.white - 1.0).abs() < 0.1, "{white}");
        let lowest = gyroscope.axes[0].points.iter().map(|point| point.deviation).fold(f64::MAX, f64::min);
        let models: Vec<f64> =
            gyroscope.axes.iter().flat_map(|axis| &axis.points).filter_map(|point| point.model).collect();
        assert!(models.iter().all(|model| *model > 0.0) && !models.is_empty(), "{models:?}");
        let instability = &gyroscope.terms.bias_instability;
        assert!(instability.value.or(instability.limit).unwrap() < 4.0 * lowest, "{instability:?}, {lowest}");
    }
}

#[test]
fn several_stretches_between_motion_are_found_and_combined() {
    let parts = [(0.0, 40.0), (47.0, 85.0), (90.0, 130.0)];
    let series = series(9, &parts, true, GYROSCOPE, ACCELEROMETER);
    let report = measure(&series, None, (0.0, 1e6));
    assert_eq!(report.stretches_s.len(), 3, "{:?}", report.stretches_s);
    for ((from, to), (begin, end)) in parts.iter().zip(&report.stretches_s) {
        assert!(
            (-0.01..1.2).contains(&(begin - from)) && (-0.01..1.2).contains(&(to - end)),
            "{from} {begin} {end} {to}"
        );
    }
    assert!(score(&report.sensors[0].terms.white, GYROSCOPE.white).abs() < 3.5);
    assert!(score(&report.sensors[1].terms.white, ACCELEROMETER.white).abs() < 3.5);
    // Up to 40 s only; then a range without a stretch that is long enough.
    assert_eq!(measure(&series, None, (0.0, 42.0)).stretches_s.len(), 1);
    assert!(!measure(&series, None, (41.0, 52.0)).is_measured());
}
