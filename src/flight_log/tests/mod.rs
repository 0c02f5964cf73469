//! Small logs written by [`LogWriter`], intact and damaged, and the frames and warnings read from them.

mod attitude;
mod broken;
mod camera_info;
mod messages;
mod rigs;
mod streams;
mod unmeasured;
pub(crate) mod video;
mod wide_images;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::Vector3;
use tempfile::TempDir;

use super::{
    FlightLog, FrameStream, LogCompression, LogWarning, LogWriter, LogWriterOptions, MessageTimes, Odometry,
    SensorFrame,
};
use crate::files::RigFile as _;
use crate::geometry::{RigidTransform, so3};
use crate::sensors::{GrayImage, Rig};

/// Absolute header stamp of the first message.
const EPOCH_NS: i64 = 1_700_000_000_250_000_000;
const MS: i64 = 1_000_000;
const WIDTH: usize = 64;
const HEIGHT: usize = 48;

/// Flight whose sensors can be omitted or damaged.
struct Flight {
    duration_ms: i64,
    options: LogWriterOptions,
    /// Changes an IMU sample before it is written; `false` omits it.
    imu: fn(&mut i64, &mut Vector3<f64>, &mut Vector3<f64>) -> bool,
    /// Changes an image's stamp and size; `false` omits it.
    image: fn(&mut i64, &mut [usize; 2]) -> bool,
    /// Stamp of the image that is shown at a stamp.
    shown: fn(i64) -> i64,
    joints: bool,
    /// Period of an accelerometer on a separate topic, in milliseconds; the IMU's messages then have no force.
    accelerometer_ms: Option<i64>,
}

impl Default for Flight {
    fn default() -> Self {
        let options = LogWriterOptions { chunk_bytes: Some(40_000), ..LogWriterOptions::default() };
        Self {
            duration_ms: 3000,
            options,
            imu: |_, _, _| true,
            image: |_, _| true,
            shown: |stamp_ns| stamp_ns,
            joints: true,
            accelerometer_ms: None,
        }
    }
}

/// Yaw angle of the encoders, wrapped as encoders do.
fn yaw_rad(stamp_ns: i64) -> f64 {
    let angle = 2.5 + 0.8 * stamp_ns as f64 * 1e-9;
    angle.sin().atan2(angle.cos())
}

fn true_pose(stamp_ns: i64) -> RigidTransform {
    let time_s = stamp_ns as f64 * 1e-9;
    RigidTransform::new(so3::exp(&Vector3::new(0.0, 0.0, 0.4 * time_s)), Vector3::new(time_s, -2.0 * time_s, 1.0))
}

/// Image for a stamp, different for each.
fn image_at(stamp_ns: i64, [width, height]: [usize; 2]) -> GrayImage {
    let shade = (stamp_ns / (50 * MS)) as usize;
    let pixels = (0..width * height).map(|index| ((index % width) * 2 + shade) as u8).collect();
    GrayImage { width, height, pixels }
}

