//! A fault of the measurements or of the rig with its values.

use nalgebra::{UnitQuaternion, Vector2, Vector3};
use serde::Serialize;

use crate::geometry::{SignedAxes, so3};
use crate::text::Named;

/// Kind of a fault; its row is in [`TABLE`](super::TABLE).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultKind {
    /// Values: factor on the focal lengths.
    Focal,
    /// Values: factor by which the focal lengths change, and the seconds over which they do.
    Zoom,
    /// Images are mirrored or upside down.
    ImageFlip,
    /// A part of the images contradicts the rest.
    ImageRegion,
    /// Values: seconds to add to `timeshift_cam_imu`.
    CameraClock,
    /// Values: seconds to add to `timeshift_gimbal_imu`.
    EncoderClock,
    /// Joints that count in the other direction. Values: angles to add to the reversed readings, in radians; zero without.
    JointReversed,
    /// Pairs of joints whose readings are exchanged, one pair after the other.
    JointsSwapped,
    /// Values: angle to add to the readings of a joint, in radians.
    JointOffset,
    /// Values: factor on the readings of a joint, or of all joints.
    JointScale,
    /// Axes of gyroscope and accelerometer.
    ImuAxes,
    GyroscopeAxes,
    AccelerometerAxes,
    /// Values: factor on the angular velocities.
    GyroscopeScale,
    /// Values: factor on the specific forces.
    AccelerometerScale,
    /// Time offsets of cameras and encoders.
    Clocks,
    /// Rolling shutter. Values: readout in seconds and its standard deviation.
    Shutter,
    /// Values: offset of the principal point in units of the focal length.
    PrincipalPoint,
    /// Values: factor on the focal lengths, then as for the principal point.
    Intrinsics,
    /// Values: time in seconds and ratio to the rig's focal length of each piece with a constant one.
    FocalPieces,
    /// Values: seconds to add to `timeshift_cam_imu`, and their change per second since the log began.
    CameraDrift,
    /// The mount of the camera moves. Values: rotation vector against the rig's orientation, camera frame, in radians.
    Mount,
    /// Pose of a rigid camera, or the chain of the gimbal. Values: distance in metres and angle in radians.
    Chain,
    ImuIntrinsics,
    /// Values: factor on the noise densities.
    ImuNoise,
    /// Values: factor on the standard deviation of the joint angles.
    EncoderNoise,
    /// Samples of the IMU that no constant correction restores.
    UnusableImu,
    /// Joint angles that no constant correction restores.
    UnusableJoints,
}

/// Sensor with the faulty measurements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    Imu,
    Joints,
    Camera,
}

/// Subject of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Area {
    /// The file and its topics.
    Log,
    /// Time bases, rates, gaps and order of stamps.
    Time,
    /// Units, gravity, biases, noise and saturation of the IMU.
    #[serde(rename = "inertial")]
    Imu,
    /// Stationary and hovering periods, fast rotation.
    Motion,
    /// Joint angles and their limits.
    Encoders,
    /// Size, blur, exposure and texture.
    Images,
    /// Camera models and lenses.
    Intrinsics,
    /// Poses of the cameras relative to the IMU.
    Extrinsics,
}

/// One of a few changes that have no number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    Flip(ImageFlip),
    Half(ImageHalf),
    /// Axes of the rig's IMU as those of the recording.
    Axes(SignedAxes),
}

/// Fault of the measurements or of the rig.
///
/// Its values undo it: they are the factors on what is recorded or given by the rig, or the additions to it, that give the
/// true value. [`Fault::inverse`] plants it.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    pub kind: FaultKind,
    /// Key of the faulty camera; `None` for the main camera of a run and for other sensors.
    pub camera: Option<String>,
    /// Names of the faulty joints; empty for all of them and for other sensors.
    pub joints: Vec<String>,
    /// As [`FaultKind`] says; fewer if they are unknown.
    pub values: Vec<f64>,
    pub choice: Option<Choice>,
    /// Time since the log began in seconds from which on the fault acts; `None` for the whole log.
    pub since_s: Option<f64>,
}

/// Image operation that undoes a camera mounted or recorded the other way around.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFlip {
    /// Left and right exchanged.
    Mirrored,
    /// Top and bottom exchanged.
    Flipped,
    /// Rotated by 180°.
    UpsideDown,
}

