use nalgebra::{SVector, Vector3};

use crate::geometry::so3;
use crate::sensors::GimbalRig;
use crate::simulation::equipment::{Equipment, GRAVITY_M_PER_S2, Lens};
use crate::simulation::experiment::Experiment;
use crate::simulation::gimbal::{JointMotion, Stabilizer, joints, true_chain};
use crate::simulation::imu::{FIREFLY_IMU, ImuRecord};
use crate::simulation::random::RandomStream;
use crate::simulation::route::{Flight, Mirrored};
use crate::simulation::scenario::{Scenario, ScenarioOptions, stream};
use crate::simulation::spline::Spline;
use crate::simulation::trajectory::{Trajectory, VehicleLimits};
use crate::simulation::vibration::{Vibration, shake};
use crate::text::Named as _;

pub(super) fn experiment_trajectory(experiment: Experiment, seed: u64, duration_s: f64) -> Trajectory {
    let flight = experiment.flight(4.0 * duration_s, &mut RandomStream::new(seed, stream::ROUTE));
    let mut random = RandomStream::new(seed, stream::MANOEUVRES);
    Trajectory::new(flight.as_ref(), &mut random, &VehicleLimits::default(), duration_s, GRAVITY_M_PER_S2)
}

/// Experiment with a static camera, optionally also with the gimbal camera.
pub(super) fn experiment_scenario(experiment: Experiment, seed: u64, duration_s: f64, gimbal_camera: bool) -> Scenario {
    let look = experiment.look_around(&mut RandomStream::new(seed, stream::LOOK));
    let equipment = Equipment {
        gimbal_camera,
        static_camera: true,
        stereo_baseline_m: None,
        second_gimbal_camera: false,
        lens: Lens::Pinhole,
        resolution_px: [640, 480],
        camera_rate_hz: 20.0,
        static_camera_rate_hz: 20.0,
        camera_time_offset_s: 0.0,
        readout_s: 0.0,
        encoder_sigma_rad: gimbal_camera.then_some(0.01),
        gimbal_imu: false,
    };
    let true_rig = equipment.true_rig("test", &mut RandomStream::new(seed, stream::RIG));
    let options = ScenarioOptions { seed, true_rig, start_error: experiment.start_error(), imu_noise_scale: 1.0 };
    let joints = |trajectory: &Trajectory, gimbal: &GimbalRig| JointMotion::stabilized(trajectory, gimbal, &look);
    Scenario::new(experiment_trajectory(experiment, seed, duration_s), joints, options)
}

