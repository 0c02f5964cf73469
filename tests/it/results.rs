//! `run --mcap` and `--euroc`: files for viewers and other programs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use mcap::MessageStream;

/// Message types of logs and results with what Foxglove and Rerun draw of them without extensions; other types are
/// values to plot in both.
///
/// Foxglove: <https://docs.foxglove.dev/docs/visualization/message-schemas>, with the ROS types of its panels.
/// Rerun: <https://rerun.io/docs/logging-and-ingestion/import/mcap/message-formats>, and what `rerun mcap convert` of
/// version 0.41 decodes. Both of November 2026.
const VIEWERS: [(&str, Option<&str>, Option<&str>); 17] = [
    ("foxglove.CompressedVideo", Some("Image panel"), Some("VideoStream")),
    ("foxglove.PosesInFrame", Some("3D panel"), Some("InstancePoses3D")),
    ("foxglove_msgs/msg/ImageAnnotations", Some("Image panel, over the image"), None),
    ("geometry_msgs/msg/PoseStamped", Some("3D panel"), Some("InstancePoses3D")),
    ("geometry_msgs/msg/QuaternionStamped", None, None),
    ("nav_msgs/msg/Odometry", Some("3D panel"), None),
    ("nav_msgs/msg/Path", Some("3D panel"), None),
    ("rcl_interfaces/msg/Log", Some("Log panel"), Some("TextLog")),
    ("sensor_msgs/msg/CameraInfo", Some("3D and Image panels"), Some("Pinhole")),
    ("sensor_msgs/msg/CompressedImage", Some("Image panel"), Some("EncodedImage")),
    ("sensor_msgs/msg/Image", Some("Image panel"), Some("Image")),
    ("sensor_msgs/msg/Imu", None, Some("Scalars")),
    ("sensor_msgs/msg/JointState", Some("3D panel, with a URDF"), Some("Scalars")),
    ("sensor_msgs/msg/PointCloud2", Some("3D panel"), Some("Points3D")),
    ("tf2_msgs/msg/TFMessage", Some("3D panel"), Some("Transform3D")),
    ("dcvins_msgs/msg/Calibration", None, None),
    ("dcvins_msgs/msg/Rank", None, None),
];

/// True for a type of the table, or one with the values of a run.
fn is_in_viewer_table(name: &str) -> bool {
    name.starts_with("dcvins_msgs/") || VIEWERS.iter().any(|(known, ..)| *known == name)
}

#[test]
fn the_table_of_viewers_is_that_of_the_documents() {
    let formats = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/formats.md")).unwrap();
    let shown = |archetype: Option<&str>| archetype.unwrap_or("values").to_owned();
    for (name, foxglove, rerun) in VIEWERS.iter().filter(|(name, ..)| !name.starts_with("dcvins_msgs/")) {
        let row = format!("| `{name}` | {} | {} |", shown(*foxglove), shown(*rerun));
        assert!(formats.lines().any(|line| line == row), "docs/formats.md lacks the row {row}");
    }
    let log = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap")).unwrap();
    for message in MessageStream::new(&log).unwrap() {
        let schema = message.unwrap().channel.schema.clone().unwrap();
        assert!(is_in_viewer_table(&schema.name), "{}", schema.name);
    }
}

/// Runs on the beginning of the sample log and returns its `results.mcap`, its trajectory and its table in EuRoC
/// format.
fn fly(out: &Path, threads: &str) -> (Vec<u8>, String, String) {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.arg("run").arg(log).arg("--out").arg(out).env("RAYON_NUM_THREADS", threads);
    command.args(["--mcap", "--euroc", "--no-check", "--no-timing", "--duration", "4.5", "--run", "auto:name=9.lives"]);
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let folder = out.join("9.lives");
    let text = |name: &str| fs::read_to_string(folder.join(name)).expect("the file was written");
    let results = fs::read(folder.join("results.mcap")).expect("the file was written");
    (results, text("trajectory.tum"), text("trajectory.euroc.csv"))
}

