//! Data that no sensor measured, and stamps that were never set, on their way to the estimator.

use super::*;
use crate::flight_log::WarningKind;
use crate::geometry::seconds_from_ns;

/// Number of messages or images in the warnings of one kind.
fn counted(warnings: &[LogWarning], is_kind: impl Fn(WarningKind) -> bool) -> usize {
    warnings.iter().filter(|warning| is_kind(warning.kind)).map(|warning| warning.count).sum()
}

#[test]
fn zero_samples_are_interpolated_over() {
    let imu = |at: &mut i64, rate: &mut Vector3<f64>, force: &mut Vector3<f64>| {
        if *at % (100 * MS) == 50 * MS {
            (*rate, *force) = (Vector3::zeros(), Vector3::zeros());
        }
        true
    };
    let (frames, warnings) = play(&Flight { imu, ..Flight::default() }, RIG, 0.0);
    assert_eq!(frames.len(), 60);
    for sample in frames.iter().flat_map(|frame| &frame.imu) {
        let time_s = seconds_from_ns(sample.stamp_ns);
        assert!((sample.angular_velocity_rad_per_s - Vector3::new(time_s, 0.0, 0.4)).norm() < 1e-12, "{sample:?}");
        assert!((sample.specific_force_m_per_s2 - Vector3::new(0.0, 0.1 * time_s, 9.81)).norm() < 1e-12, "{sample:?}");
    }
    assert_eq!(counted(&warnings, |kind| kind == WarningKind::Dropped("all six values are exactly zero")), 30);
    assert_eq!(warnings.len(), 30, "{warnings:?}");
}

#[test]
fn a_topic_without_forces_keeps_its_samples() {
    let imu = |_: &mut i64, _: &mut Vector3<f64>, force: &mut Vector3<f64>| {
        *force = Vector3::zeros();
        true
    };
    let (frames, warnings) = play(&Flight { imu, ..Flight::default() }, RIG, 0.0);
    assert_eq!((frames.len(), warnings.len()), (60, 0), "{warnings:?}");
    assert_eq!(frames[5].imu.len(), 12);
}

#[test]
fn copies_of_images_are_skipped() {
    let shown = |stamp_ns: i64| stamp_ns / (100 * MS) * (100 * MS);
    let (frames, warnings) = play(&Flight { shown, ..Flight::default() }, RIG, 0.0);
    assert_eq!(frames.iter().map(|frame| frame.index).collect::<Vec<_>>(), (0..60).step_by(2).collect::<Vec<_>>());
    assert_eq!(counted(&warnings, |kind| kind == WarningKind::ImageCopy), 30);
    assert_eq!(warnings.len(), 30, "{warnings:?}");
    // The IMU samples of a copy's interval belong to the next image.
    assert_eq!(frames[5].imu.len(), 22);
    let constant = Flight {
        shown: |_| 0,
        imu: |_, rate, _| {
            *rate = Vector3::zeros();
            true
        },
        ..Flight::default()
    };
    let (frames, _) = play(&constant, RIG, 0.0);
    assert_eq!(frames.len(), 60, "nothing moves");
}

#[test]
fn pauses_between_batches_are_no_gaps() {
    let batches = |at: &mut i64, _: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        let place = *at / (5 * MS) % 6;
        *at += (5 - place) * 5 * MS - (5 - place) * MS / 5;
        true
    };
    let (_, warnings) = play(&Flight { imu: batches, ..Flight::default() }, RIG, 0.0);
    assert_eq!(counted(&warnings, |kind| kind == WarningKind::ImuGap), 0, "{warnings:?}");
    let interrupted = |at: &mut i64, _: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        let keep = !(1500 * MS..1800 * MS).contains(at);
        let place = *at / (5 * MS) % 6;
        *at += (5 - place) * 5 * MS - (5 - place) * MS / 5;
        keep
    };
    let (_, warnings) = play(&Flight { imu: interrupted, ..Flight::default() }, RIG, 0.0);
    assert_eq!(counted(&warnings, |kind| kind == WarningKind::ImuGap), 1, "{warnings:?}");
    warning_with(&warnings, &["/imu: no samples for 0.329 s from 1.493 s on"]);
}

#[test]
fn log_times_replace_stamps_if_the_rig_says_so() {
    let unset = |at: &mut i64, _: &mut [usize; 2]| {
        *at = -EPOCH_NS;
        true
    };
    let flight = Flight { image: unset, ..Flight::default() };
    let (frames, warnings) = play(&flight, RIG, 0.0);
    assert_eq!(frames.len(), 0);
    warning_with(
        &warnings,
        &["/camera: 60 messages from 0.045 s to 2.995 s dropped", "never set", "use_log_time: true"],
    );
    let rig = RIG.replace("rostopic: /camera\n", "rostopic: /camera\n  use_log_time: true\n");
    let (frames, warnings) = play(&flight, &rig, 0.0);
    assert_eq!(warnings, []);
    // The last image is logged with the last IMU sample.
    let stamps: Vec<i64> = frames.iter().map(|frame| frame.stamp_ns).collect();
    assert_eq!(stamps, (0..60).map(|number| (45 + 50 * number) * MS).collect::<Vec<_>>());
    let folder = TempDir::new().unwrap();
    let log = Arc::new(FlightLog::open(&flight.write(folder.path())).unwrap());
    let images = super::super::ImageReader::new(log, &rig_from(&rig)).stamps_ns("cam0");
    assert_eq!(images.first(), Some(&(0, 45 * MS)));
}
