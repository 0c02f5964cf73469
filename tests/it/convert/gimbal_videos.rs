//! Videos of gimbal cameras with the attitude in the video itself, and fragmented videos (`gimbal_recorders.rs`).

use dcvins::flight_log::convert::{AutopilotLog, AutopilotLogKind, ConvertOptions};

use super::gimbal_recorders::{camera_log, fragmented, motion_track, subtitle_track, with_message};
use super::recorders::{START_UTC_S, movie, quaternion, ulog};
use super::recordings::{assert_near, converted, imu, rig_of, run, video};
use super::topic;

const MS: i64 = 1_000_000;
/// Angles of the gimbal in degrees: roll and pitch from the horizon, yaw from the vehicle.
const ANGLES_DEG: [f64; 3] = [0.5, -30.0, 12.5];

/// Message of the frame at a time; the angles were measured 30 ms before.
fn snapshot(number: usize) -> String {
    let [roll, pitch, yaw] = angles_deg(number).map(f64::to_radians);
    format!(
        r#"{{"schema":"apcg.telemetry.v1","pts90k":{},"utc_us":{},"position":{{"lat_e7":470000000,"lon_e7":80000000,"alt_amsl_m":500.0,"alt_relative_m":10.0,"age_ms":5}},"velocity":null,"vehicle_attitude":{{"roll_rad":0.02,"pitch_rad":-0.05,"yaw_rad":1.5,"age_ms":12}},"gimbal_attitude":{{"roll_rad":{roll},"pitch_rad":{pitch},"yaw_rad":{yaw},"age_ms":30}},"heading_rad":1.5,"zoom":1.0,"hfov_deg":71.5}}"#,
        number * 4500,
        START_UTC_S * 1_000_000 + 50_000 * number as u64,
    )
}

fn angles_deg(number: usize) -> [f64; 3] {
    let [roll_deg, pitch_deg, yaw_deg] = ANGLES_DEG;
    [roll_deg, pitch_deg, yaw_deg + number as f64]
}

fn check_gimbal(numbers: &[f64], number: usize) {
    let [w, x, y, z] = quaternion(angles_deg(number));
    assert_near(numbers, &[x, y, z, w], 1e-6, "the gimbal's attitude");
}

#[test]
fn messages_in_the_frames_are_attitudes() {
    let folder = tempfile::tempdir().unwrap();
    let mut track = video("h264");
    track.samples.iter_mut().enumerate().for_each(|(number, sample)| with_message(sample, &snapshot(number)));
    let start_ns = START_UTC_S as i64 * 1_000_000_000;
    // Some writers end the text with a zero.
    let mut ended = video("h264");
    let texts = (0..).map(|number| format!("{}\0", snapshot(number)));
    ended.samples.iter_mut().zip(texts).for_each(|(sample, text)| with_message(sample, &text));
    for bytes in [movie(&[track.clone()], false), fragmented(&track), movie(&[ended], true)] {
        let (report, messages) = run(folder.path(), "flight.mp4", &bytes);
        assert_eq!(messages["/camera/video"].len(), 24);
        let gimbal = &messages["/gimbal/attitude"];
        assert_eq!(gimbal.len(), 24);
        for (number, (stamp_ns, _, numbers)) in gimbal.iter().enumerate() {
            assert_eq!(*stamp_ns - start_ns, (50 * number as i64 - 30) * MS, "{number}");
            check_gimbal(numbers, number);
        }
        let vehicle = &messages["/vehicle/attitude"];
        assert_eq!((vehicle.len(), vehicle[0].0 - start_ns), (24, -12 * MS));
        // The last position is later than the last attitude of the vehicle.
        assert_eq!(messages["/gps/pose"].len(), 23);
        let remark = topic(&report, "/gimbal/attitude").reason.clone().unwrap();
        assert!(remark.contains("apcg gimbal_attitude") && remark.contains("frame vehicle"), "{remark}");
    }
}

