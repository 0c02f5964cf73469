mod clocks;
mod content;
mod gimbal_imu;
mod unmeasured;

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use tempfile::TempDir;

use super::check;
use super::report::{CheckReport, ImageRotation, Severity};
use crate::camera::CameraModel;
use crate::files::RigFile as _;
use crate::flight_log::{FlightLog, LogError, LogWriter, LogWriterOptions, MessageTimes};
use crate::geometry::SplitMix64;
use crate::sensors::{GrayImage, Rig};

const EPOCH_NS: i64 = 1_700_000_000_000_000_000;
pub(super) const MS: i64 = 1_000_000;
const DURATION_MS: i64 = 12_000;
const RATE_HZ: f64 = 200.0;
const GYRO_DENSITY: f64 = 3.4e-4;
const ACCEL_DENSITY: f64 = 0.004;

/// Normal random numbers from a seed.
pub(super) struct Noise(pub(super) u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(super) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    pub(super) fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }
}

/// Angular velocity: stationary for 2.5 s, then rotation about all axes.
pub(super) fn rate_at(time_s: f64) -> Vector3<f64> {
    let t = (time_s - 2.5).max(0.0);
    let grow = (t / 2.0).min(1.0);
    Vector3::new((1.1 * t).sin(), 0.8 * (1.7 * t).sin(), 0.9 * (0.7 * t).sin()) * (0.5 * grow)
}

/// Changes to a faultless flight.
pub(super) struct Flight {
    pub(super) imu: fn(i64, &mut MessageTimes, &mut Vector3<f64>, &mut Vector3<f64>) -> bool,
    pub(super) image: fn(i64, &mut MessageTimes, &mut GrayImage) -> bool,
    pub(super) joint: fn(i64, &mut f64),
    pub(super) rig: String,
    pub(super) camera_info: [f64; 4],
    /// True if the accelerometer has a separate topic, at 62.5 Hz.
    pub(super) accelerometer_apart: bool,
    /// Topic with orientations only.
    pub(super) orientations: Option<&'static str>,
    /// Encoding of the images, which may have several bytes per pixel.
    pub(super) encoding: &'static str,
    /// Another message on the topic of the IMU, from the time in milliseconds and the sample of the first.
    pub(super) second_imu: fn(i64, ImuMessage) -> Option<ImuMessage>,
}