fn f64_at(message: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(message[at..at + 8].try_into().expect("eight bytes"))
}

#[test]
fn results_hold_every_estimated_frame_and_have_the_same_bytes_twice() {
    let folder = tempfile::tempdir().unwrap();
    let (results, tum, euroc) = fly(&folder.path().join("first"), "2");
    assert!(results == fly(&folder.path().join("second"), "1").0, "two runs leave different results");

    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut odometry = Vec::new();
    let mut frames = Vec::new();
    for message in MessageStream::new(&results).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        let encodings = (message.channel.message_encoding.as_str(), schema.encoding.as_str());
        let of_foxglove = schema.name.starts_with("foxglove.");
        assert_eq!(encodings, if of_foxglove { ("protobuf", "protobuf") } else { ("cdr", "ros2msg") });
        assert!(is_in_viewer_table(&schema.name), "docs/formats.md does not say how viewers show {}", schema.name);
        *counts.entry(format!("{} {}", message.channel.topic, schema.name)).or_default() += 1;
        if message.channel.topic == "/run_9_lives/odometry" {
            odometry = message.data.to_vec();
        } else if message.channel.topic == "/tf" {
            frames = message.data.to_vec();
        }
    }
    let poses = tum.lines().count();
    assert!(poses > 10, "the run was initialized");
    let count = |name: &str| counts.get(&format!("/{name}")).copied().unwrap_or(0);
    for every_pose in [
        "tf tf2_msgs/msg/TFMessage",
        "run_9_lives/odometry nav_msgs/msg/Odometry",
        "run_9_lives/pose geometry_msgs/msg/PoseStamped",
        "run_9_lives/landmarks sensor_msgs/msg/PointCloud2",
        "run_9_lives/calibration dcvins_msgs/msg/Calibration",
        "run_9_lives/joints sensor_msgs/msg/JointState",
        "run_9_lives/rank dcvins_msgs/msg/Rank",
    ] {
        assert_eq!(count(every_pose), poses, "{every_pose} in {counts:?}");
    }
    let images = count("run_9_lives/annotations foxglove_msgs/msg/ImageAnnotations");
    assert!(images > poses && images == count("run_9_lives/truth geometry_msgs/msg/PoseStamped"), "{counts:?}");
    assert!(count("run_9_lives/path nav_msgs/msg/Path") >= 2, "{counts:?}");
    assert_eq!(count("run_9_lives/poses foxglove.PosesInFrame"), count("run_9_lives/path nav_msgs/msg/Path"));
    for name in ["run_9_lives/world", "run_9_lives/imu", "run_9_lives/joint3", "run_9_lives/camera"] {
        assert!(frames.windows(name.len()).any(|bytes| bytes == name.as_bytes()), "{name} is no frame of /tf");
    }

    // Position of the last pose in CDR: encapsulation 4, stamp 8, two names (each 4 + length + 1, aligned to 4), then
    // doubles aligned to 8 after the encapsulation.
    let last: Vec<f64> = tum.lines().last().unwrap().split(' ').skip(1).map(|word| word.parse().unwrap()).collect();
    let named = |at: usize, name: &str| (at + 4 + name.len() + 1).next_multiple_of(4);
    let begin = named(named(8, "run_9_lives/world"), "run_9_lives/imu").next_multiple_of(8) + 4;
    for (index, expected) in last.iter().enumerate() {
        assert!((f64_at(&odometry, begin + 8 * index) - expected).abs() < 1e-8, "number {index} of the last pose");
    }

    assert_eq!(euroc.lines().count(), poses + 1, "a header and a row for every pose");
    let row: Vec<f64> = euroc.lines().last().unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert_eq!(row.len(), 17);
    assert_eq!((row[1], row[4], row[5]), (last[0], last[6], last[3]), "position, then the quaternion with w first");
}
