//! Data that no sensor measured, and data that are recorded twice.

use super::Severity::{Error, Warning};
use super::*;

/// Checks that no finding has one of these titles.
fn expect_none(flight: &Flight, titles: &[&str]) {
    let report = flight.check(&[]);
    for title in titles {
        assert!(!report.findings.iter().any(|finding| finding.title.contains(title)), "{title} in\n{report}");
    }
}

#[test]
fn samples_of_the_imu_that_are_no_measurement_are_counted_and_not_used() {
    let imu = |imu| Flight { imu, ..Flight::default() };
    let zeros = imu(|ms, _, rate, force| {
        if ms % 500 == 250 {
            (*rate, *force) = (Vector3::zeros(), Vector3::zeros());
        }
        true
    });
    let words =
        ["exactly zero in all six values", "24 of 2400 samples (1.0 %), the first at 0.250 s, the last at 11.750 s"];
    expect(&zeros, Warning, &words);
    // Other checks have the samples without zeros.
    let report = zeros.check(&[]);
    let warnings = report.findings.iter().filter(|finding| finding.severity >= Warning);
    assert_eq!(warnings.count(), 1, "{report}");
    let no_force = imu(|ms, _, _, force| {
        if ms % 500 == 250 {
            *force = Vector3::zeros();
        }
        true
    });
    expect(&no_force, Warning, &["specific forces of the IMU are exactly zero", "24 of 2400"]);
    let no_rate = imu(|ms, _, rate, _| {
        if ms % 1000 == 0 && ms > 6000 {
            *rate = Vector3::zeros();
        }
        true
    });
    expect(&no_rate, Warning, &["angular velocities of the IMU are exactly zero during a rotation", "5 of 2400"]);
    let frozen = imu(|ms, _, rate, force| {
        if (6000..6500).contains(&ms) {
            (*rate, *force) = (Vector3::new(0.2, 0.1, 0.3), Vector3::new(0.1, 0.0, 9.8));
        }
        true
    });
    expect(
        &frozen,
        Warning,
        &["the values of the IMU freeze", "99 of 2400", "the first at 6.005 s, the last at 6.495 s"],
    );
}

#[test]
fn a_simulated_imu_without_noise_that_stands_still_is_not_frozen() {
    let ideal = |ms: i64, _: &mut MessageTimes, rate: &mut Vector3<f64>, force: &mut Vector3<f64>| {
        let moving = !(6000..9000).contains(&ms);
        *rate = if moving { rate_at(ms as f64 * 1e-3) } else { Vector3::zeros() };
        *force = Vector3::new(0.3 * rate.x, 0.0, 9.81);
        true
    };
    let flight = Flight { imu: ideal, ..Flight::default() };
    expect_none(&flight, &["freeze", "exactly zero", "IMU samples repeat"]);
    let twice = |ms: i64, _: &mut MessageTimes, rate: &mut Vector3<f64>, force: &mut Vector3<f64>| {
        *rate = rate_at((ms / 10) as f64 * 0.01);
        *force = Vector3::new(0.3 * rate.x, 0.01 * (ms / 10 % 7) as f64, 9.81);
        true
    };
    expect(&Flight { imu: twice, ..Flight::default() }, Warning, &["IMU samples repeat", "equal the previous one"]);
}

#[test]
fn copies_of_images_are_found_if_something_moves() {
    let image = |image| Flight { image, ..Flight::default() };
    let twice = image(|ms, _, image| {
        *image = texture(ms as usize / 100);
        true
    });
    // The first copy is not known to be one.
    expect(&twice, Warning, &["every second image of cam0 is a copy of the one before", "119 of 240 images (50 %)"]);
    let stalled = image(|ms, _, image| {
        *image = texture(if (7000..8000).contains(&ms) { 140 } else { ms as usize / 50 });
        true
    });
    expect(&stalled, Warning, &["images of cam0 are copies of the one before", "19 of 240", "first at 7.060 s"]);
    let stationary = image(|ms, _, image| {
        *image = texture(ms.max(2500) as usize / 50);
        true
    });
    expect_none(&stationary, &["copies of the one before", "copy of the one before"]);
    let covered = image(|_, _, image| {
        image.pixels.fill(3);
        true
    });
    expect_none(&covered, &["copies of the one before", "copy of the one before"]);
}

#[test]
fn joint_angles_that_freeze_during_a_rotation_are_an_error() {
    let joint = |joint| Flight { joint, ..Flight::default() };
    let frozen = joint(|ms, angle| *angle = if ms > 6000 { 0.3 } else { *angle });
    expect(&frozen, Error, &["readings of 'yaw' freeze at +17.19°", "300 of 600 readings", "to the last"]);
    // An encoder with steps of 1°, and one that stands while the vehicle does.
    let coarse = joint(|ms, angle| *angle = (0.7 * (9e-4 * ms as f64).sin() * 57.3).round() / 57.3);
    expect_none(&coarse, &["freeze"]);
    expect_none(&joint(|ms, angle| *angle = if ms < 2400 { 0.0 } else { *angle }), &["freeze"]);
}

#[test]
fn two_publishers_on_one_topic_are_an_error() {
    let second = |second_imu| Flight { second_imu, ..Flight::default() };
    let two = "two publishers send on the topic of imu0";
    let other_frame = second(|_, (_, times, rate, force)| Some(("imu2", times, rate.zyx(), force.zyx())));
    expect(&other_frame, Error, &[two, "frame_id 'imu' in 2400 messages, 'imu2' in 2400 messages"]);
    let between = second(|_, (frame, times, rate, force)| {
        let times = MessageTimes { stamp_ns: times.stamp_ns + 2 * MS, ..times };
        Some((frame, times, rate.zyx(), force + Vector3::x()))
    });
    expect(&between, Error, &[two, "400.0 Hz, 2.0 times the rate of the rig", "2.00 and 3.00 ms in turn"]);
    expect_none(&between, &["rate of imu0", "imu0 is stamped on arrival"]);
    let evenly = second(|_, (frame, times, rate, force)| {
        let times = MessageTimes { stamp_ns: times.stamp_ns + 5 * MS / 2, ..times };
        Some((frame, times, rate, Vector3::new(force.z, force.y, force.x)))
    });
    expect(&evenly, Error, &[two, "values that differ by", "m/s²"]);
    let earlier = second(|_, (frame, times, rate, force)| {
        Some((frame, MessageTimes { stamp_ns: times.stamp_ns - 301 * MS, ..times }, rate.zyx(), force))
    });
    expect(&earlier, Error, &[two, "0.301 s apart in the median"]);
}

#[test]
fn measurements_that_are_recorded_twice_are_found() {
    let second = |second_imu| Flight { second_imu, ..Flight::default() };
    let relayed = second(|_, message| Some(message));
    expect(&relayed, Warning, &["messages of imu0 are sent twice", "2400 of 4800 messages", "are dropped"]);
    expect_none(&relayed, &["two publishers", "run backwards", "rate of imu0", "stamps of imu0 repeat"]);
    let delayed = second(|_, (frame, times, rate, force)| {
        let times = MessageTimes { stamp_ns: times.stamp_ns + 12 * MS, log_time_ns: times.log_time_ns + 12 * MS };
        Some((frame, times, rate, force))
    });
    let words = ["measurements of imu0 are recorded twice under different stamps", "12.0 ms earlier in the median"];
    expect(&delayed, Error, &words);
}
