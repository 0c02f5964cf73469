//! Hypothetical windows: states and landmarks with exact measurements, linearized by the estimator's
//! factors, to predict the information of a motion.

use std::sync::Arc;

use nalgebra::Vector3;

use super::linearization::Linearization;
use super::problem::{CameraFactors, Problem};
use crate::camera::CameraModel;
use crate::estimator::factors::reprojection::VisualModel;
use crate::estimator::state::calibration::Calibration;
use crate::estimator::state::calibrations::Calibrations;
use crate::estimator::state::camera_pose;
use crate::estimator::state::camera_view::{Track, TrackObservation};
use crate::estimator::state::columns::{ColumnBlock, ColumnGroup, FrameId};
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::frame::{FirstEstimateReach, Frame, layout};
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::gimbal_imu_noise::GimbalImuNoise;
use crate::estimator::state::given_chain::GivenSigmas;
use crate::estimator::state::navigation::{GimbalImuState, ImuBias, NavigationState};
use crate::estimator::state::preintegration::Preintegration;
use crate::geometry::{RigidTransform, ns_from_seconds};
use crate::gimbal::{ClassicalChain, Parameterization};
use crate::optimization::{Landmark, LandmarkModel, RelativePose, RobustLoss};
use crate::sensors::{ImuNoise, ImuSample, JointAngles, JointMotionFit};

/// Information on the poses in a hypothetical window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PoseKnowledge {
    /// Known poses, without columns.
    Known,
    /// IMU measurements, with known or unknown biases.
    Imu {
        noise: ImuNoise,
        /// True if the biases are known and have no columns.
        biases_known: bool,
    },
}

/// Information on the joint angles in a hypothetical window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointKnowledge {
    /// Known joint angles, without columns.
    Known,
    /// One reading per frame and joint with white noise of this standard deviation, in radians.
    Encoder(f64),
    /// Unknown joint angles, without readings.
    Unknown,
}

#[derive(Clone, Debug)]
pub struct HypotheticalFrame {
    pub time_s: f64,
    pub navigation: NavigationState,
    /// Joint angles without the static offsets.
    pub joints_rad: Vec<f64>,
    /// IMU samples since the previous frame, both ends included; unused with known poses.
    pub imu: Vec<ImuSample>,
    /// IMU at the centre of the camera, with its axes; `None` without one.
    pub camera_imu: Option<HypotheticalCameraImu>,
}

/// Measurements of an IMU that moves with the camera; its biases are unknown.
#[derive(Clone, Debug)]
pub struct HypotheticalCameraImu {
    pub noise: ImuNoise,
    /// Velocity of the camera in the world.
    pub velocity_m_per_s: Vector3<f64>,
    /// Samples since the previous frame, both ends included.
    pub samples: Vec<ImuSample>,
}

/// Landmark of a hypothetical window with the observing frames.
#[derive(Clone, Debug)]
pub struct HypotheticalLandmark {
    /// Slot of the anchor frame.
    pub anchor: usize,
    /// Direction in the anchor's camera; need not be normalized.
    pub bearing: Vector3<f64>,
    /// Inverse distance from the anchor's camera, in 1/m.
    pub inverse_distance_per_m: f64,
    /// Slots of the other observing frames.
    pub observers: Vec<usize>,
}

/// Window of hypothetical states with exact measurements.
#[derive(Clone, Debug)]
pub struct HypotheticalWindow {
    pub camera: CameraModel,
    /// Frames of the window, oldest first.
    pub frames: Vec<HypotheticalFrame>,
    pub landmarks: Vec<HypotheticalLandmark>,
    pub poses: PoseKnowledge,
    pub joints: JointKnowledge,
    pub pixel_sigma_px: f64,
    pub landmark_model: LandmarkModel,
    /// Gravity in the world, in m/s².
    pub gravity_in_world: Vector3<f64>,
    /// Prior standard deviations of the chain's parameters, in metres and radians.
    pub chain_prior: (f64, f64),
}

impl HypotheticalWindow {
    /// Linearizes the window with the chain in a parameterization; `joint_offsets` adds the joint offsets as columns.
    ///
    /// Known quantities have no columns. The prior has the rows of the rig's prior only.
    pub fn linearize(
        &self,
        chain: &ClassicalChain,
        parameterization: Parameterization,
        joint_offsets: bool,
    ) -> Linearization {
        let (translation_m, rotation_rad) = self.chain_prior;
        let sigmas = GivenSigmas { translation_m, rotation_rad };
        let has_imu = self.frames.first().is_some_and(|first| first.camera_imu.is_some());
        let calibration = Calibration::new(chain, parameterization, sigmas, true, joint_offsets)
            .with_given_gimbal_imu(has_imu.then(RigidTransform::identity));
        let frames: Vec<Frame> = self.frames.iter().enumerate().map(|(slot, it)| self.frame(slot, it)).collect();
        let states: Vec<FrameState> = frames.iter().map(|frame| frame.state.clone()).collect();
        let (tracks, landmarks) = self.tracks(&states, &calibration);
        let layout = layout(&frames, calibration.dof());
        let visual = VisualModel {
            camera: &self.camera,
            sigma_px: self.pixel_sigma_px,
            loss: RobustLoss::None,
            track_loss: RobustLoss::None,
            landmark_model: self.landmark_model,
        };
        let problem = Problem {
            layout,
            cameras: vec![CameraFactors { visual, tracks: &tracks, columns: layout.calibration() }],
            gravity_in_world: self.gravity_in_world,
            gimbal_imu_noise: GimbalImuNoise::OF_RIG,
            frames: &frames,
            prior: None,
            start: None,
            first_estimate_reach: FirstEstimateReach::NONE,
            calibration_first_estimates: false,
        };
        let numbers: Vec<FrameId> = (0..frames.len()).map(FrameId).collect();
        let parameters = calibration.parameters();
        let calibration = Calibrations::new(calibration, []);
        let estimate = Estimate { frames: states, calibration, landmarks: vec![landmarks] };
        let whole = problem.linearization(&estimate, &parameters, &numbers, None);
        whole.without_known(&self.poses, &self.joints)
    }