/// Message of an IMU: frame, times, angular velocity and specific force.
type ImuMessage = (&'static str, MessageTimes, Vector3<f64>, Vector3<f64>);

impl Default for Flight {
    fn default() -> Self {
        Self {
            imu: |_, _, _, _| true,
            image: |_, _, _| true,
            joint: |_, _| {},
            rig: rig_text(),
            camera_info: [80.0, 80.0, 79.5, 59.5],
            accelerometer_apart: false,
            orientations: None,
            encoding: "mono8",
            second_imu: |_, _| None,
        }
    }
}

pub(super) fn rig_text() -> String {
    // The camera looks along the IMU's x axis, the IMU's z axis is up.
    format!(
        "rig_version: 1
name: faultless
gravity: 9.81
imu0: {{rostopic: /imu, update_rate: {RATE_HZ}, accelerometer_noise_density: {ACCEL_DENSITY}, accelerometer_random_walk: 0.006,
       gyroscope_noise_density: {GYRO_DENSITY}, gyroscope_random_walk: 3.9e-5}}
cam0:
  mount: static
  rostopic: /camera/image
  update_rate: 20.0
  camera_model: pinhole
  intrinsics: [80.0, 80.0, 79.5, 59.5]
  distortion_model: none
  resolution: [160, 120]
  timeshift_cam_imu: 0.0
  T_cam_imu: [[0, -1, 0, 0], [0, 0, -1, 0.05], [1, 0, 0, -0.1], [0, 0, 0, 1]]
gimbal:
  rostopic: /joints
  update_rate: 50.0
  encoder_sigma: 0.0087
  prior: {{translation_bound: 0.003, rotation_bound: 0.0087}}
  T_I_B: [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  links:
  - {{joint: yaw, theta_offset: 0, d: 0.046, a: 0.016, alpha: -1.55, limits: [-1.0, 1.0]}}
  T_E_C: [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0.2], [0, 0, 0, 1]]
"
    )
}

fn texture(shift: usize) -> GrayImage {
    let (width, height) = (160, 120);
    let pixel = |index: usize| {
        let (column, row) = (index % width + shift, index / width);
        if (column / 6 + row / 6) % 2 == 0 { 60 } else { 180 }
    };
    GrayImage { width, height, pixels: (0..width * height).map(pixel).collect() }
}

impl Flight {
    fn write(&self, folder: &Path) -> FlightLog {
        let path = folder.join("flight.mcap");
        let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).unwrap();
        let mut noise = Noise(7);
        let model = CameraModel::pinhole(self.camera_info, [160, 120]).unwrap();
        for millisecond in 0..DURATION_MS {
            let at = EPOCH_NS + millisecond * MS;
            let times = MessageTimes { stamp_ns: at, log_time_ns: at + 2 * MS };
            let time_s = millisecond as f64 * 1e-3;
            if millisecond % 5 == 0 {
                let sigma = RATE_HZ.sqrt();
                let mut rate = rate_at(time_s) + noise.vector() * (GYRO_DENSITY * sigma);
                let mut force =
                    Vector3::new(0.3 * rate_at(time_s).x, 0.0, 9.81) + noise.vector() * (ACCEL_DENSITY * sigma);
                if self.accelerometer_apart {
                    force = Vector3::zeros();
                }
                let mut times = times;
                if (self.imu)(millisecond, &mut times, &mut rate, &mut force) {
                    writer.write_imu("/imu", "imu", times, &rate, &force).unwrap();
                }
                if let Some((frame, times, rate, force)) = (self.second_imu)(millisecond, ("imu", times, rate, force)) {
                    writer.write_imu("/imu", frame, times, &rate, &force).unwrap();
                }
            }
            if let Some(topic) = self.orientations.filter(|_| millisecond % 10 == 4) {
                writer.write_imu(topic, "imu", times, &Vector3::zeros(), &Vector3::zeros()).unwrap();
            }
            if self.accelerometer_apart && millisecond % 16 == 3 {
                let force = Vector3::new(0.3 * rate_at(time_s).x, 0.0, 9.81)
                    + noise.vector() * (ACCEL_DENSITY * 62.5_f64.sqrt());
                writer.write_imu("/accelerometer", "imu", times, &Vector3::zeros(), &force).unwrap();
            }
            if millisecond % 20 == 1 {
                let mut angle = 0.7 * (0.9 * time_s).sin() + 0.0087 * noise.normal();
                (self.joint)(millisecond, &mut angle);
                writer.write_joints("/joints", times, &["yaw".to_owned()], &[angle]).unwrap();
            }
            if millisecond % 50 == 10 {
                let mut times = MessageTimes { log_time_ns: at + 18 * MS, ..times };
                let mut image = texture(millisecond as usize / 50);
                if (self.image)(millisecond, &mut times, &mut image) {
                    let size = [image.width, image.height];
                    let pixels = &image.pixels;
                    writer.write_raw_image("/camera/image", "camera", times, size, self.encoding, pixels).unwrap();
                }
                writer.write_camera_info("/camera/camera_info", "camera", times, &model).unwrap();
            }
        }
        writer.finish().unwrap();
        FlightLog::open(&path).unwrap()
    }

    pub(super) fn check(&self, rotations: &[ImageRotation]) -> CheckReport {
        let folder = TempDir::new().unwrap();
        let log = self.write(folder.path());
        let rig = Rig::from_yaml(&self.rig, Path::new("test.rig.yaml")).map_err(LogError::from);
        check(&log, rig.as_ref(), rotations)
    }
}

/// Checks that exactly one finding of this severity contains all these words.
pub(super) fn expect(flight: &Flight, severity: Severity, words: &[&str]) {
    let report = flight.check(&[]);
    let found: Vec<_> = report
        .findings
        .iter()
        .filter(|finding| {
            let text = format!("{} {} {}", finding.title, finding.evidence, finding.remedy);
            finding.severity == severity && words.iter().all(|word| text.contains(word))
        })
        .collect();
    assert_eq!(found.len(), 1, "{severity:?} {words:?} in\n{report}");
}

