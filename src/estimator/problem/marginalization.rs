//! Marginalization: the information of a removed frame becomes the prior of the other frames.

use nalgebra::DMatrix;

use super::problem::Problem;
use crate::estimator::factors::factor::Point;
use crate::estimator::factors::kind::FactorLabel;
use crate::estimator::factors::labelled_rows::{LabelledRows, stack};
use crate::estimator::factors::marginal_prior::Prior;
use crate::estimator::factors::measurements::measurements;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::frame::Frame;

/// Prior after marginalization of the oldest frame and of the landmarks of the problem's tracks (those that
/// leave the window with it).
///
/// Its residuals refer to the first estimates: frames of the old prior keep theirs, others use the current estimate.
pub(crate) fn oldest(problem: &Problem<'_>, estimate: &Estimate) -> Option<Prior> {
    let linearized = problem.linearization_point(estimate);
    let point = problem.point(estimate, &linearized);
    let (total, layout) = (problem.layout.total(), &problem.layout);
    // The rig's prior stays in the window.
    let mut priors = LabelledRows::of(total, |label| label != FactorLabel::CalibrationPrior);
    problem.priors(&point, &mut priors);
    let mut measured = LabelledRows::new(total);
    measurements(&point, layout.frames.min(2), &mut measured);
    measured.parts.retain(|part| part.touches(&layout.frame(0)));
    measured.parts.sort_by_key(|part| part.touches(&layout.frame(1)));
    let visual = problem.visual_rows(estimate, &linearized);
    let parts = priors.parts.iter().chain(&measured.parts).map(|part| &part.rows).chain([&visual]);
    eliminated(&point, parts, 0)
}

/// Prior without the frame at `slot`, including its encoder readings; its visual observations are
/// discarded and its IMU samples go to the next frame. `None` without a prior.
pub(crate) fn dropped(problem: &Problem<'_>, estimate: &Estimate, slot: usize) -> Option<Prior> {
    let prior = problem.prior?;
    if !prior.holds_frame(slot) {
        return Some(prior.clone());
    }
    let linearized = problem.linearization_point(estimate);
    let point = problem.point(estimate, &linearized);
    let label = FactorLabel::Encoder(slot as u16);
    let mut readings = LabelledRows::of(problem.layout.total(), |wanted| wanted == label);
    measurements(&point, slot + 1, &mut readings);
    let carried = prior.rows(&problem.layout, &point.first_estimate_offset());
    let parts = [&carried].into_iter().chain(readings.parts.iter().map(|part| &part.rows));
    eliminated(&point, parts, slot)
}

/// Converts rows with residuals at the current estimate to a prior at the first estimates.
fn eliminated<'a>(point: &Point<'_>, parts: impl Iterator<Item = &'a DMatrix<f64>>, slot: usize) -> Option<Prior> {
    let total = point.layout.total();
    let mut rows = stack(parts, 0..=total);
    let shift = rows.columns(0, total) * point.first_estimate_offset();
    let mut residual = rows.column_mut(total);
    residual -= shift;
    Prior::eliminating(&rows, &point.layout, slot)
}

/// Sets missing first estimates of frames in the prior to the current state; removes first estimates of frames outside.
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
