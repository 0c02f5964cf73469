//! The window of a step as a supposed one: the same states, landmarks and sightings, for asking what would have been.

use nalgebra::Vector3;

use super::Situation;
use crate::estimator::{
    ImuBias, LandmarkModel, NavigationState, PoseKnowledge, StepReport, SupposedFrame, SupposedLandmark, SupposedWindow,
};
use crate::flight_log::ImuSample;
use crate::geometry::{ns_from_seconds, seconds_from_ns, so3};

/// Rate of the inertial samples between two frames: their covariance hardly depends on it.
const IMU_RATE_HZ: f64 = 50.0;

/// The window of a step; `situation` is that of the same step.
///
/// A report keeps no inertial samples; between two frames the vehicle is taken to turn and accelerate evenly.
pub fn window_of_step(report: &StepReport, situation: &Situation) -> SupposedWindow {
    let frames: Vec<SupposedFrame> = report
        .window
        .iter()
        .map(|frame| SupposedFrame {
            time_s: seconds_from_ns(frame.stamp_ns),
            navigation: NavigationState {
                world_from_imu: frame.world_from_imu,
                velocity_m_per_s: frame.velocity_m_per_s,
                bias: ImuBias {
                    gyroscope_rad_per_s: frame.gyroscope_bias_rad_per_s,
                    accelerometer_m_per_s2: frame.accelerometer_bias_m_per_s2,
                },
            },
            joints_rad: frame.joint_angles_rad.clone(),
            imu: Vec::new(),
        })
        .collect();
    let with_samples = |slot: usize| {
        let imu = slot
            .checked_sub(1)
            .map_or_else(Vec::new, |before| even_motion(&frames[before], &frames[slot], &situation.gravity_in_world));
        SupposedFrame { imu, ..frames[slot].clone() }
    };
    let slot_of = |frame_index: usize| report.window.iter().position(|frame| frame.frame_index == frame_index);
    let of_main = report.features.iter().filter(|feature| !feature.rejected && feature.id.camera() == 0);
    let landmarks = of_main.filter_map(|feature| {
        let anchor = slot_of(feature.anchor_frame_index)?;
        let first = feature.observations.iter().next()?;
        let ray = situation.camera.unproject(&first.measured_px)?;
        let bearing = ray.normalize();
        Some(SupposedLandmark {
            anchor,
            bearing,
            inverse_distance_per_m: feature.inverse_depth_per_m * bearing.z,
            observers: feature.observations.iter().skip(1).filter_map(|seen| slot_of(seen.frame_index)).collect(),
        })
    });
    SupposedWindow {
        camera: situation.camera.clone(),
        landmarks: landmarks.filter(|landmark| landmark.inverse_distance_per_m > 0.0).collect(),
        frames: (0..frames.len()).map(with_samples).collect(),
        poses: PoseKnowledge::Inertial { noise: situation.imu_noise, biases_known: false },
        joints: situation.encoders,
        pixel_sigma_px: situation.pixel_sigma_px,
        landmark_model: LandmarkModel::BearingAndInverseDistance,
        gravity_in_world: situation.gravity_in_world,
        chain_prior: (0.03, 10_f64.to_radians()),
    }
}

/// What an inertial sensor feels when it turns and accelerates evenly from one frame to the next.
fn even_motion(from: &SupposedFrame, to: &SupposedFrame, gravity_in_world: &Vector3<f64>) -> Vec<ImuSample> {
    let length_s = (to.time_s - from.time_s).max(1e-6);
    let start = &from.navigation;
    let turn = so3::log(&(start.world_from_imu.rotation.inverse() * to.navigation.world_from_imu.rotation));
    let acceleration = (to.navigation.velocity_m_per_s - start.velocity_m_per_s) / length_s;
    let count = (length_s * IMU_RATE_HZ).round().max(1.0) as usize;
    (0..=count)
        .map(|index| {
            let share = index as f64 / count as f64;
            let rotation = start.world_from_imu.rotation * so3::exp(&(turn * share));
            ImuSample {
                stamp_ns: ns_from_seconds(from.time_s + share * length_s),
                angular_velocity_rad_per_s: turn / length_s + start.bias.gyroscope_rad_per_s,
                specific_force_m_per_s2: rotation.inverse() * (acceleration - gravity_in_world)
                    + start.bias.accelerometer_m_per_s2,
            }
        })
        .collect()
}
