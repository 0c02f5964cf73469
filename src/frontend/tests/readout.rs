//! Readout of a rolling shutter from simulated tracks of a moving camera.

use nalgebra::{UnitQuaternion, Vector3};

use super::homography::Dice;
use crate::frontend::readout::{ImagePair, ReadoutOptions, RowObservation, RowTrack, measure_readout};
use crate::geometry::{RigidTransform, so3};
use crate::sensors::AngularRates;

const FOCAL_PX: f64 = 360.0;
const HEIGHT_PX: f64 = 480.0;
const STEP_S: f64 = 0.005;

/// Camera that rotates and moves for ten seconds.
struct Flight {
    readout_s: f64,
    /// Factor of the rotation.
    rotation: f64,
    speed_m_per_s: f64,
    /// Time to add to the camera's stamps to obtain the time of the rates, in seconds.
    time_offset_s: f64,
    outlier_ratio: f64,
}

impl Default for Flight {
    fn default() -> Self {
        Self { readout_s: 0.03, rotation: 1.0, speed_m_per_s: 3.0, time_offset_s: 0.0, outlier_ratio: 0.1 }
    }
}

impl Flight {
    fn rate(&self, time_s: f64) -> Vector3<f64> {
        let wave = |hz: f64, phase: f64| (std::f64::consts::TAU * hz * time_s + phase).sin();
        Vector3::new(0.6 * wave(0.7, 0.3) + 0.2 * wave(1.9, 2.0), 0.7 * wave(0.5, 1.0), 0.4 * wave(0.9, 4.0))
            * self.rotation
    }

    /// Poses at multiples of a millisecond.
    fn poses(&self) -> Vec<RigidTransform> {
        let mut pose = RigidTransform::identity();
        let mut poses = vec![pose];
        for step in 0..10_200 {
            let time_s = f64::from(step) * 1e-3;
            let velocity = Vector3::new(1.0, 0.3 * (0.8 * time_s).sin(), (0.5 * time_s).cos()) * self.speed_m_per_s;
            pose.rotation *= so3::exp(&(self.rate(time_s + 5e-4) * 1e-3));
            pose.translation_m += velocity * 1e-3;
            poses.push(pose);
        }
        poses
    }

    /// Row and bearing of a point in the image whose first row is exposed at a time, with noise.
    fn observe(
        poses: &[RigidTransform],
        readout_s: f64,
        first_s: f64,
        point: &Vector3<f64>,
        dice: &mut Dice,
    ) -> Option<RowObservation> {
        let mut row = 0.5;
        let mut uv = [0.0; 2];
        for _ in 0..8 {
            let place = (first_s + row * readout_s) / 1e-3;
            let (from, to) = (poses.get(place as usize)?, poses.get(place as usize + 1)?);
            let fraction = place.fract();
            let rotation = from.rotation.slerp(&to.rotation, fraction);
            let centre = from.translation_m.lerp(&to.translation_m, fraction);
            let seen = rotation.inverse() * (point - centre);
            if seen.z < 0.3 {
                return None;
            }
            uv = [seen.x / seen.z, seen.y / seen.z];
            row = uv[1] * FOCAL_PX / HEIGHT_PX + 0.5;
        }
        let noise = 0.3 / FOCAL_PX;
        let bearing = Vector3::new(uv[0] + noise * dice.normal(), uv[1] + noise * dice.normal(), 1.0).normalize();
        ((0.0..1.0).contains(&row) && uv[0].abs() < 0.9).then_some(RowObservation { bearing, row })
    }

