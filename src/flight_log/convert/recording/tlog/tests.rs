//! Gimbals, IMUs and vehicles of one telemetry log are never mixed.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use tempfile::TempDir;

use super::frames::{Frame, MAX_PAYLOAD_BYTES};
use super::vehicles::{self, Vehicle};
use super::{Recorded, described, id, take};
use crate::files::LogLimits;
use crate::flight_log::convert::options::TakenRecords;
use crate::flight_log::convert::sink::LogSink;
use crate::flight_log::{LogWriter, LogWriterOptions};

const START_NS: i64 = 1_700_000_000_000_000_000;

/// Frame of a component `ms` milliseconds after its start, received at once; fields are written at their places.
fn frame([system, component]: [u8; 2], message: u32, ms: u32, fields: &[(usize, &[u8])]) -> Frame {
    let mut payload = [0; MAX_PAYLOAD_BYTES];
    let time = if message == id::HIGHRES_IMU {
        (u64::from(ms) * 1000).to_le_bytes().to_vec()
    } else {
        ms.to_le_bytes().to_vec()
    };
    for (at, bytes) in [(0, &time[..])].iter().chain(fields) {
        payload[*at..*at + bytes.len()].copy_from_slice(bytes);
    }
    Frame { received_ns: START_NS + i64::from(ms) * 1_000_000, system, component, message, payload, end: 0 }
}

/// Attitude about the x axis (w, x of the quaternion) of a gimbal.
fn gimbal(sender: [u8; 2], ms: u32, [w, x]: [f32; 2], number: u8) -> Frame {
    let (w, x) = (w.to_le_bytes(), x.to_le_bytes());
    frame(sender, id::GIMBAL_DEVICE_ATTITUDE_STATUS, ms, &[(4, &w), (8, &x), (36, &[32]), (48, &[number])])
}

fn imu(sender: [u8; 2], ms: u32, rate: f32) -> Frame {
    frame(sender, id::HIGHRES_IMU, ms, &[(20, &rate.to_le_bytes()), (60, &[0x3F])])
}

fn recorded(frames: &[Frame], wanted: &[&str]) -> (Recorded, Vec<String>) {
    let folder = TempDir::new().unwrap();
    let writer = LogWriter::create(&folder.path().join("a.mcap"), &LogWriterOptions::default()).unwrap();
    let wanted = TakenRecords::new(wanted.iter().map(|name| (*name).to_owned()).collect());
    let mut progress = |_: f64| ControlFlow::Continue(());
    let mut sink = LogSink::new(writer, LogLimits::default(), wanted, &mut progress);
    let mut vehicles: BTreeMap<u8, Vehicle> = BTreeMap::new();
    for frame in frames {
        let (name, _) = described(frame.message).unwrap();
        take(frame, name, vehicles.entry(frame.system).or_default());
    }
    let recorded = vehicles::chosen(vehicles, &mut sink);
    let gimbals = recorded.gimbal.names().map(str::to_owned).collect();
    (recorded, gimbals)
}

#[test]
fn every_gimbal_is_a_record_of_its_own() {
    let mut frames = Vec::new();
    for ms in (0..2000).step_by(20) {
        frames.push(gimbal([1, 154], ms, [1.0, 0.0], 0));
        frames.push(gimbal([1, 171], ms + 2, [0.0, 1.0], 0));
        frames.push(gimbal([1, 1], ms + 3, [0.6, 0.8], 1));
        frames.push(gimbal([1, 1], ms + 3, [0.8, 0.6], 2));
    }
    let (recorded, names) = recorded(&frames, &[]);
    let name = "GIMBAL_DEVICE_ATTITUDE_STATUS";
    let expected = [" of gimbal 1", " of gimbal 2", " of component 154", " of component 171"]
        .map(|device| format!("{name}{device}"));
    assert_eq!(names, expected);
    for (samples, w) in recorded.gimbal.samples().zip([0.6, 0.8, 1.0, 0.0]) {
        assert_eq!(samples.len(), 100);
        assert!(samples.iter().all(|(_, attitude)| (attitude.frame_from_camera.w - w).abs() < 1e-6));
    }
}

#[test]
fn imus_of_other_components_are_apart_and_behind() {
    let frames: Vec<Frame> =
        (0..1000).step_by(5).flat_map(|ms| [imu([1, 154], ms, 2.0), imu([1, 1], ms, 1.0)]).collect();
    let (recorded, _) = recorded(&frames, &[]);
    let found: Vec<(&str, bool, usize)> =
        recorded.imus.iter().map(|(name, imu)| (name.as_str(), imu.is_of_other_device, imu.combined.len())).collect();
    assert_eq!(found, [("HIGHRES_IMU[0]", false, 200), ("HIGHRES_IMU[0] of component 154", true, 200)]);
    for (imu, rate) in recorded.imus.values().zip([1.0, 2.0]) {
        assert!(imu.combined.iter().all(|(_, [found, _])| (found.x - rate).abs() < 1e-6));
    }
}

#[test]
fn one_vehicle_is_taken_even_before_its_heartbeat() {
    let heartbeat = |system: u8, autopilot: u8| frame([system, 1], id::HEARTBEAT, 0, &[(5, &[autopilot])]);
    let mut frames = vec![imu([7, 1], 0, 7.0), imu([2, 1], 1, 2.0)];
    for ms in (10..500).step_by(5) {
        frames.push(imu([2, 1], ms, 2.0));
        frames.push(imu([7, 1], ms, 7.0));
        frames.push(imu([9, 1], ms, 9.0));
        frames.push(imu([9, 1], ms + 1, 9.0));
    }
    // System 9 has most samples and no autopilot.
    frames.extend([heartbeat(2, 3), heartbeat(7, 12), heartbeat(9, 8), imu([7, 1], 500, 7.0)]);
    let rate = |recorded: &Recorded| {
        recorded.imus.values().next().unwrap().combined.iter().map(|(_, [rate, _])| rate.x).collect()
    };
    let (taken, _) = recorded(&frames, &[]);
    let rates: Vec<f64> = rate(&taken);
    assert!(rates.len() == 100 && rates.iter().all(|rate| (rate - 7.0).abs() < 1e-6), "{rates:?}");
    assert_eq!(taken.left["HIGHRES_IMU of system 2"].count, 99);
    assert_eq!(
        taken.notes,
        [
            "several vehicles: system 2 (99 measurements), system 7 (100 measurements), system 9 (196 measurements); system 7 \
          is taken, another one with --take \"NAME\""
        ]
    );
    let (wanted, _) = recorded(&frames, &["system 2"]);
    assert!(rate(&wanted).iter().all(|rate: &f64| (rate - 2.0).abs() < 1e-6));
}
