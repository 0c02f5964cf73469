//! The message definitions that are written into a log, in ROS 2's `ros2msg` format: the type itself, then every type it
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
const STAMPED_POSE: &str = "geometry_msgs/PoseStamped";
const STAMPED_TRANSFORM: &str = "geometry_msgs/TransformStamped";
const POINT_FIELD: &str = "sensor_msgs/PointField";
const CIRCLE: &str = "foxglove_msgs/CircleAnnotation";
const POINTS: &str = "foxglove_msgs/PointsAnnotation";
const TEXT: &str = "foxglove_msgs/TextAnnotation";
const COLOR: &str = "foxglove_msgs/Color";
const POINT2: &str = "foxglove_msgs/Point2";

/// The fields of a type, and the types that they need.
pub(super) type Definition<'a> = (&'a str, &'a [&'a str]);

/// Types of a header.
pub(super) const HEADER_NEEDS: &[&str] = &[HEADER, TIME];
/// `nav_msgs/msg/Path`.
pub(super) const PATH: Definition<'_> = (
    "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses",
    &[HEADER, TIME, STAMPED_POSE, POSE, POINT, QUATERNION],
);
/// `tf2_msgs/msg/TFMessage`.
pub(super) const TRANSFORMS: Definition<'_> =
    ("geometry_msgs/TransformStamped[] transforms", &[STAMPED_TRANSFORM, HEADER, TIME, TRANSFORM, VECTOR3, QUATERNION]);
/// `sensor_msgs/msg/PointCloud2`.
pub(super) const POINT_CLOUD: Definition<'_> = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n\
     uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense",
    &[HEADER, TIME, POINT_FIELD],
);
/// `foxglove_msgs/msg/ImageAnnotations`.
pub(super) const IMAGE_ANNOTATIONS: Definition<'_> = (
    "foxglove_msgs/CircleAnnotation[] circles\nfoxglove_msgs/PointsAnnotation[] points\n\
     foxglove_msgs/TextAnnotation[] texts",
    &[TIME, CIRCLE, POINTS, TEXT, COLOR, POINT2],
);
/// `rcl_interfaces/msg/Log`.
pub(super) const LOG_LINE: Definition<'_> = (
    "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\nbuiltin_interfaces/Time stamp\n\
     uint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line",
    &[TIME],
);

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
        STAMPED_POSE => "std_msgs/Header header\ngeometry_msgs/Pose pose",
        STAMPED_TRANSFORM => "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
        POINT_FIELD => {
            "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\n\
             uint8 FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count"
        }
        CIRCLE => {
            "builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\nfloat64 diameter\nfloat64 thickness\n\
             foxglove_msgs/Color fill_color\nfoxglove_msgs/Color outline_color"
        }
        POINTS => {
            "uint8 UNKNOWN=0\nuint8 POINTS=1\nuint8 LINE_LOOP=2\nuint8 LINE_STRIP=3\nuint8 LINE_LIST=4\n\
             builtin_interfaces/Time timestamp\nuint8 type\nfoxglove_msgs/Point2[] points\n\
             foxglove_msgs/Color outline_color\nfoxglove_msgs/Color[] outline_colors\n\
             foxglove_msgs/Color fill_color\nfloat64 thickness"
        }
        TEXT => {
            "builtin_interfaces/Time timestamp\nfoxglove_msgs/Point2 position\nstring text\nfloat64 font_size\n\
             foxglove_msgs/Color text_color\nfoxglove_msgs/Color background_color"
        }
        COLOR => "float64 r\nfloat64 g\nfloat64 b\nfloat64 a",
        POINT2 => "float64 x\nfloat64 y",
        _ => "",
    }
}

/// The fields of a message, and the types they need.
fn fields(kind: MessageKind) -> Definition<'static> {
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
    compose(&fields(kind))
}

/// A type's own fields, then every type that it needs.
pub(super) fn compose((own, needed): &Definition<'_>) -> String {
    let mut text = format!("{own}\n");
    for name in *needed {
        text.extend([&"=".repeat(80), "\nMSG: ", name, "\n", dependency(name), "\n"]);
    }
    text
}
