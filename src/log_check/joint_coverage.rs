//! Times for which joint angles are missing although the gimbal's camera records.

use super::survey::Survey;
use super::{Area, Findings, Severity};
use crate::geometry::seconds_from_ns;
use crate::sensors::{CameraMount, Rig};

/// Smallest reported time without joint angles at the begin and the end of the images, in seconds.
const MISSING_TOLERANCE_S: f64 = 0.5;
/// A longer missing part of the images, as a ratio, makes a result useless.
const USELESS_RATIO: f64 = 0.1;

/// Compares the first and the last joint angles with those of the images.
pub(super) fn check_joint_coverage(survey: &Survey, rig: &Rig, findings: &mut Findings) {
    if rig.gimbal.as_ref().is_none_or(|gimbal| gimbal.topic.is_none()) {
        return;
    }
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
