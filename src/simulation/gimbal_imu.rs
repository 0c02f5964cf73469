//! Motion of the IMU on the gimbal: vehicle, joints and lever arm, differentiated over one sample period.

use nalgebra::Vector3;

use super::imu::{ImuMotion, ImuRecord};
use super::random::RandomStream;
use super::scenario::{Scenario, gravity_m_per_s2, stream};
use crate::geometry::{RigidTransform, ns_from_seconds, so3};
use crate::sensors::GimbalImuRig;

/// Stamp of the first sample: the streams are not aligned on purpose.
const FIRST_SAMPLE_S: f64 = 0.0013;

impl Scenario {
    /// Simulates the samples of the IMU on the gimbal, if the rig has one; the joints must have their final motion.
    pub fn measure_gimbal_imu(&mut self, noise_scale: f64) {
        let Some(imu) = &self.true_rig.gimbal_imu else { return };
        let rate_hz = imu.sensor.rate_hz;
        let duration_s = self.trajectory.duration_s();
        let count = ((duration_s - FIRST_SAMPLE_S) * rate_hz).floor().max(0.0) as usize + 1;
        let times_s = (0..count).map(|index| FIRST_SAMPLE_S + index as f64 / rate_hz);
        // The rig has joints, as it has an IMU on them.
        let motion = |time_s: f64| motion_of_gimbal_imu(self, imu, time_s, 1.0 / rate_hz).unwrap_or_default();
        let mut random = RandomStream::new(self.seed, stream::GIMBAL_IMU);
        let record = ImuRecord::of_motion(times_s, motion, &imu.sensor.noise, rate_hz, noise_scale, &mut random);
        self.gimbal_imu_record = Some(record);
    }

    /// Applies errors of the IMU on the gimbal that the given rig does not have: the stamps are `shift_s` before the
    /// measurements, and the axes differ by random rotations of this standard deviation.
    pub fn spoil_gimbal_imu(&mut self, [shift_s, axes_rad]: [f64; 2]) {
        let mut random = RandomStream::new(self.seed, stream::GIMBAL_IMU_AXES);
        if let Some(imu) = &mut self.given_rig.gimbal_imu {
            imu.camera_from_imu.rotation *= so3::exp(&random.normal_vector(axes_rad));
        }
        if let (Some(imu), Some(record)) = (&mut self.true_rig.gimbal_imu, &mut self.gimbal_imu_record) {
            imu.timeshift_s = shift_s;
            for sample in &mut record.samples {
                sample.stamp_ns -= ns_from_seconds(shift_s);
            }
            let before_start = record.samples.partition_point(|sample| sample.stamp_ns < 0);
            record.samples.drain(..before_start);
            record.biases.drain(..before_start);
        }
    }
}

/// `world_from_imu1` of the truth at a time in seconds.
fn world_from_gimbal_imu(scenario: &Scenario, imu: &GimbalImuRig, time_s: f64) -> Option<RigidTransform> {
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
/// At both ends of the flight the differences are taken at the nearest time within it.
fn motion_of_gimbal_imu(scenario: &Scenario, imu: &GimbalImuRig, time_s: f64, period_s: f64) -> Option<ImuMotion> {
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
