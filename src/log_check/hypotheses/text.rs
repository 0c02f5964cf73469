//! Findings of the hypotheses in words, with values, times and remedies.

use super::super::correction::USELESS_DELAY_S;
use super::cause::NamedCause;
use super::fault::recorded_axes;
use super::fit::{Fitted, Kind};
use super::joint_unit::JointUnit;
use crate::log_check::report::{Area, Severity};
use crate::log_check::rotations::data::RotationData;

/// Relative errors of intrinsics and scales above which results are useless.
const USELESS_RATIO: f64 = 0.05;

/// Cause that a fit describes.
pub(super) fn cause(data: &RotationData<'_>, found: &Fitted) -> NamedCause {
    let key = &data.camera.key;
    let correction = &found.correction;
    let graded = |change: f64| if change.abs() > USELESS_RATIO { Severity::Error } else { Severity::Warning };
    match &found.kind {
        Kind::LeftHanded => left_handed(data, found),
        Kind::GyroscopeScale => gyroscope_scale(correction.gyroscope_scale),
        Kind::Focal => focal(data, correction.lens.focal),
        Kind::Centre | Kind::Intrinsics => intrinsics(data, found),
        Kind::FocalPieces(pieces) => focal_pieces(key, pieces),
        Kind::CameraDrift => {
            let ppm = correction.camera_drift * 1e6;
            NamedCause::new(
                Severity::Warning,
                Area::Time,
                format!("the time offset of {key} drifts by {:+.2} ms per second ({ppm:+.0} ppm)", ppm * 1e-3),
                format!("stamp {key} and the IMU with one clock, or record shorter logs and use timeshift=on"),
            )
        }
        Kind::Mount => {
            let angle_deg = correction.mount.angle().to_degrees();
            let since_s = found.since_s.unwrap_or(0.0);
            NamedCause::new(
                if angle_deg > 3.0 { Severity::Error } else { Severity::Warning },
                Area::Extrinsics,
                format!("the mount of {key} moves: rotated by {angle_deg:.1}° from about {since_s:.1} s on"),
                format!("use the log up to {since_s:.1} s, fix the mount, and calibrate again"),
            )
        }
        Kind::JointSigns(joints) => {
            let names = joint_names(data, joints);
            let (verb, noun) = if joints.len() == 1 { ("counts", "joint") } else { ("count", "joints") };
            NamedCause::new(
                Severity::Error,
                Area::Encoders,
                format!("{noun} {names} {verb} in the other direction than in the rig"),
                format!(
                    "reverse the sign of the readings of {names} in the driver, or describe the {noun} with the opposite axis in gimbal.links (alpha of the neighbouring links ± π)"
                ),
            )
        }
        Kind::JointOrder => {
            let all = data.rig.gimbal.as_ref().map(|gimbal| &gimbal.joints);
            let name = |joint: usize| all.and_then(|all| all.get(joint)).map_or("?", |joint| joint.name.as_str());
            let exchanged: Vec<String> = (correction.joints.iter().enumerate())
                .filter(|(joint, change)| *joint != change.source)
                .map(|(joint, change)| format!("'{}' contains the angle of '{}'", name(change.source), name(joint)))
                .collect();
            NamedCause::new(
                Severity::Error,
                Area::Encoders,
                format!("joint names are exchanged: {}", exchanged.join(", ")),
                "correct the names in the driver, or gimbal.links[].joint in the rig".to_owned(),
            )
        }
        Kind::JointUnit => {
            let size_rad = correction.joints.first().map_or(1.0, |joint| joint.scale);
            let unit = JointUnit::of_size(size_rad).map_or_else(|| "in another unit".to_owned(), JointUnit::describe);
            let title = format!("joint angles are {unit}");
            let remedy = "sensor_msgs/JointState requires radians: correct the driver".to_owned();
            NamedCause::new(Severity::Error, Area::Encoders, title, remedy)
        }
        Kind::JointScale(joint) => {
            let scale = correction.joints[*joint].scale;
            let name = joint_names(data, &[*joint]);
            NamedCause::new(
                graded(scale - 1.0),
                Area::Encoders,
                format!("readings of joint {name} are {:.3} times its angle", 1.0 / scale),
                "check the unit of the readings and the gear ratio of the encoder".to_owned(),
            )
        }
        Kind::JointOffset(joint) => joint_offset(data, found, *joint),
        Kind::JointDelay => {
            let delay_ms = correction.joint_delay_s * 1e3;
            let late = if delay_ms > 0.0 { "late" } else { "early" };
            let given_s = data.rig.gimbal.as_ref().map_or(0.0, |gimbal| gimbal.timeshift_gimbal_imu_s);
            NamedCause::new(
                if correction.joint_delay_s.abs() > USELESS_DELAY_S { Severity::Error } else { Severity::Warning },
                Area::Time,
                format!("joint angles are {:.0} ms {late}", delay_ms.abs()),
                format!("set gimbal.timeshift_gimbal_imu to {:+.3}", given_s - correction.joint_delay_s),
            )
        }
    }
}

fn joint_names(data: &RotationData<'_>, joints: &[usize]) -> String {
    let all = data.rig.gimbal.as_ref().map(|gimbal| &gimbal.joints);
    let name = |joint: &usize| all.and_then(|all| all.get(*joint)).map(|joint| format!("'{}'", joint.name));
    joints.iter().filter_map(name).collect::<Vec<_>>().join(" and ")
}

