//! The table of faults: a row per kind.

use std::f64::consts::{FRAC_PI_2, PI};

use serde::{Deserialize, Serialize};

use crate::sensors::STANDARD_GRAVITY_M_PER_S2;
use crate::text::Named;

/// Kind of a fault; its row is in [`TABLE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
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
    /// Readings change with the direction of motion. Values: angle to add in the positive direction, half the negative play,
    /// in radians.
    JointPlay,
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
    /// The focal lengths vary periodically. Values: largest ratio to the mean one, and the period in seconds.
    FocalPeriod,
    /// Distortion that the rig lacks. Values: coefficient `λ` of the division model, see [`LensChange`](super::LensChange).
    Radial,
    /// Images under the stamps of others. Values: seconds to add to the stamps of the images of a cycle, one after the other.
    ImageOrder,
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
    /// Images that do not show the scene at one instant in grey values.
    UnusableImages,
    /// Images of two cameras, each under the topic of the other.
    ImagesExchanged,
}

/// Sensor with the faulty measurements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    Imu,
    Joints,
    Camera,
}

/// Subject of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
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

impl Area {
    pub fn label(self) -> &'static str {
        match self {
            Self::Log => "log",
            Self::Time => "time",
            Self::Imu => "IMU",
            Self::Motion => "motion",
            Self::Encoders => "encoders",
            Self::Images => "images",
            Self::Intrinsics => "intrinsics",
            Self::Extrinsics => "extrinsics",
        }
    }
}

/// Definition of a kind of fault.
#[derive(Debug)]
pub struct Row {
    pub kind: FaultKind,
    /// Key in JSON.
    pub key: &'static str,
    pub sensor: Sensor,
    /// Subject of the findings about it.
    pub area: Area,
    /// Text of the correction in the changes of a fork; `None` if no constant correction of measurements undoes the fault.
    pub correction: Option<Correction>,
    /// Parameters by the number of the value; the last one also describes further values.
    pub parameters: &'static [Parameter],
    /// Values from which a fit starts: the first value of the fault, the others are those without effect.
    pub starts: &'static [f64],
    /// Values with which a run is computed again before the best one is refined.
    pub trials: &'static [f64],
    /// Largest size that sound sensors and rigs have; `None` if any size is a fault.
    pub noticeable: Option<f64>,
    /// Smallest size that makes results useless; `None` if any size only degrades them.
    pub useless: Option<f64>,
    /// Kinds that contain this one as a special case.
    pub general: &'static [FaultKind],
}

/// Text of a correction: `NAME:PART:PART`.
#[derive(Debug)]
pub struct Correction {
    pub name: &'static str,
    pub parts: &'static [Part],
    /// Parts as messages show them.
    pub example: &'static str,
}

/// Part of the text of a correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Number from 0.001 to 1000.
    Factor,
    /// Shift of a clock with its unit.
    Shift,
    /// Time of at most 60 s with its unit.
    Duration,
    /// Angle of at most 10 rad with its unit.
    Angle,
    Joint,
    Flip,
    Half,
    Axes,
}

/// Parameter of a fault that is fitted.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Step of a difference quotient, in the unit of the value.
    pub step: f64,
    /// Prior standard deviation of a change.
    pub sigma: f64,
    /// Largest change in one iteration.
    pub largest: f64,
    pub change: Change,
}

/// Composition of a value with its change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The value is multiplied by `1 + change`.
    Ratio,
    Sum,
    /// Rotation about the axis of the parameter's number, on the right of the rotation vector of the first three values.
    Rotation,
}

/// Longest shift of a clock, in seconds: samples of that time around an image are at hand.
pub const LONGEST_SHIFT_S: f64 = 0.05;

/// Relative errors of intrinsics and scales from which on results are useless.
pub(super) const USELESS_RATIO: f64 = 0.05;
/// Error of the zero of a joint from which on results are useless, in radians, and the same of a camera's orientation.
const USELESS_OFFSET_RAD: f64 = 10.0 * DEGREE;
const USELESS_ROTATION_RAD: f64 = 3.0 * DEGREE;

