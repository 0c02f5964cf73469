//! One experiment: a mechanism in a motion; its window is linearized and analysed in several parameterizations.

use nalgebra::Vector3;

use super::mechanism::Mechanism;
use super::motion::{LaboratoryMotion, MechanismMotion};
use super::sensor_columns::SensorColumns;
use crate::camera::{CameraModel, Distortion, Projection};
use crate::estimator::{
    HypotheticalCameraImu, HypotheticalFrame, HypotheticalLandmark, HypotheticalWindow, JointKnowledge, PoseKnowledge,
    gravity_in_world,
};
use crate::geometry::{Dimension, RigidTransform, SplitMix64};
use crate::gimbal::{Chain, ParameterId, Parameterization};
use crate::observability::RankReport;
use crate::optimization::LandmarkModel;
use crate::sensors::ImuNoise;

/// Readout time of the rolling shutter, in seconds.
pub(super) const READOUT_S: f64 = 0.02;
/// Radial distortion of the lens: `k1 k2`, without tangential terms.
const LENS: [f64; 2] = [-0.28, 0.07];

/// A parameterization of the mechanism, with or without its joint offsets as columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LaboratoryForm {
    pub parameterization: Parameterization,
    /// True if the joint offsets are estimated.
    pub joint_offsets: bool,
}

impl LaboratoryForm {
    /// The parameterization with its joint offsets.
    pub const fn whole(parameterization: Parameterization) -> Self {
        Self { parameterization, joint_offsets: true }
    }

    /// Name on the command line.
    pub fn name(self) -> String {
        let suffix = if self.joint_offsets { "" } else { "-without-offsets" };
        format!("{}{suffix}", self.parameterization)
    }

    pub fn chain(self, mechanism: &Mechanism) -> Chain {
        let chain = Chain::from_classical(&mechanism.chain, self.parameterization);
        if self.joint_offsets { chain } else { chain.without_joint_offsets() }
    }
}

impl std::str::FromStr for LaboratoryForm {
    type Err = crate::gimbal::UnknownParameterization;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let (parameterization, joint_offsets) = match name.strip_suffix("-without-offsets") {
            Some(parameterization) => (parameterization, false),
            None => (name, true),
        };
        Ok(Self { parameterization: parameterization.parse()?, joint_offsets })
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct LaboratorySetup {
    pub mechanism: Mechanism,
    pub camera: CameraModel,
    pub motion: LaboratoryMotion,
    /// Joints that do not move, counted from 0.
    pub frozen: Vec<usize>,
    pub joints: JointKnowledge,
    pub poses: PoseKnowledge,
    /// True with an IMU that moves with the camera, of the noise of [`LABORATORY_IMU`].
    pub gimbal_imu: bool,
    /// Number of frames, [`FRAME_PERIOD_S`] apart.
    pub frames: usize,
    pub landmarks: usize,
    /// Columns of sensors in addition to the columns of the chain.
    pub columns: SensorColumns,
    /// Readout time of the camera's rolling shutter, in seconds; used only with columns of sensors.
    pub readout_s: f64,
}

/// Time between two frames of an experiment, in seconds.
pub const FRAME_PERIOD_S: f64 = 0.25;
const GRAVITY_M_PER_S2: f64 = 9.81;
const IMU_RATE_HZ: f64 = 200.0;
pub const PIXEL_SIGMA_PX: f64 = 1.0;
/// Nearest and farthest landmark, along the optical axis of the frame in whose view it was drawn.
const DEPTH_M: [f64; 2] = [4.0, 14.0];
/// Landmarks are drawn within this tangent of the optical axis, horizontally and vertically.
const VIEW: [f64; 2] = [0.6, 0.45];
/// A landmark is observed by every camera in front of which it lies by at least this depth.
const MIN_DEPTH_M: f64 = 1.0;
/// Prior standard deviations of the chain's parameters: 3 cm and 10°, the scale of the columns.
pub(super) const CHAIN_PRIOR: (f64, f64) = (Dimension::Length.scale(), Dimension::Angle.scale());

/// The IMU of an experiment without a rig: the ADIS16448 of the paper with the parameters of `RotorS`.
pub const LABORATORY_IMU: ImuNoise = ImuNoise {
    accelerometer_noise_density: 0.004,
    accelerometer_random_walk: 0.006,
    gyroscope_noise_density: 3.394e-4,
    gyroscope_random_walk: 3.879e-5,
};

impl LaboratorySetup {
    /// Setup with aggressive motion, known poses and joint angles, ten frames and a hundred landmarks.
    pub fn new(mechanism: Mechanism) -> Self {
        let camera = CameraModel::pinhole([460.0, 460.0, 320.0, 240.0], [640, 480]);
        Self {
            mechanism,
            camera: camera.expect("four positive numbers make a pinhole camera"),
            motion: LaboratoryMotion::Aggressive,
            frozen: Vec::new(),
            joints: JointKnowledge::Known,
            poses: PoseKnowledge::Known,
            gimbal_imu: false,
            frames: 10,
            landmarks: 100,
            columns: SensorColumns::NONE,
            readout_s: 0.0,
        }
    }

    /// The experiment with columns of sensors; a missing readout time or lens is taken from docs/mathematics.md,
    /// section 11.
    #[must_use]
    pub fn with_columns(mut self, columns: SensorColumns) -> Self {
        self.columns = columns;
        if columns.any() && self.readout_s == 0.0 {
            self.readout_s = READOUT_S;
        }
        if columns.intrinsics && self.camera.distortion == Distortion::None {
            self.camera = with_lens(&self.camera).unwrap_or(self.camera);
        }
        self
    }