#[test]
fn the_recorded_field_of_view_is_that_of_the_assumed_camera() {
    let folder = tempfile::tempdir().unwrap();
    let mut track = video("h264");
    track.samples.iter_mut().enumerate().for_each(|(number, sample)| with_message(sample, &snapshot(number)));
    let log = folder.path().join("autopilot.ulg");
    std::fs::write(&log, ulog(400)).unwrap();
    let autopilot = Some(AutopilotLog { kind: AutopilotLogKind::Ulog, path: log });
    let options = ConvertOptions { autopilot, ..ConvertOptions::default() };
    let report = converted(folder.path(), "flight.mp4", &movie(&[track], false), &options).unwrap();
    let rig = rig_of(&report);
    let focal_px = rig.cameras[0].model.intrinsics_px[0];
    let horizontal_deg = 2.0 * (48.0 / focal_px).atan().to_degrees();
    assert!((horizontal_deg - 71.5).abs() < 0.01, "{horizontal_deg}");
    assert!(rig.assumed.iter().any(|assumed| assumed.field == "cam0.intrinsics"));
    // The autopilot's own log is preferred, and the video's telemetry is counted.
    let remark = topic(&report, "/vehicle/attitude").reason.clone().unwrap();
    assert!(remark.starts_with("vehicle_attitude"), "{remark}");
    assert_eq!(topic(&report, "apcg gimbal_attitude").left, 24);
    let changed: Vec<String> =
        (0..24).map(|number| snapshot(number).replace("71.5", if number < 12 { "60.0" } else { "20.0" })).collect();
    let mut track = video("h264");
    track.samples.iter_mut().zip(&changed).for_each(|(sample, text)| with_message(sample, text));
    let report = converted(folder.path(), "flight.mp4", &movie(&[track], false), &options).unwrap();
    assert!(report.notes.iter().any(|note| note.starts_with("the camera zooms: ")), "{:?}", report.notes);
}

#[test]
fn messages_that_are_no_telemetry_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut track = video("h264");
    let texts =
        ["{", "[]", r#"{"schema":"apcg.telemetry.v2"}"#, r#"{"schema":"apcg.telemetry.v1","gimbal_attitude":{}}"#, ""];
    track.samples.iter_mut().zip(texts).for_each(|(sample, text)| with_message(sample, text));
    with_message(&mut track.samples[5], &snapshot(5).replace("\"age_ms\":30", "\"age_ms\":90000"));
    with_message(&mut track.samples[6], &snapshot(6).replace("0.02,", "1e999,"));
    let (report, messages) = run(folder.path(), "flight.mp4", &movie(&[track], false));
    assert_eq!(topic(&report, "AP_CameraGimbal SEI").left, 6);
    assert!(!messages.contains_key("/gimbal/attitude"), "it had expired");
    assert_eq!(messages["/vehicle/attitude"].len(), 1);
}

#[test]
fn subtitles_are_attitudes_at_the_times_of_their_frames() {
    let folder = tempfile::tempdir().unwrap();
    let subtitle = |number: usize| {
        let [roll, pitch, yaw] = angles_deg(number);
        format!(
            "2026-05-01_10-11-12 stream->FrameCnt:{number} \nlatitude:N47°0′0″, longitude:E8°0′0.0″\nabs_alt:500.0\n\
             gb_yaw:{yaw}, gb_pitch:{pitch}, gb_roll:{roll}\nmix_ratio:1.0"
        )
    };
    let mut texts: Vec<String> = (0..24).map(subtitle).collect();
    texts[7] = "a subtitle".to_owned();
    // Another frame than the one at its time.
    texts[9] = subtitle(20);
    let (report, messages) = run(folder.path(), "flight.mp4", &movie(&[video("h264"), subtitle_track(&texts)], true));
    let gimbal = &messages["/gimbal/attitude"];
    assert_eq!((gimbal.len(), messages["/gps/pose"].len()), (22, 22));
    for (stamp_ns, _, numbers) in gimbal {
        check_gimbal(numbers, ((stamp_ns - START_UTC_S as i64 * 1_000_000_000) / (50 * MS)) as usize);
    }
    assert_eq!(topic(&report, "SIYI subtitles").left, 1);
    assert_eq!(topic(&report, "SIYI gb_roll, gb_pitch, gb_yaw").left, 1);
}