/// Tried shifts of clocks in seconds, beside those that the columns of time offsets find.
const SHIFTS_S: &[f64] = &[-0.04, -0.02, 0.02, 0.04];
const DEGREE: f64 = PI / 180.0;

const SCALE: Parameter = Parameter { step: 1e-3, sigma: 1.0, largest: 0.4, change: Change::Ratio };
const FOCAL: Parameter = Parameter { step: 1e-2, ..SCALE };
const CENTRE: Parameter = Parameter { step: 1e-2, sigma: 0.5, largest: 0.2, change: Change::Sum };
const SHIFT: Parameter = Parameter { step: 2e-3, sigma: 0.2, largest: 0.05, change: Change::Sum };
/// Readings are looked up at earlier times by a larger shift.
const JOINT_SHIFT: Parameter = Parameter { step: -2e-3, ..SHIFT };
const DRIFT: Parameter = Parameter { step: 1e-4, sigma: 0.01, largest: 0.005, change: Change::Sum };
const OFFSET: Parameter = Parameter { step: 1e-3, sigma: 1.5, largest: 0.5, change: Change::Sum };
const PLAY: Parameter = Parameter { step: 2e-3, sigma: 0.1, largest: 0.05, change: Change::Sum };
const RADIAL: Parameter = Parameter { step: 1e-2, sigma: 0.5, largest: 0.2, change: Change::Sum };
const ROTATION: Parameter = Parameter { step: 1e-3, sigma: 1.0, largest: 0.5, change: Change::Rotation };

