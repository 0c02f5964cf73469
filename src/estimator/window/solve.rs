//! One solve of the window: triangulation, minimization, outlier rejection, posterior covariances.

use nalgebra::{DMatrix, Matrix6, Vector2};

use super::features::ActiveTracks;
use super::setup::Setup;
use super::window_state::WindowState;
use crate::estimator::config::EstimatorOptions;
use crate::estimator::factors::gimbal_imu::GimbalImuFactor;
use crate::estimator::factors::reprojection;
use crate::estimator::problem::information_gain::InformationGain;
use crate::estimator::problem::linearization::Linearization;
use crate::estimator::problem::problem::{CameraFactors, Problem};
use crate::estimator::problem::solver::{self, Solution, SolverLimits};
use crate::estimator::report::{Event, EventKind};
use crate::estimator::state::camera_view::TrackObservation;
use crate::estimator::state::columns::FrameId;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::gimbal_imu_noise::AxisSquares;
use crate::geometry::median;

/// Reprojection residuals in pixels, by track and observation; `None` behind the camera.
pub(crate) type TrackResiduals = Vec<Vec<Option<Vector2<f64>>>>;

/// Input and result of a solve, for the report.
#[derive(Clone, Debug)]
pub(crate) struct SolvedWindow {
    /// Tracks by camera, with the landmarks before the solve.
    pub(crate) cameras: Vec<ActiveTracks>,
    pub(crate) solution: Solution,
    pub(crate) checks: Vec<TrackChecks>,
    /// Residuals of the IMU on the gimbal, `None` without one.
    pub(crate) gimbal_imu_squares: Option<AxisSquares>,
}

#[derive(Clone, Debug)]
pub(crate) struct TrackChecks {
    pub(crate) residuals_before: TrackResiduals,
    pub(crate) residuals_after: TrackResiduals,
    pub(crate) rejected: Vec<bool>,
}

impl WindowState {
    /// Solves the window, applies the estimate and marks outliers as rejected.
    pub(crate) fn solve(&mut self, setup: &Setup, iterations: usize) -> SolvedWindow {
        let options = &setup.config.options;
        self.frames.reintegrate(options, self.calibration.imu_errors());
        self.triangulate_new(setup);
        let cameras = self.active_tracks();
        let start = self.estimate(cameras.iter().map(|active| active.landmarks.clone()).collect());
        let limits = SolverLimits { iterations, relative_cost_tolerance: options.relative_cost_tolerance };
        let problem = self.problem(setup, &cameras);
        let before = track_residuals(&problem, &start);
        let solution = solver::solve(&problem, start, limits);
        let after = track_residuals(&problem, &solution.estimate);
        let point = problem.point(&solution.estimate, &solution.estimate);
        let gimbal_imu_squares = GimbalImuFactor::axis_squares(&point, self.frames.len());

        for (frame, state) in self.frames.iter_mut().zip(&solution.estimate.frames) {
            frame.state = state.clone();
        }
        self.calibration = solution.estimate.calibration.clone();
        for (camera, active) in cameras.iter().enumerate() {
            for (id, landmark) in active.ids.iter().zip(&solution.estimate.landmarks[camera]) {
                if let Some(feature) = self.features[camera].get_mut(id) {
                    feature.landmark = Some(*landmark);
                }
            }
        }
        let checks = before
            .into_iter()
            .zip(after)
            .map(|(residuals_before, residuals_after)| TrackChecks {
                rejected: residuals_after.iter().map(|residuals| is_outlier(residuals, options)).collect(),
                residuals_before,
                residuals_after,
            })
            .collect();
        SolvedWindow { cameras, solution, checks, gimbal_imu_squares }
    }

    /// Linearization at the final estimate (rows of the measurements and of the priors), and the
    /// information gain of the newest image.
    pub(crate) fn linearization(
        &self,
        setup: &Setup,
        solved: &SolvedWindow,
    ) -> (Linearization, Option<InformationGain>) {
        let problem = self.problem(setup, &solved.cameras);
        let frames: Vec<FrameId> = self.frames.iter().map(|frame| FrameId(frame.index)).collect();
        let parameters = self.calibration.parameters();
        let estimate = &solved.solution.estimate;
        // An image that does not become a keyframe is dropped: it adds no information.
        if !self.frames.newest().keyframe {
            let linearization = problem.linearization(estimate, &parameters, &frames, None);
            return (linearization, problem.no_information_gain(estimate));
        }
        let mut cameras = Vec::new();
        let linearization = problem.linearization(estimate, &parameters, &frames, Some(&mut cameras));
        (linearization, problem.information_gain(estimate, &cameras))
    }

