//! Recorded gimbal attitude as a replacement of joint angles: its description in a rig.

use nalgebra::{UnitQuaternion, Vector3};

use super::{BodyAxes, NamedAxes};
use crate::gimbal::ClassicalChain;
use crate::text::{Entry, Named};

/// Message type, frame and axes of a recorded gimbal attitude (`gimbal.source` of a rig); its topic is the gimbal's.
#[derive(Clone, Debug, PartialEq)]
pub struct AttitudeSource {
    /// Message type and conversion of its values to a rotation.
    pub message: AttitudeMessage,
    /// Frame that the attitude is relative to.
    pub frame: AttitudeFrame,
    /// Axes of that frame and of the gimbal, x forward in both; for the earth frame, NED with FRD and ENU with FLU.
    pub axes: BodyAxes,
    /// Axes of the gimbal if they differ from [`AttitudeSource::axes`].
    pub gimbal_axes: Option<NamedAxes>,
    /// Axes of the rig's IMU relative to the vehicle.
    pub imu_axes: NamedAxes,
    /// Topic of the vehicle's attitude, required by frames other than the body.
    pub vehicle_topic: Option<String>,
    /// Axes of the vehicle's attitude if they differ from [`AttitudeSource::axes`].
    pub vehicle_axes: Option<BodyAxes>,
    /// Constant rotation of the attitude about the axis of the first joint, in radians, for a yaw whose zero is not
    /// forward.
    pub first_joint_offset_rad: f64,
    /// Chain that converts the attitude to joint angles; `None` for the rig's chain. A calibrated rig keeps the chain
    /// from before the calibration: the calibrated chain would give other joint angles, and so undo the calibration.
    pub chain: Option<Box<ClassicalChain>>,
}

/// Message type of the gimbal's attitude.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AttitudeMessage {
    /// Orientation in a `geometry_msgs/msg/QuaternionStamped`.
    Quaternion,
    /// Orientation of a `PoseStamped`, an `Odometry` or a `TransformStamped`.
    Pose,
    /// `geometry_msgs/msg/Vector3Stamped` with Euler angles.
    Euler(EulerAngles),
    /// Transforms between two frames in `tf2_msgs/msg/TFMessage`.
    Transforms {
        /// Frame that the attitude is relative to.
        parent: String,
        /// Frame of the gimbal.
        child: String,
    },
    /// Status of a gimbal device, `mavros_msgs/msg/GimbalDeviceAttitudeStatus`.
    Mavros,
    /// Status of a gimbal device, `px4_msgs/msg/GimbalDeviceAttitudeStatus`.
    Px4,
}

impl AttitudeMessage {
    /// Value of `type` in a rig's source.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Quaternion => "quaternion",
            Self::Pose => "pose",
            Self::Euler(_) => "euler",
            Self::Transforms { .. } => "tf",
            Self::Mavros => "mavros",
            Self::Px4 => "px4",
        }
    }
}

/// Recorded attitude of a gimbal, not yet interpreted by the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AttitudeValue {
    /// Rotation from the gimbal to the frame of the source, in the axes of the source.
    Rotation(UnitQuaternion<f64>),
    Vector(Vector3<f64>),
    /// Rotation with the flags of a `MAVLink` message.
    Flagged(UnitQuaternion<f64>, u16),
}

impl AttitudeSource {
    pub fn frame_of(&self, value: &AttitudeValue) -> AttitudeFrame {
        match (self.frame, value) {
            (AttitudeFrame::Flags, AttitudeValue::Flagged(_, flags)) => AttitudeFrame::of_flags(*flags),
            (frame, _) => frame,
        }
    }

    /// Rotation from the gimbal to the frame of a recorded attitude, in the axes of the source.
    fn frame_from_gimbal(&self, value: &AttitudeValue) -> Option<UnitQuaternion<f64>> {
        match (value, &self.message) {
            (AttitudeValue::Rotation(rotation) | AttitudeValue::Flagged(rotation, _), _) => Some(*rotation),
            (AttitudeValue::Vector(vector), AttitudeMessage::Euler(angles)) => Some(angles.rotation(vector)),
            (AttitudeValue::Vector(_), _) => None,
        }
    }

