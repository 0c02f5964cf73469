//! State from which the least-squares problem of the window is built.

use super::features::{self, ActiveTracks, FeatureMap};
use super::frames::Frames;
use super::loss_scale::LossScale;
use super::setup::Setup;
use crate::estimator::factors::marginal_prior::Prior;
use crate::estimator::factors::reprojection::VisualModel;
use crate::estimator::factors::start_prior::StartPrior;
use crate::estimator::problem::problem::{CameraFactors, Problem};
use crate::estimator::state::calibrations::{Calibrations, MAIN};
use crate::estimator::state::camera_view::CameraView;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::frame::{self, FirstEstimateReach};
use crate::estimator::state::gimbal_imu_noise::GimbalImuNoise;
use crate::gimbal::Parameterization;
use crate::optimization::Landmark;

/// Frames, features, calibration and priors of the window.
#[derive(Clone, Debug)]
pub(crate) struct WindowState {
    pub(crate) frames: Frames,
    /// Features by camera, with their observations by the other camera of its pair.
    pub(crate) features: Vec<FeatureMap>,
    pub(crate) calibration: Calibrations,
    /// Marginalization prior, `None` before the first marginalization.
    pub(crate) prior: Option<Prior>,
    /// Prior on the first frame, until that frame is marginalized.
    pub(crate) start: Option<StartPrior>,
    /// Scales of the robust loss by camera.
    pub(crate) loss_scales: Vec<LossScale>,
    pub(crate) gimbal_imu_noise: GimbalImuNoise,
}

impl WindowState {
    /// Window before the first solve, with a prior on its first frame; scales and noise have followed no residuals.
    pub(crate) fn new(frames: Frames, features: Vec<FeatureMap>, calibration: Calibrations, start: StartPrior) -> Self {
        let loss_scales = vec![LossScale::default(); calibration.cameras()];
        let gimbal_imu_noise = GimbalImuNoise::default();
        Self { frames, features, calibration, prior: None, start: Some(start), loss_scales, gimbal_imu_noise }
    }

    /// Camera at the current estimate.
    pub(crate) fn view<'v>(&'v self, setup: &'v Setup, camera: usize) -> CameraView<'v> {
        let states: Vec<_> = self.frames.iter().map(|frame| frame.state.clone()).collect();
        CameraView::new(states, &self.calibration, camera, &|camera| setup.config.model(camera))
    }

    /// Least-squares problem of the window with the tracks of each camera; trailing cameras without tracks may be
    /// omitted.
    pub(crate) fn problem<'a>(&'a self, setup: &'a Setup, active: &'a [ActiveTracks]) -> Problem<'a> {
        let options = &setup.config.options;
        let layout = frame::layout(&self.frames, self.calibration.dof());
        let start = layout.calibration().start;
        let factors = |camera: usize| {
            let columns = self.calibration.pose_columns(camera);
            CameraFactors {
                visual: self.visual_model(setup, camera),
                tracks: active.get(camera).map_or(&[], |active| &active.tracks),
                columns: start + columns.start..start + columns.end,
            }
        };
        // With the second IMU, derivatives are those at the current estimate: it measures the camera's rotation to a tenth of
        // a milliradian, and chain, joint angles and attitude of the vehicle compensate each other in it, so that first
        // estimates of some with current values of the others belong to a pose in error by up to degrees. Only the classical
        // parameterization has redundant directions, which need first estimates.
        let redundant = self.calibration.of(MAIN).chain().parameterization() == Parameterization::Classical;
        let first_estimates = setup.config.gimbal_imu.is_none() || redundant;
        let reach = if first_estimates && options.first_estimate_reach_rad > 0.0 {
            FirstEstimateReach { radius_rad: options.first_estimate_reach_rad, holds_joints: self.holds_joints(setup) }
        } else {
            FirstEstimateReach::NONE
        };
        Problem {
            layout,
            cameras: (0..self.calibration.cameras()).map(factors).collect(),
            gravity_in_world: setup.gravity_in_world,
            gimbal_imu_noise: self.gimbal_imu_noise,
            frames: &self.frames,
            prior: self.prior.as_ref(),
            start: self.start.as_ref(),
            first_estimate_reach: reach,
            calibration_first_estimates: options.calibration_first_estimates && first_estimates,
        }
    }

    /// True if derivatives with respect to joint angles stay at first estimates, as those with respect to the chain do: an
    /// offset of the chain and one of the joint angles compensate each other, and derivatives at two different angles would
    /// observe both of them separately.
    ///
    /// Not where first estimates are in error by many degrees and would bias the poses: without encoder readings, and after
    /// the start with a stereo pair, half a second after the first image.
    fn holds_joints(&self, setup: &Setup) -> bool {
        let starts_with_pair = self.calibration.of(self.calibration.leading()).partner().is_some();
        setup.config.encoder_in_use().is_some() && !starts_with_pair
    }

    /// Camera model, pixel noise and current robust losses of a camera.
    pub(crate) fn visual_model<'a>(&self, setup: &'a Setup, camera: usize) -> VisualModel<'a> {
        let options = &setup.config.options;
        let scale = self.loss_scales[camera];
        VisualModel::new(setup.config.model(camera), options, scale.noise(options.loss), scale.losses(options.loss))
    }

    /// Features that take part in the solve, by camera.
    pub(crate) fn active_tracks(&self) -> Vec<ActiveTracks> {
        self.features.iter().map(ActiveTracks::new).collect()
    }

    /// Current values of the unknowns, with landmarks by camera in the order of the camera's tracks.
    pub(crate) fn estimate(&self, landmarks: Vec<Vec<Landmark>>) -> Estimate {
        Estimate {
            frames: self.frames.iter().map(|frame| frame.state.clone()).collect(),
            calibration: self.calibration.clone(),
            landmarks,
        }
    }

    /// Triangulates features with enough parallax.
    pub(crate) fn triangulate_new(&mut self, setup: &Setup) {
        for camera in 0..self.features.len() {
            let mut features = std::mem::take(&mut self.features[camera]);
            let view = self.view(setup, camera);
            for feature in features.values_mut().filter(|feature| feature.landmark.is_none()) {
                feature.landmark = features::triangulate(feature, &view, &setup.config.options);
            }
            self.features[camera] = features;
        }
    }

    /// Switches the parameterization of the chain: the calibration stays, and the prior's columns are converted.
    pub(crate) fn switch_parameterization(&mut self, parameterization: Parameterization) {
        let layout = frame::layout(&self.frames, self.calibration.dof());
        let before = self.calibration.first_estimate_offset();
        let old_from_new = self.calibration.switch_parameterization(parameterization);
        if let Some(prior) = &mut self.prior {
            let first_estimate_offsets = before.zip(self.calibration.first_estimate_offset());
            prior.transport_calibration(&old_from_new, first_estimate_offsets.as_ref(), &layout);
        }
    }
}