/// Left-handed frame of the gyroscope; the camera's orientation by the rig says which axes are exchanged.
fn left_handed(data: &RotationData<'_>, found: &Fitted) -> NamedCause {
    let axes = recorded_axes(data, found).map(|axes| axes.inverse());
    let which = axes.map_or_else(String::new, |axes| format!(" ({})", axes.describe()));
    let title = format!("the axes of the gyroscope form a left-handed frame{which}");
    let remedy = "correct order and signs of the axes in the IMU's driver, of gyroscope and accelerometer alike; no T_cam_imu \
                  can describe it";
    NamedCause::new(Severity::Error, Area::Imu, title, remedy)
}

fn gyroscope_scale(correction: f64) -> NamedCause {
    let measured = 1.0 / correction;
    let near = |value: f64| (measured / value - 1.0).abs() < USELESS_RATIO;
    let degrees = 180.0 / std::f64::consts::PI;
    let (title, remedy) = if near(degrees) {
        ("angular velocities are in degrees per second".to_owned(), "sensor_msgs/Imu requires rad/s".to_owned())
    } else if near(1.0 / degrees) {
        ("angular velocities are 57 times too small".to_owned(), "do not convert degrees to radians twice".to_owned())
    } else {
        let setting = [0.25, 0.5, 2.0, 4.0].into_iter().any(near);
        let remedy = if setting {
            "its range setting and the scale of its driver differ: correct one of them"
        } else {
            "calibrate the gyroscope's scale (imu0's intrinsics in the rig), or check its driver"
        };
        (format!("the gyroscope measures {measured:.3} times the rotation"), remedy.to_owned())
    };
    let severity = if (measured - 1.0).abs() > USELESS_RATIO { Severity::Error } else { Severity::Warning };
    NamedCause::new(severity, Area::Imu, title, remedy)
}

fn focal(data: &RotationData<'_>, ratio: f64) -> NamedCause {
    let key = &data.camera.key;
    let title = if ratio < 1.0 {
        format!("the focal length of {key} in the rig is {:.3} times too long", 1.0 / ratio)
    } else {
        format!("the focal length of {key} in the rig is {ratio:.3} times too short")
    };
    let [fx, fy, ..] = data.camera.model.intrinsics_px;
    let severity = if (ratio - 1.0).abs() > USELESS_RATIO { Severity::Error } else { Severity::Warning };
    let remedy = format!(
        "calibrate the camera at this image size and zoom; by the gyroscope the focal lengths are about {:.1} and {:.1} px",
        fx * ratio,
        fy * ratio
    );
    NamedCause::new(severity, Area::Intrinsics, title, remedy)
}

fn intrinsics(data: &RotationData<'_>, found: &Fitted) -> NamedCause {
    let key = &data.camera.key;
    let lens = &found.correction.lens;
    let [fx, fy, cx, cy] = data.camera.model.intrinsics_px;
    let [dx, dy] = [lens.centre[0] * fx, lens.centre[1] * fy];
    let centre = format!("the principal point of {key} is off by ({dx:+.0}, {dy:+.0}) px");
    let title = if matches!(found.kind, Kind::Centre) {
        centre
    } else {
        format!("{centre}, and its focal length is {:.3} times the rig's", lens.focal)
    };
    let is_useless = dx.hypot(dy) > USELESS_RATIO * fx || (lens.focal - 1.0).abs() > USELESS_RATIO;
    let severity = if is_useless { Severity::Error } else { Severity::Warning };
    let remedy = format!(
        "check how the images were cropped or resized; by the gyroscope fx, fy, cx, cy are about {:.1}, {:.1}, {:.1}, {:.1}",
        fx * lens.focal,
        fy * lens.focal,
        cx + dx,
        cy + dy
    );
    NamedCause::new(severity, Area::Intrinsics, title, remedy)
}

fn focal_pieces(key: &str, pieces: &[(f64, f64)]) -> NamedCause {
    let first = pieces.first().map_or(1.0, |(_, ratio)| *ratio);
    let later: Vec<String> =
        pieces.iter().skip(1).map(|(from_s, ratio)| format!("{ratio:.2} from {from_s:.1} s on")).collect();
    let title = format!("the focal length of {key} changes: {first:.2} times the rig's at first, {}", later.join(", "));
    let remedy =
        "switch off zoom and digital stabilization, or use the part of the log with the calibrated focal length";
    NamedCause::new(Severity::Error, Area::Intrinsics, title, remedy)
}

fn joint_offset(data: &RotationData<'_>, found: &Fitted, joint: usize) -> NamedCause {
    let offset_deg = found.correction.joints[joint].offset_rad.to_degrees();
    let name = joint_names(data, &[joint]);
    let (title, remedy) = match found.since_s {
        Some(since_s) => (
            format!("the angle of joint {name} jumps by {:+.1}° at about {since_s:.1} s", -offset_deg),
            format!("check the encoder for lost steps or a slipping coupling; use the log up to {since_s:.1} s"),
        ),
        None => (
            format!("the zero of joint {name} is off by {:+.1}°", -offset_deg),
            format!("add {:+.4} to theta_offset of gimbal.links[{joint}]", offset_deg.to_radians()),
        ),
    };
    let severity = if offset_deg.abs() > 10.0 { Severity::Error } else { Severity::Warning };
    NamedCause::new(severity, Area::Encoders, title, remedy)
}
