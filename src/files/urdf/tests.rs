//! Tests: reading of robot descriptions, paths between links, and calibrated chains written back.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3, Vector6};

use super::{CameraAxes, LinkPath, RobotModel, roll_pitch_yaw};
use crate::flight_log::FlightLog;
use crate::geometry::{RigidTransform, SplitMix64, so3};
use crate::gimbal::ClassicalChain;

/// Three mechanisms in form: file, link of the IMU, link of the camera, names of the joints.
const MECHANISMS: [(&str, &str, &str, &[&str]); 3] = [
    ("pan_tilt.urdf", "imu_link", "camera_optical_frame", &["ptu_pan", "ptu_tilt"]),
    ("three_axis_gimbal.urdf", "imu", "cgo3_camera_optical_link", &["yaw_joint", "roll_joint", "pitch_joint"]),
    (
        "arm_camera.urdf",
        "base_imu",
        "camera_color_optical_frame",
        &["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_joint"],
    ),
];
/// Largest difference between two poses, in metres and radians.
const EXACT: f64 = 1e-12;

fn mechanism(name: &str) -> RobotModel {
    RobotModel::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/urdf").join(name)).unwrap()
}

fn parse(text: &str) -> Result<RobotModel, String> {
    RobotModel::parse(text.to_owned(), Path::new("robot.urdf")).map_err(|error| error.to_string())
}

fn uniform(random: &mut SplitMix64, half_width: f64) -> f64 {
    half_width * (2.0 * random.next_unit() - 1.0)
}

fn vector(random: &mut SplitMix64, half_width: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| uniform(random, half_width))
}

fn angles(random: &mut SplitMix64, count: usize) -> Vec<f64> {
    (0..count).map(|_| uniform(random, 3.0)).collect()
}

/// The chain with small errors of every link and of both ends.
fn perturbed(chain: &ClassicalChain, random: &mut SplitMix64) -> ClassicalChain {
    let mut moved = chain.clone();
    let mut small = || Vector6::from_fn(|_, _| uniform(random, 0.02));
    moved.imu_from_base = moved.imu_from_base.plus(&small());
    moved.effector_from_camera = moved.effector_from_camera.plus(&small());
    for link in &mut moved.links {
        let change = small();
        link.theta_offset_rad += change[0];
        link.d_m += change[1];
        link.a_m += change[2];
        link.alpha_rad += change[3];
    }
    moved
}

fn check_kinematics(path: &LinkPath<'_>, chain: &ClassicalChain, random: &mut SplitMix64) {
    for _ in 0..5 {
        let angles_rad = angles(random, chain.joint_count());
        let (urdf, rig) = (path.imu_from_camera(&angles_rad), chain.imu_from_camera(&angles_rad));
        let difference = urdf.minus(&rig).norm();
        assert!(difference < EXACT, "{difference} at {angles_rad:?}: {}", path.model.text());
    }
}

/// Reads a description, calibrates its chain, writes it back, and compares the poses of both.
fn check_round_trip(model: &RobotModel, imu: &str, camera: &str, random: &mut SplitMix64) -> RobotModel {
    let axes = CameraAxes::of_link(camera);
    let path = model.path(imu, camera, axes).unwrap();
    let chain = path.chain();
    check_kinematics(&path, &chain, random);
    let names: Vec<String> = path.joints().map(|joint| joint.name.clone()).collect();
    let (unchanged, changes) = path.with_calibration(&names, &chain).unwrap();
    assert!(changes.iter().all(|change| change.after.minus(&change.before).norm() < EXACT), "{changes:?}");
    let before = parse(&unchanged).unwrap();
    check_kinematics(&before.path(imu, camera, axes).unwrap(), &chain, random);
    let calibrated = perturbed(&chain, random);
    let (text, _) = path.with_calibration(&names, &calibrated).unwrap();
    let after = parse(&text).unwrap();
    check_kinematics(&after.path(imu, camera, axes).unwrap(), &calibrated, random);
    for (one, other) in model.joints.iter().zip(&after.joints) {
        assert_eq!((&one.name, one.axis, one.limits_rad), (&other.name, other.axis, other.limits_rad));
    }
    after
}

