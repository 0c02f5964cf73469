//! Faults in words: one statement with value and time, and one remedy per kind, for `check` and `diagnose` alike. The
//! measurements that show the fault are evidence, which they add.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::apply::joint_maps;
use super::fault::{Choice, Fault};
use super::joint_unit::JointUnit;
use super::table::{FaultKind, USELESS_RATIO};
use crate::sensors::{CameraRig, Rig, STANDARD_GRAVITY_M_PER_S2};
use crate::text::Named as _;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    Good,
    Note,
    /// Degrades results or delays initialization.
    Warning,
    /// Makes results invalid until it is corrected.
    Error,
}

impl Severity {
    /// Lowercase name, printed before a finding.
    pub fn label(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

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

impl Subject<'_> {
    /// The fault in words; its values have the order of its kind.
    pub fn sentence(&self, fault: &Fault) -> Sentence {
        Self::timed(fault, self.texts(fault))
    }

    /// The same of a fault whose value lies beyond the values that were searched.
    pub fn sentence_beyond_search(&self, fault: &Fault) -> Sentence {
        Self::timed(fault, self.texts_beyond_search(fault))
    }

    /// Texts of a fault with its time.
    fn timed(fault: &Fault, (statement, remedy): (String, String)) -> Sentence {
        let severity = if fault.is_useless() { Severity::Error } else { Severity::Warning };
        let Some(since_s) = fault.since_s else { return Sentence { severity, statement, remedy } };
        let when = match fault.kind {
            FaultKind::JointOffset => format!("at about {since_s:.1} s"),
            _ => format!("from about {since_s:.1} s on"),
        };
        Sentence {
            severity,
            statement: format!("{statement} {when}"),
            remedy: format!("{remedy}; the log is sound up to {since_s:.1} s (--duration {since_s:.1})"),
        }
    }

    /// Statement and remedy without the time.
    fn texts(&self, fault: &Fault) -> (String, String) {
        let camera = self.camera_key;
        let first = fault.value(0);
        match fault.kind {
            FaultKind::Focal | FaultKind::PrincipalPoint | FaultKind::Intrinsics => self.intrinsics(fault),
            FaultKind::Zoom => texts(
                format!("the focal length of {camera} changes by a factor of {first:.2} over {:.1} s", fault.value(1)),
                FIX_ZOOM,
            ),
            FaultKind::FocalPieces => texts(self.focal_pieces(fault), FIX_ZOOM),
            FaultKind::FocalPeriod => texts(
                format!(
                    "the focal length of {camera} varies by ±{:.1} % with a period of {:.1} s",
                    100.0 * (first - 1.0),
                    fault.value(1)
                ),
                "fix the focus of the lens, and switch off zoom and digital stabilization",
            ),
            FaultKind::Radial => texts(
                format!("the images of {camera} have a radial distortion that the rig lacks, k1 of about {first:+.2}"),
                format!(
                    "calibrate {camera} with its distortion, or record the rectified images that belong to this CameraInfo"
                ),
            ),
            FaultKind::ImageOrder => self.image_order(fault),
            FaultKind::ImageFlip | FaultKind::ImageRegion => self.images(fault.choice),
            FaultKind::CameraClock => {
                let given_s = self.camera().map_or(0.0, |camera| camera.timeshift_cam_imu_s);
                clock(camera, &format!("{camera}.timeshift_cam_imu"), given_s, first)
            }
            FaultKind::EncoderClock => {
                let given_s = self.rig.gimbal.as_ref().map_or(0.0, |gimbal| gimbal.timeshift_gimbal_imu_s);
                clock("the joint angles", "gimbal.timeshift_gimbal_imu", given_s, first)
            }
            FaultKind::Clocks => {
                texts("the time offsets of camera and joint angles differ from the rig", "run with timeshift=on")
            }
            FaultKind::CameraDrift => {
                let ppm = fault.value(1) * 1e6;
                texts(
                    format!("the time offset of {camera} drifts by {:+.2} ms per second ({ppm:+.0} ppm)", ppm * 1e-3),
                    format!("stamp {camera} and the IMU with one clock, or record shorter logs and use timeshift=on"),
                )
            }
            FaultKind::Shutter => self.shutter(first, fault.value(1)),
            FaultKind::Mount => texts(
                format!("the mount of {camera} moves: rotated by {:.1}°", fault.mount().angle().to_degrees()),
                "fix the mount and calibrate again",
            ),
            FaultKind::Chain => self.chain(&fault.values),
            FaultKind::JointReversed => joints_reversed(&fault.joints),
            FaultKind::JointsSwapped => texts(
                self.exchanged_names(fault),
                "correct the names in the driver or the converter, or gimbal.links[].joint in the rig",
            ),
            FaultKind::JointOffset => self.joint_offset(fault),
            FaultKind::JointScale => joint_scale(fault),
            FaultKind::JointPlay => texts(
                format!(
                    "the reading of joint {} depends on its direction of motion: play of {:.1}°",
                    quoted(&fault.joints),
                    2.0 * first.abs().to_degrees()
                ),
                "measure the angle behind the gear, remove the play, or raise gimbal.encoder_sigma to it",
            ),
            FaultKind::EncoderNoise => self.encoder_noise(first),
            FaultKind::ImuAxes | FaultKind::GyroscopeAxes | FaultKind::AccelerometerAxes => axes(fault),
            FaultKind::GyroscopeScale | FaultKind::AccelerometerScale => imu_scale(fault),
            FaultKind::ImuIntrinsics => texts(
                "scale or misalignment of gyroscope and accelerometer differ from the rig",
                "calibrate the IMU, or run with imu-intrinsics=on",
            ),
            FaultKind::ImuNoise => texts(
                format!("the IMU is noisier than its noise densities in the rig, about {first:.0} times"),
                "measure the densities: dcvins noise",
            ),
            FaultKind::UnusableImu => texts("the IMU's samples cannot be restored", "record the IMU's raw samples"),
            FaultKind::UnusableJoints => texts("the joint angles cannot be restored", "record the encoders' readings"),
            FaultKind::UnusableImages => {
                texts("the images cannot be restored", "record whole images in grey or colour")
            }
            FaultKind::ImagesExchanged => texts(
                format!("the images of {camera} and of another camera are exchanged"),
                "exchange rostopic of the two cameras in the rig, or the topics in the driver",
            ),
        }
    }

    /// Statement and remedy without time and value.
    fn texts_beyond_search(&self, fault: &Fault) -> (String, String) {
        let (camera, first) = (self.camera_key, fault.value(0));
        let beyond_range = |statement: String, remedy: String| texts(format!("{statement} {BEYOND_SEARCH}"), remedy);
        let later = |stamps: &str| {
            let side = if first > 0.0 { "earlier" } else { "later" };
            beyond_range(
                format!("the stamps of {stamps} are {side} than the rig says, by a time"),
                "run with timeshift=on".to_owned(),
            )
        };
        match fault.kind {
            FaultKind::Focal => {
                let error = if first < 1.0 { "long" } else { "short" };
                beyond_range(
                    format!("the focal length of {camera} in the rig is too {error}, by a factor"),
                    format!("calibrate {camera} at this size, crop and zoom of its images"),
                )
            }
            FaultKind::Zoom => {
                beyond_range(format!("the focal length of {camera} changes by a factor"), FIX_ZOOM.to_owned())
            }
            FaultKind::CameraClock => later(camera),
            FaultKind::EncoderClock => later("the joint angles"),
            FaultKind::ImuNoise => beyond_range(
                "the IMU is noisier than its noise densities in the rig, by a factor".to_owned(),
                "measure the densities: dcvins noise".to_owned(),
            ),
            FaultKind::EncoderNoise => beyond_range(
                "the joint angles are noisier than gimbal.encoder_sigma, by a factor".to_owned(),
                "check what makes the readings wrong".to_owned(),
            ),
            _ => self.texts(fault),
        }
    }

    fn camera(&self) -> Option<&CameraRig> {
        self.rig.camera(self.camera_key).ok()
    }

    fn intrinsics(&self, fault: &Fault) -> (String, String) {
        let camera = self.camera_key;
        let lens = fault.lens();
        let [fx, fy, cx, cy] = self.camera().map_or([0.0; 4], |camera| camera.model.intrinsics_px);
        let [dx, dy] = [lens.centre[0] * fx, lens.centre[1] * fy];
        let error = if lens.focal < 1.0 {
            format!("{:.3} times too long", 1.0 / lens.focal)
        } else {
            format!("{:.3} times too short", lens.focal)
        };
        let focal = format!("the focal length of {camera} in the rig is {error}");
        let centre = format!("({dx:+.0}, {dy:+.0}) px from the rig's");
        let statement = match fault.kind {
            FaultKind::Focal => focal,
            FaultKind::PrincipalPoint => format!("the principal point of {camera} is {centre}"),
            _ => format!("{focal}, and its principal point is {centre}"),
        };
        let [fx, fy, cx, cy] = [fx * lens.focal, fy * lens.focal, cx + dx, cy + dy];
        let remedy = format!(
            "calibrate {camera} at this size, crop and zoom of its images, or set {camera}.intrinsics: [{fx:.1}, {fy:.1}, \
             {cx:.1}, {cy:.1}]"
        );
        (statement, remedy)
    }

    fn focal_pieces(&self, fault: &Fault) -> String {
        let ratio = |piece: &[f64]| piece.last().copied().unwrap_or(1.0);
        let mut pieces = fault.values.chunks_exact(2);
        let first = pieces.next().map_or(1.0, ratio);
        let later: Vec<String> = pieces.map(|piece| format!("{:.2} from {:.1} s on", ratio(piece), piece[0])).collect();
        format!(
            "the focal length of {} changes: {first:.2} times the rig's at first, {}",
            self.camera_key,
            later.join(", ")
        )
    }

    fn images(&self, choice: Option<Choice>) -> (String, String) {
        let camera = self.camera_key;
        match choice {
            Some(Choice::Half(half)) => texts(
                format!("the {} half of the images of {camera} contradicts the rest", half.name()),
                format!("mask what moves with the camera or the vehicle there: {camera}.mask in the rig"),
            ),
            Some(Choice::Flip(flip)) => texts(
                format!("the images of {camera} are {}", flip.name()),
                format!(
                    "record {camera} without this operation, or convert the images and give them their own extrinsics"
                ),
            ),
            _ => texts(format!("the images of {camera} are rotated or mirrored"), "look at text in the images"),
        }
    }

    fn image_order(&self, fault: &Fault) -> (String, String) {
        let camera = self.camera_key;
        let count = fault.values.len();
        let period_s = self.camera().map_or(f64::INFINITY, |camera| 1.0 / camera.rate_hz);
        let places: Vec<f64> = fault.values.iter().map(|shift_s| shift_s / period_s).collect();
        let listed: Vec<String> = fault.values.iter().map(|shift_s| format!("{:+.0}", 1e3 * shift_s)).collect();
        let times = format!("{} ms", listed.join(", "));
        let is_whole = places.iter().all(|place| (place - place.round()).abs() < WHOLE_PLACE);
        if is_whole && places.iter().any(|place| place.round() != 0.0) {
            return texts(
                format!(
                    "images of {camera} are not in the order of their stamps: in cycles of {count} they are {times} off"
                ),
                "write the images in the order of exposure, each with its own stamp (decoding order is not the order of \
                 exposure)",
            );
        }
        texts(
            format!("the stamps of {camera} are wrong in a cycle of {count} images, by {times}"),
            "stamp every image at its exposure; two sources that take turns need two topics",
        )
    }

    fn shutter(&self, readout_s: f64, sigma_s: f64) -> (String, String) {
        let camera = self.camera_key;
        let given_s = self.camera().map_or(0.0, |camera| camera.readout_s);
        let found = format!("{:.1} ± {:.1} ms", 1e3 * readout_s, 1e3 * sigma_s);
        let statement = if given_s == 0.0 {
            format!("{camera} has a rolling shutter: readout {found}")
        } else {
            format!("the readout of {camera} is {found}, not {:.1} ms", 1e3 * given_s)
        };
        let fields = format!("{camera}.readout: {readout_s:.4} and {camera}.readout_sigma: {:.4}", sigma_s.max(1e-4));
        (statement, format!("set {fields} in the rig, or run with readout=on"))
    }

    fn chain(&self, values: &[f64]) -> (String, String) {
        let on_gimbal = self.rig.chain_of_camera(self.camera_key).is_some_and(|chain| !chain.links.is_empty());
        let name = if on_gimbal { "gimbal chain" } else { "pose" };
        let by = match values {
            [distance_m, angle_rad, ..] => {
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

    fn exchanged_names(&self, fault: &Fault) -> String {
        let names = self.rig.joint_names();
        let maps = joint_maps([fault], &names);
        let exchanged: Vec<String> = (maps.iter().enumerate())
            .filter(|(joint, map)| *joint != map.source)
            .map(|(joint, map)| format!("'{}' contains the angle of '{}'", names[map.source], names[joint]))
            .collect();
        format!("joint names are exchanged: {}", exchanged.join(", "))
    }

    fn joint_offset(&self, fault: &Fault) -> (String, String) {
        let offset_rad = fault.value(0);
        let name = quoted(&fault.joints);
        let number = self.rig.joint_names().iter().position(|joint| fault.joints.contains(joint)).unwrap_or(0);
        let (verb, remedy) = if fault.since_s.is_some() {
            ("jump", "check the encoder for lost steps or a slipping coupling".to_owned())
        } else {
            let remedy = format!(
                "check the zero of {name} (of the vehicle's heading, if angles come from attitudes), or add {offset_rad:+.4} \
                 to theta_offset of gimbal.links[{number}]"
            );
            ("are off", remedy)
        };
        (format!("the readings of joint {name} {verb} by {:+.1}°", -offset_rad.to_degrees()), remedy)
    }

    fn encoder_noise(&self, factor: f64) -> (String, String) {
        let sigma_rad = self.rig.gimbal.as_ref().and_then(|gimbal| gimbal.encoder_sigma_rad).unwrap_or_default();
        let found_rad = sigma_rad * factor;
        (
            format!(
                "the joint angles are noisier than gimbal.encoder_sigma, {:.2}° instead of {:.2}°",
                found_rad.to_degrees(),
                sigma_rad.to_degrees()
            ),
            format!("set gimbal.encoder_sigma: {found_rad:.5} in the rig, or check what makes the readings wrong"),
        )
    }
}

/// Largest distance of a shift from whole periods of the images at which images are exchanged, in periods.
const WHOLE_PLACE: f64 = 0.25;
/// Words after a quantity of which the search has found no value.
const BEYOND_SEARCH: &str = "beyond the searched range";
/// Remedy of a focal length that changes.
const FIX_ZOOM: &str =
    "switch off zoom and digital stabilization, or use the part of the log with the calibrated focal length";

fn texts(statement: impl Into<String>, remedy: impl Into<String>) -> (String, String) {
    (statement.into(), remedy.into())
}

/// Names of joints in quotation marks.
fn quoted(joints: &[String]) -> String {
    joints.iter().map(|name| format!("'{name}'")).collect::<Vec<_>>().join(" and ")
}

/// Texts of a shift of the stamps of measurements, which is to be added to the rig's value of a field.
fn clock(measurements: &str, field: &str, given_s: f64, shift_s: f64) -> (String, String) {
    let side = if shift_s > 0.0 { "earlier" } else { "later" };
    (
        format!("the stamps of {measurements} are {:.1} ms {side} than the rig says", 1e3 * shift_s.abs()),
        format!("set {field}: {:.4} in the rig, or run with timeshift=on", given_s + shift_s),
    )
}

fn joints_reversed(joints: &[String]) -> (String, String) {
    let names = quoted(joints);
    let (verb, noun) = if joints.len() == 1 { ("counts", "joint") } else { ("count", "joints") };
    (
        format!("{noun} {names} {verb} in the other direction than in the rig"),
        format!(
            "reverse the sign of the readings of {names} in the driver, or describe the {noun} with the opposite axis in \
             gimbal.links (alpha of the neighbouring links ± π)"
        ),
    )
}

fn joint_scale(fault: &Fault) -> (String, String) {
    let measured = 1.0 / fault.value(0);
    if !fault.joints.is_empty() {
        let statement = format!("readings of joint {} are {measured:.3} times its angle", quoted(&fault.joints));
        return texts(statement, "check the unit of the readings and the gear ratio of the encoder");
    }
    let unit = JointUnit::of_size(fault.value(0));
    let unit = unit.map_or_else(|| format!("{measured:.3} times the true ones"), JointUnit::describe);
    let remedy = "record radians, as sensor_msgs/JointState requires, or set the unit of gimbal.source";
    texts(format!("joint angles are {unit}"), remedy)
}

/// Texts of wrong axes of the IMU or of one of its sensors; without axes the frame is left-handed.
fn axes(fault: &Fault) -> (String, String) {
    let axes = fault.axes();
    let is_left_handed = axes.is_none_or(|axes| axes.is_left_handed());
    let [sensor, error] = match (fault.kind, is_left_handed) {
        (FaultKind::AccelerometerAxes, _) => ["accelerometer", "differ from the gyroscope's"],
        (FaultKind::GyroscopeAxes, false) => ["gyroscope", "differ from the accelerometer's"],
        (FaultKind::GyroscopeAxes, true) => ["gyroscope", "form a left-handed frame"],
        (_, true) => ["IMU", "form a left-handed frame"],
        (_, false) => ["IMU", "belong to another frame"],
    };
    let remedy = match (sensor, is_left_handed) {
        ("accelerometer", _) | ("gyroscope", false) => "",
        (_, true) => ", of gyroscope and accelerometer alike; no T_cam_imu can describe it",
        (_, false) => ", or correct T_cam_imu and T_I_B",
    };
    let recorded = axes.map_or_else(String::new, |axes| format!(" ({})", axes.inverse().describe()));
    (
        format!("the axes of the {sensor} {error}{recorded}"),
        format!("correct order and signs of its axes in the IMU's driver or the converter{remedy}"),
    )
}

/// Texts of a factor on the measurements of a sensor of the IMU that corrects their unit or scale.
fn imu_scale(fault: &Fault) -> (String, String) {
    let ([sensor, quantity, measurements], [unit, wrong_unit], size) = match fault.kind {
        FaultKind::GyroscopeScale => {
            (["gyroscope", "rotation", "angular velocities"], ["rad/s", "degrees per second"], PI / 180.0)
        }
        _ => (["accelerometer", "specific force", "specific forces"], ["m/s²", "g"], STANDARD_GRAVITY_M_PER_S2),
    };
    let measured = 1.0 / fault.value(0);
    let near = |value: f64| (measured / value - 1.0).abs() < USELESS_RATIO;
    if near(1.0 / size) {
        let remedy = format!("sensor_msgs/Imu requires {unit}: correct the driver");
        return (format!("{measurements} are in {wrong_unit}"), remedy);
    }
    let remedy = if near(size) {
        format!("do not convert {wrong_unit} to {unit} twice")
    } else if RANGE_FACTORS.into_iter().any(near) {
        "its range setting and the scale of its driver differ: correct one of them".to_owned()
    } else {
        format!("calibrate the {sensor}'s scale (imu0's intrinsics in the rig), or check its driver")
    };
    (format!("the {sensor} measures {measured:.3} times the {quantity}"), remedy)
}
