use nalgebra::Vector3;
use tempfile::TempDir;

use super::read_trajectory_file;
use crate::flight_log::messages::cdr::CdrWriter;
use crate::flight_log::{FlightLog, LogWriter, LogWriterOptions, MessageTimes, MessageType};
use crate::geometry::{RigidTransform, so3};

fn read(text: &str) -> Result<Vec<super::RecordedPose>, String> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.txt");
    std::fs::write(&path, text).unwrap();
    let shown = path.display().to_string();
    read_trajectory_file(&path).map_err(|error| error.to_string().replace(&shown, "FILE"))
}

#[test]
fn tum_and_euroc_are_told_apart_by_their_commas() {
    let tum = "# stamp x y z qx qy qz qw\n1403636580.838555574 1 2 3 0 0 0.6 0.8\n1403636580.788555574 0 2 3 0 0 0 1\n";
    let euroc = "#timestamp [ns], p x, y, z, q w, x, y, z, v x\n1403636580788555574, 0, 2, 3, 1, 0, 0, 0, 0.1\n\
                 1403636580838555574, 1, 2, 3, 0.8, 0, 0, 0.6, 0.1\n";
    let poses = read(tum).unwrap();
    assert_eq!(poses, read(euroc).unwrap());
    assert_eq!(poses[1].stamp_ns, 1_403_636_580_838_555_574, "no digit is lost");
    assert_eq!(poses[1].position_m, Vector3::new(1.0, 2.0, 3.0));
    assert!((poses[1].rotation.unwrap().angle() - 2.0 * 0.6_f64.asin()).abs() < 1e-12);
    assert_eq!(read("-1.5 0 0 0 0 0 0 1\n2.5e1 0 0 0 0 0 0 1\n").unwrap()[0].stamp_ns, -1_500_000_000);
}

#[test]
fn units_marks_and_headings_are_recognized() {
    let expected = read("1403636580.788555 0 2 3 0 0 0 1\n1403636580.838555 1 2 3 0 0 0.6 0.8\n").unwrap();
    for text in [
        "1403636580788555000 0 2 3 0 0 0 1\n1403636580838555000 1 2 3 0 0 0.6 0.8\n",
        "1403636580788555 0 2 3 0 0 0 1\n1403636580838555 1 2 3 0 0 0.6 0.8\n",
        "1403636580788.555 0 2 3 0 0 0 1\n1403636580838.555 1 2 3 0 0 0.6 0.8\n",
        "\u{feff}timestamp tx ty tz qx qy qz qw\r\n 1403636580.788555\t0 2 3 0 0 0 1 \r\n\r\n1403636580.838555 1 2 3 0 0 0.6 0.8\r\n",
        "\u{feff}timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\r\n1403636580788555000 , 0,2,3,1,0,0,0\r\n1403636580838555000,1,2,3,0.8,0,0,0.6\r\n",
        "1403636580788555,0,2,3,1,0,0,0\n1403636580838555,1,2,3,0.8,0,0,0.6\n",
    ] {
        assert_eq!(read(text).unwrap(), expected, "{text}");
    }
}

#[test]
fn positions_have_no_attitude() {
    for text in ["1.5 1 2 3\n", "1.5 1 2 3 0 0 0 0\n", "1500000000,1,2,3\n", "1500000000,1,2,3,0,0,0,0\n"] {
        let poses = read(text).unwrap();
        assert_eq!((poses[0].stamp_ns, poses[0].rotation), (1_500_000_000, None), "{text}");
    }
}