#[test]
fn public_mechanisms_go_in_and_out() {
    let mut random = SplitMix64::new(7);
    for (name, imu, camera, joints) in MECHANISMS {
        let model = mechanism(name);
        let path = model.path(imu, camera, CameraAxes::Optical).unwrap();
        assert!(path.joints().map(|joint| joint.name.as_str()).eq(joints.iter().copied()), "{name}");
        check_round_trip(&model, imu, camera, &mut random);
    }
    let unit = mechanism("pan_tilt.urdf");
    let path = unit.path("imu_link", "camera_optical_frame", CameraAxes::Optical).unwrap();
    assert_eq!(path.rig_joints()[1].limits_rad, (-0.82, 0.52));
    // The camera looks along the chassis' x, which is −y of the IMU; its centre by hand from the dimensions.
    let pose = path.imu_from_camera(&[]);
    assert!((pose.rotation * Vector3::z() + Vector3::y()).norm() < 1e-12);
    assert!((pose.translation_m - Vector3::new(0.0, -0.13, 0.701)).norm() < 1e-12, "{pose:?}");
    // A link without "optical" in its name has x forward.
    let same = unit.path("imu_link", "camera_link", CameraAxes::of_link("camera_link")).unwrap();
    assert!(same.imu_from_camera(&[0.3, 0.2]).minus(&path.imu_from_camera(&[0.3, 0.2])).norm() < 1e-12);
}

#[test]
fn only_origins_of_calibrated_joints_change() {
    let model = mechanism("three_axis_gimbal.urdf");
    let path = model.path("imu", "cgo3_camera_optical_link", CameraAxes::Optical).unwrap();
    let mut chain = path.chain();
    let names: Vec<String> = path.joints().map(|joint| joint.name.clone()).collect();
    let shift = RigidTransform::new(UnitQuaternion::identity(), Vector3::new(0.001, 0.002, 0.003));
    chain.effector_from_camera = chain.effector_from_camera * shift;
    let (text, changes) = path.with_calibration(&names, &chain).unwrap();
    assert_eq!(changes.iter().map(|change| change.joint.as_str()).collect::<Vec<_>>(), ["lens_joint"]);
    let different: Vec<(&str, &str)> = model.text().lines().zip(text.lines()).filter(|(a, b)| a != b).collect();
    assert_eq!((different.len(), model.text().lines().count()), (1, text.lines().count()));
    let (before, after) = different[0];
    assert!(before.contains("<origin xyz=\"0.0412 0 0\"") && after.starts_with("    <origin xyz=\"0.044"), "{after}");
    // Joints without an origin get one; those with one attribute get the other.
    let (text, _) = path.with_calibration(&names, &perturbed(&chain, &mut SplitMix64::new(3))).unwrap();
    assert!(text.contains("<joint name=\"pitch_joint\" type=\"revolute\"><origin xyz=\""), "{text}");
    assert!(text.contains("rpy=\"") && text.contains("<axis xyz=\"0 -1 0\"/>"));
    assert!(path.with_calibration(&names[1..], &chain).unwrap_err().to_string().contains("those between the links"));
}

/// A random tree: the IMU and the camera hang on two branches, with fixed joints between the rotating ones.
fn random_robot(random: &mut SplitMix64) -> String {
    let mut text = String::from("<robot name=\"random\">\n<link name=\"root\"/>\n");
    for (branch, end) in [("imu", "imu_end"), ("camera", "camera_optical")] {
        let mut parent = "root".to_owned();
        let joints = (random.next_u64() % 4) as usize;
        for number in 0..=joints {
            for kind in ["fixed", "continuous"] {
                let last = number == joints;
                let fixed = kind == "fixed";
                if !last && fixed && random.next_unit() < 0.5 || last && !fixed {
                    continue;
                }
                let child = if last { end.to_owned() } else { format!("{branch}_{kind}_{number}") };
                let rotation = so3::exp(&vector(random, 3.0));
                let [roll, pitch, yaw] = roll_pitch_yaw(&rotation);
                let (at, axis) = (vector(random, 0.4), vector(random, 1.0));
                let _infallible = writeln!(
                    text,
                    "<link name=\"{child}\"/><joint name=\"{child}_joint\" type=\"{kind}\"><parent link=\"{parent}\"/>\
                     <child link=\"{child}\"/><origin xyz=\"{} {} {}\" rpy=\"{roll} {pitch} {yaw}\"/>\
                     <axis xyz=\"{} {} {}\"/></joint>",
                    at.x, at.y, at.z, axis.x, axis.y, axis.z
                );
                parent = child;
            }
        }
    }
    text.push_str("</robot>\n");
    text
}

