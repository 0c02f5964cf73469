//! The checks in their order.

use super::isolation::{Compared, Rotations, isolate};
use super::report::agreement::Agreement;
use super::report::{Area, CheckReport, Findings, ImageRotation, Severity};
use super::survey::Survey;
use super::{extrinsics, gimbal, ground_truth, images, imu, rig_sanity, stamps, topics};
use crate::flight_log::{FlightLog, LogError};
use crate::geometry::seconds_from_ns;
use crate::sensors::Rig;

/// Checks an entire log against its rig.
///
/// An error of reading the rig becomes a finding, and the checks that need no rig are run.
/// `image_rotations` are optional: with them the extrinsic rotations and the time offset of the cameras are checked
/// against the gyroscope, and their readouts are measured.
pub fn check(log: &FlightLog, rig: Result<&Rig, &LogError>, image_rotations: &[ImageRotation]) -> CheckReport {
    let mut survey = Survey::of(log, rig.ok());
    let mut findings = Findings::default();
    topics::check_file(log, &survey, rig.ok(), &mut findings);
    match rig {
        Ok(rig) => {
            topics::check_topics(log, rig, &mut findings);
            rig_sanity::check_rig(log, rig, &mut findings);
        }
        Err(error) => findings.add(
            Severity::Error,
            Area::Log,
            "no usable rig",
            error.to_string(),
            match error {
                LogError::NoRig { .. } => {
                    "put the rig beside the log as NAME.rig.yaml, name one with --rig, or write one with `dcvins rig new`"
                }
                _ => "correct the rig at the place that the error names",
            },
        ),
    }
    stamps::check_timing(&survey, rig.ok(), &mut findings);
    imu::unmeasured::check_orientation_topics(log, rig, &mut findings);
    let mut imu_facts = imu::check_imu(&survey, rig.ok(), &mut findings);
    imu_facts.axes_agree = imu::axes::check_imu_axes(&imu_facts, &mut findings);
    let mut proposed_masks = Vec::new();
    let mut agreement = Agreement::default();
    if let Ok(rig) = rig {
        let content_faults = images::content::check_content(&survey, rig, &mut findings);
        let image_rotations = &images::content::of_intact_images(image_rotations, &content_faults, &mut findings)[..];
        if let Some(fitted) = gimbal::source_fit::check_source(&survey, rig, &imu_facts, image_rotations, &mut findings)
        {
            // Joints and cameras are checked with the corrected attitude.
            survey.use_source(rig, fitted.source, fitted.timeshift_s);
        }
        gimbal::check_joints(&survey, rig, &mut findings);
        gimbal::check_joint_coverage(&survey, rig, &mut findings);
        gimbal::vehicle_attitude::check_vehicle_attitude(&survey, rig, &imu_facts, &mut findings);
        images::check_video_decoding(log, &survey, rig, &mut findings);
        images::check_images(log, &survey, rig, &imu_facts, &content_faults, &mut findings);
        stamps::copies::check_image_copies(&survey, rig, &imu_facts, &mut findings);
        gimbal::frozen_joints::check_frozen_joints(&survey, rig, &imu_facts, &mut findings);
        ground_truth::check_unusable_poses(log, rig, &mut findings);
        let poses = ground_truth::poses_of(log, rig);
        let cameras = extrinsics::camera_rotations(&survey, rig, &imu_facts, image_rotations);
        let compared = Compared {
            survey: &survey,
            rig,
            imu_facts: &imu_facts,
            joint_noise_ratios: survey.joint_noise_ratios(),
            images: image_rotations,
            measured: &extrinsics::measured_of(&cameras),
            poses: &poses,
        };
        // Causes are searched among the faults of the sources that are wrong.
        let rotations = Rotations::of(&compared);
        let suspects = |camera_key: &str| rotations.suspects(&compared, camera_key);
        let of_imu = extrinsics::check_rotations(cameras, suspects, &mut findings);
        gimbal::gimbal_imu::check_gimbal_imu(&survey, rig, image_rotations, &mut findings);
        ground_truth::check_ground_truth(&poses, rig, &imu_facts, &of_imu, &mut findings);
        agreement = isolate(&compared, rotations, &mut findings);
        proposed_masks = images::still_pixels::check_still_pixels(&survey, rig, image_rotations, &mut findings);
    }
    let mut findings = findings.list;
    findings.sort_by_key(|finding| (std::cmp::Reverse(finding.severity), finding.area));
    CheckReport {
        log: log.path().display().to_string(),
        rig: rig.ok().map(|rig| rig.name.clone()),
        epoch_ns: log.epoch_ns(),
        duration_s: seconds_from_ns(log.duration_ns()),
        topics: topics::topic_reports(log, &survey, rig.ok()),
        findings,
        agreement,
        proposed_masks,
    }
}
