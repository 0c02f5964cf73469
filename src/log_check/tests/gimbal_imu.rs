//! Clock, axes and unit of the IMU on the gimbal.

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};

use super::super::report::Findings;
use super::super::survey::Survey;
use super::{Noise, rate_at, rig_text};
use crate::files::RigFile as _;
use crate::geometry::{ns_from_seconds, so3};
use crate::log_check::gimbal::gimbal_imu::check_gimbal_imu;
use crate::log_check::report::{ImageRotation, Severity};
use crate::sensors::{ImuSample, Rig};

const SAMPLE_S: f64 = 0.005;
const IMAGE_S: f64 = 0.05;
const IMAGES: usize = 200;

/// Rig with an IMU on the gimbal whose x axis is the viewing direction, y left, z up.
fn rig() -> Rig {
    let noise = "accelerometer_noise_density: 0.004, accelerometer_random_walk: 0.006, \
                 gyroscope_noise_density: 0.00034, gyroscope_random_walk: 0.00004";
    let axes = "T_cam_imu: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]";
    let text = rig_text().replace("mount: static", "mount: gimbal");
    let text: Vec<&str> = text.lines().filter(|line| !line.starts_with("  T_cam_imu")).collect();
    let imu = format!("imu1: {{mount: gimbal, rostopic: /own, update_rate: 200, {noise}, {axes}}}");
    Rig::from_yaml(&format!("{}\n{imu}\n", text.join("\n")), Path::new("some.rig.yaml")).unwrap()
}

/// Survey of the samples, stamped `late_s` too late, and the rotations of the camera's images.
fn flight(rig: &Rig, late_s: f64) -> (Survey, Vec<ImageRotation>) {
    let times = (0..).map(|index| f64::from(index) * SAMPLE_S).take_while(|time_s| *time_s < 12.0);
    let mut noise = Noise(3);
    let samples = times.map(|time_s| ImuSample {
        stamp_ns: ns_from_seconds(time_s + late_s),
        angular_velocity_rad_per_s: rate_at(time_s) + noise.vector() * 0.005,
        specific_force_m_per_s2: Vector3::new(0.0, 0.0, 9.81) + noise.vector() * 0.05,
        unmeasured_s: 0.0,
    });
    let mut survey = Survey::default();
    survey.gimbal_imu.extend(samples);
    let camera_from_imu = rig.gimbal_imu.as_ref().unwrap().camera_from_imu.rotation;
    let rotation = |index: usize| {
        let (from_s, steps) = (2.0 + index as f64 * IMAGE_S, 100);
        let step_s = IMAGE_S / f64::from(steps);
        let between = (0..steps).fold(UnitQuaternion::identity(), |between, step| {
            between * so3::exp(&(rate_at(from_s + (f64::from(step) + 0.5) * step_s) * step_s))
        });
        ImageRotation {
            camera_key: "cam0".to_owned(),
            from_ns: ns_from_seconds(from_s),
            to_ns: ns_from_seconds(from_s + IMAGE_S),
            second_from_first: camera_from_imu * between.inverse() * camera_from_imu.inverse(),
            tracks: Vec::new(),
        }
    };
    (survey, (0..IMAGES - 20).map(rotation).collect())
}

fn check(rig: &Rig, survey: &Survey, rotations: &[ImageRotation]) -> Vec<(Severity, String)> {
    let mut findings = Findings::default();
    check_gimbal_imu(survey, rig, rotations, &mut findings);
    findings
        .list
        .into_iter()
        .map(|finding| (finding.severity, format!("{}; {}; {}", finding.title, finding.evidence, finding.remedy)))
        .collect()
}

#[test]
fn clock_axes_and_gravity_of_the_second_imu_are_checked() {
    let rig = rig();
    let (survey, rotations) = flight(&rig, 0.0);
    let found = check(&rig, &survey, &rotations);
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(found.iter().all(|(severity, _)| *severity == Severity::Good), "{found:?}");

    let (late, rotations) = flight(&rig, 0.03);
    let found = check(&rig, &late, &rotations);
    let text = &found.iter().find(|(severity, _)| *severity == Severity::Warning).unwrap().1;
    assert!(text.contains("-30 ms") && text.contains("timeshift_imu1_imu to -0.030"), "{text}");

    let mut inverted = rig.clone();
    let imu = inverted.gimbal_imu.as_mut().unwrap();
    imu.camera_from_imu.rotation = imu.camera_from_imu.rotation.inverse();
    let found = check(&inverted, &survey, &rotations);
    assert!(found.iter().any(|(severity, text)| *severity == Severity::Error && text.contains("write the inverse")));

    let (mut weightless, rotations) = flight(&rig, 0.0);
    weightless.gimbal_imu.iter_mut().for_each(|sample| sample.specific_force_m_per_s2 /= 9.81);
    let found = check(&rig, &weightless, &rotations);
    assert!(found.iter().any(|(severity, text)| *severity == Severity::Error && text.contains("gravity")));
}

#[test]
fn vibration_of_its_servos_is_reported_with_the_frequency() {
    let rig = rig();
    let (mut survey, rotations) = flight(&rig, 0.0);
    assert!(!check(&rig, &survey, &rotations).iter().any(|(_, text)| text.contains("vibration")));
    for sample in &mut survey.gimbal_imu {
        let phase = std::f64::consts::TAU * 60.0 * crate::geometry::seconds_from_ns(sample.stamp_ns);
        sample.angular_velocity_rad_per_s.y += 0.2 * phase.sin();
    }
    let found = check(&rig, &survey, &rotations);
    assert!(
        found.iter().any(|(severity, text)| {
            *severity == Severity::Note
                && text.contains("gyroscope of the IMU on the gimbal")
                && text.contains("at 60 Hz")
        }),
        "{found:?}"
    );
}
