use nalgebra::{UnitQuaternion, Vector3};

use super::*;
use crate::geometry::ns_from_seconds;
use crate::log_check::tests::Noise;
use crate::sensors::AngularRates;

const MS: i64 = 1_000_000;

/// Angular velocity of a hand-held camera: aperiodic, about all axes, in rad/s.
fn rate(time_s: f64) -> Vector3<f64> {
    let wave = |frequencies: [f64; 3], phase: f64| -> f64 {
        frequencies.iter().enumerate().map(|(k, f)| (f * time_s + phase + 1.7 * k as f64).sin()).sum()
    };
    0.25 * Vector3::new(wave([0.83, 2.17, 5.3], 0.1), wave([0.57, 1.91, 4.4], 1.3), wave([1.13, 2.71, 3.9], 2.2))
}

/// Gyroscope at 200 Hz with bias and noise, between two times in seconds of its clock.
fn gyroscope(from_s: f64, to_s: f64, rate: impl Fn(f64) -> Vector3<f64>) -> AngularRates {
    let mut random = Noise(7);
    let samples = (0..((to_s - from_s) * 200.0) as i64).map(|k| {
        let time_s = from_s + 0.005 * k as f64;
        let noise = 0.01 * random.vector();
        (time_s, rate(time_s) + noise + Vector3::new(0.01, -0.02, 0.005))
    });
    AngularRates::new(samples)
}

struct Video {
    /// Time of the reference's clock at time 0 of the camera's clock, in seconds.
    offset_s: f64,
    drift: f64,
    start_s: f64,
    count: i64,
    camera_from_body: UnitQuaternion<f64>,
    scale: f64,
    noise_rad: f64,
}

impl Default for Video {
    fn default() -> Self {
        Self {
            offset_s: 17.432,
            drift: 30e-6,
            start_s: 3.0,
            count: 900,
            camera_from_body: so3::exp(&Vector3::new(1.2, -0.8, 0.5)),
            scale: 0.93,
            noise_rad: 0.002,
        }
    }
}

impl Video {
    /// Rotations between the images of a camera at 30 Hz that is rigidly mounted on the body.
    fn rotations(&self, rate: impl Fn(f64) -> Vector3<f64>) -> Vec<ImageRotation> {
        let mut random = Noise(11);
        let stamp_ns = |number: i64| ns_from_seconds(self.start_s) + number * 33_366_667;
        let rotation = |number: i64| {
            let (from_ns, to_ns) = (stamp_ns(number), stamp_ns(number + 1));
            let on_reference = |ns: i64| seconds_from_ns(ns) * (1.0 + self.drift) + self.offset_s;
            let (from_s, to_s) = (on_reference(from_ns), on_reference(to_ns));
            let steps = 20;
            let mut first_from_now = UnitQuaternion::identity();
            for step in 0..steps {
                let time_s = from_s + (to_s - from_s) * (f64::from(step) + 0.5) / f64::from(steps);
                first_from_now *= so3::exp(&(rate(time_s) * ((to_s - from_s) / f64::from(steps))));
            }
            let vector = self.camera_from_body * so3::log(&first_from_now.inverse()) * self.scale;
            let mut noise = self.noise_rad * random.vector();
            // One image in fifty is matched wrongly.
            if number % 50 == 17 {
                noise += Vector3::new(0.2, -0.1, 0.15);
            }
            let second_from_first = so3::exp(&(vector + noise));
            ImageRotation { camera_key: "cam0".to_owned(), from_ns, to_ns, second_from_first, tracks: Vec::new() }
        };
        (0..self.count).map(rotation).collect()
    }

    /// Offset at the middle of the rotations.
    fn offset_at(&self, middle_s: f64) -> f64 {
        self.offset_s + self.drift * middle_s
    }
}

#[test]
fn offset_drift_rotation_and_scale_are_found() {
    let reference = RotationReference::Gyroscope(gyroscope(0.0, 150.0, rate));
    for video in [
        Video::default(),
        Video { offset_s: -2.251, drift: -50e-6, count: 3000, ..Video::default() },
        Video { offset_s: 58.7, count: 300, scale: 1.1, ..Video::default() },
    ] {
        let found = align_clocks(&video.rotations(rate), &reference, 0.0, 60.0).unwrap();
        let expected_s = video.offset_at(found.middle_s);
        assert!((found.offset_s - expected_s).abs() < 0.002, "{} {expected_s}", found.offset_s);
        assert!((found.offset_s - expected_s).abs() < 4.0 * found.offset_sigma_s && found.offset_sigma_s < 0.003);
        assert!((found.drift_ppm - video.drift * 1e6).abs() < 4.0 * found.drift_sigma_ppm);
        assert!((found.scale - video.scale).abs() < 0.02, "{}", found.scale);
        let rotation = so3::exp(&Vector3::from(found.camera_from_body_rad));
        assert!(rotation.angle_to(&video.camera_from_body).to_degrees() < 1.0);
        let camera_ns = ns_from_seconds(video.start_s + 20.0);
        let expected = video.offset_at(video.start_s + 20.0);
        assert!((seconds_from_ns(found.shift_ns(camera_ns)) - expected).abs() < 0.005);
    }
}