#[test]
fn a_faultless_flight_has_no_warning() {
    let report = Flight::default().check(&[]);
    assert_eq!(report.worst(), Severity::Note, "{report}");
    let notes: Vec<&str> = report
        .findings
        .iter()
        .filter(|finding| finding.severity == Severity::Note)
        .map(|finding| finding.title.as_str())
        .collect();
    assert_eq!(notes, ["the vehicle is stationary or hovers"], "{report}");
    let stationary = report.findings.iter().find(|finding| finding.title.contains("stationary")).unwrap();
    assert!(
        stationary.evidence.contains("0.0–2.5 s") || stationary.evidence.contains("0.0–3.0 s"),
        "{}",
        stationary.evidence
    );
    assert_eq!(
        report.topics.iter().map(|topic| topic.role.as_str()).collect::<Vec<_>>(),
        ["intrinsics", "cam0", "imu0", "gimbal"]
    );
    let latency_s = report.topics[1].latency_s.unwrap();
    assert!((latency_s - 0.018).abs() < 1e-9);
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["rig"], "faultless");
    assert_eq!(json["findings"][0]["severity"], "note");
    let mut text = String::new();
    write!(text, "{report}").unwrap();
    assert!(text.contains("/camera/image") && text.contains("good    IMU"), "{text}");
}

#[test]
fn topics_of_orientations_only_are_named() {
    let flight = Flight { orientations: Some("/imu/orientation"), ..Flight::default() };
    expect(&flight, Severity::Note, &["'/imu/orientation' holds orientations only", "it is not used"]);
    let rig = rig_text().replace("rostopic: /imu,", "rostopic: /imu/orientation,");
    let words =
        ["'/imu/orientation' holds orientations only", "name a topic with measurements in imu0.rostopic: '/imu'"];
    expect(&Flight { rig, ..flight }, Severity::Error, &words);
}

#[test]
fn an_accelerometer_on_its_own_topic_is_checked_with_its_own_rate() {
    let rig = rig_text().replace("rostopic: /imu,", "rostopic: /imu, accelerometer_rostopic: /accelerometer,");
    let report = Flight { accelerometer_apart: true, rig, ..Flight::default() }.check(&[]);
    assert_eq!(report.worst(), Severity::Note, "{report}");
    let good = |title: &str| report.findings.iter().find(|finding| finding.title == title).unwrap();
    assert!(good("accelerometer noise agrees with the rig").evidence.contains("at 62 Hz"), "{report}");
    assert!(good("gyroscope noise agrees with the rig").evidence.contains("at 200 Hz"), "{report}");
    expect(
        &Flight { accelerometer_apart: true, ..Flight::default() },
        Severity::Error,
        &["the IMU's messages have no specific force", "imu0.accelerometer_rostopic: one of '/accelerometer'"],
    );
}

