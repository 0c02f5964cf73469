//! Planted faults, which the corrections with the same text undo.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Vector2;

use super::super::{Disturbances, SimulationOptions, simulate};
use super::logs::small;
use crate::faults::{Fault, correct_joint_angles};
use crate::flight_log::RigOfLog as _;
use crate::flight_log::{FlightLog, FrameStream, SensorFrame};
use crate::sensors::{JointAngles, Rig};
use crate::simulation::Experiment;

/// Rig and frames of the gimbal camera of a short flight with faults, its images without noise, its encoders with little.
fn recorded(faults: &[&str], folder: &Path) -> (Rig, Vec<SensorFrame>) {
    let mut options = SimulationOptions { image_noise: 0.0, jpeg_quality: 100, ..small(Experiment::T3) };
    options.static_camera = false;
    options.encoder_sigma_rad = Some(1e-5);
    for fault in faults {
        options.disturbances.set(fault).unwrap();
    }
    let log = simulate(&options, &folder.join("flight.mcap"), &mut |_| ()).unwrap().log;
    let log = Arc::new(FlightLog::open(&log).unwrap());
    let rig = Rig::for_log(&log, None).unwrap();
    let frames = FrameStream::new(log, &rig, "cam0", 0.0, None).unwrap().collect();
    (rig, frames)
}

#[test]
fn faults_of_the_imu_and_of_joints_are_undone_by_their_corrections() {
    let folder = tempfile::tempdir().unwrap();
    let (rig, sound) = recorded(&[], folder.path());
    let names = rig.joint_names();
    let cases: &[&[&str]] = &[
        &["imu-axes:y/-x/z"],
        &["gyroscope-axes:z/x/y", "accelerometer-axes:x/-y/z"],
        &["gyroscope-scale:0.5", "accelerometer-scale:9.80665"],
        &["reversed:yaw", "offset:pitch:20deg"],
        &["swapped:yaw:roll", "joint-scale:0.5"],
    ];
    for texts in cases {
        let faults: Vec<Fault> = texts.iter().map(|text| text.parse().unwrap()).collect();
        let planted: Vec<String> = texts.iter().map(|text| format!("fault={text}")).collect();
        let (_, frames) = recorded(&planted.iter().map(String::as_str).collect::<Vec<_>>(), folder.path());
        let angles_of = |frame: &SensorFrame| frame.joint_angles.as_ref().unwrap().angles_rad.clone();
        let mut changes = 0.0_f64;
        for (sound, frame) in sound.iter().zip(&frames) {
            for (sound, sample) in sound.imu.iter().zip(&frame.imu) {
                changes += (sample.angular_velocity_rad_per_s - sound.angular_velocity_rad_per_s).norm();
                changes += (sample.specific_force_m_per_s2 - sound.specific_force_m_per_s2).norm();
                let sample = faults.iter().fold(*sample, |sample, fault| fault.imu_sample(&sample));
                assert!((sample.angular_velocity_rad_per_s - sound.angular_velocity_rad_per_s).norm() < 1e-9);
                assert!((sample.specific_force_m_per_s2 - sound.specific_force_m_per_s2).norm() < 1e-9);
            }
            let mut angles = JointAngles { angles_rad: angles_of(frame), ..JointAngles::default() };
            correct_joint_angles(&faults, &names, &mut angles);
            for ((sound, recorded), angle) in angles_of(sound).iter().zip(angles_of(frame)).zip(&angles.angles_rad) {
                changes += (recorded - sound).abs();
                // The curve through noisy readings depends on their size.
                assert!((angle - sound).abs() < 2e-4, "{texts:?}: {angle} {sound}");
            }
        }
        assert!(changes > 1.0, "{texts:?}: {changes}");
    }
}

#[test]
fn a_fault_begins_at_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let (_, sound) = recorded(&[], folder.path());
    let (_, frames) = recorded(&["fault=offset:yaw:20deg@0.6"], folder.path());
    for (sound, frame) in sound.iter().zip(&frames) {
        let [sound_rad, rad] = [sound, frame].map(|frame| frame.joint_angles.as_ref().unwrap().angles_rad[0]);
        // The angles of an image come from the readings around it.
        match frame.stamp_ns {
            ..550_000_000 => assert_eq!(rad, sound_rad),
            650_000_000.. => assert!((rad - sound_rad + 20_f64.to_radians()).abs() < 1e-9, "{rad} {sound_rad}"),
            _ => {}
        }
    }
}

#[test]
fn faults_of_clocks_and_focal_length_are_those_of_their_own_keys() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = |fault: &str| {
        let mut options = small(Experiment::T1);
        options.disturbances.set(fault).unwrap();
        let summary = simulate(&options, &folder.path().join("flight.mcap"), &mut |_| ()).unwrap();
        [summary.log, summary.rig, summary.ground_truth].map(|path| std::fs::read(path).unwrap())
    };
    for [key, fault] in [
        ["camera-offset=0.02", "fault=camera-shift:20ms"],
        ["joint-lag=0.03", "fault=joint-shift:-30ms"],
        ["focal=0.25", "fault=focal:0.8"],
    ] {
        assert!(bytes(key) == bytes(fault), "{key} differs from {fault}");
    }
}

#[test]
fn pixels_of_flipped_and_zoomed_images_are_those_of_their_corrections() {
    let folder = tempfile::tempdir().unwrap();
    let (rig, sound) = recorded(&[], folder.path());
    let camera = &rig.cameras[0].model;
    for text in ["image:mirrored", "image:flipped", "image:upside-down", "zoom:1.3:0.5s"] {
        let fault: Fault = text.parse().unwrap();
        let (_, frames) = recorded(&[&format!("fault={text}@0.2")], folder.path());
        let [mut corrected, mut as_recorded] = [0.0; 2];
        for (sound, frame) in sound.iter().zip(&frames) {
            let since_s = frame.stamp_ns as f64 * 1e-9 - 0.2;
            if since_s < 0.0 {
                assert!(frame.image == sound.image, "{text} before its time");
                continue;
            }
            for (index, grey) in frame.image.pixels.iter().enumerate().step_by(7) {
                let uv_px = Vector2::new((index % 96) as f64, (index / 96) as f64);
                let from_px = fault.pixel(camera, uv_px, since_s).unwrap().map(|place| place.round().max(0.0) as usize);
                corrected += f64::from(grey.abs_diff(sound.image.pixels[from_px.y * 96 + from_px.x]));
                as_recorded += f64::from(grey.abs_diff(sound.image.pixels[index]));
            }
        }
        assert!(corrected < 0.5 * as_recorded, "{text}: {corrected} {as_recorded}");
    }
}

#[test]
fn faults_that_cannot_be_planted_are_refused() {
    let refused = |text: &str| Disturbances::default().set(text).unwrap_err().to_string();
    assert!(refused("fault=focus:2").contains("'focus:2' is no correction; expected one of focal:FACTOR"));
    assert!(refused("fault=ignored:left").contains("leaves a half out"));
    assert!(refused("fault=focal:0.8@3").contains("expected no time"));
    assert!(refused("fault=reversed:yaw@soon").contains("'soon' is no time"));
    let folder = tempfile::tempdir().unwrap();
    let mut options = small(Experiment::T1);
    options.disturbances.set("fault=reversed:elbow").unwrap();
    let error = simulate(&options, &folder.path().join("flight.mcap"), &mut |_| ()).unwrap_err().to_string();
    assert!(error.contains("no joint 'elbow'; it has: yaw, roll, pitch"), "{error}");
}
