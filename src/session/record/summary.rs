//! Summaries of steps, kept instead of complete steps when memory is short, and the order in which steps are
//! summarized.

use super::step::StepRecord;
use crate::estimator::StepReport;

/// Every n-th summary keeps its landmarks: the 3D scene draws landmarks of earlier steps.
const LANDMARKS_EVERY: usize = 4;
/// Number of newest steps that are never summarized, because they are shown most often.
const NEWEST_KEPT: usize = 64;

impl StepRecord {
    /// The step without features, older frames of the window, and (except in every fourth step) landmarks, which only
    /// drawings of this step need. If the step keeps its linearization, the window is kept, because the columns refer
    /// to its frames; so is the window of the first step after an initialization, because all poses and their
    /// covariances are relative to its oldest frame.
    ///
    /// All values that are plotted over time or written to tables are kept: events, χ², iterations, calibration, ranks.
    pub(in crate::session) fn summary(&self, number: usize) -> Self {
        let report = &self.report;
        let keeps_landmarks = number.is_multiple_of(LANDMARKS_EVERY);
        let initialized = report.events.iter().any(|event| event.kind.initializes_window());
        let keeps_window = report.linearization.is_some() || initialized;
        let first_frame = if keeps_window { 0 } else { report.window.len().saturating_sub(1) };
        Self {
            report: StepReport {
                frame_index: report.frame_index,
                stamp_ns: report.stamp_ns,
                phase: report.phase,
                restarts: report.restarts,
                pixel_sigmas_px: report.pixel_sigmas_px.clone(),
                effective_pixel_sigma_px: report.effective_pixel_sigma_px,
                loss_scales_px: report.loss_scales_px.clone(),
                events: report.events.clone(),
                window: report.window[first_frame..].to_vec(),
                newest_pose_covariance: report.newest_pose_covariance,
                calibration: report.calibration.clone(),
                features: Vec::new(),
                counts: report.counts,
                landmarks: if keeps_landmarks { report.landmarks.clone() } else { Vec::new() },
                residuals: report.residuals.clone(),
                reprojection_rms_before_px: report.reprojection_rms_before_px,
                reprojection_rms_after_px: report.reprojection_rms_after_px,
                reprojection_median_after_px: report.reprojection_median_after_px,
                iterations: report.iterations.clone(),
                linearization: report.linearization.clone(),
                // Not usable without the features.
                jacobian_source: None,
                factor_rows: None,
                gain: report.gain.clone(),
                keyframe: report.keyframe,
                times: report.times,
                warnings: report.warnings.clone(),
            },
            rank: self.rank.clone(),
            tracks: self.tracks.clone(),
            further_images: self.further_images.clone(),
            ground_truth: self.ground_truth,
            log_time_ns: self.log_time_ns,
            summary_only: true,
        }
    }
}

/// Order in which a run's steps are summarized, over the whole run: steps directly after a snapshot first, because
/// their recomputation is cheapest.
#[derive(Clone, Debug, Default)]
pub(super) struct SummaryOrder {
    /// Steps between two snapshots when the order was computed.
    spacing: usize,
    /// Next step to be summarized, by distance from the snapshot.
    next: Vec<usize>,
}

impl SummaryOrder {
    /// The next step to be summarized, `None` if only the newest ones are left.
    pub(super) fn next(&mut self, begin: usize, steps: usize, spacing: usize) -> Option<usize> {
        if self.spacing != spacing {
            self.spacing = spacing;
            let first = begin - begin % spacing;
            let own = |step: usize| if step < begin { step + spacing } else { step };
            self.next = (first..first + spacing).map(own).collect();
        }
        let end = steps.saturating_sub(NEWEST_KEPT);
        let next = self.next.iter_mut().find(|next| **next < end)?;
        let number = *next;
        *next += spacing;
        Some(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cheap_recomputations_go_first_and_the_newest_steps_stay() {
        let mut order = SummaryOrder::default();
        let mut numbers = |steps, spacing, count: usize| -> Vec<usize> {
            (0..count).map_while(|_| order.next(0, steps, spacing)).collect()
        };
        assert_eq!(numbers(40 + NEWEST_KEPT, 16, 5), [0, 16, 32, 1, 17]);
        assert_eq!(numbers(50 + NEWEST_KEPT, 16, 2), [48, 33]);
        // With fewer snapshots the order restarts, and returns steps that are already summarized.
        assert_eq!(numbers(50 + NEWEST_KEPT, 32, 3), [0, 32, 1]);
        assert_eq!(numbers(50 + NEWEST_KEPT, 32, 1000).len(), 50 - 3);
        assert!(numbers(NEWEST_KEPT, 32, 1).is_empty());
    }
}
