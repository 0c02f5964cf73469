//! Rig of a EuRoC folder: its `sensor.yaml` files with Kalibr's names, and the rig that this program writes inside a
//! folder for all that they cannot describe.

use crate::files::RigFile as _;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Matrix4;
use serde_json::Value;

use super::ConvertError;
use super::sink::LogSink;
use super::source_file::read_description;
use crate::camera::CameraModel;
use crate::files::FileError;
use crate::files::limits::LINE_BYTES;
use crate::files::yaml::without_opencv_head;
use crate::flight_log::container::file::kind_of;
use crate::geometry::{RigidTransform, seconds_from_ns};
use crate::sensors::{
    CameraMount, CameraRig, ChainPrior, GimbalRig, ImuIntrinsics, ImuNoise, ImuRig, RequiredAccuracy, Rig,
};
use crate::text::without_bom;

pub(super) const IMU_TOPIC: &str = "/imu0";

pub(super) fn image_topic(key: &str) -> String {
    format!("/{key}/image_raw/compressed")
}

/// Gravity used by the dataset's authors.
const GRAVITY_M_PER_S2: f64 = 9.81;
/// Largest distance of a rotation block from orthonormal, by rounding.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Folder of a camera.
pub(super) struct CameraSensor {
    /// Key in the rig, such as `cam0`.
    pub(super) key: String,
    pub(super) folder: PathBuf,
    /// Stamps of the camera's images.
    pub(super) stamps_ns: Vec<i64>,
}

/// Content of a `sensor.yaml`.
struct SensorFile {
    document: Value,
    path: PathBuf,
}

impl SensorFile {
    /// Reads the file of a folder; `None` without such a file.
    fn read(folder: &Path) -> Result<Option<Self>, ConvertError> {
        let path = folder.join("sensor.yaml");
        if !path.is_file() {
            return Ok(None);
        }
        let text = read_description(&path, "read the sensor's description")?;
        let document = serde_saphyr::from_str(&without_opencv_head(without_bom(&text))).map_err(|error| {
            let problem = error.to_string();
            FileError::RigSyntax { problem: problem.lines().next().unwrap_or_default().to_owned(), path: path.clone() }
        })?;
        Ok(Some(Self { document, path }))
    }

    fn wrong(&self, field: &str, expected: &str) -> ConvertError {
        let problem = match self.document.get(field) {
            None => format!("missing, expected {expected}"),
            Some(value) => format!("holds {value}, expected {expected}"),
        };
        FileError::Rig { field: field.to_owned(), problem, path: self.path.clone() }.into()
    }

    fn positive(&self, field: &str, expected: &str) -> Result<f64, ConvertError> {
        let number = self.document.get(field).and_then(Value::as_f64);
        number.filter(|number| *number > 0.0 && number.is_finite()).ok_or_else(|| self.wrong(field, expected))
    }

    fn numbers(&self, field: &str, expected: &str) -> Result<Vec<f64>, ConvertError> {
        let list = self.document.get(field).and_then(Value::as_array).ok_or_else(|| self.wrong(field, expected))?;
        let number = |value: &Value| value.as_f64().filter(|number| number.is_finite());
        list.iter().map(|value| number(value).ok_or_else(|| self.wrong(field, expected))).collect()
    }

    fn text(&self, field: &str, expected: &str) -> Result<&str, ConvertError> {
        self.document.get(field).and_then(Value::as_str).ok_or_else(|| self.wrong(field, expected))
    }

    /// Returns `T_BS`, which maps points from the sensor to the body.
    fn body_from_sensor(&self) -> Result<RigidTransform, ConvertError> {
        const EXPECTED: &str = "a rigid transform as 4×4 matrix, data row by row";
        let data = self.document.get("T_BS").and_then(|matrix| matrix.get("data").or(Some(matrix)));
        let rows: Vec<f64> = data.and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_f64).collect();
        let transform = (rows.len() == 16).then(|| Matrix4::from_row_slice(&rows));
        let transform = transform.and_then(|matrix| RigidTransform::from_matrix(&matrix, ROTATION_TOLERANCE));
        transform.ok_or_else(|| self.wrong("T_BS", EXPECTED))
    }
}

fn body_from_sensor(folder: &Path) -> Result<RigidTransform, ConvertError> {
    SensorFile::read(folder)?.map_or_else(|| Ok(RigidTransform::identity()), |file| file.body_from_sensor())
}

/// Returns `imu_from_sensor` of the sensor in a folder; the identity if it is not described, with a note if its
/// description cannot be used.
pub(super) fn sensor_pose(root: &Path, name: &str, sink: &mut LogSink<'_>) -> RigidTransform {
    // An unusable description of the IMU is reported with the rig.
    let body_from_imu = body_from_sensor(&root.join("imu0")).unwrap_or_else(|_| RigidTransform::identity());
    let body_from_sensor = body_from_sensor(&root.join(name)).unwrap_or_else(|error| {
        sink.note(format!("{name}/sensor.yaml cannot be used, so its poses are taken as poses of the body: {error}"));
        RigidTransform::identity()
    });
    body_from_imu.inverse() * body_from_sensor
}