    fn frame(&self, slot: usize, hypothetical: &HypotheticalFrame) -> Frame {
        let navigation = hypothetical.navigation;
        let motion = match &self.poses {
            PoseKnowledge::Imu { noise, .. } if slot > 0 => {
                Preintegration::from_samples(*noise, navigation.bias, &hypothetical.imu)
            }
            PoseKnowledge::Imu { noise, .. } => Preintegration::new(*noise, navigation.bias),
            PoseKnowledge::Known => Preintegration::new(ImuNoise::ZERO, navigation.bias),
        };
        let encoder = match self.joints {
            JointKnowledge::Encoder(sigma_rad) => Some(JointAngles {
                angles_rad: hypothetical.joints_rad.clone(),
                sigmas_rad: vec![sigma_rad; hypothetical.joints_rad.len()],
                lasting_sigmas_rad: vec![0.0; hypothetical.joints_rad.len()],
                rates_rad_per_s: vec![0.0; hypothetical.joints_rad.len()],
                motion_fits: vec![JointMotionFit::UNKNOWN; hypothetical.joints_rad.len()],
            }),
            JointKnowledge::Known | JointKnowledge::Unknown => None,
        };
        let state = FrameState {
            navigation,
            joints_rad: hypothetical.joints_rad.clone(),
            joint_motion: Vec::new(),
            gimbal_imu: hypothetical
                .camera_imu
                .as_ref()
                .map(|imu| GimbalImuState { velocity_m_per_s: imu.velocity_m_per_s, bias: ImuBias::default() }),
            rates: Arc::new(Rates::default()),
        };
        let of_camera = hypothetical.camera_imu.as_ref().filter(|_| slot > 0);
        let of_camera = of_camera.map(|imu| Preintegration::from_samples(imu.noise, ImuBias::default(), &imu.samples));
        Frame::new(slot, ns_from_seconds(hypothetical.time_s), state, encoder, motion).with_gimbal_motion(of_camera)
    }

    /// Landmarks with exact pixels; a frame into which a landmark does not project has no observation.
    fn tracks(&self, states: &[FrameState], calibration: &Calibration) -> (Vec<Track>, Vec<Landmark>) {
        let cameras: Vec<_> = states.iter().map(|state| camera_pose::at(state, calibration)).collect();
        let mut tracks = Vec::with_capacity(self.landmarks.len());
        let mut landmarks = Vec::with_capacity(self.landmarks.len());
        for hypothetical in &self.landmarks {
            let landmark = Landmark {
                bearing: hypothetical.bearing.normalize(),
                inverse_distance: hypothetical.inverse_distance_per_m,
            };
            let anchor = hypothetical.anchor;
            let Some(uv_px) = self.camera.project(&landmark.bearing) else { continue };
            let mut observations = vec![TrackObservation { slot: anchor, matched: false, uv_px }];
            for slot in hypothetical.observers.iter().copied().filter(|slot| *slot != anchor) {
                let relative = RelativePose::new(&cameras[anchor], &cameras[slot]);
                let seen = self.camera.project(&relative.direction(&landmark));
                observations.extend(seen.map(|uv_px| TrackObservation { slot, matched: false, uv_px }));
            }
            if observations.len() > 1 {
                tracks.push(Track { observations });
                landmarks.push(landmark);
            }
        }
        (tracks, landmarks)
    }
}

impl Linearization {
    /// This linearization without the columns of known quantities.
    pub(crate) fn without_known(&self, poses: &PoseKnowledge, joints: &JointKnowledge) -> Self {
        let count = |group: ColumnGroup| match (group, poses, joints) {
            (ColumnGroup::Joints, _, JointKnowledge::Known)
            | (ColumnGroup::Pose | ColumnGroup::VelocityBias, PoseKnowledge::Known, _) => 0,
            // Keeps the velocity; the biases follow it in the block.
            (ColumnGroup::VelocityBias, PoseKnowledge::Imu { biases_known: true, .. }, _) => 3,
            _ => usize::MAX,
        };
        let (mut kept, mut columns) = (Vec::new(), Vec::new());
        for block in &self.columns {
            let len = block.len.min(count(block.id.group()));
            if len > 0 {
                columns.push(ColumnBlock { start: kept.len(), len, ..*block });
                kept.extend(block.start..block.start + len);
            }
        }
        Self {
            columns,
            jacobian: self.jacobian.select_columns(&kept),
            prior_jacobian: self.prior_jacobian.select_columns(&kept),
            ..self.clone()
        }
    }
}
