//! IMU samples that no sensor measured: values that are not finite, zeros and frozen values.

use crate::flight_log::imu_filter::Unmeasured;
use crate::geometry::seconds_from_ns;
use crate::log_check::report::{Area, Findings, Severity};
use crate::log_check::survey::Survey;

/// Reports how many samples are no measurement, and when; later checks do not use them.
pub(super) fn check_unmeasured(survey: &Survey, findings: &mut Findings) {
    let messages = |topic: &Option<String>| {
        let topic = topic.as_ref().and_then(|topic| survey.topics.get(topic));
        topic.map_or(0, |topic| topic.times.len())
    };
    for (reason, stamps_ns) in &survey.unmeasured {
        let of_accelerometer = *reason == Unmeasured::ZeroForce && survey.accelerometer_topic.is_some();
        let all = messages(if of_accelerometer { &survey.accelerometer_topic } else { &survey.imu_topic });
        let (first, last) = (stamps_ns.iter().min(), stamps_ns.iter().max());
        let evidence = format!(
            "{} of {all} samples ({:.1} %), the first at {:.3} s, the last at {:.3} s{}",
            stamps_ns.len(),
            100.0 * stamps_ns.len() as f64 / all.max(1) as f64,
            seconds_from_ns(first.copied().unwrap_or(0)),
            seconds_from_ns(last.copied().unwrap_or(0)),
            if *reason == Unmeasured::Frozen { stalls(stamps_ns) } else { String::new() },
        );
        let (title, remedy) = texts(*reason);
        findings.add(Severity::Warning, Area::Imu, title, evidence, remedy);
    }
}

fn texts(reason: Unmeasured) -> (&'static str, &'static str) {
    match reason {
        Unmeasured::NotFinite => ("IMU samples are not finite", "check the driver; these samples are dropped"),
        Unmeasured::AllZero => (
            "IMU samples are exactly zero in all six values",
            "no sensor measures this: let the driver send nothing where a reading failed; these samples are dropped",
        ),
        Unmeasured::ZeroForce => (
            "specific forces of the IMU are exactly zero",
            "no accelerometer measures this: let the driver send nothing where a reading failed; these samples are dropped",
        ),
        Unmeasured::ZeroRate => (
            "angular velocities of the IMU are exactly zero during a rotation",
            "no gyroscope measures this: let the driver send nothing where a reading failed; these samples are dropped",
        ),
        Unmeasured::Frozen => (
            "the values of the IMU freeze",
            "the driver repeats its last reading: check the connection of the sensor; the copies are dropped, and the IMU \
             is interpolated over them",
        ),
    }
}

/// Number and longest of the intervals in which the values stay equal.
fn stalls(stamps_ns: &[i64]) -> String {
    /// Samples further apart belong to different intervals.
    const APART_NS: i64 = 100_000_000;
    let mut intervals: Vec<(i64, i64)> = Vec::new();
    for stamp_ns in stamps_ns {
        match intervals.last_mut().filter(|(_, last)| stamp_ns - last < APART_NS) {
            Some((_, last)) => *last = *stamp_ns,
            None => intervals.push((*stamp_ns, *stamp_ns)),
        }
    }
    let longest = intervals.iter().max_by_key(|(first, last)| last - first).copied().unwrap_or_default();
    let (length_s, from_s) = (seconds_from_ns(longest.1 - longest.0), seconds_from_ns(longest.0));
    match intervals.len() {
        1 => String::new(),
        count => format!("; {count} intervals, the longest of {length_s:.3} s from {from_s:.3} s on"),
    }
}
