//! Joint angles that stop changing although the vehicle rotates.

use crate::faults::FaultKind;
use crate::flight_log::imu::filter::ROTATING_RAD_PER_S;
use crate::flight_log::joints::JointReading;
use crate::geometry::seconds_from_ns;
use crate::log_check::imu::ImuFacts;
use crate::log_check::report::{Area, Findings, Measurement, Severity};
use crate::log_check::survey::Survey;
use crate::sensors::{Joint, Rig};

/// Smallest number of equal readings in an interval that counts as frozen.
const FROZEN_READINGS: usize = 20;
/// Shortest interval of equal readings that counts as frozen, in nanoseconds.
const FROZEN_NS: i64 = 200_000_000;
/// Smallest ratio of readings that differ from the one before outside of frozen intervals: an encoder with coarse steps
/// repeats its readings while it works.
const MIN_CHANGING: f64 = 0.95;
/// A reading this close to a limit, in radians, counts as at the limit: at its stop a joint may repeat a reading.
pub(super) const AT_LIMIT_RAD: f64 = 0.01;

/// Reports encoders whose readings always differ from the one before, except in intervals in which the vehicle rotates
/// and they stay equal.
pub(crate) fn check_frozen_joints(survey: &Survey, rig: &Rig, imu: &ImuFacts, findings: &mut Findings) {
    let encoders = rig.gimbal.as_ref().filter(|gimbal| gimbal.attitude.is_none());
    for (number, joint) in encoders.iter().flat_map(|gimbal| gimbal.joints.iter().enumerate()) {
        let reading = |message: &JointReading| Some((message.stamp_ns, (*message.angles_rad.get(number)?)?));
        let mut readings: Vec<(i64, f64)> = survey.joints.iter().filter_map(reading).collect();
        readings.sort_by_key(|(stamp_ns, _)| *stamp_ns);
        readings.dedup_by_key(|(stamp_ns, _)| *stamp_ns);
        check_joint(joint, &readings, imu, findings);
    }
}

fn check_joint(joint: &Joint, readings: &[(i64, f64)], imu: &ImuFacts, findings: &mut Findings) {
    let equal: Vec<&[(i64, f64)]> = readings.chunk_by(|one, other| one.1 == other.1).collect();
    let is_long = |interval: &&[(i64, f64)]| interval.len() >= FROZEN_READINGS && length_ns(interval) >= FROZEN_NS;
    let outside: usize = equal.iter().filter(|interval| !is_long(interval)).map(|interval| interval.len()).sum();
    let changes = equal.iter().filter(|interval| !is_long(interval)).count();
    if outside < FROZEN_READINGS || (changes as f64) < MIN_CHANGING * outside as f64 {
        return;
    }
    let (lower_rad, upper_rad) = joint.limits_rad;
    let within_limits = |interval: &&[(i64, f64)]| {
        let angle_rad = interval[0].1;
        angle_rad > lower_rad + AT_LIMIT_RAD && angle_rad < upper_rad - AT_LIMIT_RAD
    };
    let rotates = |interval: &&[(i64, f64)]| {
        let (from_ns, to_ns) = (interval[0].0, interval[interval.len() - 1].0);
        let inside = imu.samples.iter().filter(|sample| (from_ns..=to_ns).contains(&sample.stamp_ns));
        inside.clone().filter(|sample| sample.angular_velocity_rad_per_s.norm() > ROTATING_RAD_PER_S).count() * 2
            > inside.count()
    };
    let frozen: Vec<&[(i64, f64)]> =
        equal.iter().filter(|it| is_long(it) && within_limits(it) && rotates(it)).copied().collect();
    let Some(longest) = frozen.iter().max_by_key(|interval| length_ns(interval)) else { return };
    let count: usize = frozen.iter().map(|interval| interval.len()).sum();
    let ends = readings.last().is_some_and(|last| longest[longest.len() - 1].0 == last.0);
    let evidence = format!(
        "{count} of {} readings while the vehicle rotates, {} {:.3} s from {:.3} s on{}; of the others {:.0} % differ from the \
         one before",
        readings.len(),
        if frozen.len() == 1 { "for".to_owned() } else { format!("in {} intervals, the longest of", frozen.len()) },
        seconds_from_ns(length_ns(longest)),
        seconds_from_ns(longest[0].0),
        if ends { ", to the last reading" } else { "" },
        100.0 * changes as f64 / outside as f64,
    );
    let title = format!("readings of '{}' freeze at {:+.2}°", joint.name, longest[0].1.to_degrees());
    let remedy = "the driver repeats its last reading: check the connection of the encoder; use --duration or --start to \
                  run on the log outside of these intervals";
    findings.add(Severity::Error, Area::Encoders, title, evidence, remedy);
    findings.state_interval(frozen.iter().flat_map(|interval| interval.iter().map(|(stamp_ns, _)| *stamp_ns)));
    findings.state_faults([FaultKind::UnusableJoints.into()]);
    findings.exclude(Measurement::Joints);
}

/// Time from the first to the last reading of an interval, in nanoseconds.
fn length_ns(interval: &[(i64, f64)]) -> i64 {
    interval.last().map_or(0, |last| last.0 - interval[0].0)
}
