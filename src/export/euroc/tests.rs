use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{EurocReport, check_euroc_folder, write_euroc};
use crate::flight_log::RigOfLog as _;
use crate::flight_log::convert::convert;
use crate::flight_log::{FlightLog, ground_truth_poses, imu_samples, joint_samples, recorded_images};
use crate::gimbal::ClassicalChain;
use crate::sensors::{CameraMount, ImuSample, JointSample, PoseSample, Rig};
use crate::simulated_log::{SimulationOptions, simulate};
use crate::simulation::Experiment;

/// Short flight with both cameras, and its rig.
fn flight(folder: &Path) -> (Arc<FlightLog>, Rig) {
    let options =
        SimulationOptions { duration_s: Some(0.5), resolution_px: [96, 72], ..SimulationOptions::new(Experiment::T1) };
    let summary = simulate(&options, &folder.join("flight.mcap"), &mut |_| {}).unwrap();
    opened(&summary.log)
}

fn opened(log: &Path) -> (Arc<FlightLog>, Rig) {
    let log = Arc::new(FlightLog::open(log).unwrap());
    let rig = Rig::for_log(&log, None).unwrap();
    (log, rig)
}

fn written(log: &Arc<FlightLog>, rig: &Rig, cameras: &[&str], folder: &Path) -> EurocReport {
    let cameras: Vec<String> = cameras.iter().map(|key| (*key).to_owned()).collect();
    write_euroc(log, rig, &cameras, folder, &mut |_| ControlFlow::Continue(())).unwrap().unwrap()
}

/// Absolute stamps and pixels of a camera's images.
fn images(log: &Arc<FlightLog>, rig: &Rig, key: &str) -> Vec<(i64, Vec<u8>)> {
    let images = recorded_images(log, rig, rig.camera(key).unwrap()).unwrap();
    images.map(|recorded| (log.epoch_ns() + recorded.stamp_ns, recorded.image.pixels.clone())).collect()
}

/// Samples of the other sensors with absolute stamps.
fn samples(log: &Arc<FlightLog>, rig: &Rig) -> (Vec<ImuSample>, Vec<PoseSample>, Vec<JointSample>) {
    let at = |stamp_ns: i64| log.epoch_ns() + stamp_ns;
    (
        imu_samples(log, rig).unwrap().map(|it| ImuSample { stamp_ns: at(it.stamp_ns), ..it }).collect(),
        ground_truth_poses(log, rig).unwrap().map(|it| PoseSample { stamp_ns: at(it.stamp_ns), ..it }).collect(),
        joint_samples(log, rig).unwrap().unwrap().map(|it| JointSample { stamp_ns: at(it.stamp_ns), ..it }).collect(),
    )
}

fn names(folder: &Path) -> Vec<PathBuf> {
    let mut names: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| PathBuf::from(entry.unwrap().file_name())).collect();
    names.sort();
    names
}

#[test]
fn a_log_that_is_written_and_converted_back_has_equal_measurements() {
    let folder = tempfile::tempdir().unwrap();
    let (log, mut rig) = flight(folder.path());
    rig.cameras[1].timeshift_cam_imu_s = 0.004;
    rig.cameras[1].readout_s = 0.02;
    let report = written(&log, &rig, &[], &folder.path().join("folder"));
    // The rigid camera is the first one.
    let cameras: Vec<_> = report.cameras.iter().map(|camera| (&*camera.folder, &*camera.key, camera.images)).collect();
    assert_eq!(cameras, [("cam0", "cam1", 10), ("cam1", "cam0", 10)]);
    assert_eq!((report.cameras[0].moving_extrinsics, report.cameras[1].moving_extrinsics), (None, Some(10)));
    convert(&folder.path().join("folder"), &folder.path().join("back.mcap"), &mut |_| {}).unwrap();
    let (back, back_rig) = opened(&folder.path().join("back.mcap"));
    for (before, after) in [("cam1", "cam0"), ("cam0", "cam1")] {
        let expected = images(&log, &rig, before);
        assert_eq!(expected.len(), 10);
        assert!(images(&back, &back_rig, after) == expected, "{before}");
    }
    let ((imu, poses, joints), (imu_back, poses_back, joints_back)) = (samples(&log, &rig), samples(&back, &back_rig));
    assert_eq!((imu.len(), poses.len(), joints.len()), (101, 101, 100));
    assert_eq!((imu, joints), (imu_back, joints_back));
    assert_eq!(poses.len(), poses_back.len());
    for (pose, read) in poses.iter().zip(&poses_back) {
        assert_eq!(pose.stamp_ns, read.stamp_ns);
        assert_eq!(pose.world_from_imu.translation_m, read.world_from_imu.translation_m);
        // A quaternion is normalized when it is read.
        let difference = pose.world_from_imu.rotation.coords - read.world_from_imu.rotation.coords;
        assert!(difference.amax() < 1e-15, "{difference}");
    }
    // Rotation matrices of a rig read back to within rounding.
    let (chain, chain_back) = (&rig.gimbal.as_ref().unwrap().chain, &back_rig.gimbal.as_ref().unwrap().chain);
    assert_eq!(chain.links, chain_back.links);
    let camera_of = |chain: &ClassicalChain| chain.imu_from_camera(&[0.3, -0.1, -0.7]).to_matrix();
    assert!((camera_of(chain) - camera_of(chain_back)).amax() < 1e-12);
    assert_eq!(back_rig.cameras[0].model, rig.cameras[1].model);
    assert_eq!((back_rig.cameras[0].timeshift_cam_imu_s, back_rig.cameras[0].readout_s), (0.004, 0.02));
    assert_eq!(back_rig.cameras[1].mount, CameraMount::Gimbal);
}