#[test]
fn random_chains_go_in_and_out() {
    let mut random = SplitMix64::new(48);
    let mut counts = [0; 7];
    for _ in 0..300 {
        let text = random_robot(&mut random);
        let model = parse(&text).unwrap();
        let after = check_round_trip(&model, "imu_end", "camera_optical", &mut random);
        counts[after.path("imu_end", "camera_optical", CameraAxes::Optical).unwrap().joints().count()] += 1;
    }
    assert!(counts.iter().all(|count| *count > 5), "chains of every length: {counts:?}");
}

#[test]
fn angles_of_an_origin_give_its_rotation_also_at_a_right_angle() {
    let mut random = SplitMix64::new(5);
    for case in 0..2000 {
        let pitch = match case % 4 {
            0 => std::f64::consts::FRAC_PI_2,
            1 => std::f64::consts::FRAC_PI_2 - 1e-8 * random.next_unit(),
            2 => -std::f64::consts::FRAC_PI_2 + 1e-5 * random.next_unit(),
            _ => uniform(&mut random, 1.6),
        };
        let rotation = UnitQuaternion::from_euler_angles(uniform(&mut random, 3.1), pitch, uniform(&mut random, 3.1));
        let [roll, pitch, yaw] = roll_pitch_yaw(&rotation);
        let difference = UnitQuaternion::from_euler_angles(roll, pitch, yaw).rotation_to(&rotation);
        assert!(so3::log(&difference).norm() < 1e-14, "{rotation:?}");
    }
}

