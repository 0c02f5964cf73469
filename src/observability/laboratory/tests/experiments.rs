use super::super::{LABORATORY_IMU, LaboratoryForm, LaboratoryMotion, LaboratorySetup, Mechanism};
use crate::estimator::{JointKnowledge, PoseKnowledge};
use crate::gimbal::Parameterization;

#[test]
fn mechanisms_match_their_names() {
    for (name, _) in Mechanism::NAMES {
        let mechanism = Mechanism::named(name).unwrap();
        assert_eq!(mechanism.name, name);
        assert_eq!(mechanism.joints.len(), mechanism.chain.joint_count(), "{name}");
        assert!(
            mechanism.chain.imu_from_camera(&vec![0.3; mechanism.joints.len()]).translation_m.norm() < 1.5,
            "{name}"
        );
    }
    assert!(Mechanism::named("windmill").unwrap_err().to_string().contains("pan-tilt"));
    let ideal = Mechanism::named("yaw-roll-pitch-ideal").unwrap().chain;
    for link in &ideal.links[..2] {
        assert!(link.a_m.abs() < 1e-12 && link.alpha_rad.cos().abs() < 1e-12, "{link:?}");
    }
    // All angles zero: the optical axis points forward and is level.
    let ahead = ideal.imu_from_camera(&[0.0; 3]).rotation * nalgebra::Vector3::z();
    assert!((ahead - nalgebra::Vector3::x()).norm() < 1e-12, "{ahead}");
}

#[test]
fn experiments_are_repeatable() {
    let mut setup = LaboratorySetup::new(Mechanism::named("pan-tilt").unwrap());
    setup.motion = LaboratoryMotion::YawTilted;
    let form = LaboratoryForm::whole(Parameterization::Classical);
    assert_eq!(setup.run(form).unwrap(), setup.run(form).unwrap());
}

/// Without encoders a second IMU determines the camera's path within one window; the joint offsets stay absorbed by the
/// free joint angles, whatever measures the camera's pose.
#[test]
fn an_imu_on_the_camera_leaves_only_the_joint_offsets_without_encoders() {
    let mut setup = LaboratorySetup::new(Mechanism::named("yaw-roll-pitch-offset").unwrap());
    setup.joints = JointKnowledge::Unknown;
    setup.poses = PoseKnowledge::Imu { noise: LABORATORY_IMU, biases_known: false };
    let form = LaboratoryForm::whole(Parameterization::Minimal);
    let without = setup.run(form).unwrap();
    setup.gimbal_imu = true;
    let with = setup.run(form).unwrap();
    assert_eq!(without.rank.rank_structural, 12);
    assert_eq!(with.rank.rank_structural, 15);
    let null = with.null_parameters();
    assert!(null.len() == 3 && null.iter().all(|parameter| parameter.is_joint_offset()), "{null:?}");
}
