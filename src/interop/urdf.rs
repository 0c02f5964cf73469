//! A rig as a robot description (URDF): a file of its own, or the calibrated chain written into a given one.

use std::fmt::Write as _;

use super::text::MARK;
use super::{Configuration, ConfigurationError};
use crate::files::urdf::{ChangedOrigin, LinkPath, UrdfError, roll_pitch_yaw};
use crate::geometry::RigidTransform;
use crate::sensors::{CameraMount, CameraRig, GimbalRig, Rig};
use crate::text::printable;

/// Link of the IMU, the root of the written tree.
const IMU_LINK: &str = "imu_link";

/// A robot description of the IMU, the gimbal and these cameras; all if no key is given.
///
/// The frame of a camera's link has x right, y down and z forward; joint angles are encoder readings.
///
/// # Errors
/// If a key does not belong to the rig.
pub fn robot_description(rig: &Rig, cameras: &[String]) -> Result<Configuration, ConfigurationError> {
    let chosen: Vec<&CameraRig> = if cameras.is_empty() {
        rig.cameras.iter().collect()
    } else {
        cameras.iter().map(|key| rig.camera(key)).collect::<Result<_, _>>()?
    };
    let mut notes = vec![
        "time offsets, intrinsics, readout and standard deviations of the rig are left out".to_owned(),
        "efforts and velocities of the joints are unknown: 0".to_owned(),
    ];
    if !rig.assumed.is_empty() {
        let fields: Vec<&str> = rig.assumed.iter().map(|assumed| assumed.field.as_str()).collect();
        notes.push(format!("the rig only assumes {}: measure or confirm them", fields.join(", ")));
    }
    let mut text = String::from("<?xml version=\"1.0\"?>\n");
    let head = std::iter::once(format!("{MARK} for URDF from the rig '{}'", printable(&rig.name)));
    for line in head.chain(notes.iter().cloned()) {
        // A comment of XML must not contain two hyphens in a row.
        let _infallible = writeln!(text, "<!-- {} -->", printable(&line).replace("--", "- -"));
    }
    let _infallible = writeln!(text, "<robot name=\"{}\">\n  <link name=\"{IMU_LINK}\"/>", escaped(&rig.name));
    let mut end_of_gimbal = (IMU_LINK.to_owned(), RigidTransform::identity());
    if let Some(gimbal) = rig.gimbal.as_ref().filter(|_| chosen.iter().any(|camera| is_gimballed(camera))) {
        end_of_gimbal = add_gimbal(&mut text, gimbal);
    }
    for camera in chosen {
        let (parent, pose) = match &camera.mount {
            CameraMount::Static { imu_from_camera } => (IMU_LINK, *imu_from_camera),
            CameraMount::Gimbal => (end_of_gimbal.0.as_str(), end_of_gimbal.1),
        };
        let link = format!("{}_optical", escaped(&camera.key));
        let _infallible = write!(
            text,
            "  <link name=\"{link}\"/>\n  <joint name=\"{link}_joint\" type=\"fixed\">\n    <parent link=\"{parent}\"/>\n    \
             <child link=\"{link}\"/>\n    {}\n  </joint>\n",
            origin(&pose)
        );
    }
    text.push_str("</robot>\n");
    let stem: String = rig.name.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '_' }).collect();
    let name = format!("{}.urdf", if stem.is_empty() { "rig" } else { &stem });
    Ok(Configuration { files: vec![(name, text.into_bytes())], notes })
}

/// A given robot description with the calibrated chain of a rig's camera: only origins of joints change.
///
/// # Errors
/// When the joints of both differ, or a changed pose has no joint of its own.
pub fn calibrated_description(
    rig: &Rig,
    camera: &CameraRig,
    path: &LinkPath<'_>,
    file_name: &str,
) -> Result<Configuration, UrdfError> {
    let joints = if is_gimballed(camera) { rig.joint_names() } else { Vec::new() };
    let chain = rig.chain_of_camera(&camera.key).unwrap_or_default();
    let (text, changed) = path.with_calibration(&joints, &chain)?;
    let notes = if changed.is_empty() {
        vec!["the robot description agrees with the rig: no origin is changed".to_owned()]
    } else {
        changed.iter().map(described).collect()
    };
    Ok(Configuration { files: vec![(file_name.to_owned(), text.into_bytes())], notes })
}

fn is_gimballed(camera: &CameraRig) -> bool {
    camera.mount == CameraMount::Gimbal
}

/// Change of an origin in millimetres and degrees.
fn described(changed: &ChangedOrigin) -> String {
    let shift_mm = 1e3 * (changed.after.translation_m - changed.before.translation_m).norm();
    let angle_deg = changed.before.rotation.angle_to(&changed.after.rotation).to_degrees();
    format!("origin of joint '{}' changed by {shift_mm:.3} mm and {angle_deg:.4}°", changed.joint)
}

/// Writes the joints of a gimbal; returns the last link and the pose of the camera in it.
fn add_gimbal(text: &mut String, gimbal: &GimbalRig) -> (String, RigidTransform) {
    let chain = &gimbal.chain;
    let (mut parent, mut pose) = (IMU_LINK.to_owned(), chain.imu_from_base);
    for (joint, link) in gimbal.joints.iter().zip(&chain.links) {
        // The rotation of a link by its angle and offset comes first: the offset belongs to the origin of the joint.
        let behind = link.transform(-link.theta_offset_rad);
        let offset = link.transform(0.0) * behind.inverse();
        let name = escaped(&joint.name);
        let (lower, upper) = joint.limits_rad;
        let _infallible = write!(
            text,
            "  <link name=\"{name}_link\"/>\n  <joint name=\"{name}\" type=\"revolute\">\n    <parent link=\"{parent}\"/>\n    \
             <child link=\"{name}_link\"/>\n    {}\n    <axis xyz=\"0 0 1\"/>\n    <limit lower=\"{lower}\" upper=\"{upper}\" \
             effort=\"0\" velocity=\"0\"/>\n  </joint>\n",
            origin(&(pose * offset))
        );
        (parent, pose) = (format!("{name}_link"), behind);
    }
    (parent, pose * chain.effector_from_camera)
}

fn origin(pose: &RigidTransform) -> String {
    let numbers = |values: &[f64]| {
        // Adding zero converts −0 to 0.
        values.iter().map(|value| format!("{}", value + 0.0)).collect::<Vec<_>>().join(" ")
    };
    let (xyz, rpy) = (numbers(pose.translation_m.as_slice()), numbers(&roll_pitch_yaw(&pose.rotation)));
    format!("<origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>")
}

/// Text as the value of an attribute.
fn escaped(text: &str) -> String {
    printable(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
