//! Tests: a camera whose clock, axes and rotation differ from the vehicle's.

use nalgebra::Vector3;

use super::super::recorded::RecordedImu;
use super::{camera_moves, clock_by_forces};
use crate::geometry::{ns_from_seconds, seconds_from_ns};

const RATE_HZ: f64 = 100.0;
const START_NS: i64 = 1_700_000_000_000_000_000;

/// IMU over 40 s: of a vehicle, or of a camera in its centre with other axes, whose clock starts at `start_s` of the
/// vehicle's and loses 50 ppm; `swing` is the amplitude of a gimbal's yaw rate in rad/s.
fn imu(camera: Option<(f64, f64)>) -> RecordedImu {
    let (start_s, swing) = camera.unwrap_or((0.0, 0.0));
    let mut imu = RecordedImu::default();
    for sample in 0..4000 {
        let own_s = f64::from(sample) / RATE_HZ;
        let time_s = if camera.is_some() { start_s + own_s * (1.0 + 5e-5) } else { own_s };
        let rate = Vector3::new((1.3 * time_s).sin(), 0.5 * (0.7 * time_s).cos(), 0.3 * (2.1 * time_s).sin());
        let force = Vector3::new((0.9 * time_s).sin(), (3.1 * time_s).cos(), 9.81 + (0.1 * time_s * time_s).sin());
        // Axes of the camera: a permutation.
        let (rate, force) = if camera.is_some() { (rate.zxy(), force.zxy()) } else { (rate, force) };
        let rate = rate + Vector3::new(0.0, swing * (1.1 * time_s).sin(), 0.0);
        imu.combined.push((START_NS * i64::from(camera.is_none()) + ns_from_seconds(own_s), [rate, force]));
    }
    imu
}

#[test]
fn the_offset_of_a_camera_is_found_by_the_specific_forces() {
    let (vehicle, camera) = (imu(None), imu(Some((-7.25, 0.8))));
    let guess_ns = START_NS + 5_000_000_000;
    let found = clock_by_forces(&vehicle, &camera, guess_ns).expect("the forces agree");
    let error_s = seconds_from_ns(found.start_ns - START_NS) + 7.25;
    assert!(error_s.abs() < 0.002 && (found.drift - 5e-5).abs() < 5e-5, "{error_s} s, {found:?}");
    assert!(found.agreement.correlation > 0.95 && found.agreement.offset_sigma_s < 0.002, "{found:?}");
    // Farther away than the search reaches, and a vehicle that does not move.
    assert_eq!(clock_by_forces(&vehicle, &camera, guess_ns + 90_000_000_000), None);
    let mut still = vehicle;
    still.combined.iter_mut().for_each(|(_, [_, force])| *force = Vector3::new(0.0, 0.0, 9.81));
    assert_eq!(clock_by_forces(&still, &camera, guess_ns), None);
    assert_eq!(clock_by_forces(&RecordedImu::default(), &camera, guess_ns), None);
}

#[test]
fn a_gimbal_and_a_rigid_camera_are_distinguished_by_the_angular_rates() {
    let placed = |swing: f64| {
        let mut camera = imu(Some((2.0, swing)));
        camera.combined.iter_mut().for_each(|(time_ns, _)| *time_ns += START_NS + 2_000_000_000);
        camera
    };
    let vehicle = imu(None);
    assert_eq!(camera_moves(&vehicle, &placed(0.8)), Some(true));
    assert_eq!(camera_moves(&vehicle, &placed(0.0)), Some(false));
    let mut still = vehicle.clone();
    still.combined.iter_mut().for_each(|(_, [rate, _])| *rate = Vector3::new(0.02, 0.0, 0.0));
    assert_eq!(camera_moves(&still, &still), None);
    assert_eq!(camera_moves(&vehicle, &RecordedImu::default()), None);
}
