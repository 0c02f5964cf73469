//! Text of a template: the rig in its usual format, with comments.

use crate::files::RigFile as _;
use std::fmt::Write as _;

use super::RigTemplate;

/// Numbers of a rotation matrix within this distance of an integer differ from it by rounding only.
const ROUNDING: f64 = 1e-9;

impl RigTemplate {
    /// Returns the rig as YAML with comments.
    pub fn to_yaml(&self) -> String {
        let rig = self.rig();
        let mut out = String::from(HEADER);
        let mut path: Vec<(usize, String)> = Vec::new();
        for line in rig.to_yaml().lines() {
            let content = line.trim_start_matches([' ', '-']);
            let indentation = line.len() - content.len();
            if let Some((key, _)) = content.split_once(':') {
                path.retain(|(depth, _)| *depth < indentation);
                path.push((indentation, key.to_owned()));
                let full = path.iter().map(|(_, key)| key.as_str()).collect::<Vec<_>>().join(".");
                for comment in Self::comments(&full) {
                    // Writing to a string cannot fail.
                    let _infallible = writeln!(out, "{:indentation$}# {comment}", "");
                }
            }
            out.push_str(&with_whole_numbers(line));
            out.push('\n');
        }
        out
    }

    /// Comments above a field.
    fn comments(path: &str) -> Vec<String> {
        let text = match path {
            "gravity" => "m/s²; 9.78 at the equator to 9.83 at the poles.",
            "imu0.accelerometer_noise_density" => {
                "m/s²/√Hz, m/s³/√Hz, rad/s/√Hz, rad/s²/√Hz; larger than in the data sheet, since airframes vibrate."
            }
            "imu1" => "IMU that moves with the camera of the gimbal.",
            "imu1.T_cam_imu" => "Kalibr's direction: maps points from this IMU to the camera.",
            "cam0.intrinsics" => "fx fy cx cy in pixels; a calibration with a target also gives the distortion.",
            "cam0.intrinsics_sigma" => {
                "Standard deviations: relative of fx and fy, in pixels of cx and cy, of each distortion coefficient."
            }
            "cam0.timeshift_cam_imu" => "Seconds: t_imu = t_cam + shift. `dcvins check` measures it.",
            "cam0.T_cam_imu" => "Kalibr's direction: maps points from the IMU to the camera.",
            "gimbal.source" => "No joint angles: they are computed from this attitude.",
            "gimbal.rostopic" => "Joint angles (sensor_msgs/msg/JointState), null without encoders.",
            "gimbal.encoder_sigma" => "Standard deviation of a joint angle in rad; `dcvins check` measures it.",
            "gimbal.prior" => "Error bounds of T_I_B, links and T_E_C in m and rad.",
            "gimbal.T_I_B" => "Pose of the first joint in the IMU frame; its z is the first axis.",
            "gimbal.links" => {
                "Joints from the vehicle to the camera: Rz(angle + theta_offset) Tz(d) Tx(a) Rx(alpha), limits in rad."
            }
            "gimbal.T_E_C" => "Pose of the camera (x right, y down, z forward) after the last link.",
            "assumed" => "Values not measured yet. `dcvins check` reports each; delete an entry once it is measured.",
            _ => return Vec::new(),
        };
        vec![text.to_owned()]
    }
}

const HEADER: &str =
    "# Rig before calibration, with usual values for what is not measured: see `assumed` at the end.\n";

/// Rounds a matrix row whose numbers differ from integers by rounding only; returns any other line unchanged.
fn with_whole_numbers(line: &str) -> String {
    let Some((head, row)) = line.split_once("- [") else { return line.to_owned() };
    let Some(row) = row.strip_suffix(']') else { return line.to_owned() };
    let number = |text: &str| match text.parse::<f64>() {
        // Adding zero converts −0 to 0.
        Ok(value) if (value - value.round()).abs() < ROUNDING => format!("{:?}", value.round() + 0.0),
        _ => text.to_owned(),
    };
    let numbers: Vec<String> = row.split(", ").map(number).collect();
    format!("{head}- [{}]", numbers.join(", "))
}
