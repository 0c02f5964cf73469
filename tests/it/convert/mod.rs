//! `convert`: generated bags, databases and folders, compared with the log that the same values give when written
//! directly.

mod action_camera;
mod damage;
mod euroc;
mod gimbal_recorders;
mod gimbal_videos;
mod recorders;
mod recordings;
mod ros1;

use std::fs;
use std::path::Path;

use dcvins::camera::{CameraModel, Distortion, Projection};
use dcvins::flight_log::convert::{ConversionReport, ConvertError, ConvertedTopic, convert};
use dcvins::flight_log::{LogWriter, LogWriterOptions, MessageTimes, Odometry};
use dcvins::geometry::RigidTransform;
use nalgebra::{UnitQuaternion, Vector3};
use ros1::{Compression, Message, bag, f64_sequence, f64s, header, text};
use rusqlite::Connection;

const EPOCH_NS: i64 = 1_700_000_000_250_000_000;

fn times(index: i64) -> MessageTimes {
    let stamp_ns = EPOCH_NS + 5_000_000 * index;
    MessageTimes { stamp_ns, log_time_ns: stamp_ns + 1_000_000 }
}

fn run(source: &Path, log: &Path) -> Result<ConversionReport, ConvertError> {
    convert(source, log, &mut |_| {})
}

fn topic<'a>(report: &'a ConversionReport, name: &str) -> &'a ConvertedTopic {
    report.topics.iter().find(|topic| topic.topic == name).expect("the topic stands in the report")
}

fn camera() -> CameraModel {
    CameraModel {
        projection: Projection::Pinhole,
        intrinsics_px: [100.0, 101.0, 8.0, 6.0],
        distortion: Distortion::Radtan([0.1, -0.2, 0.001, 0.002]),
        resolution_px: [16, 12],
    }
}

/// Writes one message of every type with the log writer.
fn write_directly(path: &Path) {
    let mut log = LogWriter::create(path, &LogWriterOptions::default()).expect("the log can be created");
    let (pose, rate, force) = values();
    let joints = ["yaw".to_owned(), "roll".to_owned()];
    let pixels: Vec<u8> = (0..16 * 12).map(|index| index as u8).collect();
    let odometry =
        Odometry { linear_m_per_s: force, angular_rad_per_s: rate, ..Odometry::at_rest("world", "imu", pose) };
    let written = [
        log.write_imu("/imu", "imu", times(0), &rate, &force),
        log.write_raw_image("/cam/image_raw", "camera", times(1), [16, 12], "mono8", &pixels),
        log.write_compressed_image("/cam/compressed", "cam", times(2), "jpeg", &[1, 2, 3, 4, 5]),
        log.write_camera_info("/cam/camera_info", "camera", times(3), &camera()),
        log.write_joints("/joints", times(4), &joints, &[0.5, -1.25]),
        log.write_odometry("/truth/odometry", times(5), &odometry),
        log.write_pose("/truth/pose", "odd", times(6), &pose),
        log.write_transform("/truth/transform", "world", "imu", times(7), &pose),
        log.write_imu("/imu", "imu", times(8), &force, &rate),
    ];
    for result in written {
        result.expect("the message can be written");
    }
    log.finish().expect("the log can be completed");
}

fn values() -> (RigidTransform, Vector3<f64>, Vector3<f64>) {
    let rotation = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3);
    let pose = RigidTransform::new(rotation, Vector3::new(1.0, 2.0, 3.0));
    (pose, Vector3::new(0.1, 0.2, -0.3), Vector3::new(0.5, -9.0, 1e-3))
}

