//! Windows of predicted motions: landmarks at the distances of the scene, and the information about the calibration.

use nalgebra::{DMatrix, Vector2};

use super::super::analysis::measured_information;
use super::Situation;
use crate::estimator::{
    EstimatorOptions, HypotheticalFrame, HypotheticalLandmark, HypotheticalWindow, JointKnowledge, KEYFRAME_JOINT_RAD,
    Linearization, PoseKnowledge,
};
use crate::geometry::{Dimension, RigidTransform};
use crate::optimization::LandmarkModel;

/// Smallest number of observations of a landmark, as in the estimator.
const MIN_OBSERVATIONS: usize = 3;
/// Landmarks are drawn with this distance to the image border, and observed up to the border.
const BORDER_PX: f64 = 8.0;

/// Information matrix of a window of predicted frames about the calibration columns (n × n), in units of 10° and 3 cm,
/// with `landmarks_per_frame` landmarks drawn in the view of each frame; `None` when it is not finite.
///
/// The window is independent of the past: positions, yaw, velocities and biases at its start are unknown.
pub(super) fn predicted_information(
    situation: &Situation,
    frames: Vec<HypotheticalFrame>,
    landmarks_per_frame: usize,
) -> Option<DMatrix<f64>> {
    let poses = camera_poses(situation, &frames);
    let mut landmarks = Vec::new();
    let mut view = PredictedView::new(situation, &poses);
    for index in 0..landmarks_per_frame * poses.len() {
        landmarks.extend(view.draw(index % poses.len(), 0));
    }
    let by_joints = situation.joints_make_keyframes() && joints_move(&frames);
    if !by_joints && !makes_keyframes(&landmarks, &poses) {
        landmarks.clear();
    }
    measured_information(&linearization(situation, frames, landmarks, situation.encoders))
}

/// Linearization of keyframes and of a last frame without an image.
///
/// As by the front end, every image has this many features, as far as they are in the view, new ones for those that left
/// it.
pub(super) fn predicted_linearization(
    situation: &Situation,
    frames: Vec<HypotheticalFrame>,
    joints: JointKnowledge,
    features: usize,
) -> Linearization {
    let poses = camera_poses(situation, &frames[..frames.len() - 1]);
    let mut landmarks: Vec<HypotheticalLandmark> = Vec::new();
    let mut view = PredictedView::new(situation, &poses);
    for slot in 0..poses.len() {
        let seen = landmarks.iter().filter(|landmark| landmark.observers.contains(&slot)).count();
        for _ in seen..features {
            landmarks.extend(view.draw(slot, slot));
        }
    }
    linearization(situation, frames, landmarks, joints)
}

fn camera_poses(situation: &Situation, frames: &[HypotheticalFrame]) -> Vec<RigidTransform> {
    let pose = |frame: &HypotheticalFrame| {
        frame.navigation.world_from_imu * situation.chain.imu_from_camera(&frame.joints_rad)
    };
    frames.iter().map(pose).collect()
}

fn linearization(
    situation: &Situation,
    frames: Vec<HypotheticalFrame>,
    landmarks: Vec<HypotheticalLandmark>,
    joints: JointKnowledge,
) -> Linearization {
    let window = HypotheticalWindow {
        camera: situation.camera.clone(),
        landmarks,
        frames,
        poses: PoseKnowledge::Imu { noise: situation.imu_noise, biases_known: false },
        joints,
        pixel_sigma_px: situation.pixel_sigma_px,
        landmark_model: LandmarkModel::BearingAndInverseDistance,
        gravity_in_world: situation.gravity_in_world,
        chain_prior: (Dimension::Length.scale(), Dimension::Angle.scale()),
    };
    let chain = &situation.chain;
    window.linearize(&chain.to_classical(), chain.parameterization(), !chain.hides_joint_offsets())
}

/// Landmarks in the views of cameras, at the distances of the scene.
struct PredictedView<'a> {
    situation: &'a Situation,
    poses: &'a [RigidTransform],
    drawn: usize,
}

