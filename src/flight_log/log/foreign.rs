//! Recordings that are no MCAP log, by their first bytes and their name, and what to do with each.

/// First bytes of an SQLite file.
const SQLITE: &[u8] = b"SQLite format 3";
/// Advice for recordings that `dcvins convert` reads.
const CONVERT: &str = "convert it with `dcvins convert`";
/// Advice for recordings without an IMU.
pub(crate) const RECORD_AN_IMU: &str = "without angular rates and specific forces of an IMU at 100 Hz or more no motion can be estimated from it: record them \
     with the images (a ROS bag by DJI's Payload or Onboard SDK, the video with an autopilot's log beside it, or a camera \
     with its own IMU such as a GoPro), and convert that";

/// Recording without the measurements of an IMU, described; `None` for any other.
///
/// `start` are the first bytes of the file, `name` is its name without the folder.
pub(crate) fn without_imu(start: &[u8], name: &str) -> Option<&'static str> {
    let text = String::from_utf8_lossy(start);
    let name = name.to_ascii_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| text.contains(word));
    let is_subtitle = text.lines().take(4).any(|line| line.contains(" --> "));
    if is_subtitle && has(&["SrtCnt", "FrameCnt", "DiffTime", "HOME(", "GPS", "[iso", "[latitude"]) {
        return Some(
            "subtitles of a DJI video (.srt): exposure, position and on some aircraft the gimbal's angles, once per image or \
             second",
        );
    }
    if is_subtitle {
        return Some("subtitles (.srt): texts with the times of a video");
    }
    if name.starts_with("djiflightrecord") {
        return Some(
            "a flight record of DJI's app (DJIFlightRecord): attitude, position and gimbal angles at 10 Hz, encrypted",
        );
    }
    let is_flight_log = has(&["DJI_LOG"])
        || start.get(16..21) == Some(b"BUILD")
        || name.strip_suffix(".dat").is_some_and(|stem| stem.starts_with("fly"))
        || name.starts_with("dji_assistant");
    if is_flight_log {
        return Some("a log of a DJI aircraft (.DAT), whose format is not published and encrypted in newer aircraft");
    }
    let heading = text.lines().next().unwrap_or_default().to_ascii_lowercase();
    let is_table = heading.contains(',')
        && ["osd.flytime", "custom.date", "time(millisecond)", "gimbal.pitch", "gimbal_pitch(degrees)"]
            .iter()
            .any(|word| heading.contains(word));
    is_table.then_some("a table of a DJI flight (.csv): attitude, position and gimbal angles at 10 Hz or less")
}

/// Description and advice for a file that is no MCAP log; `None` for an unknown one.
pub(crate) fn described(start: &[u8], name: &str) -> Option<(&'static str, &'static str)> {
    let movie = [b"ftyp", b"moov"].iter().any(|kind| start.get(4..8) == Some(*kind));
    let found = if start.starts_with(b"#ROSBAG") {
        "a ROS 1 bag"
    } else if start.starts_with(SQLITE) {
        "a ROS 2 bag in SQLite"
    } else if movie {
        "an MP4 video"
    } else if start.starts_with(b"ULog") {
        "a log of PX4 (ULog)"
    } else if start.starts_with(&[0xA3, 0x95]) {
        "a log of ArduPilot (DataFlash)"
    } else if start.len() > 8 && matches!(start, [0, 5 | 6, ..]) && matches!(start[8], 0xFD | 0xFE) {
        "a telemetry log (MAVLink)"
    } else {
        return without_imu(start, name).map(|found| (found, RECORD_AN_IMU));
    };
    Some((found, CONVERT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_of_dji_are_told_what_they_lack() {
        let old =
            b"1\r\n00:00:00,000 --> 00:00:01,000\r\nHOME(8.54,47.37) 2017.08.05 14:11:51\r\nGPS(8.54,47.37,16)\r\n";
        let new = b"\xef\xbb\xbf1\n00:00:00,000 --> 00:00:00,033\n<font size=\"28\">SrtCnt : 1, DiffTime : 33ms\n[iso : 110]\n";
        for start in [&old[..], &new[..]] {
            let (found, advice) = described(start, "DJI_0001.SRT").unwrap();
            assert!(found.starts_with("subtitles of a DJI video") && advice == RECORD_AN_IMU);
        }
        let film = without_imu(b"1\n00:00:01,000 --> 00:00:04,000\nHello.\n", "film.srt").unwrap();
        assert!(film.starts_with("subtitles (.srt)"));
        let record = without_imu(&[0x12, 0x34, 0, 0], "DJIFlightRecord_2023-05-01_[12-00-00].txt").unwrap();
        assert!(record.starts_with("a flight record of DJI's app"));
        let mut aircraft = [0_u8; 64];
        aircraft[16..21].copy_from_slice(b"BUILD");
        for (start, name) in [(&aircraft[..], "a.bin"), (&[0x55, 1][..], "FLY042.DAT")] {
            assert!(without_imu(start, name).unwrap().starts_with("a log of a DJI aircraft"));
        }
        let table = "time(millisecond),datetime(utc),latitude,longitude,gimbal_pitch(degrees)\n0,2023\n";
        assert!(without_imu(table.as_bytes(), "a.csv").unwrap().starts_with("a table of a DJI flight"));
    }

    #[test]
    fn recordings_that_convert_reads_are_sent_there() {
        let telemetry = [0, 5, 0xE0, 1, 2, 3, 4, 5, 0xFD, 9];
        for (start, found) in [
            (&b"#ROSBAG V2.0\n"[..], "a ROS 1 bag"),
            (b"SQLite format 3\0", "a ROS 2 bag in SQLite"),
            (b"\0\0\0\x20ftypisom", "an MP4 video"),
            (b"ULog\x01\x12\x35", "a log of PX4 (ULog)"),
            (b"\xA3\x95\x80\x80", "a log of ArduPilot (DataFlash)"),
            (&telemetry, "a telemetry log (MAVLink)"),
        ] {
            assert_eq!(described(start, "file"), Some((found, CONVERT)));
        }
        for start in [&b""[..], b"hello", b"0,1,2\n", b"rig_version: 1\n"] {
            assert_eq!(described(start, "file.txt"), None);
        }
    }
}
