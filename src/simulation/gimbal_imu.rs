//! Motion of the IMU on the gimbal: vehicle, joints and lever arm, differentiated over one sample period.

use nalgebra::Vector3;

use super::imu::ImuMotion;
use super::scenario::{Scenario, gravity_m_per_s2};
use crate::geometry::{RigidTransform, so3};
use crate::sensors::GimbalImuRig;

/// Stamp of the first sample: the streams are not aligned on purpose.
pub(super) const FIRST_SAMPLE_S: f64 = 0.0013;

/// `world_from_imu1` of the truth at a time in seconds.
pub(super) fn world_from_gimbal_imu(scenario: &Scenario, imu: &GimbalImuRig, time_s: f64) -> Option<RigidTransform> {
    let (gimbal, joints) = (scenario.true_rig.gimbal.as_ref()?, scenario.joints.as_ref()?);
    let imu_from_camera = gimbal.chain.imu_from_camera(&joints.at(time_s));
    Some(scenario.trajectory.at(time_s).world_from_imu * imu_from_camera * imu.camera_from_imu)
}

/// Angular velocity and specific force of the IMU on the gimbal, by differences of its true pose over a sample period:
/// the mean over the period, as of a sensor with a low-pass filter, so that the samples integrate to the true motion.
///
/// ```text
/// ω(t) = Log(R(t − h/2)ᵀ R(t + h/2)) / h
/// f(t) = R(t)ᵀ ((p(t + h) − 2 p(t) + p(t − h)) / h² − g)
/// ```
///
/// At both ends of the flight the differences are those of the nearest time within it.
pub(super) fn motion_of_gimbal_imu(
    scenario: &Scenario,
    imu: &GimbalImuRig,
    time_s: f64,
    period_s: f64,
) -> Option<ImuMotion> {
    let h = period_s;
    let time_s = time_s.clamp(h, (scenario.trajectory.duration_s() - h).max(h));
    let at = |time_s: f64| world_from_gimbal_imu(scenario, imu, time_s);
    let (before, now, after) = (at(time_s - h)?, at(time_s)?, at(time_s + h)?);
    let (from, to) = (at(time_s - 0.5 * h)?.rotation, at(time_s + 0.5 * h)?.rotation);
    let acceleration = (after.translation_m - now.translation_m * 2.0 + before.translation_m) / (h * h);
    let gravity = Vector3::new(0.0, 0.0, -gravity_m_per_s2());
    Some(ImuMotion {
        angular_velocity_rad_per_s: so3::log(&(from.inverse() * to)) / h,
        specific_force_m_per_s2: now.rotation.inverse() * (acceleration - gravity),
    })
}