    /// Adapts the scales of the loss to the residuals of a solved window, over an interval in seconds.
    pub(crate) fn follow_residuals(&mut self, setup: &Setup, solved: &SolvedWindow, interval_s: f64) {
        let sigma_px = setup.config.options.pixel_sigma_px;
        for (scale, checks) in self.loss_scales.iter_mut().zip(&solved.checks) {
            scale.follow(median_length(std::iter::once(&checks.residuals_after)) / sigma_px, interval_s);
        }
        if let Some(squares) = &solved.gimbal_imu_squares {
            self.gimbal_imu_noise.follow(squares, interval_s);
        }
    }

    /// Drops rejected features; a continuing track becomes a new feature at its next observation.
    pub(crate) fn drop_rejected(&mut self, solved: &SolvedWindow, options: &EstimatorOptions, events: &mut Vec<Event>) {
        let (mut count, mut all) = (0, 0);
        for (features, (active, checks)) in self.features.iter_mut().zip(solved.cameras.iter().zip(&solved.checks)) {
            for (id, _) in active.ids.iter().zip(&checks.rejected).filter(|(_, rejected)| **rejected) {
                features.remove(id);
                count += 1;
            }
            all += active.ids.len();
        }
        if count > 0 {
            let limit = options.outlier_px;
            let message = format!("{count} of {all} features rejected: mean residual above {limit:.1} px");
            events.push(Event::decided(EventKind::OutliersRejected, message, count as f64, limit));
        }
    }
}

fn is_outlier(residuals: &[Option<Vector2<f64>>], options: &EstimatorOptions) -> bool {
    let unseen = residuals.iter().any(Option::is_none);
    let counted = residuals.len().max(1) as f64;
    let mean = residuals.iter().flatten().map(|residual| residual.norm()).sum::<f64>() / counted;
    unseen || mean > options.outlier_px
}

/// Reprojection residuals of all observations at an estimate, by camera.
fn track_residuals(problem: &Problem<'_>, estimate: &Estimate) -> Vec<TrackResiduals> {
    let of_camera = |(camera, factors): (usize, &CameraFactors<'_>)| {
        let view = problem.view(camera, estimate);
        factors
            .tracks
            .iter()
            .zip(&estimate.landmarks[camera])
            .map(|(track, landmark)| {
                let anchor = view.relative_to(&track.observations[0]);
                let residual = |observation: &TrackObservation| {
                    reprojection::observation_residual_px(&view, &anchor, landmark, observation)
                };
                track.observations.iter().map(residual).collect()
            })
            .collect()
    };
    problem.cameras.iter().enumerate().map(of_camera).collect()
}

/// Median length of residuals in pixels, NaN without any.
pub(crate) fn median_length<'a>(residuals: impl Iterator<Item = &'a TrackResiduals>) -> f64 {
    median(residuals.flatten().flatten().flatten().map(|residual| residual.norm())).unwrap_or(f64::NAN)
}

/// Length of the velocity in a velocity-bias block.
const VELOCITY: usize = 3;

/// Posterior covariances of a window at its current estimate, all other unknowns marginalized.
#[derive(Clone, Debug)]
pub(crate) struct WindowCovariances {
    pub(crate) calibration: DMatrix<f64>,
    /// Covariance of the newest frame's biases, gyroscope first.
    pub(crate) newest_bias: Matrix6<f64>,
}

/// Posterior covariances from a linearization at the current estimate; `None` if the information is not positive
/// definite.
pub(crate) fn covariances(setup: &Setup, window: &WindowState) -> Option<WindowCovariances> {
    let active = window.active_tracks();
    let problem = window.problem(setup, &active);
    let estimate = window.estimate(active.iter().map(|active| active.landmarks.clone()).collect());
    let equations = problem.linearize(&estimate);
    let layout = &problem.layout;
    let (information, _) = equations.reduced(layout, &equations.eliminate(0.0));
    let factor = solver::factor(layout, &information)?;
    let newest = layout.velocity_bias(layout.frames.checked_sub(1)?);
    let newest_bias = factor.covariance_of(newest.start + VELOCITY..newest.end);
    let calibration = factor.trailing_covariance(layout.calibration);
    let finite = newest_bias.iter().chain(calibration.iter()).all(|entry| entry.is_finite());
    let newest_bias = Matrix6::from_column_slice(newest_bias.as_slice());
    finite.then_some(WindowCovariances { calibration, newest_bias })
}
