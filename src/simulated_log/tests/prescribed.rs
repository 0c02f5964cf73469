//! Flights along a prescribed motion.

use std::path::Path;
use std::sync::Arc;

use super::super::{SimulationError, SimulationOptions, SimulationSummary, simulate};
use crate::files::RigFile as _;
use crate::flight_log::RigOfLog as _;
use crate::flight_log::{FlightLog, FrameStream};
use crate::geometry::{RigidTransform, seconds_from_ns, so3};
use crate::sensors::{CameraMount, Rig};
use crate::simulation::{Experiment, MotionSplines, PrescribedMotion};

/// A motion of two seconds with a heading, a translation and a swing of the pitch joint.
fn motion() -> PrescribedMotion {
    let mut splines = MotionSplines::at_rest(&[0.2, 0.0, -0.3], 4.0, 16);
    for index in splines.free_points() {
        splines.set_point(2, index, -0.3 + 0.2 * (0.9 * index as f64).sin());
        splines.set_point(3, index, 0.1);
        splines.set_point(6, index, 0.15);
    }
    PrescribedMotion {
        joint_names: ["yaw", "roll", "pitch"].map(str::to_owned).into(),
        samples: (0..=40).map(|step| splines.sample(0.1 * f64::from(step))).collect(),
    }
}

fn fly(
    change: impl FnOnce(&mut SimulationOptions, &mut PrescribedMotion),
) -> Result<SimulationSummary, SimulationError> {
    let folder = tempfile::tempdir().unwrap();
    fly_in(folder.path(), change)
}

fn fly_in(
    folder: &std::path::Path,
    change: impl FnOnce(&mut SimulationOptions, &mut PrescribedMotion),
) -> Result<SimulationSummary, SimulationError> {
    let mut options = SimulationOptions {
        static_camera: false,
        resolution_px: [32, 24],
        camera_rate_hz: 10.0,
        imu_noise_scale: 0.0,
        encoder_sigma_rad: Some(1e-4),
        ..SimulationOptions::new(Experiment::T2)
    };
    let mut motion = motion();
    change(&mut options, &mut motion);
    options.motion = Some(motion);
    simulate(&options, &folder.join("flight.mcap"), &mut |_| ())
}

#[test]
fn a_prescribed_motion_is_flown_from_the_start_of_the_route() {
    let folder = tempfile::tempdir().unwrap();
    let summary = fly_in(folder.path(), |_, _| ()).unwrap();
    assert!((summary.duration_s - 4.0).abs() < 1e-9, "{summary:?}");
    let log = Arc::new(FlightLog::open(&summary.log).unwrap());
    let rig = Rig::for_log(&log, None).unwrap();
    let frames: Vec<_> = FrameStream::new(log, &rig, "cam0", 0.0, None).unwrap().collect();
    let expected = MotionSplines::through(&motion());
    let first = frames[0].ground_truth.unwrap();
    let mut largest_m: f64 = 0.0;
    for frame in &frames {
        let (time_s, pose) = (seconds_from_ns(frame.stamp_ns), frame.ground_truth.unwrap());
        let sample = expected.sample(time_s);
        // T2 starts with the heading +y: forward is +y, left is −x.
        let moved = pose.translation_m - first.translation_m;
        let shift = nalgebra::Vector3::new(moved.y, -moved.x, moved.z);
        assert!((shift - sample.position_m).norm() < 1e-3, "{shift} {} at {time_s}", sample.position_m);
        largest_m = largest_m.max(shift.norm());
        let turned = so3::log(&(first.rotation.inverse() * pose.rotation)).z;
        assert!((turned - sample.heading_rad).abs() < 0.02, "{turned} {}", sample.heading_rad);
        let angles = frame.joint_angles.as_ref().unwrap();
        for (angle, wanted) in angles.angles_rad.iter().zip(&sample.joints_rad) {
            assert!((angle - wanted).abs() < 2e-3, "{angles:?} {sample:?}");
        }
    }
    assert!(largest_m > 0.09, "{largest_m}");
}

#[test]
fn motions_beyond_the_vehicle_and_its_gimbal_are_rejected() {
    let check = |change: fn(&mut SimulationOptions, &mut PrescribedMotion), words: &str| {
        let problem = fly(change).unwrap_err().to_string();
        assert!(problem.contains(words), "{problem}");
    };
    check(
        |_, motion| motion.joint_names[1] = "tilt".to_owned(),
        "it moves yaw, tilt, pitch, the rig has yaw, roll, pitch",
    );
    check(
        |_, motion| {
            motion.joint_names.pop();
            motion.samples.iter_mut().for_each(|sample| sample.joints_rad.truncate(2));
        },
        "it moves yaw, roll, the rig has yaw, roll, pitch",
    );
    check(|_, motion| motion.samples[20].joints_rad[1] = 0.6, "the joint 'roll' is at 34.4°, its range is -25° to 25°");
    check(
        |_, motion| motion.samples[20].position_m.x = 30.0,
        "the vehicle would need an angular rate of 168°/s (at most 138°/s)",
    );
    check(|_, motion| motion.samples[3].time_s = 0.1, "after 0.200 s is 0.100 s");
    check(|options, _| options.disturbances.set("hover=1,1").unwrap(), "the disturbance 'hover'");
}

