//! Tests: a rig as a robot description and back.

use std::path::Path;

use nalgebra::Vector6;

use super::{calibrated_description, robot_description};
use crate::files::RigFile as _;
use crate::files::urdf::{CameraAxes, RobotModel};
use crate::geometry::SplitMix64;
use crate::sensors::Rig;

fn garden() -> Rig {
    Rig::from_yaml(include_str!("../../sample_logs/garden.rig.yaml"), Path::new("garden.rig.yaml")).unwrap()
}

fn parsed(bytes: &[u8]) -> RobotModel {
    RobotModel::parse(String::from_utf8(bytes.to_vec()).unwrap(), Path::new("garden.urdf")).unwrap()
}

#[test]
fn the_description_of_a_rig_has_its_kinematics_limits_and_names() {
    let rig = garden();
    let written = robot_description(&rig, &[]).unwrap();
    assert_eq!(written.files[0].0, "garden.urdf");
    let model = parsed(&written.files[0].1);
    let mut random = SplitMix64::new(3);
    for camera in &rig.cameras {
        let link = format!("{}_optical", camera.key);
        let path = model.path("imu_link", &link, CameraAxes::Optical).unwrap();
        let chain = rig.chain_of_camera(&camera.key).unwrap();
        for _ in 0..20 {
            let angles_rad: Vec<f64> = (0..chain.joint_count()).map(|_| 3.0 * random.next_unit() - 1.5).collect();
            let difference = path.imu_from_camera(&angles_rad).minus(&chain.imu_from_camera(&angles_rad)).norm();
            assert!(difference < 1e-12, "{difference}");
        }
        if chain.joint_count() > 0 {
            assert_eq!(path.rig_joints(), rig.gimbal.as_ref().unwrap().joints);
        }
    }
    let one = robot_description(&rig, &["cam1".to_owned()]).unwrap();
    assert_eq!(parsed(&one.files[0].1).joints.len(), 1);
    robot_description(&rig, &["cam7".to_owned()]).unwrap_err();
}

#[test]
fn a_calibrated_rig_is_written_into_its_description() {
    let mut rig = garden();
    let before = parsed(&robot_description(&rig, &[]).unwrap().files[0].1);
    let path = before.path("imu_link", "cam0_optical", CameraAxes::Optical).unwrap();
    let camera = rig.camera("cam0").unwrap().clone();
    let same = calibrated_description(&rig, &camera, &path, "garden.urdf").unwrap();
    let changed = |text: &[u8]| {
        let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
        let (old, new) = (lines(before.text()), lines(std::str::from_utf8(text).unwrap()));
        assert_eq!(old.len(), new.len());
        old.iter().zip(&new).filter(|(old, new)| old != new).count()
    };
    assert_eq!(changed(&same.files[0].1), 0, "{:?}", same.notes);
    assert!(same.notes[0].contains("no origin is changed"));
    let gimbal = rig.gimbal.as_mut().unwrap();
    gimbal.chain.imu_from_base = gimbal.chain.imu_from_base.plus(&Vector6::from_element(0.01));
    gimbal.chain.links[1].a_m += 0.004;
    let patch = calibrated_description(&rig, &camera, &path, "garden.urdf").unwrap();
    assert!(changed(&patch.files[0].1) >= 2 && patch.notes[0].starts_with("origin of joint 'yaw' changed by"));
    let after = parsed(&patch.files[0].1);
    let path = after.path("imu_link", "cam0_optical", CameraAxes::Optical).unwrap();
    let angles_rad = [0.4, -0.2, 0.7];
    let chain = &rig.gimbal.as_ref().unwrap().chain;
    assert!(path.imu_from_camera(&angles_rad).minus(&chain.imu_from_camera(&angles_rad)).norm() < 1e-12);
}
