use nalgebra::Vector3;

use super::super::{SyntheticMotion, SyntheticMount, SyntheticOptions, synthetic_tracks};
use crate::geometry::{RigidTransform, so3};

fn short(mount: SyntheticMount, motion: SyntheticMotion) -> SyntheticOptions {
    SyntheticOptions { mount, motion, duration_s: 8.0, seed: 11, ..SyntheticOptions::default() }
}

#[test]
fn tracks_are_projections_of_their_landmarks_through_the_true_rig() {
    for mount in [SyntheticMount::Gimbal, SyntheticMount::Static] {
        let options = SyntheticOptions { pixel_sigma_px: 0.0, ..short(mount, SyntheticMotion::Aggressive) };
        let flight = synthetic_tracks(&options);
        let camera = &flight.true_rig.cameras[0];
        let chain = flight.true_rig.chain_of_camera(&camera.key).unwrap();
        assert_eq!(flight.frames.len(), 160);
        for frame in &flight.frames {
            let imu_from_camera = chain.imu_from_camera(&frame.true_joint_angles_rad);
            let world_from_camera: RigidTransform = frame.true_world_from_imu * imu_from_camera;
            assert!(frame.tracks.features.len() > 120, "{} features", frame.tracks.features.len());
            assert!(frame.tracks.features.windows(2).all(|pair| pair[0].id < pair[1].id));
            for feature in &frame.tracks.features {
                let point = world_from_camera.inverse().transform(&flight.landmarks[&feature.id]);
                assert!((camera.model.project(&point).unwrap() - feature.uv_px).norm() < 1e-6);
                assert!((point.normalize() - feature.bearing).norm() < 1e-9);
            }
        }
        let mean_age: f64 =
            flight.frames.iter().flat_map(|frame| &frame.tracks.features).map(|f| f64::from(f.age)).sum();
        let count: usize = flight.frames.iter().map(|frame| frame.tracks.features.len()).sum();
        assert!(mean_age / count as f64 > 8.0, "tracks live {} frames only", mean_age / count as f64);
    }
}

#[test]
fn imu_samples_of_consecutive_frames_integrate_to_the_ground_truth() {
    let options =
        SyntheticOptions { imu_noise_scale: 0.0, ..short(SyntheticMount::Gimbal, SyntheticMotion::Aggressive) };
    let flight = synthetic_tracks(&options);
    for pair in flight.frames.windows(2) {
        let (from, to) = (&pair[0], &pair[1]);
        assert_eq!(from.imu.last(), to.imu.first());
        assert_eq!(to.imu.first().unwrap().stamp_ns, from.stamp_ns);
        assert_eq!(to.imu.last().unwrap().stamp_ns, to.stamp_ns);
        let mut rotation = from.true_world_from_imu.rotation;
        let mut velocity = from.true_velocity_m_per_s;
        for step in to.imu.windows(2) {
            let dt = (step[1].stamp_ns - step[0].stamp_ns) as f64 * 1e-9;
            let rate = (step[0].angular_velocity_rad_per_s + step[1].angular_velocity_rad_per_s) * 0.5;
            let force = (step[0].specific_force_m_per_s2 + step[1].specific_force_m_per_s2) * 0.5;
            velocity += (rotation * so3::exp(&(rate * (0.5 * dt))) * force - Vector3::new(0.0, 0.0, 9.81)) * dt;
            rotation *= so3::exp(&(rate * dt));
        }
        assert!(so3::log(&(rotation.inverse() * to.true_world_from_imu.rotation)).norm() < 2e-5);
        assert!((velocity - to.true_velocity_m_per_s).norm() < 1e-3);
    }
}

#[test]
fn noise_and_motion_are_as_asked() {
    let flight = synthetic_tracks(&short(SyntheticMount::Gimbal, SyntheticMotion::StationaryThenAggressive));
    let still = flight.frames.iter().filter(|frame| frame.stamp_ns < 2_000_000_000);
    assert!(still.clone().count() > 30);
    assert!(still.clone().all(|frame| frame.true_velocity_m_per_s.norm() < 1e-9));
    assert!(flight.frames.last().unwrap().true_velocity_m_per_s.norm() > 0.3);
    let sigma = 0.5_f64.to_radians();
    let errors: Vec<f64> = flight
        .frames
        .iter()
        .flat_map(|frame| {
            let readings = frame.joint_angles_rad.clone().unwrap();
            let ground_truth = frame.true_joint_angles_rad.clone();
            readings.into_iter().zip(ground_truth).map(|(reading, ground_truth)| reading - ground_truth)
        })
        .collect();
    let spread = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
    assert!((spread / sigma - 1.0).abs() < 0.15, "{spread}");
    let hover = synthetic_tracks(&short(SyntheticMount::Static, SyntheticMotion::Hover));
    assert!(hover.true_rig.gimbal.is_none());
    assert!(hover.frames.iter().all(|frame| frame.true_velocity_m_per_s.norm() < 0.2));
}

#[test]
fn the_given_rig_errs_within_its_bounds() {
    let flight = synthetic_tracks(&short(SyntheticMount::Gimbal, SyntheticMotion::Hover));
    let (given, ground_truth) = (flight.given_rig.gimbal.unwrap(), flight.true_rig.gimbal.unwrap());
    let (length, angle) = (given.prior.translation_bound_m, given.prior.rotation_bound_rad);
    assert!(length > 0.0 && angle > 0.0);
    let mut differences = 0;
    for (given, ground_truth) in given.chain.links.iter().zip(&ground_truth.chain.links) {
        for (given, ground_truth, bound) in [
            (given.theta_offset_rad, ground_truth.theta_offset_rad, angle),
            (given.alpha_rad, ground_truth.alpha_rad, angle),
            (given.d_m, ground_truth.d_m, length),
            (given.a_m, ground_truth.a_m, length),
        ] {
            assert!((given - ground_truth).abs() <= bound);
            differences += usize::from(given != ground_truth);
        }
    }
    assert_eq!(differences, 12);
    let base = given.chain.imu_from_base.minus(&ground_truth.chain.imu_from_base);
    assert!(base.fixed_rows::<3>(0).amax() <= angle && base.fixed_rows::<3>(3).amax() <= length);
    assert!(base.norm() > 0.0);
}

#[test]
fn the_same_options_give_the_same_bits() {
    let options = short(SyntheticMount::Gimbal, SyntheticMotion::HoverThenAggressive);
    let (first, second) = (synthetic_tracks(&options), synthetic_tracks(&options));
    assert_eq!(first.frames, second.frames);
    let other = synthetic_tracks(&SyntheticOptions { seed: 12, ..options });
    assert_ne!(first.frames, other.frames);
}