#[test]
fn hover_fixed_joint_and_fixed_camera_intervals_start_and_end_as_given() {
    let mut trajectory = experiment_trajectory(Experiment::T1, 3, 40.0);
    let before = trajectory.clone();
    trajectory.hover([10.0, 6.0]);
    let speed = |time_s: f64| trajectory.at(time_s).velocity_m_per_s.norm();
    assert_eq!(trajectory.at(5.0), before.at(5.0));
    assert!((0..60).all(|tenth| speed(12.5 + 0.06 * f64::from(tenth)) < 0.1), "it hovers");
    assert!((200..300).any(|tenth| speed(0.1 * f64::from(tenth)) > 1.5), "and flies on");

    let chain = true_chain(&mut RandomStream::new(3, stream::RIG));
    let mut look = Experiment::T1.look_around(&mut RandomStream::new(3, stream::LOOK));
    look.fixed_joint = Some((1, [5.0, 4.0]));
    let motion = JointMotion::simulate(&before, &chain, &joints(), &look, &Stabilizer::default());
    let spread = |joint: usize, from_s: f64, to_s: f64| {
        let angles = (0..100).map(|step| motion.at(from_s + (to_s - from_s) * f64::from(step) / 100.0)[joint]);
        let angles: Vec<f64> = angles.collect();
        angles.iter().copied().fold(f64::MIN, f64::max) - angles.iter().copied().fold(f64::MAX, f64::min)
    };
    assert!(spread(1, 5.5, 9.0) < 1e-6 && spread(0, 5.5, 9.0) > 0.02 && spread(2, 5.5, 9.0) > 0.02);
    assert!(spread(1, 9.0, 13.0) > 0.02);

    look.fixed_joint = None;
    look.stabilized_s = Some([5.0, 4.0]);
    let motion = JointMotion::simulate(&before, &chain, &joints(), &look, &Stabilizer::default());
    let looks =
        |time_s: f64| before.at(time_s).world_from_imu.rotation * chain.imu_from_camera(&motion.at(time_s)).rotation;
    let rotated_rad = |time_s: f64| so3::log(&(looks(5.001).inverse() * looks(time_s))).norm();
    let within = |time_s: f64| {
        let angles = motion.at(time_s);
        joints()
            .iter()
            .zip(angles)
            .all(|(joint, angle)| angle > joint.limits_rad.0 + 1e-9 && angle < joint.limits_rad.1 - 1e-9)
    };
    let kept: Vec<f64> = (51..90).map(|tenth| 0.1 * f64::from(tenth)).filter(|time_s| within(*time_s)).collect();
    assert!(kept.len() > 20, "{} instants clear of the stops", kept.len());
    assert!(kept.iter().all(|time_s| rotated_rad(*time_s) < 1e-5), "the camera keeps its orientation");
    assert!((95..130).any(|tenth| rotated_rad(0.1 * f64::from(tenth)) > 0.02), "and follows again");
}

#[test]
fn spline_derivatives_meet_central_differences() {
    let mut random = RandomStream::new(4, 0);
    let points = (0..20).map(|_| SVector::<f64, 2>::new(random.normal(), random.normal())).collect();
    let spline = Spline { knot_s: 0.65, points };
    let step = 1e-4;
    for order in 0..4 {
        for time_s in [0.2, 0.6498, 0.6502, 3.17, 7.4] {
            let numeric =
                (spline.derivative(time_s + step, order) - spline.derivative(time_s - step, order)) / (2.0 * step);
            let analytic = spline.derivative(time_s, order + 1);
            assert!((numeric - analytic).norm() < 1e-4 * (1.0 + analytic.norm()), "order {order} at {time_s}");
        }
    }
}

#[test]
fn every_experiment_lasts_its_length_and_keeps_the_limits() {
    let limits = VehicleLimits::default();
    for experiment in Experiment::all() {
        let trajectory = experiment_trajectory(experiment, 3, 200.0);
        let end_s = trajectory.time_of_length(experiment.length_m());
        assert!((trajectory.length_m(end_s) - experiment.length_m()).abs() < 0.3, "{experiment:?}");
        let mut rate_squares = 0.0;
        let mut height_m = (f64::MAX, 0.0_f64);
        let steps = (end_s / 0.05) as usize;
        for step in 0..steps {
            let state = trajectory.at(step as f64 * 0.05);
            assert!(limits.admit(&state), "{experiment:?} at step {step}");
            rate_squares += state.angular_velocity_rad_per_s.norm_squared();
            let height = state.world_from_imu.translation_m.z;
            height_m = (height_m.0.min(height), height_m.1.max(height));
        }
        let rate = (rate_squares / steps as f64).sqrt();
        assert!(rate > 0.5, "{experiment:?} turns at {rate} rad/s only");
        assert!(height_m.0 > 0.6 && height_m.1 < 6.0, "{experiment:?} height {height_m:?}");
        // Two seconds of near-hover come first.
        let hover = trajectory.at(1.0).velocity_m_per_s.norm();
        assert!(hover < 0.1 && trajectory.length_m(2.0) < 0.15, "{experiment:?} hovers at {hover} m/s");
    }
}