    /// Interpolates two recorded attitudes at a fraction of the time between them; `None` if their frames differ.
    pub fn between(&self, first: &AttitudeValue, second: &AttitudeValue, fraction: f64) -> Option<AttitudeValue> {
        let frame = self.frame_of(first);
        if self.frame_of(second) != frame {
            return None;
        }
        let (from, to) = (self.frame_from_gimbal(first)?, self.frame_from_gimbal(second)?);
        let rotation = from.try_slerp(&to, fraction, 1e-9)?;
        Some(match first {
            AttitudeValue::Flagged(_, flags) => AttitudeValue::Flagged(rotation, *flags),
            _ => AttitudeValue::Rotation(rotation),
        })
    }

    /// Converts a recorded attitude to the rotation `imu_from_camera` (camera: x right, y down, z forward).
    ///
    /// `enu_from_flu` is the vehicle's attitude by [`AttitudeSource::enu_from_flu`], required by frames other than the
    /// body.
    /// Returns `None` without it, and for the vehicle frame if the vehicle points up or down and has no heading.
    pub fn imu_from_camera(
        &self,
        value: &AttitudeValue,
        enu_from_flu: Option<&UnitQuaternion<f64>>,
    ) -> Option<UnitQuaternion<f64>> {
        let frame_from_gimbal = self.frame_from_gimbal(value)?;
        let gimbal_axes = self.gimbal_axes.unwrap_or_else(|| self.axes.into());
        let frame_from_gimbal = frame_from_gimbal * gimbal_axes.flu_from_axes().inverse();
        let vehicle_from_gimbal = match self.frame_of(value) {
            AttitudeFrame::Body | AttitudeFrame::Flags => self.axes.flu_from_axes() * frame_from_gimbal,
            AttitudeFrame::Vehicle => {
                let attitude = enu_from_flu?;
                let forward = attitude * Vector3::x();
                if forward.xy().norm() < MIN_HORIZONTAL {
                    return None;
                }
                let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), forward.y.atan2(forward.x));
                attitude.inverse() * heading * self.axes.flu_from_axes() * frame_from_gimbal
            }
            AttitudeFrame::Earth => enu_from_flu?.inverse() * self.axes.enu_from_earth() * frame_from_gimbal,
        };
        Some(self.imu_axes.flu_from_axes().inverse() * vehicle_from_gimbal * NamedAxes::RDF.flu_from_axes())
    }

    /// Vehicle's attitude in axes forward, left, up and east, north, up, from the recorded `earth_from_vehicle`; PX4's
    /// messages are in FRD and NED.
    pub fn enu_from_flu(&self, earth_from_vehicle: &UnitQuaternion<f64>, of_px4: bool) -> UnitQuaternion<f64> {
        let axes = if of_px4 { BodyAxes::Frd } else { self.vehicle_axes.unwrap_or(self.axes) };
        axes.enu_from_earth() * earth_from_vehicle * axes.flu_from_axes().inverse()
    }
}

/// Smallest horizontal part of the forward direction that defines a heading for the vehicle frame (1°).
const MIN_HORIZONTAL: f64 = 0.0175;

/// Frame that a gimbal's attitude is relative to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AttitudeFrame {
    Body,
    /// `MAVLink`'s vehicle frame: levelled, x towards the vehicle's heading.
    Vehicle,
    /// North and east of the earth.
    Earth,
    /// Vehicle or earth frame by the `MAVLink` flags of each message.
    Flags,
}

/// Names in a rig.
impl Named for AttitudeFrame {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Body, "body"), (Self::Vehicle, "vehicle"), (Self::Earth, "earth"), (Self::Flags, "flags")];
}