#[test]
fn motion_tracks_are_the_imu_of_the_camera() {
    let folder = tempfile::tempdir().unwrap();
    let floats = |values: [f32; 3]| values.map(f32::to_le_bytes).concat();
    let packets: Vec<(u16, Vec<u8>)> = (0..240)
        .map(|index| match index % 2 {
            0 => (2, floats([0.25, -0.5, index as f32])),
            _ => (3, floats([0.0, 9.75, 0.5])),
        })
        .collect();
    let (report, messages) = run(folder.path(), "flight.mp4", &movie(&[video("h264"), motion_track(&packets)], false));
    let rates = &messages["/camera/imu/gyroscope"];
    assert_eq!((rates.len(), messages["/camera/imu/accelerometer"].len()), (120, 120));
    assert_eq!(rates[1].0 - rates[0].0, 10 * MS);
    assert_near(&imu(&rates[3].2).0, &[0.25, -0.5, 6.0], 1e-6, "angular velocity");
    assert!(report.notes.iter().any(|note| note.contains("CAMM does not define")), "{:?}", report.notes);
    let rig = rig_of(&report);
    assert_eq!(rig.imu.accelerometer_topic.as_deref(), Some("/camera/imu/accelerometer"));
}

#[test]
fn logs_of_gimbal_cameras_have_angles_at_the_times_of_their_measurement() {
    let folder = tempfile::tempdir().unwrap();
    let (report, messages) = run(folder.path(), "00000007.BIN", &camera_log(30, ANGLES_DEG));
    let gimbal = &messages["/gimbal/attitude"];
    assert_eq!(gimbal.len(), 30);
    check_gimbal(&gimbal[0].2, 0);
    let start_ns = START_UTC_S as i64 * 1_000_000_000;
    assert_eq!(gimbal[0].0 - start_ns, 1980 * MS);
    assert_eq!((messages["/vehicle/attitude"].len(), messages["/gps/pose"].len()), (30, 30));
    let remark = topic(&report, "/gimbal/attitude").reason.clone().unwrap();
    assert!(remark.starts_with("GIMB, "), "{remark}");
}

#[test]
fn fragments_are_read_up_to_the_damage() {
    let folder = tempfile::tempdir().unwrap();
    let whole = fragmented(&video("h264"));
    let (_, messages_whole) = run(folder.path(), "flight.mp4", &whole);
    let stamps: Vec<i64> = messages_whole["/camera/video"].iter().map(|(stamp_ns, _, _)| *stamp_ns).collect();
    assert!(stamps.len() == 24 && stamps.windows(2).all(|pair| pair[1] - pair[0] == 50 * MS), "{stamps:?}");
    // The same frames as from tables.
    let data = |bytes: &[u8]| {
        run(folder.path(), "flight.mp4", bytes);
        let log = std::fs::read(folder.path().join("flight.mcap")).unwrap();
        let stream = mcap::MessageStream::new(&log).unwrap().map(Result::unwrap);
        // After the stamp, which has another start.
        stream.map(|message| message.data[2 + usize::from(message.data[1])..].to_vec()).collect::<Vec<_>>()
    };
    assert!(data(&whole) == data(&movie(&[video("h264")], true)));
    // Power lost within the last fragments.
    let (report, messages_cut) = run(folder.path(), "flight.mp4", &whole[..whole.len() - 3000]);
    let left = messages_cut["/camera/video"].len();
    assert!(left > 0 && left < 24, "{left}");
    assert!(report.notes.iter().any(|note| note.contains("frames are lost") || note.contains("incomplete")));
    // One byte changed at many positions.
    for at in (0..whole.len()).step_by(whole.len() / 199) {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x81;
        let _result = converted(folder.path(), "flight.mp4", &damaged, &ConvertOptions::default());
    }
}