/// Rig of a test file and a motion of its joints, one swing each.
fn mechanism(name: &str) -> (Rig, PrescribedMotion) {
    let rig =
        Rig::from_file(Path::new(&format!("{}/../../tests/data/{name}.rig.yaml", env!("CARGO_MANIFEST_DIR")))).unwrap();
    let mut splines = MotionSplines::at_rest(&vec![0.1; rig.joint_names().len()], 4.0, 16);
    for index in splines.free_points() {
        for joint in 0..splines.joint_count() {
            let swing = (0.5 * index as f64 + joint as f64).sin();
            splines.set_point(joint, index, 0.1 + 0.2 * swing);
        }
    }
    let samples = (0..=40).map(|step| splines.sample(0.1 * f64::from(step))).collect();
    (rig.clone(), PrescribedMotion { joint_names: rig.joint_names(), samples })
}

#[test]
fn a_motion_is_flown_with_the_mechanism_of_a_rig() {
    for (name, joints) in [("pan_tilt", 2), ("wrist_arm", 5)] {
        let folder = tempfile::tempdir().unwrap();
        let (mut rig, prescribed) = mechanism(name);
        rig.cameras[0].model.resolution_px = [32, 24];
        rig.cameras[0].model.intrinsics_px = [23.0, 23.0, 15.5, 11.5];
        let options = SimulationOptions { motion: Some(prescribed), ..SimulationOptions::new(Experiment::T2) };
        let options = SimulationOptions { imu_noise_scale: 0.0, ..options.with_rig(rig.clone()) };
        let summary = simulate(&options, &folder.path().join("flight.mcap"), &mut |_| ()).unwrap();
        let (given, truth) = (Rig::from_file(&summary.rig).unwrap(), Rig::from_file(&summary.ground_truth).unwrap());
        let [file, given_gimbal, true_gimbal] = [&rig, &given, &truth].map(|rig| rig.gimbal.as_ref().unwrap());
        assert_eq!((true_gimbal.joints.len(), &true_gimbal.joints), (joints, &file.joints));
        assert_eq!(given_gimbal.prior, file.prior);
        for (link, (given, truth)) in given_gimbal.chain.links.iter().zip(&true_gimbal.chain.links).enumerate() {
            assert!((truth.alpha_rad - file.chain.links[link].alpha_rad).abs() < 1e-9, "{name}");
            let error = (given.d_m - truth.d_m).abs();
            assert!(error > 1e-6 && error <= file.prior.translation_bound_m, "{name}: {error}");
        }
        assert_eq!(given.cameras[0].model.resolution_px, [32, 24]);
        let log = Arc::new(FlightLog::open(&summary.log).unwrap());
        let frames: Vec<_> = FrameStream::new(log, &given, "cam0", 0.0, None).unwrap().collect();
        assert_eq!(frames.len(), 80);
        let expected = MotionSplines::through(options.motion.as_ref().unwrap());
        for frame in &frames {
            let wanted = expected.joints_rad(seconds_from_ns(frame.stamp_ns));
            let angles = frame.joint_angles.as_ref().unwrap();
            for (angle, wanted) in angles.angles_rad.iter().zip(&wanted) {
                // Encoders of 0.5°, ten readings per frame.
                assert!((angle - wanted).abs() < 0.03, "{angles:?} {wanted:?}");
            }
        }
    }
}

#[test]
fn a_rig_beyond_the_simulation_is_rejected_with_its_reason() {
    let check = |change: fn(&mut SimulationOptions, &mut Rig), words: &str| {
        let folder = tempfile::tempdir().unwrap();
        let (mut rig, prescribed) = mechanism("pan_tilt");
        let mut options = SimulationOptions { motion: Some(prescribed), ..SimulationOptions::new(Experiment::T2) };
        change(&mut options, &mut rig);
        let output = folder.path().join("flight.mcap");
        let problem = simulate(&options.with_rig(rig), &output, &mut |_| ()).unwrap_err().to_string();
        assert!(problem.contains("the rig 'pan_tilt' cannot be simulated") && problem.contains(words), "{problem}");
        assert!(!output.exists());
    };
    check(|options, _| options.motion = None, "give a motion");
    check(|options, _| options.gimbal_imu_noise_scale = Some(1.0), "omit imu1");
    check(|_, rig| rig.imu.accelerometer_topic = Some("/accelerometer".to_owned()), "two topics");
    check(|_, rig| rig.imu.use_log_time = true, "header stamps");
    check(|_, rig| rig.cameras[0].timeshift_cam_imu_s = 0.01, "--disturb camera-offset");
    check(|_, rig| rig.cameras[0].model.intrinsics_px[0] = 50.0, "cam0 sees rays 8");
    check(|_, rig| rig.gimbal.as_mut().unwrap().timeshift_gimbal_imu_s = 0.01, "--disturb joint-lag");
    check(
        |options, rig| {
            options.static_camera = false;
            rig.cameras[0].mount = CameraMount::Static { imu_from_camera: RigidTransform::identity() };
        },
        "no camera on the gimbal",
    );
}
