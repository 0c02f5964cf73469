//! Times for which joint angles are missing although the gimbal's camera records, and readings that stop changing.

use super::statistics::median;
use super::survey::Survey;
use super::{Area, Findings, Severity};
use crate::geometry::seconds_from_ns;
use crate::sensors::{CameraMount, GimbalRig, Rig};

/// Smallest reported time without joint angles at the begin and the end of the images, in seconds.
const MISSING_TOLERANCE_S: f64 = 0.5;
/// A longer missing part of the images, as a ratio, makes a result useless.
const USELESS_RATIO: f64 = 0.1;
/// Shortest reported time over which all readings of a joint are equal, in seconds.
const FROZEN_S: f64 = 1.0;
/// Largest ratio of equal consecutive readings of an encoder whose noise exceeds its resolution.
const MAX_EQUAL: f64 = 0.2;

/// Checks that there are joint angles for all images of the gimbal's camera, and that they change.
pub(super) fn check_joint_coverage(survey: &Survey, rig: &Rig, findings: &mut Findings) {
    let Some(gimbal) = rig.gimbal.as_ref().filter(|gimbal| gimbal.topic.is_some()) else { return };
    check_missing(survey, rig, findings);
    if gimbal.attitude.is_none() {
        check_frozen(survey, gimbal, findings);
    }
}

/// Compares the first and the last joint angles with those of the images.
fn check_missing(survey: &Survey, rig: &Rig, findings: &mut Findings) {
    let Some(camera) = rig.cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal) else { return };
    let images = survey.topics.get(&camera.topic).filter(|images| images.times.len() > 1);
    let Some(images) = images.filter(|images| !images.has_one_stamp()) else { return };
    let samples = &survey.joint_samples;
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return };
    let (first_image, last_image) = images.stamp_range();
    let [begin_s, end_s, from_s, to_s] = [first_image, last_image, first.stamp_ns, last.stamp_ns].map(seconds_from_ns);
    let (begin_s, end_s) = (begin_s + camera.timeshift_cam_imu_s, end_s + camera.timeshift_cam_imu_s);
    let missing = [("begin", from_s, from_s - begin_s), ("end", to_s, end_s - to_s)];
    for (what, at_s, missing_s) in missing.into_iter().filter(|(.., missing_s)| *missing_s > MISSING_TOLERANCE_S) {
        let ratio = missing_s / (end_s - begin_s);
        let title = format!("joint angles {what} at {at_s:.1} s");
        let evidence = format!(
            "images of {} from {begin_s:.1} s to {end_s:.1} s: {missing_s:.1} s ({:.0} %) without joint angles",
            camera.key,
            100.0 * ratio
        );
        let remedy = "record the joint angles over the whole flight, or use the images up to there (--start, --duration): \
                      without them the camera's orientation is estimated from its images alone";
        let severity = if ratio > USELESS_RATIO { Severity::Error } else { Severity::Warning };
        findings.add(severity, Area::Encoders, title, evidence, remedy);
    }
}

/// Reports joints whose readings are all equal for a while although they have noise otherwise.
fn check_frozen(survey: &Survey, gimbal: &GimbalRig, findings: &mut Findings) {
    for (number, joint) in gimbal.joints.iter().enumerate() {
        let readings: Vec<(i64, f64)> = survey
            .joints
            .iter()
            .filter_map(|message| Some((message.stamp_ns, message.angles_rad.get(number).copied().flatten()?)))
            .collect();
        let Some(longest) = longest_equal(&readings) else { continue };
        let [from_s, to_s] = longest.map(|index| seconds_from_ns(readings[index].0));
        // Equal readings outside of the longest stretch are those of a coarse or resting encoder.
        let equal = |part: &[(i64, f64)]| part.windows(2).filter(|pair| pair[0].1 == pair[1].1).count();
        let (before, after) = (&readings[..=longest[0]], &readings[longest[1]..]);
        let outside = (before.len() + after.len()).saturating_sub(2);
        let is_noisy = outside > 10 && (equal(before) + equal(after)) as f64 <= MAX_EQUAL * outside as f64;
        if to_s - from_s < FROZEN_S || !is_noisy {
            continue;
        }
        let steps: Vec<f64> =
            before.windows(2).chain(after.windows(2)).map(|pair| (pair[1].1 - pair[0].1).abs()).collect();
        let title = format!("readings of '{}' freeze from {from_s:.2} s to {to_s:.2} s", joint.name);
        let evidence = format!(
            "{} equal readings of {:+.2}°; otherwise they change by {:.3}° in the median",
            longest[1] - longest[0] + 1,
            readings[longest[0]].1.to_degrees(),
            median(&steps).to_degrees()
        );
        let remedy = "check the encoder and its driver: the last value is repeated, and is not the joint's angle";
        findings.add(Severity::Error, Area::Encoders, title, evidence, remedy);
    }
}

/// First and last index of the longest sequence of equal readings.
fn longest_equal(readings: &[(i64, f64)]) -> Option<[usize; 2]> {
    let mut longest: Option<[usize; 2]> = None;
    let mut start = 0;
    for index in 1..=readings.len() {
        if readings.get(index).is_some_and(|reading| reading.1 == readings[start].1) {
            continue;
        }
        if longest.is_none_or(|[from, to]| index - 1 - start > to - from) {
            longest = Some([start, index - 1]);
        }
        start = index;
    }
    longest
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Flight, expect};
    use super::*;

    #[test]
    fn readings_that_freeze_are_found() {
        let flight = Flight { joint: |ms, angle| *angle = if ms > 7000 { 0.25 } else { *angle }, ..Flight::default() };
        expect(&flight, Severity::Error, &["readings of 'yaw' freeze from 7.0", "equal readings of +14.32°"]);
        // A coarse encoder has equal readings all the time.
        let coarse = Flight { joint: |_, angle| *angle = (*angle / 0.05).round() * 0.05, ..Flight::default() };
        let report = coarse.check(&[]);
        assert!(!report.findings.iter().any(|finding| finding.title.contains("freeze")), "{report}");
    }

    #[test]
    fn the_longest_sequence_of_equal_readings_is_taken() {
        let of = |values: &[f64]| longest_equal(&values.iter().map(|value| (0, *value)).collect::<Vec<_>>());
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[1.0]), Some([0, 0]));
        assert_eq!(of(&[1.0, 1.0, 2.0, 2.0, 2.0, 3.0]), Some([2, 4]));
    }
}