#[test]
fn imu_faults_are_found() {
    use Severity::{Error, Good, Note, Warning};
    let imu = |imu| Flight { imu, ..Flight::default() };
    let rig = |from: &str, to: &str| {
        assert!(rig_text().contains(from));
        Flight { rig: rig_text().replace(from, to), ..Flight::default() }
    };
    expect(&imu(|_, _, _, force| scaled(force, 1.0 / 9.81)), Error, &["accelerations are in g"]);
    expect(&imu(|_, _, _, force| scaled(force, 4.5)), Error, &["does not measure gravity", "44.1"]);
    expect(&imu(|_, _, _, force| shifted(force, 0.5)), Note, &["large bias or scale error", "+0.5"]);
    expect(&imu(|_, _, rate, _| scaled(rate, 180.0)), Error, &["appear to be in degrees"]);
    expect(&imu(|_, _, rate, _| shifted(rate, 0.05)), Note, &["gyroscope's bias is large", "+0.05"]);
    let clip = |_: i64, _: &mut MessageTimes, rate: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        rate.x = (rate.x * 4.0).clamp(-1.5, 1.5);
        true
    };
    expect(&imu(clip), Warning, &["the gyroscope saturates on x", "±1.5000 rad/s"]);
    // One value that comes again and again at one peak is held, not clipped.
    let repeated = |ms: i64, _: &mut MessageTimes, rate: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        if (6000..6060).contains(&ms) {
            *rate = Vector3::new(3.5, 0.1, 0.2);
        }
        true
    };
    expect(&imu(repeated), Good, &["the IMU does not saturate"]);
    let held = |ms: i64, _: &mut MessageTimes, _: &mut Vector3<f64>, force: &mut Vector3<f64>| {
        let measured_ms = ms - ms % 15;
        *force = Vector3::new(0.001 * measured_ms as f64, 0.3, 9.81);
        true
    };
    expect(&imu(held), Warning, &["the accelerometer holds its values: 66.7 new ones", "in messages at 200 Hz"]);
    let nan = |ms: i64, _: &mut MessageTimes, rate: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        rate.y = if ms == 5000 { f64::NAN } else { rate.y };
        true
    };
    expect(&imu(nan), Warning, &["not finite", "1 of 2400 samples (0.0 %), the first at 5.000 s"]);
    expect(
        &rig("gyroscope_noise_density: 0.00034", "gyroscope_noise_density: 3.4e-5"),
        Warning,
        &["gyroscope noise in the rig is 10.0 times too small"],
    );
    expect(
        &rig("gyroscope_noise_density: 0.00034", "gyroscope_noise_density: 2.4e-5"),
        Warning,
        &["divided by √rate twice"],
    );
    expect(
        &rig("accelerometer_noise_density: 0.004", "accelerometer_noise_density: 0.0566"),
        Note,
        &["accelerometer noise in the rig is 14 times too large", "it appears to be the noise of one sample"],
    );
    expect(&rig("gravity: 9.81", "gravity: 9.6"), Warning, &["gravity is unusual"]);
    // Vibration in flight only.
    let vibrates = |ms: i64, _: &mut MessageTimes, _: &mut Vector3<f64>, force: &mut Vector3<f64>| {
        force.z += if ms > 3000 && ms % 10 == 0 { 3.0 } else { 0.0 };
        true
    };
    expect(&imu(vibrates), Note, &["vibration on the accelerometer", "at 100 Hz"]);
}

/// Rotors that idle at 57 Hz on the ground and in flight.
fn idling_rotors(ms: i64, _: &mut MessageTimes, rate: &mut Vector3<f64>, force: &mut Vector3<f64>) -> bool {
    let phase = std::f64::consts::TAU * 57.0 * ms as f64 * 1e-3;
    rate.x += 0.3 * phase.sin();
    force.z += 3.0 * phase.cos();
    true
}

#[test]
fn vibration_is_neither_noise_nor_motion() {
    use Severity::{Good, Note};
    let flight = Flight { imu: idling_rotors, ..Flight::default() };
    expect(&flight, Note, &["vibration on the gyroscope", "0.212 rad/s at 57 Hz"]);
    expect(&flight, Note, &["vibration on the accelerometer", "m/s² at 57 Hz"]);
    expect(&flight, Good, &["gyroscope noise agrees with the rig"]);
    expect(&flight, Good, &["accelerometer noise agrees with the rig"]);
    let report = flight.check(&[]);
    let stationary = report.findings.iter().find(|finding| finding.title.contains("is stationary")).unwrap();
    assert!(stationary.evidence.contains("0.0–2.5 s"), "{}", stationary.evidence);
    assert!(report.worst() == Note, "{report}");
}

/// Image of a moving scene, with a frame of the vehicle in its lower left corner.
fn behind_a_frame(_: i64, times: &mut MessageTimes, image: &mut GrayImage) -> bool {
    let at = (times.stamp_ns - EPOCH_NS) / (50 * MS);
    for (index, pixel) in image.pixels.iter_mut().enumerate() {
        let (column, row) = ((index % 160) as i64, (index / 160) as i64);
        if column < 48 && row >= 80 {
            // Struts of the vehicle.
            *pixel = if (column / 6 + row / 9) % 2 == 0 { 30 } else { 90 };
        } else {
            // A different scene in every image.
            let random = SplitMix64::new(((column / 5 * 1000 + row / 5) * 1000 + at) as u64).next_u64();
            *pixel = 60 + u8::try_from(random % 120).unwrap();
        }
    }
    true
}