#[test]
fn a_mirrored_orbit_turns_to_the_right() {
    let route = || Experiment::T1.flight(400.0, &mut RandomStream::new(3, stream::ROUTE));
    let (left, right) = (route(), Mirrored(route()));
    let turned_rad = |flight: &dyn Flight| flight.point(60.0).heading_rad - flight.point(0.0).heading_rad;
    assert!(turned_rad(left.as_ref()) > 10.0);
    assert!((turned_rad(left.as_ref()) + turned_rad(&right)).abs() < 1e-9);
    let (seen, mirrored) = (left.point(20.0).position_m, right.point(20.0).position_m);
    assert_eq!((mirrored.x, mirrored.y, mirrored.z), (seen.x, -seen.y, seen.z));
    assert_eq!(left.knot_s(), right.knot_s());
    let looks = |mirror: bool| {
        let look = Experiment::T1.look_around(&mut RandomStream::new(3, stream::LOOK));
        if mirror { look.mirrored() } else { look }.yaw_rad[0]
    };
    assert_eq!(looks(true), -looks(false), "towards the house, on the other side");
}

#[test]
fn noise_free_imu_samples_integrate_to_the_trajectory() {
    let trajectory = experiment_trajectory(Experiment::T3, 5, 30.0);
    let step_s = 5e-4;
    let start = trajectory.at(4.0);
    let (mut rotation, mut position) = (start.world_from_imu.rotation, start.world_from_imu.translation_m);
    let mut velocity = start.velocity_m_per_s;
    let gravity = Vector3::new(0.0, 0.0, -GRAVITY_M_PER_S2);
    let steps = (20.0 / step_s) as usize;
    for step in 0..steps {
        let middle = trajectory.at(4.0 + (step as f64 + 0.5) * step_s);
        let half_turned = rotation * so3::exp(&(middle.angular_velocity_rad_per_s * (0.5 * step_s)));
        let acceleration = half_turned * middle.specific_force_m_per_s2 + gravity;
        position += velocity * step_s + acceleration * (0.5 * step_s * step_s);
        velocity += acceleration * step_s;
        rotation *= so3::exp(&(middle.angular_velocity_rad_per_s * step_s));
    }
    let end = trajectory.at(4.0 + steps as f64 * step_s);
    let error_rad = so3::log(&(rotation.inverse() * end.world_from_imu.rotation)).norm();
    assert!(error_rad < 1e-5, "{error_rad} rad");
    assert!((velocity - end.velocity_m_per_s).norm() < 1e-4);
    assert!((position - end.world_from_imu.translation_m).norm() < 1e-3);
}

#[test]
fn the_gimbal_keeps_its_limits_and_stabilizes_the_image() {
    for experiment in [Experiment::T1, Experiment::T4] {
        let scenario = experiment_scenario(experiment, 8, 40.0, true);
        let rig = &scenario.true_rig;
        let limits: Vec<_> = rig.gimbal.as_ref().unwrap().joints.iter().map(|joint| joint.limits_rad).collect();
        let mut swing = [0.0_f64; 2];
        let mut roll_squares = [0.0; 2];
        for step in 0..4000 {
            let time_s = f64::from(step) * 0.01;
            let angles = scenario.joint_angles_rad(time_s).unwrap();
            for (angle, (low, high)) in angles.iter().zip(&limits) {
                assert!(angle >= low && angle <= high, "{angles:?}");
            }
            let before = scenario.joint_angles_rad((time_s - 0.01).max(0.0)).unwrap();
            swing[1] = swing[1].max((angles[2] - before[2]).abs() / 0.01);
            swing[0] = swing[0].max((angles[0] - before[0]).abs() / 0.01);
            for camera in 0..2 {
                let pose = scenario.world_from_camera(&rig.cameras[camera], time_s);
                // The optical x axis points right: its vertical component is zero if level.
                roll_squares[camera] += (pose.rotation * Vector3::x()).z.powi(2);
            }
        }
        assert!(swing.iter().all(|rate| *rate < 3.6), "{swing:?} rad/s");
        if experiment == Experiment::T1 {
            assert!(roll_squares[0] < 0.2 * roll_squares[1], "{roll_squares:?}");
        }
    }
}

