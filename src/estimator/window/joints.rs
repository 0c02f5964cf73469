//! Joint angles of the frames: initial values, and the encoder readings of dropped frames.

use nalgebra::{DVector, Dyn};

use super::setup::Setup;
use super::window_state::WindowState;
use crate::estimator::factors::joint_motion::UNKNOWN_JOINT_SIGMA_RAD;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::camera_pose::{self, CameraMaps};
use crate::estimator::state::camera_view::CameraView;
use crate::geometry::wrap_angle;
use crate::optimization::{NormalEquations, RelativePose, gauss_newton, reprojection};
use crate::sensors::JointAngles;

/// Smallest number of landmarks that constrain the joint angles of a frame.
const MIN_LANDMARKS: usize = 15;
/// Factor by which the visual standard deviation of a joint angle must be smaller than the encoder's before
/// readings are propagated with it: the visual rotation between the frames is then independent of the encoder.
const SHARPER: f64 = 3.0;

/// Standard deviation of joint angles that the difference of two gyroscopes predicts from the joint angles of the last
/// frame, in radians: turn-on biases of 1°/s over two images.
const GYROSCOPES_SIGMA_RAD: f64 = 0.002;

impl WindowState {
    /// Fits the newest frame's joint angles to the observations of triangulated landmarks at a fixed pose: an
    /// encoder may have an error of many degrees, and without encoders there is no other initial value.
    pub(crate) fn align_newest_joints(&mut self, setup: &Setup) {
        let joints = self.calibration.of(MAIN).joint_count();
        if joints == 0 {
            return;
        }
        let slot = self.frames.newest_slot();
        let view = self.view(setup, MAIN);
        let known = self.frames[slot].encoder.as_ref().map(|encoder| encoder.sigmas_rad.as_slice());
        let sigma_rad = |joint: usize| match &self.frames[slot].gimbal_motion {
            Some(_) => GYROSCOPES_SIGMA_RAD,
            None => known.map_or(UNKNOWN_JOINT_SIGMA_RAD, |sigmas| sigmas[joint]),
        };
        let prior = DVector::from_fn(joints, |joint, _| sigma_rad(joint).powi(-2));
        let start = self.frames[slot].state.joints_rad.clone();
        let mut angles = start.clone();
        let linearize = |angles: &Vec<f64>| {
            let (mut equations, _) = self.joints_by_landmarks(setup, slot, angles, &view);
            for joint in 0..joints {
                equations.add_diagonal(joint, angles[joint] - start[joint], prior[joint]);
            }
            Some(equations)
        };
        let solved = gauss_newton(&mut angles, 5, linearize, |angles, step| {
            angles.iter_mut().zip(step.iter()).for_each(|(angle, change)| *angle += change);
            step.amax() < 1e-5
        });
        if solved.is_some() {
            self.frames[slot].state.joints_rad = angles;
        }
    }

    /// Normal equations of a frame's joint angles from landmarks anchored in other frames, all other unknowns
    /// fixed, and the number of these landmarks.
    fn joints_by_landmarks(
        &self,
        setup: &Setup,
        slot: usize,
        angles_rad: &[f64],
        view: &CameraView<'_>,
    ) -> (NormalEquations<Dyn>, usize) {
        let joints = angles_rad.len();
        let sigma = self.visual_model(setup, MAIN).sigma_px;
        let mut state = self.frames[slot].state.clone();
        state.joints_rad = angles_rad.to_vec();
        let sensor = self.calibration.sensor_model(MAIN);
        let camera_at = |row: f64| camera_pose::at_row(&state, &sensor, row);
        let first_row = camera_at(0.0);
        let own = CameraMaps::of_sensors(std::slice::from_ref(&state), std::slice::from_ref(&sensor)).own.remove(0);
        let by_joints = own.columns(6, joints).into_owned();
        let mut equations = NormalEquations::zeros(Dyn(joints));
        let mut count = 0;
        for feature in self.features[MAIN].values() {
            let (Some(anchor), Some(landmark), Some(seen)) =
                (feature.observations.first(), feature.landmark.as_ref(), feature.observation(slot))
            else {
                continue;
            };
            if anchor.view == slot {
                continue;
            }
            let camera = if sensor.rolling { camera_at(view.row_fraction(&seen.uv_px)) } else { first_row };
            let relative = RelativePose::new(&view.pose(anchor.view, &anchor.uv_px), &camera);
            let Some(term) = reprojection::linearize(view.model(), &relative, &relative, landmark, &seen.uv_px) else {
                continue;
            };
            let squared = term.residual.norm_squared() / (sigma * sigma);
            let weight = 1.0 / (sigma * sigma * squared.sqrt().max(1.0));
            equations.add(&term.residual, &(term.by_observer * &by_joints), weight);
            count += 1;
        }
        (equations, count)
    }

