//! Faults in words: the statement with its value, and the remedy. A check names a fault by the rotations of a camera, a
//! diagnosis by the residuals of a run.

use std::f64::consts::PI;

use serde::Serialize;

use super::apply::joint_maps;
use super::fault::{Choice, Fault};
use super::joint_unit::JointUnit;
use super::table::FaultKind;
use crate::geometry::SignedAxes;
use crate::sensors::{CameraRig, Rig};
use crate::text::Named as _;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    Good,
    Note,
    /// Degrades results or delays initialization.
    Warning,
    /// Makes results invalid until it is corrected.
    Error,
}

/// Delay of images or joint angles in seconds above which results are useless.
pub const USELESS_DELAY_S: f64 = 0.05;
/// Relative errors of intrinsics and scales above which results are useless.
const USELESS_RATIO: f64 = 0.05;
/// Error of the zero of a joint in degrees above which results are useless, and the same of a camera's orientation.
const USELESS_OFFSET_DEG: f64 = 10.0;
const USELESS_ROTATION_DEG: f64 = 3.0;
const STANDARD_GRAVITY: f64 = 9.806_65;
/// Factors by which a wrong range setting scales measurements.
const RANGE_FACTORS: [f64; 4] = [0.25, 0.5, 2.0, 4.0];

/// Statement, remedy and severity of a fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sentence {
    pub severity: Severity,
    /// The fault with its value and time.
    pub statement: String,
    pub remedy: String,
}

/// Rig and main camera of a sentence.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    pub rig: &'a Rig,
    pub camera_key: &'a str,
}

fn graded(is_useless: bool) -> Severity {
    if is_useless { Severity::Error } else { Severity::Warning }
}

fn is_useless_ratio(ratio: f64) -> bool {
    (ratio - 1.0).abs() > USELESS_RATIO
}