impl AttitudeFrame {
    /// Frame by the flags of a `GIMBAL_DEVICE_ATTITUDE_STATUS`: the flag of the yaw's frame; without one, the yaw lock.
    pub fn of_flags(flags: u16) -> Self {
        const YAW_LOCK: u16 = 16;
        const YAW_IN_VEHICLE_FRAME: u16 = 32;
        const YAW_IN_EARTH_FRAME: u16 = 64;
        let names_vehicle = flags & YAW_IN_VEHICLE_FRAME != 0;
        if flags & YAW_IN_EARTH_FRAME != 0 || (!names_vehicle && flags & YAW_LOCK != 0) {
            Self::Earth
        } else {
            Self::Vehicle
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AngleUnit {
    Radians,
    Degrees,
}

/// Names in a rig.
impl Named for AngleUnit {
    const NAMES: &'static [(Self, &'static str)] = &[(Self::Radians, "rad"), (Self::Degrees, "deg")];
}

impl AngleUnit {
    fn radians(self, angle: f64) -> f64 {
        match self {
            Self::Radians => angle,
            Self::Degrees => angle.to_radians(),
        }
    }
}

/// Euler angles in the fields of a vector: intrinsic rotations, from the frame to the gimbal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EulerAngles {
    /// At most one rotation about each axis, in the order of the rotations.
    pub order: Vec<EulerRotation>,
    pub unit: AngleUnit,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EulerRotation {
    /// 0 (x, roll), 1 (y, pitch) or 2 (z, yaw).
    pub axis: usize,
    /// Field of the vector with the angle: 0 (x), 1 (y) or 2 (z).
    pub field: usize,
    /// True if the field holds the negative angle.
    pub negative: bool,
}

impl EulerAngles {
    /// Names of the rotations about x, y and z.
    const ROTATIONS: [&'static str; 3] = ["roll", "pitch", "yaw"];
    /// Names of the vector's fields.
    const FIELDS: [&'static str; 3] = ["x", "y", "z"];

    /// Parses the order of a rig, such as `yaw=z roll=y pitch=-x`; `None` for another text.
    pub fn parse_order(text: &str) -> Option<Vec<EulerRotation>> {
        let mut order: Vec<EulerRotation> = Vec::new();
        for word in text.split_whitespace() {
            let Entry { key: rotation, value: field } = Entry::parse(word)?;
            let axis = Self::ROTATIONS.iter().position(|name| *name == rotation)?;
            let (negative, field) = field.strip_prefix('-').map_or((false, field), |field| (true, field));
            let field = Self::FIELDS.iter().position(|name| *name == field)?;
            if order.iter().any(|other| other.axis == axis || other.field == field) {
                return None;
            }
            order.push(EulerRotation { axis, field, negative });
        }
        (!order.is_empty()).then_some(order)
    }

    /// Order in the notation of a rig.
    pub fn order_text(&self) -> String {
        let word = |rotation: &EulerRotation| {
            let sign = if rotation.negative { "-" } else { "" };
            format!("{}={sign}{}", Self::ROTATIONS[rotation.axis], Self::FIELDS[rotation.field])
        };
        self.order.iter().map(word).collect::<Vec<_>>().join(" ")
    }

    /// Rotation from the gimbal to the frame for a vector of Euler angles.
    pub fn rotation(&self, vector: &Vector3<f64>) -> UnitQuaternion<f64> {
        let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
        self.order.iter().fold(UnitQuaternion::identity(), |before, rotation| {
            let angle_rad = self.unit.radians(vector[rotation.field]);
            let signed = if rotation.negative { -angle_rad } else { angle_rad };
            before * UnitQuaternion::from_axis_angle(&axes[rotation.axis], signed)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flags_of_mavlink_name_the_frame() {
        for (flags, frame) in [
            (0, AttitudeFrame::Vehicle),
            (12, AttitudeFrame::Vehicle),
            (16, AttitudeFrame::Earth),
            (16 + 32, AttitudeFrame::Vehicle),
            (64, AttitudeFrame::Earth),
            (64 + 16, AttitudeFrame::Earth),
        ] {
            assert_eq!(AttitudeFrame::of_flags(flags), frame, "{flags}");
        }
    }

    #[test]
    fn euler_angles_follow_their_order() {
        let order = EulerAngles::parse_order("yaw=z roll=y pitch=-x").unwrap();
        let angles = EulerAngles { order, unit: AngleUnit::Degrees };
        assert_eq!(angles.order_text(), "yaw=z roll=y pitch=-x");
        let about = |axis, degrees: f64| UnitQuaternion::from_axis_angle(&axis, degrees.to_radians());
        let expected =
            about(Vector3::z_axis(), 30.0) * about(Vector3::x_axis(), 20.0) * about(Vector3::y_axis(), -10.0);
        assert!(angles.rotation(&Vector3::new(10.0, 20.0, 30.0)).angle_to(&expected) < 1e-12);
        for text in ["", "yaw", "yaw=w", "turn=x", "yaw=x yaw=y", "yaw=x pitch=x", "yaw=+x", "yaw = x"] {
            assert_eq!(EulerAngles::parse_order(text), None, "{text}");
        }
    }
}