#[test]
fn a_mask_is_proposed_for_what_never_moves() {
    let turn = |index: i64| ImageRotation {
        camera_key: "cam0".to_owned(),
        from_ns: index * 50 * MS,
        to_ns: (index + 1) * 50 * MS,
        second_from_first: UnitQuaternion::from_euler_angles(0.0, 0.01, 0.0),
        tracks: Vec::new(),
    };
    let turns: Vec<ImageRotation> = (0..200).map(turn).collect();
    let flight = Flight { image: behind_a_frame, ..Flight::default() };
    let report = flight.check(&turns);
    let [proposed] = report.proposed_masks.as_slice() else { panic!("{report}") };
    assert_eq!((proposed.camera_key.as_str(), proposed.mask.size_px()), ("cam0", [160, 120]));
    let (mut missed, mut beyond) = (0, 0);
    for (row, column) in (0..120).flat_map(|row| (0..160).map(move |column| (row, column))) {
        let vehicle = column < 48 && row >= 80;
        // Blocks of 8 pixels, and the blocks around them.
        let near = column < 48 + 16 && row >= 80 - 16;
        missed += usize::from(vehicle && !proposed.mask.is_masked(column, row));
        beyond += usize::from(!near && proposed.mask.is_masked(column, row));
    }
    assert_eq!((missed, beyond), (0, 0));
    // Without rotation, or with everything static, there is nothing to compare.
    assert!(flight.check(&turns[..10]).proposed_masks.is_empty());
    let still = |_: i64, _: &mut MessageTimes, image: &mut GrayImage| {
        *image = texture(0);
        true
    };
    assert!(Flight { image: still, ..Flight::default() }.check(&turns).proposed_masks.is_empty());
}

fn scaled(vector: &mut Vector3<f64>, factor: f64) -> bool {
    *vector *= factor;
    true
}

fn shifted(vector: &mut Vector3<f64>, shift: f64) -> bool {
    vector.z += shift;
    true
}

#[test]
fn faults_of_time_are_found() {
    use Severity::{Error, Warning};
    let imu = |imu| Flight { imu, ..Flight::default() };
    let image = |image| Flight { image, ..Flight::default() };
    expect(
        &image(|ms, _, _| !(4000..6000).contains(&ms)),
        Warning,
        &["cam0 has gaps", "the longest 2.050 s after 3.960 s", "about 40 of"],
    );
    let jump = |ms: i64, times: &mut MessageTimes, _: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        times.stamp_ns -= if ms == 6000 { 500 * MS } else { 0 };
        true
    };
    expect(&imu(jump), Error, &["stamps of imu0 run backwards", "the largest 0.495 s"]);
    let repeat = |ms: i64, times: &mut MessageTimes, _: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        times.stamp_ns -= if ms == 6000 { 5 * MS } else { 0 };
        true
    };
    expect(&imu(repeat), Warning, &["stamps of imu0 repeat", "1 of 2400 messages", "at 5.995 s", "with other content"]);
    let scatter = |ms: i64, times: &mut MessageTimes, _: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        times.stamp_ns += if ms / 5 % 3 == 0 { 3 * MS } else { 0 };
        true
    };
    expect(&imu(scatter), Warning, &["stamps of imu0 jitter"]);
    expect(
        &imu(|ms, _, _, _| ms % 10 == 0),
        Warning,
        &["the rate of imu0 differs from the rig", "100.0 Hz measured, 200.0 Hz in the rig"],
    );
    let late = |_: i64, times: &mut MessageTimes, _: &mut GrayImage| {
        times.stamp_ns -= 1000 * MS;
        true
    };
    expect(&image(late), Error, &["cam0 and imu0 are stamped by different clocks", "cam0 1018.0 ms"]);
    let drift = |ms: i64, times: &mut MessageTimes, _: &mut GrayImage| {
        times.stamp_ns -= ms * MS / 1000;
        true
    };
    expect(&image(drift), Warning, &["the clock of cam0 drifts", "ppm"]);
    let future = |_: i64, times: &mut MessageTimes, _: &mut GrayImage| {
        times.stamp_ns += 50 * MS;
        true
    };
    expect(&image(future), Warning, &["stamps of cam0 are in the future", "the median by 0.032 s"]);
}