impl Subject<'_> {
    fn camera(&self) -> Option<&CameraRig> {
        self.rig.camera(self.camera_key).ok()
    }

    /// The rig's intrinsics `fx`, `fy`, `cx`, `cy` in pixels.
    fn intrinsics_px(&self) -> [f64; 4] {
        self.camera().map_or([0.0; 4], |camera| camera.model.intrinsics_px)
    }

    fn joint_timeshift_s(&self) -> f64 {
        self.rig.gimbal.as_ref().map_or(0.0, |gimbal| gimbal.timeshift_gimbal_imu_s)
    }

    fn focal_statement(&self, ratio: f64) -> String {
        let error = if ratio < 1.0 {
            format!("{:.3} times too long", 1.0 / ratio)
        } else {
            format!("{ratio:.3} times too short")
        };
        format!("the focal length of {} in the rig is {error}", self.camera_key)
    }

    /// Sentence of a fault that the rotations of the camera show; `true_axes` are the axes of a gyroscope with a left-handed
    /// frame, if they are known.
    pub fn by_rotations(&self, fault: &Fault, true_axes: Option<SignedAxes>) -> Sentence {
        let key = self.camera_key;
        let since_s = fault.since_s.unwrap_or(0.0);
        let (is_useless, statement, remedy) = match fault.kind {
            FaultKind::GyroscopeScale => gyroscope_scale(fault.value(0)),
            FaultKind::Focal => {
                let ratio = fault.value(0);
                let [fx, fy] = [0, 1].map(|axis| self.intrinsics_px()[axis] * ratio);
                (
                    is_useless_ratio(ratio),
                    self.focal_statement(ratio),
                    format!(
                        "calibrate the camera at this image size and zoom; by the gyroscope the focal lengths are about \
                         {fx:.1} and {fy:.1} px"
                    ),
                )
            }
            FaultKind::PrincipalPoint | FaultKind::Intrinsics => self.intrinsics(fault),
            FaultKind::FocalPieces => {
                let ratio = |piece: &[f64]| piece.last().copied().unwrap_or(1.0);
                let mut pieces = fault.values.chunks_exact(2);
                let first = pieces.next().map_or(1.0, ratio);
                let later: Vec<String> =
                    pieces.map(|piece| format!("{:.2} from {:.1} s on", ratio(piece), piece[0])).collect();
                (
                    true,
                    format!(
                        "the focal length of {key} changes: {first:.2} times the rig's at first, {}",
                        later.join(", ")
                    ),
                    "switch off zoom and digital stabilization, or use the part of the log with the calibrated focal length"
                        .to_owned(),
                )
            }
            FaultKind::CameraDrift => {
                let ppm = fault.value(1) * 1e6;
                (
                    false,
                    format!("the time offset of {key} drifts by {:+.2} ms per second ({ppm:+.0} ppm)", ppm * 1e-3),
                    format!("stamp {key} and the IMU with one clock, or record shorter logs and use timeshift=on"),
                )
            }
            FaultKind::Mount => {
                let angle_deg = fault.mount().angle().to_degrees();
                (
                    angle_deg > USELESS_ROTATION_DEG,
                    format!("the mount of {key} moves: rotated by {angle_deg:.1}° from about {since_s:.1} s on"),
                    format!("use the log up to {since_s:.1} s, fix the mount, and calibrate again"),
                )
            }
            FaultKind::JointReversed => {
                let names = quoted(&fault.joints);
                let (verb, noun) = if fault.joints.len() == 1 { ("counts", "joint") } else { ("count", "joints") };
                (
                    true,
                    format!("{noun} {names} {verb} in the other direction than in the rig"),
                    format!(
                        "reverse the sign of the readings of {names} in the driver, or describe the {noun} with the \
                         opposite axis in gimbal.links (alpha of the neighbouring links ± π)"
                    ),
                )
            }
            FaultKind::JointsSwapped => {
                let names = self.rig.joint_names();
                let maps = joint_maps([fault], &names);
                let exchanged: Vec<String> = (maps.iter().enumerate())
                    .filter(|(joint, map)| *joint != map.source)
                    .map(|(joint, map)| format!("'{}' contains the angle of '{}'", names[map.source], names[joint]))
                    .collect();
                (
                    true,
                    format!("joint names are exchanged: {}", exchanged.join(", ")),
                    "correct the names in the driver, or gimbal.links[].joint in the rig".to_owned(),
                )
            }
            FaultKind::JointScale if fault.joints.is_empty() => {
                let unit = JointUnit::of_size(fault.value(0));
                let unit = unit.map_or_else(|| "in another unit".to_owned(), JointUnit::describe);
                let remedy = "sensor_msgs/JointState requires radians: correct the driver";
                (true, format!("joint angles are {unit}"), remedy.to_owned())
            }
            FaultKind::JointScale => (
                is_useless_ratio(fault.value(0)),
                format!("readings of joint {} are {:.3} times its angle", quoted(&fault.joints), 1.0 / fault.value(0)),
                "check the unit of the readings and the gear ratio of the encoder".to_owned(),
            ),
            FaultKind::JointOffset => self.joint_offset(fault),
            FaultKind::EncoderClock => {
                let shift_s = fault.value(0);
                let late = if shift_s < 0.0 { "late" } else { "early" };
                (
                    shift_s.abs() > USELESS_DELAY_S,
                    format!("joint angles are {:.0} ms {late}", (shift_s * 1e3).abs()),
                    format!("set gimbal.timeshift_gimbal_imu to {:+.3}", self.joint_timeshift_s() + shift_s),
                )
            }
            // Other kinds are no candidates for rotations: a left-handed frame of the gyroscope remains.
            _ => {
                let which = true_axes.map_or_else(String::new, |axes| format!(" ({})", axes.describe()));
                (
                    true,
                    format!("the axes of the gyroscope form a left-handed frame{which}"),
                    "correct order and signs of the axes in the IMU's driver, of gyroscope and accelerometer alike; no \
                     T_cam_imu can describe it"
                        .to_owned(),
                )
            }
        };
        Sentence { severity: graded(is_useless), statement, remedy }
    }

    fn intrinsics(&self, fault: &Fault) -> (bool, String, String) {
        let lens = fault.lens();
        let [fx, fy, cx, cy] = self.intrinsics_px();
        let [dx, dy] = [lens.centre[0] * fx, lens.centre[1] * fy];
        let centre = format!("the principal point of {} is off by ({dx:+.0}, {dy:+.0}) px", self.camera_key);
        let statement = match fault.kind {
            FaultKind::PrincipalPoint => centre,
            _ => format!("{centre}, and its focal length is {:.3} times the rig's", lens.focal),
        };
        let remedy = format!(
            "check how the images were cropped or resized; by the gyroscope fx, fy, cx, cy are about {:.1}, {:.1}, {:.1}, \
             {:.1}",
            fx * lens.focal,
            fy * lens.focal,
            cx + dx,
            cy + dy
        );
        (dx.hypot(dy) > USELESS_RATIO * fx || is_useless_ratio(lens.focal), statement, remedy)
    }

    fn joint_offset(&self, fault: &Fault) -> (bool, String, String) {
        let offset_deg = fault.value(0).to_degrees();
        let name = quoted(&fault.joints);
        let number = self.rig.joint_names().iter().position(|joint| fault.joints.contains(joint)).unwrap_or(0);
        let (statement, remedy) = match fault.since_s {
            Some(since_s) => (
                format!("the angle of joint {name} jumps by {:+.1}° at about {since_s:.1} s", -offset_deg),
                format!("check the encoder for lost steps or a slipping coupling; use the log up to {since_s:.1} s"),
            ),
            None => (
                format!("the zero of joint {name} is off by {:+.1}°", -offset_deg),
                format!("add {:+.4} to theta_offset of gimbal.links[{number}]", offset_deg.to_radians()),
            ),
        };
        (offset_deg.abs() > USELESS_OFFSET_DEG, statement, remedy)
    }

    /// Statement and remedy of a fault whose correction brings the residuals of a run back to their noise.
    pub fn by_residuals(&self, fault: &Fault) -> (String, String) {
        let camera = self.camera_key;
        let joint = |number: usize| fault.joints.get(number).map_or("", |joint| joint);
        let factor = fault.value(0);
        let axes = fault.axes();
        let text = axes.map_or_else(String::new, |axes| axes.to_string());
        match fault.kind {
            FaultKind::Focal => {
                let [fx, fy, cx, cy] = self.intrinsics_px();
                (
                    self.focal_statement(factor),
                    format!(
                        "calibrate the camera, or set {camera}.intrinsics: [{:.1}, {:.1}, {cx:.1}, {cy:.1}]",
                        fx * factor,
                        fy * factor
                    ),
                )
            }
            FaultKind::Zoom => (
                format!("the focal length of {camera} changes by a factor of {factor:.2} over {:.1} s", fault.value(1)),
                format!("fix the zoom of {camera}"),
            ),
            FaultKind::CameraClock => {
                let given_s = self.camera().map_or(0.0, |camera| camera.timeshift_cam_imu_s);
                clock_texts(camera, &format!("{camera}.timeshift_cam_imu"), given_s, factor)
            }
            FaultKind::EncoderClock => {
                let given_s = self.joint_timeshift_s();
                clock_texts("the joint angles", "gimbal.timeshift_gimbal_imu", given_s, factor)
            }
            FaultKind::JointReversed => (
                format!("joint {} counts in the other direction", joint(0)),
                format!("reverse the sign of {} in the recording, or turn its axis in the rig", joint(0)),
            ),
            FaultKind::JointsSwapped => (
                format!("joints {} and {} have each other's readings", joint(0), joint(1)),
                "correct the names of gimbal.links in the rig, or the order in the recording".to_owned(),
            ),
            FaultKind::JointOffset => (
                format!("the readings of joint {} are {:.1}° off", joint(0), -factor.to_degrees()),
                format!("check the zero of {}, or the heading of the vehicle if angles come from attitudes", joint(0)),
            ),
            FaultKind::JointScale => {
                let unit = if factor < 1.0 { "degrees" } else { "radians that were converted twice" };
                let remedy = "record radians, or set the unit of gimbal.source";
                (format!("the joint angles are in {unit}"), remedy.to_owned())
            }
            FaultKind::ImuAxes => {
                let is_left_handed = axes.is_some_and(|axes| axes.is_left_handed());
                let frame = if is_left_handed { "form a left-handed frame" } else { "belong to another frame" };
                (
                    format!("the axes of the IMU {frame}: x/y/z of the rig's IMU are {text} of the recording"),
                    "correct the axes in the driver or the converter; check T_cam_imu or T_I_B if the frame is right-handed"
                        .to_owned(),
                )
            }
            FaultKind::GyroscopeAxes => axes_texts(["gyroscope", "accelerometer"], &text, "angular velocities"),
            FaultKind::AccelerometerAxes => axes_texts(["accelerometer", "gyroscope"], &text, "specific forces"),
            FaultKind::GyroscopeScale => (
                scale_text("angular velocities", factor, PI / 180.0, "degrees per second"),
                "record rad/s; check the range setting of the gyroscope".to_owned(),
            ),
            FaultKind::AccelerometerScale => (
                scale_text("specific forces", factor, STANDARD_GRAVITY, "g"),
                "record m/s²; check the range setting of the accelerometer".to_owned(),
            ),
            _ => match fault.choice {
                Some(Choice::Flip(flip)) => (
                    format!("the images of {camera} are {}", flip.name()),
                    format!(
                        "record {camera} without this operation, or convert the images and give them their own extrinsics"
                    ),
                ),
                Some(Choice::Half(half)) => (
                    format!("the {} half of the images of {camera} contradicts the rest", half.name()),
                    format!("mask what moves with the camera or the vehicle there: {camera}.mask in the rig"),
                ),
                _ => self.by_estimate(fault.kind, &[]),
            },
        }
    }

    /// Statement and remedy of a fault whose values a run estimates, with their standard deviations: the readout in seconds;
    /// `fx`, `fy`, `cx`, `cy` in pixels; translation in metres and rotation in radians of the chain; a factor on noise.
    pub fn by_estimate(&self, kind: FaultKind, values: &[(f64, f64)]) -> (String, String) {
        let camera = self.camera_key;
        let first = values.first().copied().unwrap_or_default();
        match kind {
            FaultKind::Shutter => {
                let (readout_s, sigma_s) = first;
                let given_s = self.camera().map_or(0.0, |camera| camera.readout_s);
                let found = format!("{:.1} ± {:.1} ms", 1e3 * readout_s, 1e3 * sigma_s);
                let statement = if given_s == 0.0 {
                    format!("{camera} has a rolling shutter: readout {found}")
                } else {
                    format!("the readout of {camera} is {found}, not {:.1} ms", 1e3 * given_s)
                };
                (statement, format!("set {camera}.readout: {readout_s:.4} in the rig, or run with readout=on"))
            }
            FaultKind::Intrinsics => {
                let shown = ["fx", "fy", "cx", "cy"].iter().zip(values);
                let shown: Vec<String> =
                    shown.map(|(name, (value, sigma))| format!("{name} {value:.1} ± {sigma:.1}")).collect();
                (
                    format!("the intrinsics of {camera} are wrong: {}", shown.join(", ")),
                    "calibrate the camera, or run with intrinsics=on".to_owned(),
                )
            }
            FaultKind::Chain => self.chain_texts(values),
            FaultKind::ImuIntrinsics => (
                "scale or misalignment of gyroscope and accelerometer".to_owned(),
                "calibrate the IMU, or run with imu-intrinsics=on".to_owned(),
            ),
            FaultKind::ImuNoise => (
                format!("the IMU is noisier than its noise densities in the rig, about {:.0} times", first.0),
                "measure the densities: dcvins noise".to_owned(),
            ),
            FaultKind::EncoderNoise => {
                let sigma_rad =
                    self.rig.gimbal.as_ref().and_then(|gimbal| gimbal.encoder_sigma_rad).unwrap_or_default();
                let found_rad = sigma_rad * first.0;
                (
                    format!(
                        "the joint angles are noisier than gimbal.encoder_sigma, {:.2}° instead of {:.2}°",
                        found_rad.to_degrees(),
                        sigma_rad.to_degrees()
                    ),
                    format!(
                        "set gimbal.encoder_sigma: {found_rad:.5} in the rig, or check what makes the readings wrong"
                    ),
                )
            }
            _ => ("time offsets of camera and joint angles".to_owned(), "run with timeshift=on".to_owned()),
        }
    }

    fn chain_texts(&self, values: &[(f64, f64)]) -> (String, String) {
        let on_gimbal = self.rig.chain_of_camera(self.camera_key).is_some_and(|chain| !chain.links.is_empty());
        let name = if on_gimbal { "gimbal chain" } else { "pose" };
        let by = match values {
            [(distance_m, _), (angle_rad, _), ..] => {
                format!(" by {:.1}° and {:.0} mm", angle_rad.to_degrees(), 1e3 * distance_m)
            }
            _ => String::new(),
        };
        let bounds = if on_gimbal { "gimbal.prior: its bounds are smaller than the error" } else { "T_cam_imu" };
        (
            format!("the {name} of {} in the rig is wrong{by}", self.camera_key),
            format!("calibrate it (dcvins calibrate, or the rig.yaml of a run with the fork's change); check {bounds}"),
        )
    }
}

