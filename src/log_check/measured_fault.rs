//! Faults of a log with their values, for programs that undo them.

use crate::geometry::SignedAxes;

/// Fault of the measurements or of the rig that changes the estimates of a run.
#[derive(Clone, Debug, PartialEq)]
pub enum MeasuredFault {
    /// Ratio of the true focal length of a camera to the rig's.
    FocalLength {
        camera_key: String,
        ratio: f64,
    },
    /// Ratio of the true focal length of a camera to the rig's, from about a time in seconds since the log began on.
    Zoom {
        camera_key: String,
        since_s: f64,
        ratio: f64,
    },
    /// Principal point of a camera, and perhaps its focal length.
    PrincipalPoint {
        camera_key: String,
    },
    Readout {
        camera_key: String,
    },
    /// Orientation of a camera against the rig.
    Orientation {
        camera_key: String,
    },
    /// Images of a camera are mirrored or rotated.
    ImagesTurned {
        camera_key: String,
    },
    /// Time in seconds to add to `timeshift_cam_imu` of a camera.
    CameraShift {
        camera_key: String,
        shift_s: f64,
    },
    /// Time in seconds to add to `timeshift_gimbal_imu`.
    JointShift {
        shift_s: f64,
    },
    /// Names of joints that count in the other direction.
    JointsReversed(Vec<String>),
    /// Pairs of joints whose readings are to be exchanged, one after the other.
    JointsExchanged(Vec<[String; 2]>),
    /// Angle in radians to add to the readings of a joint, from a time in seconds since the log began on if there is one.
    JointOffset {
        joint: String,
        offset_rad: f64,
        since_s: Option<f64>,
    },
    /// Factor on the readings of all joints.
    JointUnit(f64),
    /// Factor on the angular velocities.
    GyroscopeScale(f64),
    /// Factor on the specific forces.
    AccelerometerScale(f64),
    /// Axes of the rig's IMU as those of the recording, of the gyroscope and perhaps of the accelerometer.
    GyroscopeAxes(SignedAxes),
    /// The same of the accelerometer alone.
    AccelerometerAxes(SignedAxes),
    /// Measurements that no constant correction restores.
    Irreversible(FaultySource),
}

/// Source of faulty measurements.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FaultySource {
    Imu,
    Joints,
    /// Camera with this key.
    Camera(String),
}