/// Rig of a folder, `None` with a note if its sensors are not described or their descriptions cannot be used.
pub(super) fn rig_of(
    source: &Path,
    root: &Path,
    cameras: &[CameraSensor],
    ground_truth_topic: Option<String>,
    sink: &mut LogSink<'_>,
) -> Option<Rig> {
    let (imu, body_from_imu) = match imu_rig(root) {
        Ok(Some(imu)) => imu,
        Ok(None) => {
            sink.note("imu0/sensor.yaml is missing, so no rig was written");
            return None;
        }
        Err(error) => {
            sink.note(format!("imu0/sensor.yaml cannot be used, so no rig was written: {error}"));
            return None;
        }
    };
    let mut described = Vec::new();
    for camera in cameras {
        match described_camera(camera, &body_from_imu) {
            Ok(Some(rig)) => described.push(rig),
            Ok(None) => sink.note(format!("{}/sensor.yaml is missing, so the rig has no such camera", camera.key)),
            Err(error) => {
                sink.note(format!("{}/sensor.yaml cannot be used, so the rig has no such camera: {error}", camera.key));
            }
        }
    }
    if described.is_empty() {
        sink.note("no camera is described, so no rig was written");
        return None;
    }
    let absolute = fs::canonicalize(source).unwrap_or_else(|_| source.to_owned());
    let name = absolute.file_name().map_or_else(|| "euroc".to_owned(), |name| name.to_string_lossy().into_owned());
    Some(Rig {
        name,
        gravity_m_per_s2: GRAVITY_M_PER_S2,
        imu,
        gimbal_imu: None,
        cameras: described,
        gimbal: None,
        ground_truth_topic,
        ground_truth_use_log_time: false,
        ground_truth_lever_arm: None,
        required_accuracy: RequiredAccuracy::default(),
        assumed: Vec::new(),
    })
}

/// IMU of a folder with `body_from_imu`, `None` without a description.
fn imu_rig(root: &Path) -> Result<Option<(ImuRig, RigidTransform)>, ConvertError> {
    let Some(file) = SensorFile::read(&root.join("imu0"))? else { return Ok(None) };
    let imu = ImuRig {
        topic: IMU_TOPIC.to_owned(),
        accelerometer_topic: None,
        use_log_time: false,
        frame_id: "imu0".to_owned(),
        rate_hz: file.positive("rate_hz", "the rate in Hz")?,
        noise: ImuNoise {
            accelerometer_noise_density: file.positive("accelerometer_noise_density", "m/s²/√Hz above 0")?,
            accelerometer_random_walk: file.positive("accelerometer_random_walk", "m/s³/√Hz above 0")?,
            gyroscope_noise_density: file.positive("gyroscope_noise_density", "rad/s/√Hz above 0")?,
            gyroscope_random_walk: file.positive("gyroscope_random_walk", "rad/s²/√Hz above 0")?,
        },
        intrinsics: ImuIntrinsics::default(),
    };
    Ok(Some((imu, file.body_from_sensor()?)))
}

/// Camera of a folder, `None` without a description.
fn described_camera(camera: &CameraSensor, body_from_imu: &RigidTransform) -> Result<Option<CameraRig>, ConvertError> {
    SensorFile::read(&camera.folder)?.map(|file| camera_rig(camera, &file, body_from_imu)).transpose()
}