#[test]
fn other_programs_find_the_extrinsics_in_the_descriptions() {
    let folder = tempfile::tempdir().unwrap();
    let (log, rig) = flight(folder.path());
    written(&log, &rig, &["cam0", "cam1"], folder.path());
    // Without the rig, the rigid camera is described completely, and the other one at its first image.
    fs::remove_file(folder.path().join("mav0/rig.yaml")).unwrap();
    let source = folder.path().join("mav0");
    let report = convert(&source, &folder.path().join("back.mcap"), &mut |_| {}).unwrap();
    let (_, back) = opened(&folder.path().join("back.mcap"));
    assert!(report.topics.iter().any(|topic| topic.topic == "/gimbal0" && topic.left == 100), "{report}");
    let poses: Vec<_> = back
        .cameras
        .iter()
        .map(|camera| match &camera.mount {
            CameraMount::Static { imu_from_camera } => *imu_from_camera,
            CameraMount::Gimbal => panic!("{} is described as rigid", camera.key),
        })
        .collect();
    let CameraMount::Static { imu_from_camera } = &rig.cameras[1].mount else { panic!("cam1 is rigid") };
    assert!((poses[1].to_matrix() - imu_from_camera.to_matrix()).amax() < 1e-12);
    let first = recorded_images(&log, &rig, &rig.cameras[0]).unwrap().next().unwrap();
    let chain = &rig.gimbal.as_ref().unwrap().chain;
    let at_first = chain.imu_from_camera(&first.joint_angles.unwrap().angles_rad);
    assert!((poses[0].to_matrix() - at_first.to_matrix()).amax() < 1e-12);
    let table = fs::read_to_string(source.join("cam0/extrinsics.csv")).unwrap();
    let stamp_ns = log.epoch_ns() + first.stamp_ns;
    let position = at_first.translation_m;
    let row = table.lines().nth(1).unwrap();
    assert!(row.starts_with(&format!("{stamp_ns},{},{},{},", position.x, position.y, position.z)), "{row}");
    assert_eq!((back.imu.noise, back.imu.rate_hz), (rig.imu.noise, rig.imu.rate_hz));
}

#[test]
fn only_a_complete_folder_replaces_an_earlier_one() {
    let folder = tempfile::tempdir().unwrap();
    let (log, rig) = flight(folder.path());
    let target = folder.path().join("euroc");
    let stopped = write_euroc(&log, &rig, &[], &target, &mut |ratio| {
        if ratio > 0.5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(stopped.unwrap().is_none());
    assert!(names(&target).is_empty(), "{:?}", names(&target));
    written(&log, &rig, &[], &target);
    fs::write(target.join("notes.txt"), "of a person").unwrap();
    fs::write(target.join("mav0/leftover"), "").unwrap();
    check_euroc_folder(&target, log.path(), false).unwrap();
    written(&log, &rig, &["cam1"], &target);
    assert_eq!(names(&target), [PathBuf::from("mav0"), PathBuf::from("notes.txt")]);
    let expected = ["body.yaml", "cam0", "gimbal0", "imu0", "rig.yaml", "state_groundtruth_estimate0"];
    assert_eq!(names(&target.join("mav0")), expected.map(PathBuf::from));
    let refused = check_euroc_folder(&target, Path::new("other.mcap"), false).unwrap_err().to_string();
    assert!(refused.contains("is not other.mcap") && refused.contains("--force"), "{refused}");
    check_euroc_folder(&target, Path::new("other.mcap"), true).unwrap();
    let unknown = write_euroc(&log, &rig, &["cam7".to_owned()], &target, &mut |_| ControlFlow::Continue(()));
    assert!(unknown.unwrap_err().to_string().contains("'cam7'"));
}

#[test]
fn a_damaged_folder_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let (log, rig) = flight(folder.path());
    let report = written(&log, &rig, &["cam1"], folder.path());
    let (table, back) = (report.folder.join("gimbal0/data.csv"), folder.path().join("back.mcap"));
    fs::write(&table, "#timestamp [ns],yaw [rad],roll [rad],pitch [rad]\n1750000000000000000,0.1,0.2\n").unwrap();
    let problem = convert(&report.folder, &back, &mut |_| {}).unwrap_err().to_string();
    assert!(problem.starts_with("line 2: 2 numbers after the stamp, expected 3: "), "{problem}");
    fs::remove_file(&table).unwrap();
    // Without a usable rig the descriptions of the sensors are taken, with a note.
    fs::write(report.folder.join("rig.yaml"), "rig_version: 1\n").unwrap();
    let notes = convert(&report.folder, &back, &mut |_| {}).unwrap().notes;
    assert!(notes.iter().any(|note| note.starts_with("rig.yaml cannot be used")), "{notes:?}");
    let (_, rig_back) = opened(&back);
    assert_eq!((rig_back.cameras.len(), rig_back.gimbal.is_none()), (1, true));
}
