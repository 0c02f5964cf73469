//! Flight with its rig and the measurements of all sensors except the cameras.

use super::equipment::{GRAVITY_M_PER_S2, given_rig, random_imu_intrinsics};
use super::gimbal::JointMotion;
use super::imu::ImuRecord;
use super::random::RandomStream;
use super::trajectory::Trajectory;
use crate::faults::LensChange;
use crate::geometry::{RigidTransform, ns_from_seconds, seconds_from_ns};
use crate::sensors::{CameraMount, CameraRig, ChainPrior, GimbalRig, JointSample, Rig};

/// Streams of random numbers, one per purpose, so that they are independent.
pub mod stream {
    pub const ROUTE: u64 = 1;
    pub const MANOEUVRES: u64 = 2;
    pub const RIG: u64 = 3;
    pub(crate) const GIVEN_RIG: u64 = 4;
    pub const IMU: u64 = 5;
    pub const LOOK: u64 = 6;
    pub(crate) const ENCODERS: u64 = 7;
    pub(crate) const FEATURES: u64 = 8;
    pub const IMAGES: u64 = 9;
    pub const DELIVERY: u64 = 10;
    pub const VIBRATION: u64 = 11;
    pub const IMU_INTRINSICS: u64 = 12;
    pub const ACCELEROMETER_DRIFT: u64 = 13;
    pub(crate) const GIMBAL_IMU: u64 = 14;
    pub const GIMBAL_VIBRATION: u64 = 15;
    pub(crate) const GIMBAL_IMU_AXES: u64 = 16;
    pub const GIMBAL_RIPPLE: u64 = 17;
}

/// Time from an IMU sample to the encoder reading.
const ENCODER_PHASE_S: f64 = 0.002;

/// Flight, its rig, and the measurements of its IMU and encoders.
#[derive(Clone, Debug)]
pub struct Scenario {
    pub trajectory: Trajectory,
    pub(crate) joints: Option<JointMotion>,
    pub imu_record: ImuRecord,
    /// Samples of the IMU on the gimbal, `None` without one.
    pub gimbal_imu_record: Option<ImuRecord>,
    pub true_rig: Rig,
    pub given_rig: Rig,
    pub(super) seed: u64,
}

/// Options of a scenario in addition to its trajectory.
#[derive(Clone, Debug)]
pub struct ScenarioOptions {
    pub seed: u64,
    pub true_rig: Rig,
    pub start_error: ChainPrior,
    pub imu_noise_scale: f64,
}

impl Scenario {
    /// Simulates gimbal and sensors along a trajectory.
    ///
    /// `joints` moves them along the trajectory; it is not called for a rig without a gimbal.
    pub fn new(
        trajectory: Trajectory,
        joints: impl FnOnce(&Trajectory, &GimbalRig) -> JointMotion,
        options: ScenarioOptions,
    ) -> Self {
        let random = |stream| RandomStream::new(options.seed, stream);
        let true_rig = options.true_rig;
        let given_rig = given_rig(&true_rig, options.start_error, &mut random(stream::GIVEN_RIG));
        let joints = true_rig.gimbal.as_ref().map(|gimbal| joints(&trajectory, gimbal));
        let imu_record = ImuRecord::measure(
            &trajectory,
            &true_rig.imu.noise,
            true_rig.imu.rate_hz,
            options.imu_noise_scale,
            &mut random(stream::IMU),
        );
        let gimbal_imu_record = None;
        Self { trajectory, joints, imu_record, gimbal_imu_record, true_rig, given_rig, seed: options.seed }
    }

    /// Applies random scales and axes to the IMU samples, which are absent from the given rig.
    pub fn miscalibrate_imu(&mut self, [scale, angle_rad]: [f64; 2], random: &mut RandomStream) {
        let intrinsics = random_imu_intrinsics(scale, angle_rad, random);
        self.imu_record.miscalibrate(&intrinsics);
        self.true_rig.imu.intrinsics = intrinsics;
    }

    /// Applies errors to the intrinsics of all cameras of the given rig.
    pub fn spoil_intrinsics(&mut self, error: &LensChange) {
        for camera in &mut self.given_rig.cameras {
            camera.model = error.camera(&camera.model);
        }
    }

    /// Ground truth `world_from_camera` at a time in the IMU's clock.
    pub fn world_from_camera(&self, camera: &CameraRig, time_s: f64) -> RigidTransform {
        let world_from_imu = self.trajectory.at(time_s).world_from_imu;
        match (&camera.mount, &self.true_rig.gimbal, &self.joints) {
            (CameraMount::Static { imu_from_camera }, ..) => world_from_imu * *imu_from_camera,
            (CameraMount::Gimbal, Some(gimbal), Some(joints)) => {
                camera.beside(world_from_imu * gimbal.chain.imu_from_camera(&joints.at(time_s)))
            }
            (CameraMount::Gimbal, ..) => world_from_imu,
        }
    }

    /// True joint angles at a time.
    pub fn joint_angles_rad(&self, time_s: f64) -> Option<Vec<f64>> {
        self.joints.as_ref().map(|joints| joints.at(time_s))
    }

    /// True joint angles at the encoders' stamps.
    pub fn true_joint_samples(&self) -> Vec<JointSample> {
        let (Some(joints), Some(gimbal)) = (&self.joints, &self.true_rig.gimbal) else { return Vec::new() };
        let (duration_s, rate_hz) = (self.trajectory.duration_s(), gimbal.rate_hz);
        let count = ((duration_s - ENCODER_PHASE_S) * rate_hz).floor().max(0.0) as usize + 1;
        (0..count)
            .map(|index| ns_from_seconds(index as f64 / rate_hz + ENCODER_PHASE_S))
            .map(|stamp_ns| JointSample { stamp_ns, angles_rad: joints.at(seconds_from_ns(stamp_ns)) })
            .collect()
    }

    /// Encoder readings with white noise of this standard deviation.
    pub fn encoder_samples(&self, sigma_rad: f64) -> Vec<JointSample> {
        let mut random = RandomStream::new(self.seed, stream::ENCODERS);
        let mut samples = self.true_joint_samples();
        for sample in &mut samples {
            for angle in &mut sample.angles_rad {
                *angle += sigma_rad * random.normal();
            }
        }
        samples
    }
}

pub fn gravity_m_per_s2() -> f64 {
    GRAVITY_M_PER_S2
}