#[test]
fn slew_and_spin_reach_their_rates_in_their_intervals_only() {
    let mut trajectory = experiment_trajectory(Experiment::T3, 1, 12.0);
    let plain = trajectory.clone();
    trajectory.spin([5.0, 2.0], 3.0);
    let rate = |trajectory: &Trajectory| (trajectory.at(6.05).heading_rad - trajectory.at(5.95).heading_rad) / 0.1;
    let added = rate(&trajectory) - rate(&plain);
    // The flight's spline rounds the ends of the interval, which extends slightly into its middle.
    assert!((added / 3.0 - 1.0).abs() < 0.05, "{added} rad/s");
    for (time_s, turned_rad) in [(1.0, 0.0), (10.0, 6.0)] {
        let rotated_rad = trajectory.at(time_s).heading_rad - plain.at(time_s).heading_rad;
        assert!((rotated_rad - turned_rad).abs() < 1e-9, "{rotated_rad} rad at {time_s} s");
    }

    let mut random = RandomStream::new(1, 5);
    let chain = true_chain(&mut random);
    let mut look = Experiment::T3.look_around(&mut random);
    look.slew_s = Some([5.0, 4.0]);
    let motion = JointMotion::simulate(&plain, &chain, &joints(), &look, &Stabilizer::default());
    let yaw_rate = |time_s: f64| ((motion.at(time_s + 0.01)[0] - motion.at(time_s - 0.01)[0]) / 0.02).abs();
    let largest = |from_s: f64| (0..300).map(|step| yaw_rate(from_s + 0.01 * f64::from(step))).fold(0.0, f64::max);
    assert!(largest(5.5) > 150_f64.to_radians(), "{} rad/s", largest(5.5));
    assert!(largest(1.0) < 100_f64.to_radians(), "{} rad/s", largest(1.0));
}

#[test]
fn rotors_shake_the_imu_less_on_the_ground() {
    let mut trajectory = experiment_trajectory(Experiment::T1, 3, 20.0);
    trajectory.hover([0.0, 3.0]);
    let still = ImuRecord::measure(&trajectory, &FIREFLY_IMU, 200.0, 0.0, &mut RandomStream::new(3, stream::IMU));
    let vibration = Vibration { rotor_hz: 60.0, rate_rad_per_s: 0.5, force_m_per_s2: 5.0 };
    let shaken = |vibration: &Vibration| {
        let mut record = still.clone();
        shake(&mut record, &trajectory, vibration, &mut RandomStream::new(3, stream::VIBRATION));
        record.samples
    };
    let samples = shaken(&vibration);
    assert_eq!(samples, shaken(&vibration));
    assert_eq!(shaken(&Vibration { rate_rad_per_s: 0.0, force_m_per_s2: 0.0, ..vibration }), still.samples);
    let rms = |from: usize, to: usize| {
        let pairs = samples[from..to].iter().zip(&still.samples[from..to]);
        let squares = pairs.map(|(a, b)| {
            let rate = (a.angular_velocity_rad_per_s - b.angular_velocity_rad_per_s).norm_squared();
            (rate, (a.specific_force_m_per_s2 - b.specific_force_m_per_s2).norm_squared())
        });
        let sum = squares.fold((0.0, 0.0), |sum, (rate, force)| (sum.0 + rate, sum.1 + force));
        (((sum.0 / (to - from) as f64).sqrt()), (sum.1 / (to - from) as f64).sqrt())
    };
    // A sine has an RMS of 0.71 of its amplitude; the filter removes 13 % at 60 Hz, the harmonics add some.
    let (rate, force) = rms(1600, 3600);
    assert!((0.28..0.45).contains(&rate), "{rate} rad/s");
    assert!((2.8..4.5).contains(&force), "{force} m/s²");
    let idle = rms(0, 300).0;
    assert!((0.3..0.5).contains(&(idle / rate)), "idling rotors shake with {idle} rad/s, flying ones with {rate}");
}