#[test]
fn errors_name_the_line() {
    let check = |text: &str, expected: &str| assert_eq!(read(text).unwrap_err(), expected, "{text}");
    let tum = "expected 't x y z qx qy qz qw': FILE";
    check("1 2 3 4 0 0 0 1\n1 2 3\n", &format!("line 2 holds 3 numbers; {tum}"));
    check("1 2 3 x 0 0 0 1\n", &format!("line 1 holds 'x', which is not a finite number; {tum}"));
    check("1 2 3 4 0 0 0 2\n", &format!("line 1 has a quaternion of norm 2.0000, not 1; {tum}"));
    check(
        "0.5,1,2,3\n",
        &format!(
            "line 1 begins with '0.5', expected a stamp in whole nanoseconds as in EuRoC's tables with commas (w of the \
             quaternion first); write seconds with spaces instead of commas (TUM, w last); {tum}"
        ),
    );
    check("1e30 1 2 3\n", &format!("line 1 has a stamp of 1e30 s, which no clock has; {tum}"));
    check(
        "99999999999999 1 2 3\n",
        &format!("line 1 has a stamp of 99999999999999 seconds, which no clock has; {tum}"),
    );
    check("# nothing\n", "cannot use the trajectory: no pose in it: FILE");
}

#[test]
fn positions_on_topics_are_read() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    let mut writer = LogWriter::create(&path, &LogWriterOptions::default()).unwrap();
    let point =
        MessageType::ros2("geometry_msgs/msg/PointStamped", "std_msgs/Header header\ngeometry_msgs/Point point");
    let fix = MessageType::ros2("sensor_msgs/msg/NavSatFix", "std_msgs/Header header");
    for number in 0..5_i64 {
        let stamp_ns = 1_700_000_000_000_000_000 + number * 200_000_000;
        let times = MessageTimes { stamp_ns, log_time_ns: stamp_ns };
        let header = || {
            let mut cdr = CdrWriter::new();
            cdr.i32((stamp_ns / 1_000_000_000) as i32);
            cdr.u32((stamp_ns % 1_000_000_000) as u32);
            cdr.string("gps");
            cdr
        };
        let mut cdr = header();
        cdr.f64s(&[number as f64, 2.0, 3.0]);
        writer.write_typed("/point", &point, times, &cdr.finish()).unwrap();
        let mut cdr = header();
        // The third message has no fix.
        cdr.u8(if number == 2 { u8::MAX } else { 2 });
        cdr.u16(1);
        cdr.f64s(&[47.0 + 1e-5 * number as f64, 8.0, 500.0 + number as f64]);
        cdr.f64s(&[0.0; 9]);
        cdr.u8(0);
        writer.write_typed("/fix", &fix, times, &cdr.finish()).unwrap();
        let pose = RigidTransform::new(so3::exp(&Vector3::new(0.0, 0.0, 0.1)), Vector3::new(number as f64, 0.0, 0.0));
        writer.write_pose("/pose", "world", times, &pose).unwrap();
        writer.write_imu("/imu", "imu", times, &Vector3::zeros(), &Vector3::z()).unwrap();
    }
    writer.finish().unwrap();
    let log = FlightLog::open(&path).unwrap();
    let points = log.read_trajectory_topic("/point").unwrap();
    assert_eq!((points.len(), points[3].position_m), (5, Vector3::new(3.0, 2.0, 3.0)));
    assert_eq!((points[0].stamp_ns, points[0].rotation), (1_700_000_000_000_000_000, None));
    let fixes = log.read_trajectory_topic("/fix").unwrap();
    assert_eq!((fixes.len(), fixes[0].position_m), (4, Vector3::zeros()), "a message without a fix is passed over");
    // 1e-5° of latitude are 1.112 m.
    assert!((fixes[3].position_m - Vector3::new(0.0, 4.447, 4.0)).norm() < 0.01, "{}", fixes[3].position_m);
    let poses = log.read_trajectory_topic("/pose").unwrap();
    assert!((poses[4].rotation.unwrap().angle() - 0.1).abs() < 1e-12);
    let problem = |topic: &str| log.read_trajectory_topic(topic).unwrap_err().to_string();
    assert!(
        problem("/imu").contains("topic '/imu' is of type sensor_msgs/msg/Imu, expected one of nav_msgs/msg/Odometry")
    );
    let missing = problem("/vins");
    assert!(
        missing.contains("no topic '/vins' in the log; topics with poses or positions: /fix, /point, /pose"),
        "{missing}"
    );
}