impl Flight {
    /// Writes the log into a folder and returns its path.
    fn write(&self, folder: &Path) -> PathBuf {
        let path = folder.join("flight.mcap");
        let mut writer = LogWriter::create(&path, &self.options).unwrap();
        let names = ["roll".to_owned(), "yaw".to_owned()];
        for millisecond in 0..self.duration_ms {
            let stamp_ns = millisecond * MS;
            let times = |stamp_ns: i64, lag_ms: i64| MessageTimes {
                stamp_ns: EPOCH_NS + stamp_ns,
                log_time_ns: EPOCH_NS + millisecond * MS + lag_ms * MS,
            };
            if millisecond % 5 == 0 {
                let (mut at, time_s) = (stamp_ns, stamp_ns as f64 * 1e-9);
                let (mut rate, mut force) = (Vector3::new(time_s, 0.0, 0.4), Vector3::new(0.0, 0.1 * time_s, 9.81));
                if (self.imu)(&mut at, &mut rate, &mut force) {
                    if self.accelerometer_ms.is_some() {
                        force = Vector3::zeros();
                    }
                    writer.write_imu("/imu", "imu", times(at, 1), &rate, &force).unwrap();
                }
            }
            if self.accelerometer_ms.is_some_and(|period_ms| millisecond % period_ms == 1) {
                let force = Vector3::new(0.0, 0.1 * stamp_ns as f64 * 1e-9, 9.81);
                writer.write_imu("/accelerometer", "imu", times(stamp_ns, 1), &Vector3::zeros(), &force).unwrap();
            }
            if self.joints && millisecond % 10 == 3 {
                writer.write_joints("/joints", times(stamp_ns, 1), &names, &[0.1, yaw_rad(stamp_ns)]).unwrap();
            }
            if millisecond % 10 == 2 {
                let odometry = Odometry::at_rest("world", "imu", true_pose(stamp_ns));
                writer.write_odometry("/truth", times(stamp_ns, 1), &odometry).unwrap();
            }
            if millisecond % 50 == 27 {
                let (mut at, mut size) = (stamp_ns, [WIDTH, HEIGHT]);
                if (self.image)(&mut at, &mut size) {
                    let image = image_at((self.shown)(stamp_ns), size);
                    writer.write_raw_image("/camera", "camera", times(at, 18), size, "mono8", &image.pixels).unwrap();
                }
            }
        }
        writer.finish().unwrap();
        path
    }
}

pub(crate) const RIG: &str = "\
rig_version: 1
name: test
gravity: 9.81
imu0: {rostopic: /imu, frame_id: imu, update_rate: 200.0, accelerometer_noise_density: 0.004,
       accelerometer_random_walk: 0.006, gyroscope_noise_density: 3.4e-4, gyroscope_random_walk: 3.9e-5}
cam0:
  mount: gimbal
  rostopic: /camera
  frame_id: camera
  update_rate: 20.0
  camera_model: pinhole
  intrinsics: [50.0, 50.0, 31.5, 23.5]
  distortion_model: none
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [64, 48]
  timeshift_cam_imu: 0.0
gimbal:
  rostopic: /joints
  update_rate: 100.0
  encoder_sigma: 0.0087
  prior: {translation_bound: 0.003, rotation_bound: 0.0087}
  T_I_B: [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  links:
  - {joint: yaw, theta_offset: -1.56, d: 0.046, a: 0.016, alpha: -1.55, limits: [-3.14, 3.14]}
  T_E_C: [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0.2], [0, 0, 0, 1]]
ground_truth: {rostopic: /truth}
";

fn rig_from(text: &str) -> Rig {
    Rig::from_yaml(text, Path::new("test.rig.yaml")).unwrap()
}

/// All frames and warnings of a flight.
fn play(flight: &Flight, rig: &str, start_s: f64) -> (Vec<SensorFrame>, Vec<LogWarning>) {
    let folder = TempDir::new().unwrap();
    play_file(&flight.write(folder.path()), rig, start_s)
}

fn play_file(path: &Path, rig: &str, start_s: f64) -> (Vec<SensorFrame>, Vec<LogWarning>) {
    let log = Arc::new(FlightLog::open(path).unwrap());
    let mut stream = FrameStream::new(log, &rig_from(rig), "cam0", start_s, None).unwrap();
    let mut frames = Vec::new();
    while let Some(frame) = stream.next_frame() {
        frames.push(frame);
    }
    let mut warnings: Vec<LogWarning> = frames.iter().flat_map(|frame| frame.warnings.clone()).collect();
    warnings.extend_from_slice(stream.remaining_warnings());
    (frames, warnings)
}

/// Returns the only warning whose message contains all the words.
fn warning_with<'a>(warnings: &'a [LogWarning], words: &[&str]) -> &'a LogWarning {
    let found: Vec<&LogWarning> =
        warnings.iter().filter(|warning| words.iter().all(|word| warning.message.contains(word))).collect();
    assert_eq!(found.len(), 1, "{words:?} in {warnings:?}");
    found[0]
}
