//! `check` on rendered images: time offsets and extrinsics measured from the rotations of the cameras.

use std::path::Path;
use std::sync::Arc;

use dcvins::flight_log::FlightLog;
use dcvins::flight_log::RigOfLog as _;
use dcvins::log_check::{CheckReport, Finding, ImageRotation, Severity, check};
use dcvins::sensors::{CameraMount, Rig};
use dcvins::session::image_rotations;
use dcvins::simulated_log::{SimulationOptions, simulate};
use dcvins::simulation::Experiment;
use tempfile::TempDir;

/// A log with the rotations of its cameras.
struct Measured {
    log: Arc<FlightLog>,
    rig: Rig,
    rotations: Vec<ImageRotation>,
}

impl Measured {
    fn of(path: &Path) -> Self {
        let log = Arc::new(FlightLog::open(path).expect("the log can be read"));
        let rig = Rig::for_log(&log, None).expect("the rig lies beside the log");
        let rotations = image_rotations(&log, &rig);
        Self { log, rig, rotations }
    }

    /// Checks the log with a changed rig.
    fn check(&self, change: impl Fn(&mut Rig)) -> CheckReport {
        let mut rig = self.rig.clone();
        change(&mut rig);
        check(&self.log, Ok(&rig), &self.rotations)
    }

    fn static_camera(&self) -> &str {
        self.camera(|mount| matches!(mount, CameraMount::Static { .. }))
    }

    fn gimbal_camera(&self) -> &str {
        self.camera(|mount| *mount == CameraMount::Gimbal)
    }

    fn camera(&self, has_mount: impl Fn(&CameraMount) -> bool) -> &str {
        &self.rig.cameras.iter().find(|camera| has_mount(&camera.mount)).expect("there is such a camera").key
    }
}

fn shifted(rig: &mut Rig, shift_s: f64) {
    for camera in &mut rig.cameras {
        camera.timeshift_cam_imu_s += shift_s;
    }
}

/// Asserts that exactly one finding of this severity has these words in its title, and returns it.
fn expect<'a>(report: &'a CheckReport, severity: Severity, title: &str) -> &'a Finding {
    let found: Vec<&Finding> = report.findings.iter().filter(|finding| finding.title.contains(title)).collect();
    assert!(found.len() == 1 && found[0].severity == severity, "{severity:?} '{title}' in\n{report}");
    found[0]
}

/// Time offset to be added to the rig's in milliseconds, from a title such as `the stamps of cam1 are 30.0 ms earlier than
/// the rig says`.
fn time_offset_ms(report: &CheckReport, camera: &str) -> i32 {
    let finding = expect(report, Severity::Warning, &format!("the stamps of {camera} are "));
    let number: Option<f64> = finding.title.split_whitespace().find_map(|word| word.parse().ok());
    let sign = if finding.title.contains(" earlier ") { 1.0 } else { -1.0 };
    (sign * number.expect("the title names the milliseconds")).round() as i32
}

#[test]
fn rotations_of_the_sample_log_detect_a_wrong_rig() {
    let mut sample = Measured::of(&Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap"));
    // The first five seconds are enough for each fault.
    let first_ns = sample.rotations.iter().map(|rotation| rotation.from_ns).min().expect("there are rotations");
    sample.rotations.retain(|rotation| rotation.from_ns < first_ns + 5_000_000_000);
    let camera = sample.static_camera();
    let correct = sample.check(|_| {});
    expect(&correct, Severity::Good, &format!("the orientation of {camera} agrees with the rig"));
    expect(&correct, Severity::Good, &format!("{camera} and the gyroscope are synchronized"));
    assert!(correct.worst() < Severity::Error, "{correct}");
    assert!(!correct.findings.iter().any(|finding| finding.title.contains("than the rig says")), "{correct}");

    // Noise of the encoders is no time offset, and the misfit of both cameras is what noise predicts.
    let gimbal = sample.gimbal_camera();
    expect(&correct, Severity::Good, &format!("the orientation of {gimbal} agrees with the rig"));
    assert!(!correct.findings.iter().any(|finding| finding.title.contains("unexplained")), "{correct}");

    // The rig's time offset is too small.
    for shift_ms in [10, 30] {
        let report = sample.check(|rig| shifted(rig, -1e-3 * f64::from(shift_ms)));
        let offset_ms = time_offset_ms(&report, camera);
        assert!((offset_ms - shift_ms).abs() <= 2, "{offset_ms} ms for {shift_ms} ms in\n{report}");
    }

    let inverted = sample.check(|rig| {
        for camera in &mut rig.cameras {
            if let CameraMount::Static { imu_from_camera } = &mut camera.mount {
                *imu_from_camera = imu_from_camera.inverse();
            }
        }
    });
    let finding = expect(&inverted, Severity::Error, &format!("{camera}.T_cam_imu is inverted"));
    assert!(finding.remedy.contains("inverse"), "{inverted}");

    let end = sample.check(|rig| {
        let chain = &mut rig.gimbal.as_mut().expect("the sample has a gimbal").chain;
        chain.effector_from_camera = chain.effector_from_camera.inverse();
    });
    expect(&end, Severity::Error, "gimbal.T_E_C is inverted");

    // Against a gyroscope with left-handed axes (here all three are reversed) no rotation of the extrinsics helps.
    let mut reversed = sample;
    for rotation in &mut reversed.rotations {
        rotation.second_from_first = rotation.second_from_first.inverse();
        rotation.tracks.iter_mut().for_each(|track| std::mem::swap(&mut track.previous, &mut track.now));
    }
    let camera = reversed.static_camera().to_owned();
    // Ground truth would confirm the gyroscope, whose rates are not changed here.
    let report = reversed.check(|rig| rig.ground_truth_topic = None);
    expect(&report, Severity::Error, "the axes of the gyroscope form a left-handed frame (all axes reversed)");
    assert!(!report.findings.iter().any(|finding| finding.title.contains(&format!("{camera} agrees"))), "{report}");
}

#[test]
fn a_simulated_time_offset_is_found() {
    let folder = TempDir::new().expect("a temporary folder");
    let path = folder.path().join("late.mcap");
    let mut options = SimulationOptions::new(Experiment::T1);
    options.duration_s = Some(9.0);
    options.resolution_px = [320, 240];
    options.disturbances.camera_time_offset_s = 0.03;
    simulate(&options, &path, &mut |_| {}).expect("the flight can be simulated");
    let late = Measured::of(&path);
    let camera = late.static_camera();
    let report = late.check(|_| {});
    assert!((time_offset_ms(&report, camera) - 30).abs() <= 2, "{report}");
    // A rig with 20 of the 30 ms: 10 remain.
    let report = late.check(|rig| shifted(rig, 0.02));
    assert!((time_offset_ms(&report, camera) - 10).abs() <= 2, "{report}");
    let report = late.check(|rig| shifted(rig, 0.03));
    expect(&report, Severity::Good, &format!("{camera} and the gyroscope are synchronized"));
}
