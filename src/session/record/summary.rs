//! What is kept of a step when memory runs short, and which steps that befalls.

use super::recording::StepRecord;
use crate::estimator::StepReport;

/// Every so many steps the points of the map stay, for the scene that draws those of earlier steps.
const LANDMARKS_EVERY: usize = 4;
/// So many of the newest steps are left alone: people look at them.
const SPARED: usize = 64;

impl StepRecord {
    /// The step without what only the pictures of this very instant need: features, older frames of the window, and
    /// points of the map but in every fourth step. A linearization that was asked for keeps its window, whose frames its
    /// columns belong to.
    ///
    /// Everything that is plotted over time or written into tables stays; events, χ², iterations, calibration, ranks.
    pub(in crate::session) fn outline(&self, number: usize) -> Self {
        let report = &self.report;
        let keeps_landmarks = number.is_multiple_of(LANDMARKS_EVERY);
        let keeps_window = report.linearization.is_some();
        let first_frame = if keeps_window { 0 } else { report.window.len().saturating_sub(1) };
        Self {
            report: StepReport {
                frame_index: report.frame_index,
                stamp_ns: report.stamp_ns,
                phase: report.phase,
                restarts: report.restarts,
                pixel_sigma_px: report.pixel_sigma_px,
                effective_pixel_sigma_px: report.effective_pixel_sigma_px,
                events: report.events.clone(),
                window: report.window[first_frame..].to_vec(),
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
                // Worth nothing without the features.
                jacobian_source: None,
                factor_rows: None,
                gain: report.gain.clone(),
                keyframe: report.keyframe,
                times: report.times,
                warnings: report.warnings.clone(),
            },
            rank: self.rank.clone(),
            tracks: std::sync::Arc::clone(&self.tracks),
            truth: self.truth,
            log_time_ns: self.log_time_ns,
            outlined: true,
        }
    }
}

/// Which steps of a run are kept in outline: those that are the quickest to take again first, right behind a snapshot,
/// all over the run.
#[derive(Clone, Debug, Default)]
pub(in crate::session) struct Thinning {
    /// Steps between two snapshots when the order was made.
    spacing: usize,
    /// By distance from the snapshot, the next step to be outlined.
    next: Vec<usize>,
}

impl Thinning {
    /// The step that is to be outlined next, `None` when only spared ones are left.
    pub(in crate::session) fn next_victim(&mut self, begin: usize, steps: usize, spacing: usize) -> Option<usize> {
        if self.spacing != spacing {
            self.spacing = spacing;
            let first = begin - begin % spacing;
            let own = |step: usize| if step < begin { step + spacing } else { step };
            self.next = (first..first + spacing).map(own).collect();
        }
        let end = steps.saturating_sub(SPARED);
        let next = self.next.iter_mut().find(|next| **next < end)?;
        let victim = *next;
        *next += spacing;
        Some(victim)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_quick_to_take_again_goes_first_and_the_newest_steps_stay() {
        let mut thinning = Thinning::default();
        let mut victims = |steps, spacing, count: usize| -> Vec<usize> {
            (0..count).map_while(|_| thinning.next_victim(0, steps, spacing)).collect()
        };
        assert_eq!(victims(40 + SPARED, 16, 5), [0, 16, 32, 1, 17]);
        assert_eq!(victims(50 + SPARED, 16, 2), [48, 33]);
        // Fewer snapshots: the order begins anew, and steps that are outlined already come by again.
        assert_eq!(victims(50 + SPARED, 32, 3), [0, 32, 1]);
        assert_eq!(victims(50 + SPARED, 32, 1000).len(), 50 - 3);
        assert!(victims(SPARED, 32, 1).is_empty());
    }
}