#[test]
fn batches_and_messages_out_of_order_miss_nothing() {
    let check = |imu, severity, words: &[&str]| {
        let flight = Flight { imu, ..Flight::default() };
        expect(&flight, severity, words);
        let report = flight.check(&[]);
        let gap = |title: &str| title.contains("imu0 has gaps") || title.contains("rate of imu0");
        assert!(!report.findings.iter().any(|finding| gap(&finding.title)), "{report}");
    };
    let batches = |ms: i64, times: &mut MessageTimes, _: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        let place = ms / 5 % 6;
        times.stamp_ns += (5 - place) * 5 * MS - (5 - place) * MS / 5;
        true
    };
    let words = ["imu0 is stamped on arrival, in batches", "of 6, 0.200 ms apart", "200.", "miss no messages"];
    check(batches, Severity::Warning, &words);
    let swapped = |ms: i64, times: &mut MessageTimes, _: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        times.stamp_ns += if ms / 5 % 10 == 4 { 20 * MS } else { 0 };
        times.stamp_ns -= if ms / 5 % 10 == 8 { 20 * MS } else { 0 };
        true
    };
    check(swapped, Severity::Warning, &["messages of imu0 are out of order", "nothing is missing"]);
    // More than half of the messages are missing: no batches.
    let lossy = |ms: i64, _: &mut MessageTimes, _: &mut Vector3<f64>, _: &mut Vector3<f64>| ms % 100 < 40;
    expect(&Flight { imu: lossy, ..Flight::default() }, Severity::Warning, &["imu0 has gaps", "are missing"]);
}

#[test]
fn faults_of_images_and_lenses_are_found() {
    use Severity::{Error, Note, Warning};
    let image = |image| Flight { image, ..Flight::default() };
    let rig = |from: &str, to: &str| {
        assert!(rig_text().contains(from));
        Flight { rig: rig_text().replace(from, to), ..Flight::default() }
    };
    expect(
        &rig("resolution: [160, 120]", "resolution: [320, 240]"),
        Error,
        &["cam0 differs in size from the rig", "160×120 in", "scaled by 0.500"],
    );
    expect(
        &rig("[80.0, 80.0, 79.5, 59.5]", "[160.0, 160.0, 159.5, 119.5]"),
        Error,
        &["principal point of cam0", "1.99 times as large"],
    );
    expect(&rig("[80.0, 80.0, 79.5, 59.5]", "[80.0, 120.0, 79.5, 59.5]"), Warning, &["focal lengths of cam0 differ"]);
    expect(
        &rig("[80.0, 80.0, 79.5, 59.5]", "[3000.0, 3000.0, 79.5, 59.5]"),
        Warning,
        &["field of view of cam0 is unusual"],
    );
    expect(
        &Flight { camera_info: [90.0, 90.0, 79.5, 59.5], ..Flight::default() },
        Warning,
        &["CameraInfo differs from the rig for cam0"],
    );
    let lens = "distortion_model: plumb_bob\n  distortion_coeffs: [-0.3, 0.09, 0.0, 0.0, 0.02]";
    expect(
        &Flight { rig: rig_text().replace("distortion_model: none", lens), ..Flight::default() },
        Warning,
        &["CameraInfo differs from the rig for cam0"],
    );
    let blur = |ms: i64, _: &mut MessageTimes, image: &mut GrayImage| {
        if ms > 10_000 {
            let sharp = image.pixels.clone();
            for index in 0..sharp.len() {
                let from = index.saturating_sub(4);
                let part = &sharp[from..(index + 5).min(sharp.len())];
                image.pixels[index] = (part.iter().map(|value| usize::from(*value)).sum::<usize>() / part.len()) as u8;
            }
            for column in 0..160 {
                for row in 4..116 {
                    let sum: usize = (row - 4..row + 5).map(|row| usize::from(image.pixels[row * 160 + column])).sum();
                    image.pixels[row * 160 + column] = (sum / 9) as u8;
                }
            }
        }
        true
    };
    expect(&image(blur), Warning, &["some images of cam0 are blurred", "10."]);
    let dark = |_: i64, _: &mut MessageTimes, image: &mut GrayImage| {
        image.pixels.iter_mut().for_each(|pixel| *pixel /= 12);
        true
    };
    expect(&image(dark), Warning, &["cam0 is underexposed"]);
    expect(&image(dark), Warning, &["all images of cam0 are blurred"]);
    expect(&image(dark), Warning, &["some images of cam0 have little texture"]);
    let bright = |_: i64, _: &mut MessageTimes, image: &mut GrayImage| {
        image.pixels.iter_mut().for_each(|pixel| *pixel = pixel.saturating_add(150));
        true
    };
    expect(&image(bright), Warning, &["cam0 is overexposed"]);
    expect(&rig("update_rate: 20.0", "update_rate: 2.0"), Note, &["high angular rate of cam0"]);
}