    /// Variances of a frame's joint angles from the image alone, `None` with too few landmarks.
    fn visual_variances(&self, setup: &Setup, slot: usize, view: &CameraView<'_>) -> Option<DVector<f64>> {
        let (equations, count) = self.joints_by_landmarks(setup, slot, &self.frames[slot].state.joints_rad, view);
        let inverse = equations.hessian.cholesky()?.inverse();
        (count >= MIN_LANDMARKS).then(|| inverse.diagonal())
    }

    /// Combines the encoder readings of a removed frame with the readings of the next frame, propagated by the visually
    /// measured rotation of the joints between the frames.
    ///
    /// Only independent errors are averaged; the variance of the visual rotation is added.
    pub(crate) fn carry_encoder(&mut self, setup: &Setup, from: usize, to: usize) {
        let (Some(removed), Some(own)) = (&self.frames[from].encoder, &self.frames[to].encoder) else { return };
        let view = self.view(setup, MAIN);
        let (Some(variance_from), Some(variance_to)) =
            (self.visual_variances(setup, from, &view), self.visual_variances(setup, to, &view))
        else {
            return;
        };
        let mut combined = own.clone();
        for joint in 0..own.angles_rad.len() {
            let rotation_rad = self.frames[to].state.joints_rad[joint] - self.frames[from].state.joints_rad[joint];
            let between = variance_from[joint] + variance_to[joint];
            let (own_variance, own_bias_variance) = variances(own, joint);
            let (removed_variance, removed_bias_variance) = variances(removed, joint);
            if between * SHARPER * SHARPER > own_variance.min(removed_variance) {
                continue;
            }
            let removed_variance = removed_variance + between;
            let removed_weight = own_variance / (own_variance + removed_variance);
            // The time offset shifts a reading by the joint rate of its frame.
            let faster =
                self.frames[to].state.joint_rate_rad_per_s(joint) - self.frames[from].state.joint_rate_rad_per_s(joint);
            let rotation_rad = rotation_rad + faster * self.calibration.of(MAIN).encoder_shift_s();
            let change = wrap_angle(removed.angles_rad[joint] + rotation_rad - own.angles_rad[joint]);
            let bias_variance = own_bias_variance.max(removed_bias_variance);
            combined.angles_rad[joint] = own.angles_rad[joint] + removed_weight * change;
            combined.sigmas_rad[joint] =
                (own_variance * removed_variance / (own_variance + removed_variance) + bias_variance).sqrt();
            combined.lasting_sigmas_rad[joint] = bias_variance.sqrt();
        }
        self.frames[to].encoder = Some(combined);
    }
}

/// Variances of an encoder angle: the independent part, and the part common to neighbouring frames.
fn variances(encoder: &JointAngles, joint: usize) -> (f64, f64) {
    let bias_variance = encoder.lasting_sigmas_rad[joint].powi(2);
    ((encoder.sigmas_rad[joint].powi(2) - bias_variance).max(0.0), bias_variance)
}
