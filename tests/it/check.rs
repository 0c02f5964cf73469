//! `check` on rendered pictures: what the turns of the cameras tell about clocks and extrinsics.

use std::path::Path;
use std::sync::Arc;

use dcvins::flight_log::FlightLog;
use dcvins::log_check::{CheckReport, Finding, ImageRotation, Severity, check};
use dcvins::sensors::{CameraMount, Rig};
use dcvins::session::image_rotations;
use dcvins::simulation::{Experiment, SimulationOptions, simulate};
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

    /// What is found when the rig is changed so.
    fn check(&self, change: impl Fn(&mut Rig)) -> CheckReport {
        let mut rig = self.rig.clone();
        change(&mut rig);
        check(&self.log, Ok(&rig), &self.rotations)
    }

    fn static_camera(&self) -> &str {
        let is_static = |mount: &CameraMount| matches!(mount, CameraMount::Static { .. });
        &self.rig.cameras.iter().find(|camera| is_static(&camera.mount)).expect("there is a static camera").key
    }
}

fn shifted(rig: &mut Rig, shift_s: f64) {
    for camera in &mut rig.cameras {
        camera.timeshift_cam_imu_s += shift_s;
    }
}

/// Exactly one finding with these words in its title, as severe as said.
fn expect<'a>(report: &'a CheckReport, severity: Severity, title: &str) -> &'a Finding {
    let found: Vec<&Finding> = report.findings.iter().filter(|finding| finding.title.contains(title)).collect();
    assert!(found.len() == 1 && found[0].severity == severity, "{severity:?} '{title}' in\n{report}");
    found[0]
}

/// The milliseconds of a title such as `cam1 and the gyroscope are +30 ms apart`.
fn milliseconds_apart(report: &CheckReport, camera: &str) -> i32 {
    let finding = expect(report, Severity::Warning, &format!("{camera} and the gyroscope are"));
    let number = finding.title.split_whitespace().find_map(|word| word.parse().ok());
    number.expect("the title names the milliseconds")
}

#[test]
fn turns_of_the_sample_log_tell_a_wrong_rig() {
    let sample = Measured::of(&Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap"));
    let camera = sample.static_camera();
    let sound = sample.check(|_| {});
    expect(&sound, Severity::Good, &format!("{camera} points where the rig says"));
    expect(&sound, Severity::Good, &format!("{camera} and the gyroscope turn at the same time"));
    assert!(sound.worst() < Severity::Error, "{sound}");
    assert!(!sound.findings.iter().any(|finding| finding.title.contains("ms apart")), "{sound}");

    // The rig says that the images are earlier than they are.
    for shift_ms in [10, 30] {
        let report = sample.check(|rig| shifted(rig, -1e-3 * f64::from(shift_ms)));
        let apart_ms = milliseconds_apart(&report, camera);
        assert!((apart_ms - shift_ms).abs() <= 2, "{apart_ms} ms for {shift_ms} ms in\n{report}");
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
    assert!((milliseconds_apart(&report, camera) - 30).abs() <= 2, "{report}");
    // A rig that knows of 20 ms leaves 10.
    let report = late.check(|rig| shifted(rig, 0.02));
    assert!((milliseconds_apart(&report, camera) - 10).abs() <= 2, "{report}");
    let report = late.check(|rig| shifted(rig, 0.03));
    expect(&report, Severity::Good, &format!("{camera} and the gyroscope turn at the same time"));
}