#[test]
fn refusals_say_what_is_wrong_and_where() {
    let arm = mechanism("arm_camera.urdf");
    let problem = |imu: &str, camera: &str| arm.path(imu, camera, CameraAxes::Optical).unwrap_err().to_string();
    let prismatic = problem("base_imu", "finger");
    assert!(prismatic.starts_with("joint 'finger_joint' between 'base_imu' and 'finger' is prismatic"), "{prismatic}");
    assert!(problem("imu", "finger").starts_with("no link 'imu'; it has world, base_link"));
    // An ending without a fixed joint cannot take the pose of the camera.
    let path = arm.path("base_imu", "wrist", CameraAxes::Body).unwrap();
    let names: Vec<String> = path.joints().map(|joint| joint.name.clone()).collect();
    let moved = perturbed(&path.chain(), &mut SplitMix64::new(1));
    let refused = path.with_calibration(&names, &moved).unwrap_err().to_string();
    assert!(refused.contains("link 'wrist' on joint 'wrist_joint'") && refused.contains("add a link"), "{refused}");

    let xacro =
        "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" name=\"a\"><xacro:include filename=\"b\"/></robot>";
    assert!(parse(xacro).unwrap_err().contains("<xacro:include>"));
    let used = "<robot name=\"a\"><link name=\"${prefix}b\"/></robot>";
    assert!(parse(used).unwrap_err().contains("a macro file of xacro (name=\"${prefix}b\")"));
    let joint = |text: &str| {
        format!("<robot name=\"a\"><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" {text}</joint></robot>")
    };
    let ends = "<parent link=\"a\"/><child link=\"b\"/>";
    for (text, expected) in [
        (joint(&format!("type=\"hinge\">{ends}")), "type 'hinge', expected revolute, continuous, fixed"),
        (joint("type=\"fixed\"><parent link=\"a\"/>"), "<child link=…> is missing"),
        (joint("type=\"fixed\"><parent link=\"a\"/><child link=\"c\"/>"), "link 'c' is not described"),
        (joint(&format!("type=\"fixed\">{ends}<origin xyz=\"1 2\"/>")), "xyz=\"1 2\", expected three numbers"),
        (joint(&format!("type=\"revolute\">{ends}<axis xyz=\"0 0 0\"/>")), "its axis is zero"),
        (joint(&format!("type=\"revolute\">{ends}<limit lower=\"2\" upper=\"1\"/>")), "lower limit 2 is above"),
        ("<sdf/>".to_owned(), "the root element is <sdf>, expected <robot>"),
        ("hello".to_owned(), "no URDF"),
    ] {
        let problem = parse(&text).unwrap_err();
        assert!(problem.contains(expected) && problem.ends_with("robot.urdf"), "{problem}");
    }
    let ring = "<robot name=\"a\"><link name=\"a\"/><link name=\"b\"/>\
                <joint name=\"i\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\
                <joint name=\"j\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint></robot>";
    let ring = parse(ring).unwrap();
    assert!(ring.path("a", "b", CameraAxes::Body).unwrap_err().to_string().contains("closed loop"));
}

/// Flips, cuts and doubles bytes of a description: an error or a model, never a panic.
#[test]
fn damaged_descriptions_do_not_panic() {
    let text = mechanism("three_axis_gimbal.urdf").text().to_owned();
    let mut random = SplitMix64::new(11);
    let mut read = 0;
    for _ in 0..3000 {
        let mut bytes = text.clone().into_bytes();
        for _ in 0..=random.next_u64() % 3 {
            let at = random.next_u64() as usize % bytes.len();
            match random.next_u64() % 3 {
                0 => bytes[at] = b" \"<>/a0-"[random.next_u64() as usize % 8],
                1 => drop(bytes.drain(at..bytes.len().min(at + 9))),
                _ => bytes.truncate(at.max(1)),
            }
        }
        let Ok(damaged) = String::from_utf8(bytes) else { continue };
        let Ok(model) = RobotModel::parse(damaged, Path::new("damaged.urdf")) else { continue };
        if let Ok(path) = model.path("imu", "cgo3_camera_optical_link", CameraAxes::Optical) {
            let names: Vec<String> = path.joints().map(|joint| joint.name.clone()).collect();
            read += usize::from(path.with_calibration(&names, &perturbed(&path.chain(), &mut random)).is_ok());
        }
    }
    assert!(read > 100, "{read}");
}

#[test]
fn a_description_is_read_from_its_topic() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("a.mcap");
    let model = mechanism("pan_tilt.urdf");
    let mut writer = mcap::Writer::new(std::fs::File::create(&log).unwrap()).unwrap();
    let schema = writer.add_schema("std_msgs/msg/String", "ros2msg", b"string data").unwrap();
    let other = writer.add_schema("sensor_msgs/msg/Imu", "ros2msg", b"").unwrap();
    let description = writer.add_channel(schema, "/robot_description", "cdr", &Default::default()).unwrap();
    let imu = writer.add_channel(other, "/imu", "cdr", &Default::default()).unwrap();
    let mut message = vec![0, 1, 0, 0];
    message.extend_from_slice(&(model.text().len() as u32 + 1).to_le_bytes());
    message.extend_from_slice(model.text().as_bytes());
    message.push(0);
    let header = |channel_id| mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 5, publish_time: 5 };
    writer.write_to_known_channel(&header(description), &message).unwrap();
    writer.write_to_known_channel(&header(imu), &[0, 1, 0, 0]).unwrap();
    writer.finish().unwrap();
    let log = FlightLog::open(&log).unwrap();
    let found = RobotModel::of_topic(&log, "/robot_description").unwrap();
    assert_eq!((found.text(), found.joints.len()), (model.text(), 6));
    let problem = RobotModel::of_topic(&log, "/imu").unwrap_err().to_string();
    assert!(problem.contains("topics of std_msgs/msg/String: /robot_description"), "{problem}");
}
