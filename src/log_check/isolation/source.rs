//! Sources of measurements that are compared with each other.

use crate::faults::{Area, Sensor};
use crate::log_check::report::suspects::Suspect;

/// Source of a quantity that others measure, too.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    Gyroscope,
    Accelerometer,
    /// Images of a camera; on a gimbal together with joint angles and chain.
    Images {
        camera_key: String,
        with_joints: bool,
    },
    /// One joint of the gimbal, by the images of a camera on it.
    Joint {
        joint: String,
        camera_key: String,
    },
    /// Topic of the vehicle's attitude.
    Attitude(String),
    GroundTruth,
    /// Accelerations by the ground truth.
    Positions,
    GimbalImu,
}

impl Source {
    /// Name with its article.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Gyroscope => "the gyroscope".to_owned(),
            Self::Accelerometer => "the accelerometer".to_owned(),
            Self::Images { camera_key, with_joints: false } => format!("the images of {camera_key}"),
            Self::Images { camera_key, with_joints: true } => format!("the images of {camera_key} on the gimbal"),
            Self::Joint { joint, camera_key } => format!("the angles of joint '{joint}' by the images of {camera_key}"),
            Self::Attitude(topic) => format!("the attitude {topic}"),
            Self::GroundTruth => "the ground truth".to_owned(),
            Self::Positions => "the motion of the ground truth".to_owned(),
            Self::GimbalImu => "the IMU on the gimbal".to_owned(),
        }
    }

    pub(super) fn camera_key(&self) -> Option<&str> {
        if let Self::Images { camera_key, .. } | Self::Joint { camera_key, .. } = self {
            Some(camera_key)
        } else {
            None
        }
    }

    /// Verb with which its name goes.
    pub(super) fn disagrees(&self) -> &'static str {
        if matches!(self, Self::Images { .. } | Self::Joint { .. }) { "disagree" } else { "disagrees" }
    }

    /// Subject of a finding about it.
    pub(super) fn area(&self) -> Area {
        match self {
            Self::Gyroscope | Self::Accelerometer | Self::GimbalImu => Area::Imu,
            Self::Images { .. } => Area::Extrinsics,
            Self::Joint { .. } | Self::Attitude(_) => Area::Encoders,
            Self::GroundTruth | Self::Positions => Area::Log,
        }
    }

    /// True if a finding on this subject can be the cause of its disagreement.
    pub(super) fn is_explained_by(&self, area: Area) -> bool {
        match self {
            Self::Gyroscope | Self::Accelerometer => matches!(area, Area::Imu | Area::Time),
            Self::GimbalImu => matches!(area, Area::Imu | Area::Time | Area::Encoders | Area::Extrinsics),
            Self::Images { with_joints, .. } => {
                let of_camera = matches!(area, Area::Images | Area::Intrinsics | Area::Extrinsics | Area::Time);
                of_camera || (*with_joints && area == Area::Encoders)
            }
            Self::Joint { .. } | Self::Attitude(_) => matches!(area, Area::Encoders | Area::Time),
            Self::GroundTruth | Self::Positions => matches!(area, Area::Log | Area::Time),
        }
    }

    /// Sensors with its measurements. A wrong angle of the last joint is a rotation of the camera, too.
    pub(super) fn suspects(&self) -> Vec<Suspect> {
        let joint = if let Self::Joint { joint, .. } = self { Some(joint.clone()) } else { None };
        let sensors = [Sensor::Imu, Sensor::Camera, Sensor::Joints].into_iter();
        let used = sensors.filter(|sensor| self.uses(*sensor) || (joint.is_some() && *sensor == Sensor::Camera));
        used.map(|sensor| Suspect { sensor, joint: joint.clone().filter(|_| sensor == Sensor::Joints) }).collect()
    }

    /// True if its measurements are those of a sensor.
    pub(super) fn uses(&self, sensor: Sensor) -> bool {
        match self {
            Self::Gyroscope | Self::Accelerometer => sensor == Sensor::Imu,
            Self::Images { with_joints, .. } => sensor == Sensor::Camera || (*with_joints && sensor == Sensor::Joints),
            Self::GimbalImu | Self::Joint { .. } | Self::Attitude(_) => sensor == Sensor::Joints,
            Self::GroundTruth | Self::Positions => false,
        }
    }

    /// Instruction for a disagreement without a known cause.
    pub(super) fn remedy(&self) -> &'static str {
        match self {
            Self::Gyroscope => {
                "check resets, calibration, units and axes of the gyroscope in its driver, and use the part of the log in which it agrees"
            }
            Self::Accelerometer => {
                "check the source of the specific forces (raw samples of an accelerometer at the gyroscope's stamps), units and axes"
            }
            Self::Images { with_joints: false, .. } => {
                "check order, stamps and content of the images, the lens, and the orientation of the camera in the rig"
            }
            Self::Images { with_joints: true, .. } => {
                "check the joint angles and the chain of the gimbal in the rig, then order, stamps and content of the images"
            }
            Self::Joint { .. } => {
                "check the encoder of this joint: its zero, direction, scale, delay, steps and the play of its gear"
            }
            Self::Attitude(_) => "check axes, frame and stamps of the attitude",
            Self::GroundTruth => {
                "check body frame, gaps and stamps of the ground truth; errors against it mean nothing there"
            }
            Self::Positions => {
                "check unit, axes and body of the ground truth's positions; errors against it mean nothing"
            }
            Self::GimbalImu => "check axes, stamps and units of the IMU on the gimbal, and the joint angles",
        }
    }
}
