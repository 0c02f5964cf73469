//! Marginalization: the information of a removed frame becomes the prior of the other frames.

use nalgebra::DMatrix;

use super::frame::Frame;
use super::problem::Problem;
use super::rows::stack;
use crate::estimator::factors::marginal_prior::Prior;
use crate::estimator::state::estimate::Estimate;

/// Prior after marginalization of the oldest frame and of the landmarks of the problem's tracks (those that
/// leave the window with it).
///
/// Its residuals refer to the first estimates: frames of the old prior keep theirs, others use the current estimate.
pub(crate) fn oldest(problem: &Problem<'_>, estimate: &Estimate) -> Option<Prior> {
    let mut parts = vec![problem.prior_rows(estimate), problem.encoder_rows(0, estimate)];
    parts.extend(problem.velocity_terms(0, &estimate.frames[0]).map(|terms| problem.zero_velocity_rows(&terms)));
    if problem.frames.len() > 1 {
        parts.push(problem.imu_rows(1, estimate));
        parts.extend(problem.position_terms(1, &estimate.frames).map(|terms| problem.zero_velocity_rows(&terms)));
    }
    parts.push(problem.visual_rows(estimate));
    eliminated(problem, estimate, &parts, 0)
}

/// Prior without the frame at `slot`, including its encoder readings; its visual observations are
/// discarded and its IMU samples go to the next frame. `None` without a prior.
pub(crate) fn dropped(problem: &Problem<'_>, estimate: &Estimate, slot: usize) -> Option<Prior> {
    let prior = problem.prior?;
    if !prior.holds_frame(slot) {
        return Some(prior.clone());
    }
    let carried = prior.rows(&problem.layout, &problem.first_estimate_offset(estimate));
    eliminated(problem, estimate, &[carried, problem.encoder_rows(slot, estimate)], slot)
}

/// Converts rows with residuals at the current estimate to a prior at the first estimates.
fn eliminated(problem: &Problem<'_>, estimate: &Estimate, parts: &[DMatrix<f64>], slot: usize) -> Option<Prior> {
    let total = problem.layout.total();
    let mut rows = stack(parts, total + 1);
    let shift = rows.columns(0, total) * problem.first_estimate_offset(estimate);
    let mut residual = rows.column_mut(total);
    residual -= shift;
    Prior::eliminating(&rows, &problem.layout, slot)
}

/// Sets missing first estimates of frames in the prior to the current state; removes those of frames outside.
pub(crate) fn keep_first_estimates(prior: &Prior, frames: &mut [Frame]) {
    for (slot, frame) in frames.iter_mut().enumerate() {
        if prior.holds_frame(slot) {
            if frame.first_estimate.is_none() {
                frame.first_estimate = Some(frame.state.clone());
            }
        } else {
            frame.first_estimate = None;
        }
    }
}
