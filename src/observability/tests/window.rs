//! Window of known poses, linearized as in the estimator.

use nalgebra::Vector3;

use crate::camera::CameraModel;
use crate::estimator::{
    HypotheticalFrame, HypotheticalLandmark, HypotheticalWindow, ImuBias, JointKnowledge, Linearization,
    NavigationState, PoseKnowledge,
};
use crate::geometry::{Dimension, RigidTransform};
use crate::gimbal::Chain;
use crate::optimization::LandmarkModel;

pub(super) struct Landmark {
    pub(super) anchor: usize,
    /// `(x/z, y/z, 1)` in the anchor's camera.
    pub(super) bearing: Vector3<f64>,
    pub(super) inverse_depth_per_m: f64,
}

pub(super) struct Window {
    pub(super) camera: CameraModel,
    pub(super) world_from_imu: Vec<RigidTransform>,
    pub(super) joint_angles_rad: Vec<Vec<f64>>,
    pub(super) landmarks: Vec<Landmark>,
    /// Landmark, anchor frame, observing frame.
    pub(super) observations: Vec<[usize; 3]>,
}

impl Window {
    /// Whitened linearization (1 px) with the joint angles known, or free in every frame; the bearings of the landmarks
    /// are exact, as in Eq. 9.
    pub(super) fn linearize(&self, chain: &Chain, joints_free: bool) -> Linearization {
        let frames = self.world_from_imu.iter().zip(&self.joint_angles_rad).enumerate();
        let landmarks = self.landmarks.iter().enumerate();
        let hypothetical = HypotheticalWindow {
            camera: self.camera.clone(),
            frames: frames
                .map(|(slot, (world_from_imu, joints_rad))| HypotheticalFrame {
                    time_s: slot as f64,
                    navigation: NavigationState {
                        world_from_imu: *world_from_imu,
                        velocity_m_per_s: Vector3::zeros(),
                        bias: ImuBias::default(),
                    },
                    joints_rad: joints_rad.clone(),
                    imu: Vec::new(),
                    camera_imu: None,
                })
                .collect(),
            landmarks: landmarks
                .map(|(index, landmark)| HypotheticalLandmark {
                    anchor: landmark.anchor,
                    bearing: landmark.bearing,
                    inverse_distance_per_m: landmark.inverse_depth_per_m / landmark.bearing.norm(),
                    observers: self.observations.iter().filter(|seen| seen[0] == index).map(|seen| seen[2]).collect(),
                })
                .collect(),
            poses: PoseKnowledge::Known,
            joints: if joints_free { JointKnowledge::Unknown } else { JointKnowledge::Known },
            pixel_sigma_px: 1.0,
            landmark_model: LandmarkModel::InverseDistance,
            gravity_in_world: Vector3::new(0.0, 0.0, -9.81),
            chain_prior: (Dimension::Length.scale(), Dimension::Angle.scale()),
        };
        hypothetical.linearize(&chain.to_classical(), chain.parameterization(), !chain.hides_joint_offsets())
    }
}
