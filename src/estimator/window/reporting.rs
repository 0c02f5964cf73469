//! Report of a step from the window.

use super::setup::Setup;
use super::solve::{SolvedWindow, TrackResiduals, median_length};
use super::window_state::WindowState;
use crate::estimator::factors::FactorKind;
use crate::estimator::factors::reprojection::VisualModel;
use crate::estimator::problem::solver::Solution;
use crate::estimator::report::{
    CalibrationEstimate, FeatureCounts, FeatureReport, FrameStateReport, FurtherCameraEstimate, LandmarkReport,
    ObservationReport, Phase, PoseCovariance, ResidualSummary, StageTimes, StepReport,
};
use crate::estimator::state::calibrations::{Calibrations, MAIN};
use crate::estimator::step_input::StepInput;
use crate::text::Named as _;

/// Report with the calibration only.
pub(crate) fn empty_report(
    setup: &Setup,
    input: &StepInput<'_>,
    phase: Phase,
    calibration: CalibrationEstimate,
) -> StepReport {
    StepReport {
        frame_index: input.frame_index,
        stamp_ns: input.stamp_ns,
        phase,
        restarts: 0,
        pixel_sigmas_px: Vec::new(),
        effective_pixel_sigma_px: setup.config.options.pixel_sigma_px,
        loss_scales_px: Vec::new(),
        events: Vec::new(),
        window: Vec::new(),
        newest_pose_covariance: None,
        calibration,
        features: Vec::new(),
        counts: FeatureCounts::default(),
        landmarks: Vec::new(),
        residuals: Vec::new(),
        reprojection_rms_before_px: 0.0,
        reprojection_rms_after_px: 0.0,
        reprojection_median_after_px: f64::NAN,
        iterations: Vec::new(),
        linearization: None,
        jacobian_source: None,
        factor_rows: None,
        gain: None,
        keyframe: false,
        times: StageTimes::default(),
        warnings: Vec::new(),
    }
}

impl WindowState {
    pub(crate) fn report(
        &self,
        setup: &Setup,
        input: &StepInput<'_>,
        solved: &mut SolvedWindow,
        calibration: CalibrationEstimate,
    ) -> StepReport {
        let begin_ms = setup.clock_ms();
        let mut report = empty_report(setup, input, Phase::Tracking, calibration);
        report.window = self.window_report();
        report.keyframe = self.frames.newest().keyframe;
        report.newest_pose_covariance = solved.solution.newest_pose_covariance.map(PoseCovariance);
        report.features = self.feature_reports(setup, solved);
        report.counts = FeatureCounts::of(&report.features);
        let models: Vec<VisualModel<'_>> =
            (0..solved.cameras.len()).map(|camera| self.visual_model(setup, camera)).collect();
        report.pixel_sigmas_px = models.iter().map(|model| model.sigma_px).collect();
        report.loss_scales_px = models.iter().map(|model| model.loss.scale() * model.sigma_px).collect();
        report.effective_pixel_sigma_px = effective_sigma(&report).unwrap_or(report.effective_pixel_sigma_px);
        report.landmarks = self.landmark_reports(setup, solved);
        report.residuals = residual_summaries(&solved.solution);
        report.reprojection_rms_before_px =
            root_mean_square(solved.checks.iter().map(|checks| &checks.residuals_before));
        let residuals_after = || solved.checks.iter().map(|checks| &checks.residuals_after);
        report.reprojection_rms_after_px = root_mean_square(residuals_after());
        report.reprojection_median_after_px = median_length(residuals_after());
        report.iterations = std::mem::take(&mut solved.solution.iterations);
        let reported_ms = setup.clock_ms();
        if setup.config.options.keep_linearization {
            let (linearization, gain) = self.linearization(setup, solved);
            (report.linearization, report.gain) = (Some(linearization), gain);
            let (source, rows) = self.jacobian_source(setup, solved);
            report.jacobian_source = Some(source);
            report.factor_rows = setup.config.options.keep_factor_rows.then_some(rows);
        }
        report.times.report_ms = reported_ms - begin_ms;
        report.times.linearize_ms = setup.clock_ms() - reported_ms;
        report
    }

    pub(crate) fn window_report(&self) -> Vec<FrameStateReport> {
        self.frames
            .iter()
            .map(|frame| {
                let navigation = &frame.state.navigation;
                FrameStateReport {
                    frame_index: frame.index,
                    stamp_ns: frame.stamp_ns,
                    world_from_imu: navigation.world_from_imu,
                    velocity_m_per_s: navigation.velocity_m_per_s,
                    accelerometer_bias_m_per_s2: navigation.bias.accelerometer_m_per_s2,
                    gyroscope_bias_rad_per_s: navigation.bias.gyroscope_rad_per_s,
                    joint_angles_rad: frame.state.joints_rad.clone(),
                    gimbal_imu: frame.state.gimbal_imu,
                    encoder_angles_rad: frame.encoder.as_ref().map(|encoder| encoder.angles_rad.clone()),
                    encoder_sigmas_rad: frame.encoder.as_ref().map(|encoder| encoder.sigmas_rad.clone()),
                    imu_from_camera: self.calibration.of(MAIN).imu_from_camera(&frame.state.joints_rad),
                    keyframe: frame.keyframe,
                }
            })
            .collect()
    }

