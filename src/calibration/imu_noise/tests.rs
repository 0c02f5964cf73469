//! Fits of synthetic flights with wrong initial densities.

use std::ops::ControlFlow;

use super::{FlightNoise, fit_imu_noise};
use crate::calibration::tests::fixture::views;
use crate::estimator::EstimatorConfig;
use crate::gimbal::Parameterization;
use crate::simulation::{SyntheticMotion, SyntheticMount, SyntheticOptions, synthetic_tracks};

/// Standard deviation of encoder readings; unused for a rigid camera.
const NO_ENCODERS: f64 = 1.0;

/// Fits a flight of `seconds` whose true densities are the densities of the rig times `factor`.
fn fitted(seed: u64, factor: f64, seconds: f64) -> FlightNoise {
    let flight = synthetic_tracks(&SyntheticOptions {
        mount: SyntheticMount::Static,
        motion: SyntheticMotion::Aggressive,
        seed,
        duration_s: seconds,
        features: 80,
        pixel_sigma_px: 0.25,
        ..SyntheticOptions::default()
    });
    let mut config = EstimatorConfig::for_camera(&flight.given_rig, "cam0", Parameterization::Minimal).unwrap();
    config.imu_noise.gyroscope_noise_density /= factor;
    config.imu_noise.accelerometer_noise_density /= factor;
    fit_imu_noise(&config, &views(&flight, NO_ENCODERS), &mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn densities_of_a_flight_are_found_from_wrong_ones() {
    let factor = 3.0;
    let noise = fitted(2, factor, 14.0);
    let [gyroscope, accelerometer, ..] = &noise.densities;
    assert!(noise.converged, "{noise:?}");
    assert!((noise.pixel_sigma_px / 0.25 - 1.0).abs() < 0.1, "{noise:?}");
    for density in [gyroscope, accelerometer] {
        let (sigma, truth) = (density.sigma.unwrap(), density.given * factor);
        assert!((density.found - truth).abs() < 3.0 * sigma && sigma < 0.6 * truth, "{density:?}, true {truth:.2e}");
    }
    // The residuals have about 250 degrees of freedom of the gyroscope and a dozen of the accelerometer, whose density
    // is kept if its NIS agrees with 1 within two standard deviations.
    assert!((gyroscope.nis_after - 1.0).abs() < 0.1, "{gyroscope:?}");
    let agrees = 2.0 * (2.0 / accelerometer.degrees_of_freedom).sqrt();
    assert!((accelerometer.nis_after - 1.0).abs() < agrees.min(0.8), "{accelerometer:?}");
    assert!(accelerometer.nis_before > 1.0 + agrees, "{accelerometer:?}");
    assert!(gyroscope.nis_before > 1.5 && gyroscope.sigma.unwrap() < 0.12 * gyroscope.found, "{gyroscope:?}");
}
