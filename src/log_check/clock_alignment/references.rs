//! Clock of a camera against the IMU of its log.

use std::fmt;

use serde::Serialize;

use super::{AlignmentError, ClockAlignment, RotationReference, align_clocks};
use crate::flight_log::FlightLog;
use crate::geometry::seconds_from_ns;
use crate::gimbal::ClassicalChain;
use crate::log_check::report::ImageRotation;
use crate::log_check::survey::Survey;
use crate::sensors::{AngularRates, CameraMount, JointSample, Rig};

/// Reference of the image rotations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AlignmentReference {
    /// Gyroscope: for a rigid camera, or a gimbal that does not move.
    Gyroscope,
    /// Gyroscope and angles of the gimbal's joints.
    GyroscopeAndJoints,
}

impl fmt::Display for AlignmentReference {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Gyroscope => "the gyroscope",
            Self::GyroscopeAndJoints => "gyroscope and joint angles",
        })
    }
}

/// Finds the offset of a camera's clock from the clock of the log's IMU, by the gyroscope and, for a camera on a
/// gimbal, by gyroscope and joint angles; returns the better of both.
///
/// # Errors
/// The error of the better reference, if no offset explains the rotations.
pub fn align_camera(
    log: &FlightLog,
    rig: &Rig,
    camera_key: &str,
    rotations: &[ImageRotation],
    search_s: f64,
) -> Result<(AlignmentReference, ClockAlignment), AlignmentError> {
    let survey = Survey::of(log, Some(rig));
    let samples = survey.imu.iter().map(|sample| (sample.stamp_ns, sample.angular_velocity_rad_per_s));
    let in_seconds = samples.map(|(stamp_ns, rate)| (seconds_from_ns(stamp_ns), rate));
    let rates = AngularRates::new(in_seconds).bridging_gaps();
    let gyroscope = RotationReference::Gyroscope(rates.clone());
    let rigid = align_clocks(rotations, &gyroscope, 0.0, search_s).map(|found| (AlignmentReference::Gyroscope, found));
    let on_gimbal = rig.cameras.iter().any(|camera| camera.key == camera_key && camera.mount == CameraMount::Gimbal);
    let Some(chain) = rig.chain_of_camera(camera_key).filter(|_| on_gimbal && !survey.joint_samples.is_empty()) else {
        return rigid;
    };
    let camera = RotationReference::from_chain(&rates, &survey.joint_samples, &chain);
    let moving =
        align_clocks(rotations, &camera, 0.0, search_s).map(|found| (AlignmentReference::GyroscopeAndJoints, found));
    match (rigid, moving) {
        (Ok(rigid), Ok(moving)) => Ok(if moving.1.explained >= rigid.1.explained { moving } else { rigid }),
        (rigid @ Ok(_), Err(_)) => rigid,
        (Err(_), moving) => moving,
    }
}

impl RotationReference {
    /// Orientations of a camera at the end of a chain, at the stamps of the joint angles; the gyroscope alone for a chain
    /// without joints.
    pub(crate) fn from_chain(gyroscope: &AngularRates, joint_samples: &[JointSample], chain: &ClassicalChain) -> Self {
        if chain.links.is_empty() {
            return Self::Gyroscope(gyroscope.clone());
        }
        Self::from_orientations(joint_samples.iter().filter_map(|sample| {
            let imu_from_camera = chain.imu_from_camera(&sample.angles_rad).rotation;
            Some((sample.stamp_ns, gyroscope.orientation_at(seconds_from_ns(sample.stamp_ns))? * imu_from_camera))
        }))
    }
}