impl<'a> PredictedView<'a> {
    fn new(situation: &'a Situation, poses: &'a [RigidTransform]) -> Self {
        Self { situation, poses, drawn: 0 }
    }

    /// Draws a landmark in the view of a frame, observed while it is in the image, from the frame `earliest` on; `None`
    /// if fewer frames observe it than the estimator needs.
    fn draw(&mut self, home: usize, earliest: usize) -> Option<HypotheticalLandmark> {
        let camera = &self.situation.camera;
        let scene_m = self.situation.scene_m();
        let [width, height] = camera.resolution_px.map(|size| size as f64);
        self.drawn += 1;
        // A low-discrepancy sequence over the image and over the distances (Roberts' R3).
        let fraction = |factor: f64| (0.5 + factor * self.drawn as f64).fract();
        let (across, down, far) = (fraction(0.819_172_513_4), fraction(0.671_043_606_7), fraction(0.549_700_477_9));
        let inside = |position: f64, size: f64| BORDER_PX + position * (size - 2.0 * BORDER_PX);
        let uv_px = Vector2::new(inside(across, width), inside(down, height));
        let distance_m = scene_m[((far * scene_m.len() as f64) as usize).min(scene_m.len() - 1)];
        let poses = self.poses;
        let point = poses[home].transform(&(camera.unproject(&uv_px)?.normalize() * distance_m));
        let seen = |slot: &usize| {
            let in_camera = poses[*slot].inverse().transform(&point);
            let seen = camera.project(&in_camera).filter(|_| in_camera.z > 0.0);
            *slot == home || seen.is_some_and(|uv_px| camera.contains(&uv_px, 0.0))
        };
        let first = (earliest..=home).rev().take_while(seen).last().unwrap_or(home);
        let last = (home..poses.len()).take_while(seen).last().unwrap_or(home);
        if last + 1 - first < MIN_OBSERVATIONS {
            return None;
        }
        let in_anchor = poses[first].inverse().transform(&point);
        Some(HypotheticalLandmark {
            anchor: first,
            bearing: in_anchor.normalize(),
            inverse_distance_per_m: in_anchor.norm().recip(),
            observers: (first + 1..=last).collect(),
        })
    }
}

/// True if a joint leaves its first angle by as much as makes a keyframe.
fn joints_move(frames: &[HypotheticalFrame]) -> bool {
    let Some((first, later)) = frames.split_first() else { return false };
    let moves = |(angle, begin): (&f64, &f64)| (angle - begin).abs() >= KEYFRAME_JOINT_RAD;
    later.iter().any(|frame| frame.joints_rad.iter().zip(&first.joints_rad).any(moves))
}

/// True if the estimator makes a keyframe of any frame after the first, by parallax or by new features. A camera that
/// hardly translates makes none in this way, whatever the motion of its gimbal, and its observations are dropped.
fn makes_keyframes(landmarks: &[HypotheticalLandmark], poses: &[RigidTransform]) -> bool {
    let options = EstimatorOptions::default();
    let is_keyframe = |slot: usize| {
        let seen = || landmarks.iter().filter(|landmark| landmark.anchor == slot || landmark.observers.contains(&slot));
        let parallaxes = || {
            seen().filter(|landmark| landmark.anchor == 0).map(|landmark| {
                let point = poses[0].transform(&(landmark.bearing / landmark.inverse_distance_per_m));
                (point - poses[0].translation_m).angle(&(point - poses[slot].translation_m))
            })
        };
        let common = parallaxes().count() as f64;
        let new_ratio = 1.0 - common / seen().count().max(1) as f64;
        let parallax_rad = parallaxes().sum::<f64>() / common.max(1.0);
        parallax_rad >= options.keyframe_parallax_rad || new_ratio > options.keyframe_new_ratio
    };
    (1..poses.len()).any(is_keyframe)
}