/// All kinds of faults; messages list the corrections in this order.
pub const TABLE: &[Row] = &[
    Row::new(FaultKind::Focal, "focal_length", Sensor::Camera, Area::Intrinsics)
        .corrected("focal", &[Part::Factor], "FACTOR")
        .fitted(&[FOCAL], &[])
        .tried(&[0.5, 0.6, 0.7, 0.78, 0.87, 0.95, 1.05, 1.15, 1.3, 1.5, 1.8])
        .within(&[FaultKind::Intrinsics, FaultKind::FocalPieces])
        .useless(USELESS_RATIO),
    Row::new(FaultKind::Zoom, "zoom", Sensor::Camera, Area::Intrinsics)
        .corrected("zoom", &[Part::Factor, Part::Duration], "FACTOR:1s")
        .tried(&[0.6, 0.78, 1.28, 1.6])
        .useless(0.0),
    Row::new(FaultKind::ImageFlip, "image_flip", Sensor::Camera, Area::Images)
        .corrected("image", &[Part::Flip], "mirrored|flipped|upside-down")
        .within(&[FaultKind::Mount])
        .useless(0.0),
    Row::new(FaultKind::ImageRegion, "image_region", Sensor::Camera, Area::Images).corrected(
        "ignored",
        &[Part::Half],
        "left|right|top|bottom",
    ),
    Row::new(FaultKind::CameraClock, "camera_clock", Sensor::Camera, Area::Time)
        .corrected("camera-shift", &[Part::Shift], "15ms")
        .fitted(&[SHIFT], &[])
        .tried(SHIFTS_S)
        .within(&[FaultKind::Clocks, FaultKind::CameraDrift])
        .useless(LONGEST_SHIFT_S),
    Row::new(FaultKind::EncoderClock, "encoder_clock", Sensor::Joints, Area::Time)
        .corrected("joint-shift", &[Part::Shift], "15ms")
        .fitted(&[JOINT_SHIFT], &[0.1, 0.0, -0.1, -0.2, -0.35])
        .noticeable(0.02)
        .tried(SHIFTS_S)
        .within(&[FaultKind::Clocks, FaultKind::EncoderNoise])
        .useless(LONGEST_SHIFT_S),
    Row::new(FaultKind::JointReversed, "joint_reversed", Sensor::Joints, Area::Encoders)
        .corrected("reversed", &[Part::Joint], "JOINT")
        .fitted(&[OFFSET], &[])
        .within(&[FaultKind::EncoderNoise])
        .useless(0.0),
    Row::new(FaultKind::JointsSwapped, "joints_swapped", Sensor::Joints, Area::Encoders)
        .corrected("swapped", &[Part::Joint, Part::Joint], "JOINT:JOINT")
        .within(&[FaultKind::EncoderNoise])
        .useless(0.0),
    Row::new(FaultKind::JointOffset, "joint_offset", Sensor::Joints, Area::Encoders)
        .corrected("offset", &[Part::Joint, Part::Angle], "JOINT:20deg")
        .fitted(&[OFFSET], &[0.0, 0.6, -0.6, FRAC_PI_2, -FRAC_PI_2])
        .noticeable(0.026)
        .within(&[FaultKind::EncoderNoise, FaultKind::Chain])
        .useless(USELESS_OFFSET_RAD),
    Row::new(FaultKind::JointScale, "joint_scale", Sensor::Joints, Area::Encoders)
        .corrected("joint-scale", &[Part::Factor], "FACTOR")
        .fitted(&[SCALE], &[1.0])
        .noticeable(0.03)
        .tried(&[DEGREE, 1.0 / DEGREE])
        .within(&[FaultKind::EncoderNoise])
        .useless(USELESS_RATIO),
    Row::new(FaultKind::JointPlay, "joint_play", Sensor::Joints, Area::Encoders)
        .fitted(&[PLAY], &[-0.01, -0.03, -0.08, 0.01, 0.03])
        .noticeable(0.006)
        .within(&[FaultKind::EncoderNoise]),
    Row::new(FaultKind::ImuAxes, "imu_axes", Sensor::Imu, Area::Imu)
        .corrected("imu-axes", &[Part::Axes], "y/x/-z")
        .useless(0.0),
    Row::new(FaultKind::GyroscopeAxes, "gyroscope_axes", Sensor::Imu, Area::Imu)
        .corrected("gyroscope-axes", &[Part::Axes], "…")
        .useless(0.0),
    Row::new(FaultKind::AccelerometerAxes, "accelerometer_axes", Sensor::Imu, Area::Imu)
        .corrected("accelerometer-axes", &[Part::Axes], "…")
        .useless(0.0),
    // Wrong units and ranges: degrees and radians, g and m/s², half and double the range.
    Row::new(FaultKind::GyroscopeScale, "gyroscope_scale", Sensor::Imu, Area::Imu)
        .corrected("gyroscope-scale", &[Part::Factor], "FACTOR")
        .fitted(&[SCALE], &[1.0, 2.0, 0.5, DEGREE])
        .noticeable(0.03)
        .tried(&[DEGREE, 1.0 / DEGREE, 2.0, 0.5])
        .useless(USELESS_RATIO),
    Row::new(FaultKind::AccelerometerScale, "accelerometer_scale", Sensor::Imu, Area::Imu)
        .corrected("accelerometer-scale", &[Part::Factor], "FACTOR")
        .tried(&[STANDARD_GRAVITY_M_PER_S2, 1.0 / STANDARD_GRAVITY_M_PER_S2, 2.0, 0.5])
        .useless(USELESS_RATIO),
    Row::new(FaultKind::Clocks, "clocks", Sensor::Camera, Area::Time),
    Row::new(FaultKind::Shutter, "shutter", Sensor::Camera, Area::Time),
    Row::new(FaultKind::PrincipalPoint, "principal_point", Sensor::Camera, Area::Intrinsics)
        .fitted(&[CENTRE], &[0.0])
        .within(&[FaultKind::Intrinsics])
        .useless(USELESS_RATIO),
    Row::new(FaultKind::Intrinsics, "intrinsics", Sensor::Camera, Area::Intrinsics)
        .fitted(&[FOCAL, CENTRE], &[])
        .useless(USELESS_RATIO),
    Row::new(FaultKind::FocalPieces, "focal_pieces", Sensor::Camera, Area::Intrinsics).useless(0.0),
    Row::new(FaultKind::FocalPeriod, "focal_period", Sensor::Camera, Area::Intrinsics)
        .noticeable(0.01)
        .within(&[FaultKind::FocalPieces])
        .useless(USELESS_RATIO),
    Row::new(FaultKind::Radial, "radial_distortion", Sensor::Camera, Area::Intrinsics)
        .fitted(&[RADIAL], &[0.0])
        .noticeable(0.03)
        .useless(0.1),
    Row::new(FaultKind::ImageOrder, "image_order", Sensor::Camera, Area::Images).useless(0.01),
    Row::new(FaultKind::CameraDrift, "camera_drift", Sensor::Camera, Area::Time)
        .fitted(&[SHIFT, DRIFT], &[0.0])
        .noticeable(2e-4),
    Row::new(FaultKind::Mount, "mount", Sensor::Camera, Area::Extrinsics)
        .fitted(&[ROTATION], &[0.0])
        .noticeable(0.026)
        .useless(USELESS_ROTATION_RAD),
    Row::new(FaultKind::Chain, "extrinsics", Sensor::Camera, Area::Extrinsics).within(&[FaultKind::EncoderNoise]),
    Row::new(FaultKind::ImuIntrinsics, "imu_intrinsics", Sensor::Imu, Area::Imu),
    Row::new(FaultKind::ImuNoise, "imu_noise", Sensor::Imu, Area::Imu).tried(NOISE_FACTORS),
    Row::new(FaultKind::EncoderNoise, "encoder_noise", Sensor::Joints, Area::Encoders).tried(NOISE_FACTORS),
    Row::new(FaultKind::UnusableImu, "unusable_imu", Sensor::Imu, Area::Imu).useless(0.0),
    Row::new(FaultKind::UnusableJoints, "unusable_joints", Sensor::Joints, Area::Encoders).useless(0.0),
    Row::new(FaultKind::UnusableImages, "unusable_images", Sensor::Camera, Area::Images).useless(0.0),
    Row::new(FaultKind::ImagesExchanged, "images_exchanged", Sensor::Camera, Area::Images).useless(0.0),
];

