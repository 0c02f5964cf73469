//! The message definitions that are written into a log, in ROS 2's `ros2msg` form: the type itself, then every type it
//! needs after a line of 80 equals signs.

use super::super::MessageKind;

const HEADER: &str = "std_msgs/Header";
const TIME: &str = "builtin_interfaces/Time";
const VECTOR3: &str = "geometry_msgs/Vector3";
const QUATERNION: &str = "geometry_msgs/Quaternion";
const POINT: &str = "geometry_msgs/Point";
const POSE: &str = "geometry_msgs/Pose";
const TRANSFORM: &str = "geometry_msgs/Transform";
const POSE_COVARIANCE: &str = "geometry_msgs/PoseWithCovariance";
const TWIST: &str = "geometry_msgs/Twist";
const TWIST_COVARIANCE: &str = "geometry_msgs/TwistWithCovariance";
const REGION: &str = "sensor_msgs/RegionOfInterest";

/// The fields of a type that others need.
fn dependency(name: &str) -> &'static str {
    match name {
        HEADER => "builtin_interfaces/Time stamp\nstring frame_id",
        TIME => "int32 sec\nuint32 nanosec",
        VECTOR3 | POINT => "float64 x\nfloat64 y\nfloat64 z",
        QUATERNION => "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1",
        POSE => "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
        TRANSFORM => "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
        POSE_COVARIANCE => "geometry_msgs/Pose pose\nfloat64[36] covariance",
        TWIST => "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
        TWIST_COVARIANCE => "geometry_msgs/Twist twist\nfloat64[36] covariance",
        REGION => "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify",
        _ => "",
    }
}

/// The fields of a message, and the types they need.
fn fields(kind: MessageKind) -> (&'static str, &'static [&'static str]) {
    match kind {
        MessageKind::Imu => (
            "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
             geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
             geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
            &[HEADER, TIME, QUATERNION, VECTOR3],
        ),
        MessageKind::Image => (
            "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n\
             uint8[] data",
            &[HEADER, TIME],
        ),
        MessageKind::CompressedImage => ("std_msgs/Header header\nstring format\nuint8[] data", &[HEADER, TIME]),
        MessageKind::CameraInfo => (
            "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n\
             float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi",
            &[HEADER, TIME, REGION],
        ),
        MessageKind::JointState => (
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
            &[HEADER, TIME],
        ),
        MessageKind::Odometry => (
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
             geometry_msgs/TwistWithCovariance twist",
            &[HEADER, TIME, POSE_COVARIANCE, POSE, POINT, QUATERNION, TWIST_COVARIANCE, TWIST, VECTOR3],
        ),
        MessageKind::PoseStamped => {
            ("std_msgs/Header header\ngeometry_msgs/Pose pose", &[HEADER, TIME, POSE, POINT, QUATERNION])
        }
        MessageKind::TransformStamped => (
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
            &[HEADER, TIME, TRANSFORM, VECTOR3, QUATERNION],
        ),
    }
}

/// The whole definition of a message type.
pub(super) fn definition(kind: MessageKind) -> String {
    let (own, needed) = fields(kind);
    let mut text = format!("{own}\n");
    for name in needed {
        text.extend([&"=".repeat(80), "\nMSG: ", name, "\n", dependency(name), "\n"]);
    }
    text
}