fn camera_rig(
    camera: &CameraSensor,
    file: &SensorFile,
    body_from_imu: &RigidTransform,
) -> Result<CameraRig, ConvertError> {
    const RESOLUTION: &str = "2 whole numbers, width and height";
    let resolution = file.numbers("resolution", RESOLUTION)?;
    let whole = |side: &f64| side.fract() == 0.0 && (1.0..=65_535.0).contains(side);
    let &[width, height] = resolution.as_slice() else { return Err(file.wrong("resolution", RESOLUTION)) };
    if !resolution.iter().all(whole) {
        return Err(file.wrong("resolution", RESOLUTION));
    }
    let model = CameraModel::from_kalibr(
        file.text("camera_model", "pinhole, omni, eucm or ds")?,
        &file.numbers("intrinsics", "numbers, fu fv cu cv for pinhole")?,
        file.text("distortion_model", "radial-tangential, equidistant or none")?,
        &file.numbers("distortion_coefficients", "the coefficients of the lens")?,
        [width as usize, height as usize],
    )
    .map_err(|error| FileError::Rig {
        field: "intrinsics and distortion".to_owned(),
        problem: error.to_string(),
        path: file.path.clone(),
    })?;
    let span_s = match (camera.stamps_ns.first(), camera.stamps_ns.last()) {
        (Some(first), Some(last)) => seconds_from_ns(last - first),
        _ => 0.0,
    };
    let measured_hz = camera.stamps_ns.len().saturating_sub(1) as f64 / span_s;
    Ok(CameraRig {
        key: camera.key.clone(),
        first_from_camera: RigidTransform::identity(),
        // Further cameras of a folder were calibrated with the first one.
        relative_prior: (camera.key != "cam0").then_some(ChainPrior::RELATIVE),
        mount: CameraMount::Static { imu_from_camera: body_from_imu.inverse() * file.body_from_sensor()? },
        topic: image_topic(&camera.key),
        use_log_time: false,
        frame_id: camera.key.clone(),
        rate_hz: file
            .positive("rate_hz", "the rate in Hz")
            .or_else(|error| if measured_hz.is_finite() && measured_hz > 0.0 { Ok(measured_hz) } else { Err(error) })?,
        model,
        timeshift_cam_imu_s: 0.0,
        readout_s: 0.0,
        readout_sigma_s: None,
        intrinsics_sigma: None,
        mask: None,
    })
}

/// Name of the rig in `mav0`.
pub const EUROC_RIG: &str = "rig.yaml";
/// Folder of the joint readings in `mav0`.
pub const EUROC_GIMBAL: &str = "gimbal0";
/// Folder of the ground truth in `mav0`.
pub const EUROC_GROUND_TRUTH: &str = "state_groundtruth_estimate0";
/// Topic of the joint readings in the log of such a folder.
pub(super) const JOINT_TOPIC: &str = "/gimbal0/joint_states";
/// Largest size of the rig.
const LARGEST_BYTES: u64 = 4 * LINE_BYTES;

/// Topic of the poses of a folder in its log.
pub(super) fn pose_topic(folder: &str) -> String {
    format!("/{folder}/pose")
}

/// The rig of a EuRoC folder made of `cameras` (`cam0`, `cam1`, … in this order): names and topics as the conversion of
/// the folder gives them, samples of IMU and joints in IMU time and corrected.
pub fn rig_of_euroc_folder(rig: &Rig, cameras: &[&CameraRig], has_joints: bool, has_ground_truth: bool) -> Rig {
    let camera = |(number, camera): (usize, &&CameraRig)| {
        let key = format!("cam{number}");
        CameraRig {
            topic: image_topic(&key),
            frame_id: key.clone(),
            use_log_time: false,
            key,
            ..CameraRig::clone(camera)
        }
    };
    let gimbal = |gimbal: &GimbalRig| GimbalRig {
        topic: has_joints.then(|| JOINT_TOPIC.to_owned()),
        attitude: None,
        use_log_time: false,
        timeshift_gimbal_imu_s: 0.0,
        ..gimbal.clone()
    };
    Rig {
        imu: ImuRig {
            topic: IMU_TOPIC.to_owned(),
            accelerometer_topic: None,
            use_log_time: false,
            frame_id: "imu0".to_owned(),
            intrinsics: ImuIntrinsics::default(),
            ..rig.imu.clone()
        },
        cameras: cameras.iter().enumerate().map(camera).collect(),
        gimbal: rig.gimbal.as_ref().map(gimbal),
        ground_truth_topic: has_ground_truth.then(|| pose_topic(EUROC_GROUND_TRUTH)),
        ground_truth_use_log_time: false,
        ground_truth_lever_arm: None,
        required_accuracy: RequiredAccuracy::default(),
        ..rig.clone()
    }
}

/// Rig in the folder of the sensors; `None` without one, with a note if it cannot be used. Masks stay in the folder.
pub(super) fn rig_in(root: &Path, sink: &mut LogSink<'_>) -> Option<Rig> {
    let path = root.join(EUROC_RIG);
    let metadata = std::fs::metadata(&path).ok()?;
    let problem = if !metadata.is_file() {
        format!("it is {}, expected a file", kind_of(&metadata))
    } else if metadata.len() > LARGEST_BYTES {
        format!("it has {} bytes, more than {LARGEST_BYTES}", metadata.len())
    } else {
        match Rig::from_file(&path) {
            Ok(mut rig) => {
                for camera in rig.cameras.iter_mut().filter(|camera| camera.mask.is_some()) {
                    camera.mask = None;
                    sink.note(format!("the mask of {} stays in {}", camera.key, root.display()));
                }
                return Some(rig);
            }
            Err(error) => error.to_string(),
        }
    };
    sink.note(format!("{EUROC_RIG} cannot be used, so the rig is that of the files sensor.yaml: {problem}"));
    None
}