const NOISE_FACTORS: &[f64] = &[3.0, 10.0, 30.0];

impl Row {
    const fn new(kind: FaultKind, key: &'static str, sensor: Sensor, area: Area) -> Self {
        Self {
            kind,
            key,
            sensor,
            area,
            correction: None,
            parameters: &[],
            starts: &[],
            trials: &[],
            noticeable: None,
            useless: None,
            general: &[],
        }
    }

    const fn corrected(self, name: &'static str, parts: &'static [Part], example: &'static str) -> Self {
        Self { correction: Some(Correction { name, parts, example }), ..self }
    }

    const fn fitted(self, parameters: &'static [Parameter], starts: &'static [f64]) -> Self {
        Self { parameters, starts, ..self }
    }

    const fn noticeable(self, size: f64) -> Self {
        Self { noticeable: Some(size), ..self }
    }

    const fn useless(self, size: f64) -> Self {
        Self { useless: Some(size), ..self }
    }

    const fn tried(self, trials: &'static [f64]) -> Self {
        Self { trials, ..self }
    }

    const fn within(self, general: &'static [FaultKind]) -> Self {
        Self { general, ..self }
    }

    /// Composition of a value with its change; a value that is not fitted is a factor or, in a shift, an addition.
    pub(super) fn change(&self, number: usize) -> Change {
        let parameter = self.parameters.get(number).or_else(|| self.parameters.last());
        parameter.map_or(Change::Ratio, |parameter| parameter.change)
    }
}

impl Change {
    /// Value without effect.
    pub(super) fn neutral(self) -> f64 {
        if self == Self::Ratio { 1.0 } else { 0.0 }
    }
}

impl FaultKind {
    pub fn row(self) -> &'static Row {
        TABLE.iter().find(|row| row.kind == self).expect("the table has a row of each kind")
    }

    /// True if this kind has the other one as a special case.
    pub fn contains(self, other: Self) -> bool {
        other.row().general.contains(&self)
    }
}

/// Names of the kinds in JSON.
impl Named for FaultKind {
    const NAMES: &'static [(Self, &'static str)] = &names();
}

const fn names() -> [(FaultKind, &'static str); TABLE.len()] {
    let mut names = [(FaultKind::Focal, ""); TABLE.len()];
    let mut number = 0;
    while number < TABLE.len() {
        names[number] = (TABLE[number].kind, TABLE[number].key);
        number += 1;
    }
    names
}
