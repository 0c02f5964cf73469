//! Clocks, time offsets of the rig, and stamps that were never set.

use super::Severity::{Error, Good, Warning};
use super::*;

const TAI_NS: i64 = 37_000 * MS;

/// Images stamped by a clock in TAI.
fn in_tai(_: i64, times: &mut MessageTimes, _: &mut GrayImage) -> bool {
    times.stamp_ns += TAI_NS;
    true
}

/// Rig with another time offset of its camera.
fn shifted(shift: &str) -> String {
    rig_text().replace("timeshift_cam_imu: 0.0", &format!("timeshift_cam_imu: {shift}"))
}

#[test]
fn a_time_offset_of_another_clock_is_named_and_confirmed() {
    let flight = Flight { image: in_tai, ..Flight::default() };
    let set = "set cam0.timeshift_cam_imu: -37.0 (its clock is in TAI, 37 s ahead of UTC)";
    expect(&flight, Error, &["cam0 and imu0 are stamped by different clocks", "cam0 -36982.0 ms", set]);
    let followed = Flight { rig: shifted("-37.0"), ..flight };
    expect(&followed, Good, &["the log times confirm cam0.timeshift_cam_imu", "-36.982 s without it"]);
    expect(&followed, Good, &["all sensors appear to be stamped by one clock", "cam0 18.0 ms"]);
    let report = followed.check(&[]);
    assert!(report.worst() < Warning, "{report}");
    // The wrong sign.
    let flight = Flight { rig: shifted("37.0"), ..followed };
    expect(&flight, Error, &["cam0 and imu0 are stamped by different clocks", "cam0 -73982.0 ms", set]);
}

#[test]
fn an_offset_is_confirmed_by_the_times_of_the_imu_where_log_times_say_nothing() {
    let image = |_: i64, times: &mut MessageTimes, _: &mut GrayImage| {
        times.stamp_ns += TAI_NS;
        times.log_time_ns = times.stamp_ns;
        true
    };
    let flight = Flight { image, rig: shifted("-37.0"), ..Flight::default() };
    expect(&flight, Good, &["the times of the IMU confirm cam0.timeshift_cam_imu"]);
}

#[test]
fn a_large_offset_that_nothing_confirms_is_reported() {
    let flight = Flight { rig: shifted("0.15"), ..Flight::default() };
    expect(&flight, Warning, &["cam0.timeshift_cam_imu is large", "check its sign"]);
}

#[test]
fn log_times_replace_stamps_that_were_never_set() {
    let image = |_: i64, times: &mut MessageTimes, _: &mut GrayImage| {
        times.stamp_ns = 0;
        true
    };
    let flight = Flight { image, ..Flight::default() };
    expect(&flight, Error, &["all stamps of cam0 are equal", "240 messages", "set cam0.use_log_time: true in the rig"]);
    // One finding is enough.
    let report = flight.check(&[]);
    assert!(!report.findings.iter().any(|finding| finding.title.contains("not of the log's time")), "{report}");
    let rig = rig_text().replace("rostopic: /camera/image", "rostopic: /camera/image\n  use_log_time: true");
    let report = Flight { rig, ..flight }.check(&[]);
    assert!(report.worst() < Warning, "{report}");
    let used = &report.topics[1];
    assert!((used.first_s - 0.028).abs() < 1e-9 && used.latency_s == Some(0.0), "{report}");
}

#[test]
fn stamps_that_step_or_are_rounded_are_named() {
    let step = |ms: i64, times: &mut MessageTimes, _: &mut GrayImage| {
        times.stamp_ns -= if ms > 6000 { 50 * MS } else { 0 };
        !(6000..6050).contains(&ms)
    };
    let words = ["stamps of cam0 are 50 ms earlier from 6.0 s on", "changes by +50.0 ms there"];
    expect(&Flight { image: step, ..Flight::default() }, Warning, &words);
    let rounded = |_: i64, times: &mut MessageTimes, _: &mut GrayImage| {
        let tick_ns = 1_000_000_000 / 64;
        times.stamp_ns -= times.stamp_ns % tick_ns;
        true
    };
    let words = ["stamps of cam0 are rounded to multiples of 15.6 ms", "where the mean step is 50.0 ms"];
    expect(&Flight { image: rounded, ..Flight::default() }, Warning, &words);
}
