//! Posterior covariances of a window.

use nalgebra::{DMatrix, Matrix6};

use super::setup::Setup;
use super::window_state::WindowState;
use crate::estimator::problem::solver::factor;

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
    let factor = factor(layout, &information)?;
    let newest = layout.velocity_bias(layout.frames.checked_sub(1)?);
    let newest_bias = factor.covariance_of(newest.start + VELOCITY..newest.end);
    let calibration = factor.trailing_covariance(layout.calibration);
    let finite = newest_bias.iter().chain(calibration.iter()).all(|entry| entry.is_finite());
    let newest_bias = Matrix6::from_column_slice(newest_bias.as_slice());
    finite.then_some(WindowCovariances { calibration, newest_bias })
}