/// Over many seeds the errors agree with their standard deviations.
#[test]
fn the_standard_deviation_of_the_offset_is_that_of_its_errors() {
    let mut squares = 0.0;
    let count = 12;
    for seed in 0..count {
        let video = Video { offset_s: 9.0 + 0.37 * f64::from(seed), count: 400, ..Video::default() };
        let found =
            align_clocks(&video.rotations(rate), &RotationReference::Gyroscope(gyroscope(0.0, 60.0, rate)), 10.0, 8.0)
                .unwrap();
        squares += ((found.offset_s - video.offset_at(found.middle_s)) / found.offset_sigma_s).powi(2);
    }
    let ratio = (squares / f64::from(count)).sqrt();
    assert!((0.4..1.8).contains(&ratio), "{ratio}");
}

/// Stabilized camera with an attitude from encoders, accurate to 0.5° at 25 Hz: from one image to the next it rotates
/// less.
#[test]
fn a_noisy_reference_gives_neither_a_bias_nor_a_small_standard_deviation() {
    let slow = |time_s: f64| 0.25 * rate(time_s);
    let mut squares = 0.0;
    let count: u8 = 8;
    for seed in 0..count {
        let mut noise = Noise(100 + u64::from(seed));
        let exact = gyroscope(0.0, 60.0, slow);
        let stamps_ns = (0..60 * 25).map(|number| number * 40 * MS);
        let orientations = stamps_ns.filter_map(|stamp_ns| {
            let orientation = exact.orientation_at(seconds_from_ns(stamp_ns))?;
            Some((stamp_ns, orientation * so3::exp(&(noise.vector() * 0.5_f64.to_radians()))))
        });
        let reference = RotationReference::from_orientations(orientations);
        let video = Video { noise_rad: 0.0005, scale: 1.0, offset_s: 5.0 + 0.3 * f64::from(seed), ..Video::default() };
        let found = align_clocks(&video.rotations(slow), &reference, 6.0, 15.0).unwrap();
        let error_s = found.offset_s - video.offset_at(found.middle_s);
        assert!(error_s.abs() < 0.06, "{error_s}");
        squares += (error_s / found.offset_sigma_s).powi(2);
    }
    let ratio = (squares / f64::from(count)).sqrt();
    assert!((0.3..2.0).contains(&ratio), "{ratio}");
}

#[test]
fn periodic_motion_is_ambiguous() {
    let periodic = |time_s: f64| Vector3::new(0.5 * (2.0 * time_s).sin(), 0.3 * (4.0 * time_s).cos(), 0.1);
    let error = align_clocks(
        &Video::default().rotations(periodic),
        &RotationReference::Gyroscope(gyroscope(0.0, 150.0, periodic)),
        0.0,
        60.0,
    );
    let error = error.unwrap_err();
    assert!(matches!(error, AlignmentError::Ambiguous { .. }), "{error}");
    assert!(error.to_string().contains("it is ambiguous"), "{error}");
}

#[test]
fn unrelated_motion_is_refused() {
    let other = |time_s: f64| rate(3.0 * time_s + 500.0).yzx();
    let error = align_clocks(
        &Video::default().rotations(other),
        &RotationReference::Gyroscope(gyroscope(0.0, 150.0, rate)),
        0.0,
        60.0,
    )
    .unwrap_err();
    assert!(matches!(error, AlignmentError::NoAgreement { .. }), "{error}");
}

#[test]
fn a_camera_at_rest_and_short_recordings_are_refused() {
    let reference = RotationReference::Gyroscope(gyroscope(0.0, 150.0, rate));
    let check = |video: &Video, scale: f64, expected: &str| {
        let error = align_clocks(&video.rotations(|time_s| scale * rate(time_s)), &reference, 0.0, 60.0).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    };
    check(&Video { noise_rad: 1e-5, ..Video::default() }, 1e-3, "too little to compare");
    check(&Video { count: 20, ..Video::default() }, 1.0, "only 20 rotations between images");
    check(&Video { start_s: 500.0, ..Video::default() }, 1.0, "no offset lets at least 40 image rotations overlap");
}