/// The same messages in ROS 1 serialization.
fn ros1_messages() -> Vec<Message> {
    let (pose, rate, force) = values();
    let stamped = |index: i64, frame_id: &str| header(times(index).stamp_ns, frame_id);
    let q = pose.rotation.quaternion();
    let transform = f64s(&[1.0, 2.0, 3.0, q.i, q.j, q.k, q.w]);
    let imu = |index: i64, rate: &Vector3<f64>, force: &Vector3<f64>| {
        let mut unknown = [0.0; 9];
        unknown[0] = -1.0;
        let orientation = f64s(&[0.0, 0.0, 0.0, 1.0]);
        let vectors = [f64s(rate.as_slice()), f64s(&[0.0; 9]), f64s(force.as_slice()), f64s(&[0.0; 9])].concat();
        [stamped(index, "imu"), orientation, f64s(&unknown), vectors].concat()
    };
    let u32s = |values: &[u32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let pixels: Vec<u8> = (0..16 * 12).map(|index| index as u8).collect();
    let image =
        [stamped(1, "camera"), u32s(&[12, 16]), text("mono8"), vec![0], u32s(&[16, pixels.len() as u32]), pixels];
    let info = [
        stamped(3, "camera"),
        u32s(&[12, 16]),
        text("plumb_bob"),
        f64_sequence(&[0.1, -0.2, 0.001, 0.002, 0.0]),
        f64s(&[100.0, 0.0, 8.0, 0.0, 101.0, 6.0, 0.0, 0.0, 1.0]),
        f64s(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        f64s(&[100.0, 0.0, 8.0, 0.0, 0.0, 101.0, 6.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
        u32s(&[0; 6]),
        vec![0],
    ];
    let joints = [
        stamped(4, ""),
        u32s(&[2]),
        text("yaw"),
        text("roll"),
        f64_sequence(&[0.5, -1.25]),
        f64_sequence(&[]),
        f64_sequence(&[]),
    ];
    let odometry = [
        stamped(5, "world"),
        text("imu"),
        transform.clone(),
        f64s(&[0.0; 36]),
        f64s(force.as_slice()),
        f64s(rate.as_slice()),
        f64s(&[0.0; 36]),
    ];
    let messages = [
        ("/imu", "sensor_msgs/Imu", imu(0, &rate, &force)),
        ("/cam/image_raw", "sensor_msgs/Image", image.concat()),
        (
            "/cam/compressed",
            "sensor_msgs/CompressedImage",
            [stamped(2, "cam"), text("jpeg"), u32s(&[5]), vec![1, 2, 3, 4, 5]].concat(),
        ),
        ("/cam/camera_info", "sensor_msgs/CameraInfo", info.concat()),
        ("/joints", "sensor_msgs/JointState", joints.concat()),
        ("/truth/odometry", "nav_msgs/Odometry", odometry.concat()),
        ("/truth/pose", "geometry_msgs/PoseStamped", [stamped(6, "odd"), transform.clone()].concat()),
        (
            "/truth/transform",
            "geometry_msgs/TransformStamped",
            [stamped(7, "world"), text("imu"), transform.clone()].concat(),
        ),
        ("/imu", "sensor_msgs/Imu", imu(8, &force, &rate)),
    ];
    let message = |(index, (topic, message_type, data)): (usize, (&'static str, &'static str, Vec<u8>))| Message {
        topic,
        message_type,
        time_ns: times(index as i64).log_time_ns,
        data,
    };
    messages.into_iter().enumerate().map(message).collect()
}

#[test]
fn bags_of_every_compression_give_the_bytes_of_the_log_written_directly() {
    let folder = tempfile::tempdir().unwrap();
    let expected = folder.path().join("expected.mcap");
    write_directly(&expected);
    for compression in [Compression::None, Compression::Bz2, Compression::Lz4] {
        let source = folder.path().join("flight.bag");
        let mut messages = ros1_messages();
        let string = Message {
            topic: "/talk",
            message_type: "std_msgs/String",
            time_ns: times(3).log_time_ns,
            data: text("hi"),
        };
        messages.insert(3, string);
        fs::write(&source, bag(&messages, 4, compression, "")).unwrap();
        let log = folder.path().join("flight.mcap");
        let report = run(&source, &log).unwrap();
        assert!(fs::read(&log).unwrap() == fs::read(&expected).unwrap(), "{compression:?}\n{report}");
        assert_eq!((topic(&report, "/imu").taken, topic(&report, "/imu").left), (2, 0));
        let left = topic(&report, "/talk");
        assert_eq!((left.taken, left.left), (0, 1));
        assert!(left.reason.as_ref().is_some_and(|reason| reason.contains("unsupported type")), "{report}");
        assert!(!folder.path().join("flight.mcap.partial").exists());
    }
}

#[test]
fn a_damaged_bag_converts_as_far_as_it_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let (source, log) = (folder.path().join("flight.bag"), folder.path().join("flight.mcap"));
    let whole = bag(&ros1_messages(), 1, Compression::Lz4, "");
    fs::write(&source, &whole[..whole.len() - 100]).unwrap();
    let report = run(&source, &log).unwrap();
    assert_eq!(topic(&report, "/imu").taken, 1);
    assert!(report.notes.iter().any(|note| note.contains("damaged at byte")), "{report}");

    // A message shorter than its type is skipped, and the next one is read.
    let mut messages = ros1_messages();
    messages[0].data.truncate(40);
    messages[8].data.push(0);
    messages.push(ros1_messages().swap_remove(8));
    fs::write(&source, bag(&messages, 3, Compression::None, "")).unwrap();
    let report = run(&source, &log).unwrap();
    let imu = topic(&report, "/imu");
    assert_eq!((imu.taken, imu.left), (1, 2), "{report}");
    assert!(imu.reason.as_ref().is_some_and(|reason| reason.contains("ends at byte 40")), "{report}");

    // A chunk with changed bytes is skipped.
    let mut changed = bag(&ros1_messages(), 4, Compression::Bz2, "");
    let chunk = changed.windows(3).position(|bytes| bytes == b"BZh").unwrap();
    changed[chunk + 40] ^= 0xff;
    fs::write(&source, changed).unwrap();
    let report = run(&source, &log).unwrap();
    assert!(report.notes.iter().any(|note| note.contains("chunk at byte")), "{report}");
    assert_eq!(topic(&report, "/joints").taken, 1, "{report}");
    // The chunk described the IMU's connection, and the bag has no index with another description.
    assert!(report.notes.iter().any(|note| note.contains("1 messages belong to no connection")), "{report}");
}

/// Writes the messages of a log into a database, as a ROS 2 recorder does.
fn write_database(log: &Path, database: &Path, change: impl Fn(&[u8]) -> Vec<u8>) {
    let file = fs::read(log).expect("the log can be read");
    let database = Connection::open(database).expect("the database can be created");
    let tables = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
                      serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
                  CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
                      data BLOB NOT NULL);
                  CREATE INDEX timestamp_idx ON messages (timestamp ASC);";
    database.execute_batch(tables).expect("the tables can be made");
    let messages =
        mcap::MessageStream::new(&file).expect("the log is MCAP").map(|message| message.expect("it is whole"));
    // In reverse order: the messages are sorted by time, not by row.
    let mut messages: Vec<_> = messages.collect();
    messages.reverse();
    // One transaction: each would wait for the disk.
    let database = database.unchecked_transaction().expect("a transaction can begin");
    for message in messages {
        let schema = message.channel.schema.as_ref().expect("every topic has a type");
        let topic = (i64::from(message.channel.id), &message.channel.topic, &schema.name);
        let insert = "INSERT OR IGNORE INTO topics VALUES (?1, ?2, ?3, 'cdr', '')";
        database.execute(insert, topic).expect("a topic can be added");
        let row = (i64::from(message.channel.id), message.log_time as i64, change(&message.data));
        let insert = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
        database.execute(insert, row).expect("a message can be added");
    }
    database.commit().expect("the rows can be written");
}

fn write_metadata(bag: &Path, file: &str, mode: &str, format: &str) {
    let text = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  relative_file_paths:\n    - {file}\n  \
         compression_format: \"{format}\"\n  compression_mode: \"{mode}\"\n"
    );
    fs::write(bag.join("metadata.yaml"), text).expect("the metadata can be written");
}

#[test]
fn databases_of_ros_2_give_the_bytes_of_the_log_they_were_made_from() {
    let folder = tempfile::tempdir().unwrap();
    let expected = folder.path().join("expected.mcap");
    write_directly(&expected);
    let log = folder.path().join("flight.mcap");
    let check = |source: &Path| {
        let report = run(source, &log).unwrap();
        assert!(fs::read(&log).unwrap() == fs::read(&expected).unwrap(), "{report}");
    };
    let bag = folder.path().join("bag");
    fs::create_dir(&bag).unwrap();
    let database = bag.join("bag_0.db3");
    write_database(&expected, &database, <[u8]>::to_vec);
    check(&database);
    check(&bag);
    write_metadata(&bag, "bag/bag_0.db3", "", "");
    check(&bag);

    let packed = zstd::encode_all(&fs::read(&database).unwrap()[..], 1).unwrap();
    fs::write(bag.join("bag_0.db3.zstd"), packed).unwrap();
    fs::remove_file(&database).unwrap();
    write_metadata(&bag, "bag_0.db3.zstd", "FILE", "zstd");
    check(&bag);

    fs::remove_file(bag.join("bag_0.db3.zstd")).unwrap();
    write_database(&expected, &database, |data| zstd::encode_all(data, 1).expect("it can be packed"));
    write_metadata(&bag, "bag_0.db3", "MESSAGE", "zstd");
    check(&bag);

    // MCAP in a bag's folder, and a single file.
    fs::remove_file(&database).unwrap();
    fs::copy(&expected, bag.join("bag_0.mcap")).unwrap();
    write_metadata(&bag, "bag_0.mcap", "", "");
    check(&bag);
    check(&expected);
}

#[test]
fn what_cannot_be_converted_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let (source, log) = (folder.path().join("flight.bag"), folder.path().join("flight.mcap"));
    let complain = |words: &[&str]| {
        let complaint = run(&source, &log).unwrap_err().to_string();
        for word in words {
            assert!(complaint.contains(word), "'{word}' is missing in: {complaint}");
        }
        assert!(!log.exists(), "no half log is left behind");
    };
    complain(&["flight.bag"]);
    fs::write(&source, bag(&ros1_messages(), 4, Compression::None, "rosbag/AesCbcEncryptor")).unwrap();
    complain(&["encrypted", "AesCbcEncryptor", "decrypt"]);
    let talk = Message { topic: "/talk", message_type: "std_msgs/String", time_ns: EPOCH_NS, data: text("hi") };
    fs::write(&source, bag(&[talk], 4, Compression::None, "")).unwrap();
    complain(&["/talk", "std_msgs/String"]);
    fs::write(&source, b"#ROSBAG V1.2\n").unwrap();
    complain(&["V1.2", "V2.0"]);
    fs::write(&source, b"GIF89a and so on, which is a picture").unwrap();
    complain(&["EuRoC", "ROS 1 bag"]);
    fs::write(&source, b"").unwrap();
    complain(&["empty"]);
    fs::write(&source, bag(&ros1_messages(), 4, Compression::None, "")).unwrap();
    let complaint = run(&source, &source).unwrap_err().to_string();
    assert!(complaint.contains("own source"), "{complaint}");
}
