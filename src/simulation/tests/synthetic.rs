use nalgebra::Vector3;

use super::super::{SyntheticMotion, SyntheticMount, SyntheticOptions, synthetic_tracks};
use crate::faults::LensChange;
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
fn with_a_readout_each_landmark_is_observed_at_the_time_of_its_row() {
    for (mount, readout_s) in [(SyntheticMount::Gimbal, 0.03), (SyntheticMount::Static, -0.02)] {
        let options = SyntheticOptions { pixel_sigma_px: 0.0, readout_s, ..short(mount, SyntheticMotion::Aggressive) };
        let flight = synthetic_tracks(&options);
        let camera = &flight.true_rig.cameras[0];
        assert_eq!((camera.readout_s, flight.given_rig.cameras[0].readout_s), (readout_s, 0.0));
        // Poses at many times, from the first rows of the frames of a flight with a shifted clock.
        let rows = [90.0, 240.0, 400.0];
        let shifted = rows.map(|row_px| {
            let clock_offsets_s = [camera.row_time_s(row_px), 0.0];
            synthetic_tracks(&SyntheticOptions { clock_offsets_s, readout_s: 0.0, ..options.clone() }).frames
        });
        let (mut worst_px, mut moved_px, mut count) = (0.0_f64, 0.0_f64, 0);
        for (index, frame) in flight.frames.iter().enumerate() {
            for feature in &frame.tracks.features {
                let near = rows.iter().position(|row_px| (feature.uv_px.y - row_px).abs() < 0.5);
                let Some(row) = near else { continue };
                let landmark = &flight.landmarks[&feature.id];
                let error_px = |pose: &RigidTransform| {
                    let seen = camera.model.project(&pose.inverse().transform(landmark)).unwrap();
                    (seen - feature.uv_px).norm()
                };
                worst_px = worst_px.max(error_px(&shifted[row][index].true_world_from_camera));
                moved_px = moved_px.max(error_px(&frame.true_world_from_camera));
                count += 1;
            }
        }
        // Half a row is 0.03 ms, in which a point moves by a few hundredths of a pixel.
        assert!(count > 50 && worst_px < 0.08 && moved_px > 3.0, "{count}, {worst_px} px, {moved_px} px");
    }
}

#[test]
fn the_imu_measures_with_its_scales_and_axes_and_drifts() {
    let plain = short(SyntheticMount::Static, SyntheticMotion::Aggressive);
    let wrong = SyntheticOptions {
        imu_intrinsics_error: [0.01, 0.02],
        accelerometer_drift: Some([0.02, 3.0]),
        intrinsics_error: LensChange { focal: 1.01, centre: [0.0055, -0.0028], ..LensChange::NONE },
        ..plain.clone()
    };
    let (plain, wrong) = (synthetic_tracks(&plain), synthetic_tracks(&wrong));
    let intrinsics = wrong.true_rig.imu.intrinsics;
    let parameters = intrinsics.parameters();
    assert!(parameters.gyroscope.scale.amin() > 1e-5 && parameters.gyroscope.scale.amax() < 0.0201);
    assert!(parameters.gyroscope_rotation_rad.amax() < 0.0401 && parameters.accelerometer.misalignment.norm() > 1e-3);
    assert!(wrong.given_rig.imu.intrinsics.is_identity());
    let mut drift = Vec::new();
    for (before, after) in plain.frames.iter().zip(&wrong.frames) {
        let error = after.true_bias.accelerometer_m_per_s2 - before.true_bias.accelerometer_m_per_s2;
        assert_eq!(after.true_bias.gyroscope_rad_per_s, before.true_bias.gyroscope_rad_per_s);
        let (measured, expected) = (&after.imu[after.imu.len() - 2], &before.imu[before.imu.len() - 2]);
        let corrected = intrinsics.correct(measured);
        assert!((corrected.angular_velocity_rad_per_s - expected.angular_velocity_rad_per_s).norm() < 1e-12);
        let found = corrected.specific_force_m_per_s2 - expected.specific_force_m_per_s2;
        assert!((found - error).norm() < 0.01, "{found} {error}");
        drift.push(error.x);
    }
    let spread = (drift.iter().map(|error| error * error).sum::<f64>() / drift.len() as f64).sqrt();
    assert!((0.005..0.06).contains(&spread), "{spread}");
    let step = drift.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!(step < spread, "{step}");
    let (given, actual) = (&wrong.given_rig.cameras[0].model, &wrong.true_rig.cameras[0].model);
    assert_eq!(given.intrinsics_px[0], actual.intrinsics_px[0] * 1.01);
    for feature in &wrong.frames[3].tracks.features {
        assert!((given.unproject(&feature.uv_px).unwrap() - feature.bearing).norm() < 1e-12);
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