/// Names of joints in quotation marks.
fn quoted(joints: &[String]) -> String {
    joints.iter().map(|name| format!("'{name}'")).collect::<Vec<_>>().join(" and ")
}

fn gyroscope_scale(factor: f64) -> (bool, String, String) {
    let measured = 1.0 / factor;
    let near = |value: f64| (measured / value - 1.0).abs() < USELESS_RATIO;
    let degrees = 180.0 / PI;
    let (statement, remedy) = if near(degrees) {
        ("angular velocities are in degrees per second".to_owned(), "sensor_msgs/Imu requires rad/s")
    } else if near(1.0 / degrees) {
        ("angular velocities are 57 times too small".to_owned(), "do not convert degrees to radians twice")
    } else {
        let remedy = if RANGE_FACTORS.into_iter().any(near) {
            "its range setting and the scale of its driver differ: correct one of them"
        } else {
            "calibrate the gyroscope's scale (imu0's intrinsics in the rig), or check its driver"
        };
        (format!("the gyroscope measures {measured:.3} times the rotation"), remedy)
    };
    (is_useless_ratio(measured), statement, remedy.to_owned())
}

/// Texts of a shift of the stamps of measurements, which is to be added to the rig's value of a field.
fn clock_texts(measurements: &str, field: &str, given_s: f64, shift_s: f64) -> (String, String) {
    let side = if shift_s > 0.0 { "earlier" } else { "later" };
    (
        format!("the stamps of {measurements} are {:.1} ms {side} than the rig says", 1e3 * shift_s.abs()),
        format!("set {field}: {:.4} in the rig, or run with timeshift=on", given_s + shift_s),
    )
}

/// Texts of wrong axes of a sensor alone, not of the other one.
fn axes_texts([sensor, other]: [&str; 2], axes: &str, measurements: &str) -> (String, String) {
    (
        format!("the axes of the {sensor} differ from the {other}'s: x/y/z are {axes} of the recording"),
        format!("correct the axes of the {measurements} in the driver or the converter"),
    )
}

fn scale_text(measurements: &str, factor: f64, of_unit: f64, unit: &str) -> String {
    if (factor / of_unit - 1.0).abs() < USELESS_RATIO {
        format!("the {measurements} are in {unit}")
    } else {
        format!("the {measurements} are {:.3} times the true ones", 1.0 / factor)
    }
}