    fn feature_reports(&self, setup: &Setup, solved: &SolvedWindow) -> Vec<FeatureReport> {
        let mut reports = Vec::new();
        for (camera, of_camera) in solved.cameras.iter().enumerate() {
            let checks = &solved.checks[camera];
            let model = self.visual_model(setup, camera);
            reports.extend((0..of_camera.ids.len()).map(|index| {
                let observations = &of_camera.tracks[index].observations;
                let landmark = &solved.solution.estimate.landmarks[camera][index];
                let (before, after) = (&checks.residuals_before[index], &checks.residuals_after[index]);
                let weights = model.robust_weights(after);
                let observation = |number: usize| ObservationReport {
                    frame_index: self.frames[observations[number].slot].index,
                    measured_px: observations[number].uv_px,
                    residual_before_px: before[number],
                    residual_after_px: after[number],
                    chi2: after[number].map_or(0.0, |residual| residual.norm_squared() / model.sigma_px.powi(2)),
                    robust_weight: weights[number],
                };
                let seen_by = |matched: bool| {
                    (0..observations.len()).filter(move |number| observations[*number].matched == matched)
                };
                FeatureReport {
                    id: of_camera.ids[index].of_camera(camera),
                    anchor_frame_index: self.frames[observations[0].slot].index,
                    inverse_depth_per_m: landmark.inverse_distance / landmark.bearing.z,
                    observations: seen_by(false).map(observation).collect(),
                    matched: seen_by(true).map(observation).collect(),
                    rejected: checks.rejected[index],
                }
            }));
        }
        // Reports are stored: release unused capacity.
        reports.shrink_to_fit();
        reports
    }

    fn landmark_reports(&self, setup: &Setup, solved: &SolvedWindow) -> Vec<LandmarkReport> {
        let mut landmarks = Vec::new();
        for (camera, of_camera) in solved.cameras.iter().enumerate() {
            let view = self.view(setup, camera);
            let kept = (0..of_camera.ids.len()).filter(|index| !solved.checks[camera].rejected[*index]);
            landmarks.extend(kept.map(|index| {
                let anchor = &of_camera.tracks[index].observations[0];
                let pose = view.pose(anchor.slot, &anchor.uv_px);
                let point = solved.solution.estimate.landmarks[camera][index].point_in_anchor();
                LandmarkReport {
                    id: of_camera.ids[index].of_camera(camera),
                    position_m: pose.rotation * point + pose.position_m,
                }
            }));
        }
        landmarks.shrink_to_fit();
        landmarks
    }
}

/// Residuals by kind of factor; residuals of zero-velocity updates and of the gimbal's IMU only where there are some.
fn residual_summaries(solution: &Solution) -> Vec<ResidualSummary> {
    let (before, after) = (&solution.costs_before, &solution.costs_after);
    let shown =
        |kind: &FactorKind| !matches!(kind, FactorKind::ZeroVelocity | FactorKind::GimbalImu) || after.count(*kind) > 0;
    let summary = |factor: FactorKind| ResidualSummary {
        factor,
        count: after.count(factor),
        chi2_before: before.of(factor),
        chi2_after: after.of(factor),
    };
    FactorKind::all().filter(shown).map(summary).collect()
}

/// Standard deviation of a pixel with the same average information as the observations, robust weights included; `None`
/// without any.
fn effective_sigma(report: &StepReport) -> Option<f64> {
    let information = || {
        let kept = report.features.iter().filter(|feature| !feature.rejected);
        kept.flat_map(|feature| {
            let sigma_px = report.pixel_sigma_px(feature.id);
            let weights = feature.observations.iter().map(|seen| seen.robust_weight).filter(|weight| *weight > 0.0);
            weights.map(move |weight| weight / sigma_px.powi(2))
        })
    };
    let count = information().count();
    (count > 0).then(|| (information().sum::<f64>() / count as f64).sqrt().recip())
}

fn root_mean_square<'a>(residuals: impl Iterator<Item = &'a TrackResiduals>) -> f64 {
    let (sum, count) = residuals
        .flatten()
        .flatten()
        .flatten()
        .fold((0.0, 0_usize), |(sum, count), residual| (sum + residual.norm_squared(), count + 1));
    (sum / count.max(1) as f64).sqrt()
}

/// Static calibration with the standard deviations of its columns: NaN before a solve, zero if it is fixed.
pub(crate) fn calibration_estimate(setup: &Setup, calibration: &Calibrations, sigmas: &[f64]) -> CalibrationEstimate {
    let cameras = || (0..calibration.cameras()).map(|camera| calibration.of(camera));
    let parameters = calibration.parameters();
    let chain = calibration.of(MAIN).chain();
    let sigmas = if calibration.dof() == 0 {
        vec![0.0; parameters.len()]
    } else if sigmas.len() == parameters.len() {
        sigmas.to_vec()
    } else {
        vec![f64::NAN; parameters.len()]
    };
    let further_cameras = setup.config.further_cameras.iter().zip(cameras().skip(1));
    CalibrationEstimate {
        parameterization: chain.parameterization(),
        parameters,
        values: calibration.values(),
        sigmas,
        sigma_scale: 1.0,
        prior_sigmas: calibration.prior_sigmas(),
        classical: chain.to_classical(),
        margins: chain.margins(),
        further_cameras: further_cameras
            .map(|(camera, calibration)| FurtherCameraEstimate {
                key: camera.key.clone(),
                number: camera.number,
                base: camera.base.map(|base| match base.checked_sub(1) {
                    None => setup.config.key.clone(),
                    Some(further) => setup.config.further_cameras[further].key.clone(),
                }),
                base_from_camera: calibration.imu_from_camera(&[]),
            })
            .collect(),
    }
}