#[test]
fn faults_of_the_gimbal_and_the_extrinsics_are_found() {
    use Severity::{Error, Note, Warning};
    let joint = |joint| Flight { joint, ..Flight::default() };
    let rig = |from: &str, to: &str| {
        assert!(rig_text().contains(from));
        Flight { rig: rig_text().replace(from, to), ..Flight::default() }
    };
    expect(&joint(|_, angle| *angle = 0.3), Warning, &["'yaw' hardly moves"]);
    expect(&joint(|_, angle| *angle = angle.to_degrees()), Error, &["readings of 'yaw' appear to be in degrees"]);
    expect(&joint(|_, angle| *angle *= 2.0), Warning, &["'yaw' exceeds its limits"]);
    expect(&joint(|_, angle| *angle = (*angle * 2.0).clamp(-1.0, 1.0)), Note, &["'yaw' reaches its limit", "%"]);
    expect(&rig("encoder_sigma: 0.0087", "encoder_sigma: 0.002"), Warning, &["encoder noise of 'yaw' is 4."]);
    expect(&rig("encoder_sigma: 0.0087", "encoder_sigma: 0.1"), Note, &["encoder noise of 'yaw' is below the rig's"]);
    expect(&rig("encoder_sigma: 0.0087", "encoder_sigma: null"), Note, &["encoders are not used"]);
    expect(&rig("joint: yaw", "joint: pan"), Error, &["joint 'pan' is not in the messages", "name yaw"]);
    expect(
        &rig("rostopic: /joints", "rostopic: /gone"),
        Error,
        &["gimbal.rostopic names a topic that is not in the log", "'/joints'"],
    );
    expect(&rig("translation_bound: 0.003", "translation_bound: 0.0"), Note, &["the prior of the chain is zero"]);
    expect(&rig("d: 0.046", "d: 46.0"), Warning, &["the gimbal chain is unusually long"]);
    // Inverse matrix: the optical axis changes from the IMU's x to −y, and the image is upright.
    expect(
        &rig(
            "[[0, -1, 0, 0], [0, 0, -1, 0.05], [1, 0, 0, -0.1], [0, 0, 0, 1]]",
            "[[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]",
        ),
        Error,
        &["the extrinsics of cam0 appear inverted"],
    );
    expect(
        &rig(
            "[[0, -1, 0, 0], [0, 0, -1, 0.05], [1, 0, 0, -0.1], [0, 0, 0, 1]]",
            "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]",
        ),
        Warning,
        &["the rotation of cam0 is the identity"],
    );
}

#[test]
fn a_log_without_a_rig_is_checked() {
    let flight = Flight { rig: "rig_version: 1\n".into(), ..Flight::default() };
    expect(&flight, Severity::Error, &["no usable rig", "gravity: missing"]);
    let report = flight.check(&[]);
    assert!(report.findings.iter().any(|finding| finding.title == "the accelerometer measures gravity"), "{report}");
}