impl Named for ImageFlip {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Mirrored, "mirrored"), (Self::Flipped, "flipped"), (Self::UpsideDown, "upside-down")];
}

/// Half of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageHalf {
    Left,
    Right,
    Top,
    Bottom,
}

impl Named for ImageHalf {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Left, "left"), (Self::Right, "right"), (Self::Top, "top"), (Self::Bottom, "bottom")];
}

impl ImageHalf {
    /// True for a pixel in this half of an image of this resolution.
    pub fn contains(self, uv_px: &Vector2<f64>, resolution_px: [usize; 2]) -> bool {
        let [width, height] = resolution_px.map(|size| size as f64);
        match self {
            Self::Left => uv_px.x < 0.5 * width,
            Self::Right => uv_px.x >= 0.5 * width,
            Self::Top => uv_px.y < 0.5 * height,
            Self::Bottom => uv_px.y >= 0.5 * height,
        }
    }
}

impl From<FaultKind> for Fault {
    fn from(kind: FaultKind) -> Self {
        Self { kind, camera: None, joints: Vec::new(), values: Vec::new(), choice: None, since_s: None }
    }
}

impl Fault {
    pub fn new(kind: FaultKind, values: &[f64]) -> Self {
        Self { values: values.to_vec(), ..kind.into() }
    }

    /// Fault of the axes of an IMU.
    pub fn of_axes(kind: FaultKind, axes: SignedAxes) -> Self {
        Self { choice: Some(Choice::Axes(axes)), ..kind.into() }
    }

    /// The fault of a camera with this key.
    #[must_use]
    pub fn of_camera(self, key: &str) -> Self {
        Self { camera: Some(key.to_owned()), ..self }
    }

    #[must_use]
    pub fn of_joints<'a>(self, names: impl IntoIterator<Item = &'a String>) -> Self {
        Self { joints: names.into_iter().cloned().collect(), ..self }
    }

    /// Value with a number in the order of its kind; that of a fault without effect if it is unknown.
    pub fn value(&self, number: usize) -> f64 {
        self.values.get(number).copied().unwrap_or_else(|| self.kind.row().change(number).neutral())
    }

    pub fn axes(&self) -> Option<SignedAxes> {
        if let Some(Choice::Axes(axes)) = self.choice { Some(axes) } else { None }
    }

    /// Rotation of the mount of a camera against its orientation by the rig, camera frame.
    pub fn mount(&self) -> UnitQuaternion<f64> {
        if self.kind != FaultKind::Mount {
            return UnitQuaternion::identity();
        }
        so3::exp(&Vector3::from_fn(|axis, _| self.value(axis)))
    }

    /// Size of the fault against the largest one of sound sensors and rigs, [`Row::noticeable`](super::Row).
    pub fn is_noticeable(&self) -> bool {
        let size = match self.kind {
            FaultKind::GyroscopeScale | FaultKind::JointScale => self.value(0) - 1.0,
            FaultKind::CameraDrift => self.value(1),
            FaultKind::Mount => self.mount().angle(),
            _ => self.value(0),
        };
        self.kind.row().noticeable.is_none_or(|noticeable| size.abs() > noticeable)
    }

    /// True if no fault with this one as a special case can be excluded by it: it fits as well.
    pub fn contains(&self, other: &Self) -> bool {
        match (self.kind, other.kind) {
            (FaultKind::Mount, FaultKind::JointOffset) => self.since_s.is_some() && other.since_s.is_some(),
            // Two axes reversed are half a turn about the third: other signs with an offset can be the same mechanism.
            (FaultKind::JointReversed, FaultKind::JointReversed) => {
                other.joints.iter().all(|joint| self.joints.contains(joint))
            }
            (mine, others) if mine == others => self.is_alike(other),
            (mine, others) => mine.contains(others),
        }
    }

    /// True for faults that differ only in values and time.
    pub fn is_alike(&self, other: &Self) -> bool {
        self.kind == other.kind && (self.joints == other.joints || self.kind == FaultKind::JointsSwapped)
    }

    /// Faults of one joint, or of one pair of joints, which are one after the other the same as this one.
    pub fn of_single_joints(&self) -> Vec<Self> {
        let size = match self.kind {
            FaultKind::JointReversed => 1,
            FaultKind::JointsSwapped => 2,
            _ => return vec![self.clone()],
        };
        self.joints.chunks(size).map(|joints| Self::from(self.kind).of_joints(joints)).collect()
    }
}
