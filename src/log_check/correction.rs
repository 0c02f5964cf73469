//! Corrections of what a log contains: each describes a fault of a sensor, its driver or the rig by a few numbers.

use nalgebra::{UnitQuaternion, Vector3};

use crate::geometry::so3;

/// Delay of images or joint angles in seconds above which results are useless.
pub(super) const USELESS_DELAY_S: f64 = 0.05;

/// Change of the measurements that removes a fault; the default changes nothing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Correction {
    /// Factor of the angular rates; negative for a left-handed frame, whose rotations are reversed.
    pub(super) gyroscope_scale: f64,
    pub(super) lens: LensChange,
    /// Time to add to the camera's stamps beyond the rig's, in seconds, and its change per second since the log began.
    pub(super) camera_delay_s: f64,
    pub(super) camera_drift: f64,
    /// One for each joint, in the order of the rig.
    pub(super) joints: Vec<JointChange>,
    /// Time by which the stamps of joint angles are late, in seconds.
    pub(super) joint_delay_s: f64,
    /// Rotation of the camera against its orientation by the rig, camera frame.
    pub(super) mount: UnitQuaternion<f64>,
}

/// Pinhole intrinsics relative to the rig's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LensChange {
    /// Ratio of the true focal length to the rig's.
    pub(super) focal: f64,
    /// Offset of the true principal point in units of the rig's focal length.
    pub(super) centre: [f64; 2],
}

/// True angle of a joint from readings: `scale · reading(source) + offset_rad`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JointChange {
    /// Joint of the rig under whose name the readings are recorded.
    pub(super) source: usize,
    pub(super) scale: f64,
    pub(super) offset_rad: f64,
}

/// Parameter of a correction that is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parameter {
    GyroscopeScale,
    Focal,
    /// Coordinate 0 or 1 of the principal point.
    Centre(usize),
    CameraDelay,
    CameraDrift,
    JointScale(usize),
    JointOffset(usize),
    JointDelay,
    /// Rotation of the mount about an axis of the camera.
    Mount(usize),
}

impl Correction {
    pub(super) fn none(joints: usize) -> Self {
        let joint = |source| JointChange { source, scale: 1.0, offset_rad: 0.0 };
        Self {
            gyroscope_scale: 1.0,
            lens: LensChange::NONE,
            camera_delay_s: 0.0,
            camera_drift: 0.0,
            joints: (0..joints).map(joint).collect(),
            joint_delay_s: 0.0,
            mount: UnitQuaternion::identity(),
        }
    }
}

impl LensChange {
    pub(super) const NONE: Self = Self { focal: 1.0, centre: [0.0; 2] };

    /// Bearing with these intrinsics from one with the rig's.
    pub(super) fn bearing(&self, bearing: &Vector3<f64>) -> Vector3<f64> {
        let [x, y] = [0, 1].map(|axis| (bearing[axis] - self.centre[axis] * bearing.z) / self.focal);
        Vector3::new(x, y, bearing.z).normalize()
    }

    /// Approximate rotation vector with these intrinsics from one with the rig's: a shorter focal length widens rotations
    /// across the optical axis.
    pub(super) fn rotation(&self, rotation: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(rotation.x / self.focal, rotation.y / self.focal, rotation.z)
    }
}

impl Parameter {
    /// Step of a difference quotient, in the unit of the parameter.
    pub(super) fn step(self) -> f64 {
        match self {
            Self::GyroscopeScale | Self::JointScale(_) | Self::JointOffset(_) | Self::Mount(_) => 1e-3,
            Self::Focal | Self::Centre(_) => 1e-2,
            Self::CameraDelay | Self::JointDelay => 2e-3,
            Self::CameraDrift => 1e-4,
        }
    }

    /// Prior standard deviation of a change, and largest change in one iteration.
    pub(super) fn bounds(self) -> (f64, f64) {
        match self {
            Self::GyroscopeScale | Self::JointScale(_) | Self::Focal => (1.0, 0.4),
            Self::Centre(_) => (0.5, 0.2),
            Self::CameraDelay | Self::JointDelay => (0.2, 0.05),
            Self::CameraDrift => (0.01, 0.005),
            Self::JointOffset(_) => (1.5, 0.5),
            Self::Mount(_) => (1.0, 0.5),
        }
    }

    /// Adds a change of the parameter; those that are ratios change by a factor `1 + change`.
    pub(super) fn add(self, correction: &mut Correction, change: f64) {
        match self {
            Self::GyroscopeScale => correction.gyroscope_scale *= 1.0 + change,
            Self::Focal => correction.lens.focal *= 1.0 + change,
            Self::Centre(axis) => correction.lens.centre[axis] += change,
            Self::CameraDelay => correction.camera_delay_s += change,
            Self::CameraDrift => correction.camera_drift += change,
            Self::JointScale(joint) => correction.joints[joint].scale *= 1.0 + change,
            Self::JointOffset(joint) => correction.joints[joint].offset_rad += change,
            Self::JointDelay => correction.joint_delay_s += change,
            Self::Mount(axis) => {
                correction.mount *= so3::exp(&(Vector3::ith(axis, change)));
            }
        }
    }
}