    fn images(&self, seed: u64) -> (Vec<ImagePair>, AngularRates) {
        let mut dice = Dice(seed);
        let poses = self.poses();
        let pair = |index: usize| {
            let stamps_s = [0.3 + index as f64 * 0.05, 0.35 + index as f64 * 0.05];
            let pose = &poses[(stamps_s[0] * 1e3) as usize];
            let mut tracks = Vec::new();
            for _ in 0..160 {
                let depth_m = 3.0 * (20.0_f64 / 3.0).powf(dice.uniform());
                let ray = Vector3::new(1.6 * dice.uniform() - 0.8, 1.2 * dice.uniform() - 0.6, 1.0);
                let point = pose.transform(&(ray * depth_m));
                let mut observe = |stamp_s: f64| Self::observe(&poses, self.readout_s, stamp_s, &point, &mut dice);
                let (Some(previous), Some(mut now)) = (observe(stamps_s[0]), observe(stamps_s[1])) else { continue };
                if dice.uniform() < self.outlier_ratio {
                    let wrong = Vector3::new(dice.normal(), dice.normal(), 0.0) * (10.0 / FOCAL_PX);
                    now.bearing = (now.bearing + wrong).normalize();
                }
                tracks.push(RowTrack { previous, now });
            }
            ImagePair { stamps_s, tracks, ..ImagePair::default() }
        };
        let images = (0..180).map(pair).collect();
        // Gyroscope with a time offset, bias, noise and axes with an error of two degrees.
        let wrong: UnitQuaternion<f64> = so3::exp(&Vector3::new(0.02, -0.03, 0.01));
        let samples = (0..2040).map(|step| {
            let time_s = f64::from(step) * STEP_S;
            let noise = Vector3::from_fn(|_, _| 0.005 * dice.normal());
            (time_s + self.time_offset_s, wrong * self.rate(time_s) + noise + Vector3::new(0.01, -0.02, 0.015))
        });
        (images, AngularRates::new(samples))
    }
}

fn check(name: &str, flight: &Flight, largest_sigma_s: f64) {
    for seed in 1..3 {
        let (images, rates) = flight.images(seed * 7919);
        let found = measure_readout(&images, Some(&rates), &ReadoutOptions::for_focal_length(FOCAL_PX)).unwrap();
        let error_s = found.readout_s - flight.readout_s;
        // The sigma contains two percent of the readout in addition to the random part.
        let largest_sigma_s = largest_sigma_s.hypot(0.02 * flight.readout_s);
        assert!(found.sigma_s < largest_sigma_s, "{name}, seed {seed}: {found:?}");
        assert!(error_s.abs() < 4.0 * found.sigma_s, "{name}, seed {seed}: {found:?}, error {error_s}");
    }
}

#[test]
fn a_readout_is_measured_with_and_without_parallax() {
    check("flight", &Flight::default(), 1.2e-3);
    check("upwards", &Flight { readout_s: -0.02, ..Flight::default() }, 1.2e-3);
    check("global", &Flight { readout_s: 0.0, ..Flight::default() }, 1.2e-3);
    check("rotation alone", &Flight { speed_m_per_s: 0.0, ..Flight::default() }, 1e-3);
}

#[test]
fn an_offset_of_the_clocks_is_no_readout() {
    for time_offset_s in [-0.04, 0.03] {
        for readout_s in [0.0, 0.03] {
            let flight = Flight { readout_s, time_offset_s, ..Flight::default() };
            check("offset", &flight, 2e-3);
            let (images, rates) = flight.images(99);
            let found = measure_readout(&images, Some(&rates), &ReadoutOptions::for_focal_length(FOCAL_PX)).unwrap();
            assert!((found.time_offset_s - time_offset_s).abs() < 0.004, "{found:?}");
        }
    }
}

#[test]
fn without_rotation_the_readout_is_not_known() {
    let flight = Flight { rotation: 0.01, speed_m_per_s: 0.2, ..Flight::default() };
    let (images, rates) = flight.images(5);
    let found = measure_readout(&images, Some(&rates), &ReadoutOptions::for_focal_length(FOCAL_PX));
    assert_eq!(found, None);
    let (images, rates) = Flight::default().images(5);
    let options = ReadoutOptions::for_focal_length(FOCAL_PX);
    assert_eq!(measure_readout(&images[..8], Some(&rates), &options), None);
    assert_eq!(measure_readout(&images, Some(&AngularRates::default()), &options), None);
}