    pub fn window(&self) -> HypotheticalWindow {
        self.window_from(0)
    }

    pub(super) fn flight(&self) -> MechanismMotion<'_> {
        let gravity_in_world = gravity_in_world(GRAVITY_M_PER_S2);
        MechanismMotion { mechanism: &self.mechanism, motion: self.motion, frozen: &self.frozen, gravity_in_world }
    }

    pub(super) fn time_s(slot: usize) -> f64 {
        slot as f64 * FRAME_PERIOD_S
    }

    /// True if the joint angles are unknown.
    pub(super) fn joints_free(&self) -> bool {
        self.joints == JointKnowledge::Unknown && self.mechanism.chain.joint_count() > 0
    }

    /// Hypothetical window that starts `first` frames after the start of the motion.
    pub(super) fn window_from(&self, first: usize) -> HypotheticalWindow {
        let flight = self.flight();
        let gravity_in_world = flight.gravity_in_world;
        let imu_poses = matches!(self.poses, PoseKnowledge::Imu { .. });
        let time_of = |slot: usize| Self::time_s(first + slot);
        let frames: Vec<HypotheticalFrame> = (0..self.frames)
            .map(|slot| HypotheticalFrame {
                time_s: time_of(slot),
                navigation: flight.navigation(time_of(slot)),
                joints_rad: flight.joints_rad(time_of(slot)),
                imu: if imu_poses && slot > 0 {
                    flight.imu(time_of(slot - 1), time_of(slot), IMU_RATE_HZ)
                } else {
                    Vec::new()
                },
                camera_imu: self.gimbal_imu.then(|| HypotheticalCameraImu {
                    noise: LABORATORY_IMU,
                    velocity_m_per_s: flight.camera_velocity_m_per_s(time_of(slot)),
                    samples: match slot.checked_sub(1) {
                        Some(before) => flight.camera_imu(time_of(before), time_of(slot), IMU_RATE_HZ),
                        None => Vec::new(),
                    },
                }),
            })
            .collect();
        let camera_of = |frame: &HypotheticalFrame| {
            frame.navigation.world_from_imu * self.mechanism.chain.imu_from_camera(&frame.joints_rad)
        };
        let landmarks = self.landmarks_of(&frames.iter().map(camera_of).collect::<Vec<_>>());
        HypotheticalWindow {
            camera: self.camera.clone(),
            frames,
            landmarks,
            poses: self.poses,
            joints: self.joints,
            pixel_sigma_px: PIXEL_SIGMA_PX,
            landmark_model: LandmarkModel::BearingAndInverseDistance,
            gravity_in_world,
            chain_prior: CHAIN_PRIOR,
        }
    }

    /// Landmarks drawn in the views of all cameras, `world_from_camera` by frame, in turn, anchored in the first frame that
    /// observes them.
    pub(super) fn landmarks_of(&self, cameras: &[RigidTransform]) -> Vec<HypotheticalLandmark> {
        let mut random = SplitMix64::new(1);
        let mut within = |low: f64, high: f64| low + (high - low) * random.next_unit();
        (0..self.landmarks)
            .filter_map(|index| {
                let ray = Vector3::new(within(-VIEW[0], VIEW[0]), within(-VIEW[1], VIEW[1]), 1.0);
                let point = cameras[index % cameras.len()].transform(&(ray * within(DEPTH_M[0], DEPTH_M[1])));
                let seen = |slot: &usize| cameras[*slot].inverse().transform(&point).z > MIN_DEPTH_M;
                let mut observers = (0..cameras.len()).filter(seen);
                let anchor = observers.next()?;
                let in_anchor = cameras[anchor].inverse().transform(&point);
                Some(HypotheticalLandmark {
                    anchor,
                    bearing: in_anchor.normalize(),
                    inverse_distance_per_m: in_anchor.norm().recip(),
                    observers: observers.collect(),
                })
            })
            .collect()
    }
}

/// Result of an experiment in one parameterization.
#[derive(Clone, Debug, PartialEq)]
pub struct LaboratoryResult {
    pub form: LaboratoryForm,
    /// Ranks, null and uninformed directions.
    pub rank: RankReport,
}

impl LaboratoryResult {
    /// Parameters with a weight in null directions, in column order.
    pub fn null_parameters(&self) -> Vec<ParameterId> {
        let null: Vec<_> = self.rank.directions.iter().filter(|direction| direction.structural).collect();
        let takes_part = |column: usize| null.iter().any(|direction| direction.weights[column].abs() > TAKES_PART);
        let named = self.rank.parameters.iter().enumerate().filter(|(column, _)| takes_part(*column));
        named.map(|(_, parameter)| *parameter).collect()
    }
}

/// Smallest scaled weight of a parameter that belongs to a null direction.
const TAKES_PART: f64 = 1e-5;

/// The camera with the radial distortion [`LENS`] in place of none.
pub(super) fn with_lens(camera: &CameraModel) -> Option<CameraModel> {
    let [k1, k2] = LENS;
    let lens = Distortion::Radtan([k1, k2, 0.0, 0.0]);
    CameraModel::new(Projection::Pinhole, lens, camera.intrinsics_px, camera.resolution_px).ok()
}
