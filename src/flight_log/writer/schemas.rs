//! Message definitions that are written into a log, in ROS 2's `ros2msg` format: the type itself, then every type it
//! needs after a line of 80 equals signs.
//! The fields of each type are a file of `assets/messages/`.

use super::super::MessageKind;

/// Fields of a type, from its file.
macro_rules! fields {
    ($name:literal) => {
        include_str!(concat!("../../../assets/messages/", $name, ".msg"))
    };
}

/// Name and fields of a type that others need.
macro_rules! needed {
    ($name:literal) => {
        ($name, fields!($name))
    };
}

/// Name and fields of a type that others need.
type Needed = (&'static str, &'static str);

const HEADER: Needed = needed!("std_msgs/Header");
const TIME: Needed = needed!("builtin_interfaces/Time");
const VECTOR3: Needed = needed!("geometry_msgs/Vector3");
const QUATERNION: Needed = needed!("geometry_msgs/Quaternion");
const POINT: Needed = needed!("geometry_msgs/Point");
const POSE: Needed = needed!("geometry_msgs/Pose");
const TRANSFORM: Needed = needed!("geometry_msgs/Transform");
const POSE_COVARIANCE: Needed = needed!("geometry_msgs/PoseWithCovariance");
const TWIST: Needed = needed!("geometry_msgs/Twist");
const TWIST_COVARIANCE: Needed = needed!("geometry_msgs/TwistWithCovariance");
const REGION: Needed = needed!("sensor_msgs/RegionOfInterest");
const STAMPED_POSE: Needed = needed!("geometry_msgs/PoseStamped");
const STAMPED_TRANSFORM: Needed = needed!("geometry_msgs/TransformStamped");
const POINT_FIELD: Needed = needed!("sensor_msgs/PointField");
const CIRCLE: Needed = needed!("foxglove_msgs/CircleAnnotation");
const POINTS: Needed = needed!("foxglove_msgs/PointsAnnotation");
const TEXT: Needed = needed!("foxglove_msgs/TextAnnotation");
const COLOR: Needed = needed!("foxglove_msgs/Color");
const POINT2: Needed = needed!("foxglove_msgs/Point2");

/// Fields of a type, and the types that they need.
pub(super) type Definition<'a> = (&'a str, &'a [Needed]);

/// Types of a header.
pub(super) const HEADER_NEEDS: &[Needed] = &[HEADER, TIME];
pub(super) const PATH: Definition<'_> =
    (fields!("nav_msgs/Path"), &[HEADER, TIME, STAMPED_POSE, POSE, POINT, QUATERNION]);
pub(super) const TRANSFORMS: Definition<'_> =
    (fields!("tf2_msgs/TFMessage"), &[STAMPED_TRANSFORM, HEADER, TIME, TRANSFORM, VECTOR3, QUATERNION]);
pub(super) const POINT_CLOUD: Definition<'_> = (fields!("sensor_msgs/PointCloud2"), &[HEADER, TIME, POINT_FIELD]);
pub(super) const IMAGE_ANNOTATIONS: Definition<'_> =
    (fields!("foxglove_msgs/ImageAnnotations"), &[TIME, CIRCLE, POINTS, TEXT, COLOR, POINT2]);
pub(super) const LOG_LINE: Definition<'_> = (fields!("rcl_interfaces/Log"), &[TIME]);

/// Fields of a message, and the types they need.
fn fields(kind: MessageKind) -> Definition<'static> {
    match kind {
        MessageKind::Imu => (fields!("sensor_msgs/Imu"), &[HEADER, TIME, QUATERNION, VECTOR3]),
        MessageKind::Image => (fields!("sensor_msgs/Image"), &[HEADER, TIME]),
        MessageKind::CompressedImage => (fields!("sensor_msgs/CompressedImage"), &[HEADER, TIME]),
        // Protobuf has a definition of its own; these are the same fields in ROS 2.
        MessageKind::CompressedVideo | MessageKind::CompressedVideoProtobuf => {
            (fields!("foxglove_msgs/CompressedVideo"), &[TIME])
        }
        MessageKind::FfmpegPacket => (fields!("ffmpeg_image_transport_msgs/FFMPEGPacket"), &[HEADER, TIME]),
        MessageKind::CameraInfo => (fields!("sensor_msgs/CameraInfo"), &[HEADER, TIME, REGION]),
        MessageKind::JointState => (fields!("sensor_msgs/JointState"), &[HEADER, TIME]),
        MessageKind::Odometry => (
            fields!("nav_msgs/Odometry"),
            &[HEADER, TIME, POSE_COVARIANCE, POSE, POINT, QUATERNION, TWIST_COVARIANCE, TWIST, VECTOR3],
        ),
        MessageKind::PoseStamped => (fields!("geometry_msgs/PoseStamped"), &[HEADER, TIME, POSE, POINT, QUATERNION]),
        MessageKind::TransformStamped => {
            (fields!("geometry_msgs/TransformStamped"), &[HEADER, TIME, TRANSFORM, VECTOR3, QUATERNION])
        }
        MessageKind::QuaternionStamped => (fields!("geometry_msgs/QuaternionStamped"), &[HEADER, TIME, QUATERNION]),
        MessageKind::Vector3Stamped => (fields!("geometry_msgs/Vector3Stamped"), &[HEADER, TIME, VECTOR3]),
        MessageKind::Transforms => TRANSFORMS,
        MessageKind::MavrosGimbalAttitude => {
            (fields!("mavros_msgs/GimbalDeviceAttitudeStatus"), &[HEADER, TIME, QUATERNION])
        }
        MessageKind::Px4GimbalAttitude => (fields!("px4_msgs/GimbalDeviceAttitudeStatus"), &[]),
        MessageKind::Px4VehicleAttitude => (fields!("px4_msgs/VehicleAttitude"), &[]),
    }
}

/// Complete definition of a message type.
pub(super) fn definition(kind: MessageKind) -> String {
    compose(&fields(kind))
}

/// Fields of a type, then every type that it needs.
pub(super) fn compose((root, needed): &Definition<'_>) -> String {
    let mut text = format!("{}\n", root.trim_end());
    for (name, fields) in *needed {
        text.extend([&"=".repeat(80), "\nMSG: ", name, "\n", fields]);
    }
    text
}
