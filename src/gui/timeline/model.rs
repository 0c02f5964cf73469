//! The content of the lanes, read from the steps incrementally.

use crate::estimator::{EventKind, Phase};
use crate::gui::derived::follow::Follower;
use crate::gui::residuals::rms_px;
use crate::session::RunRecord;

/// An event with its position in the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TimedEvent {
    pub(crate) stamp_ns: i64,
    pub(crate) kind: EventKind,
    pub(crate) step: usize,
    pub(crate) event: usize,
}

/// Columns of a run's table.
pub(crate) const FEATURES: usize = 0;
pub(crate) const RMS: usize = 1;
pub(crate) const INFORMED: usize = 2;
pub(crate) const STRUCTURAL: usize = 3;
pub(crate) const COLUMNS: usize = 4;

#[derive(Debug, Default)]
pub(crate) struct RunLanes {
    follower: Follower,
    pub(crate) stamps_ns: Vec<i64>,
    /// Values of the steps by column; NaN where unknown.
    pub(crate) columns: [Vec<f64>; COLUMNS],
    /// True for each step in the tracking phase.
    pub(crate) tracking: Vec<bool>,
    pub(crate) keyframes_ns: Vec<i64>,
    pub(crate) events: Vec<TimedEvent>,
    /// Steps with rejected outliers: stamp and number of rejected features.
    pub(crate) rejected: Vec<(i64, usize)>,
    /// Steps with warnings: stamp and index.
    pub(crate) warnings: Vec<(i64, usize)>,
    /// Changes when steps are removed.
    pub(crate) epoch: u64,
}

impl RunLanes {
    /// Reads the steps that are new since the last call.
    pub(crate) fn read(&mut self, run: &RunRecord) {
        let new_steps = self.follower.new_steps(run);
        if new_steps.restarted {
            let epoch = self.epoch + 1;
            *self = Self { follower: std::mem::take(&mut self.follower), epoch, ..Self::default() };
        }
        for step in new_steps.steps {
            let report = &step.report;
            let (stamp_ns, number) = (report.stamp_ns, self.stamps_ns.len());
            self.stamps_ns.push(stamp_ns);
            self.tracking.push(report.phase == Phase::Tracking);
            let rank = step.rank.as_ref().filter(|rank| !rank.parameters.is_empty());
            let row = [
                step.feature_count() as f64,
                rms_px(report),
                rank.map_or(f64::NAN, |rank| rank.rank_informed as f64),
                rank.map_or(f64::NAN, |rank| rank.rank_structural as f64),
            ];
            for (column, value) in self.columns.iter_mut().zip(row) {
                column.push(value);
            }
            if report.keyframe {
                self.keyframes_ns.push(stamp_ns);
            }
            let rejected = report.counts.rejected;
            if rejected > 0 {
                self.rejected.push((stamp_ns, rejected));
            }
            if !report.warnings.is_empty() {
                self.warnings.push((stamp_ns, number));
            }
            let events = report.events.iter().enumerate().filter(|(_, event)| event.kind.is_notable());
            self.events.extend(events.map(|(event, one)| TimedEvent { stamp_ns, kind: one.kind, step: number, event }));
        }
    }

    /// The value of a column at the last step at or before a stamp.
    pub(crate) fn at(&self, column: usize, stamp_ns: i64) -> Option<f64> {
        let row = self.stamps_ns.partition_point(|stamp| *stamp <= stamp_ns).checked_sub(1)?;
        self.columns[column].get(row).copied().filter(|value| value.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::{first_tracked_frame, sample_recording_of};

    #[test]
    fn lanes_have_the_values_of_the_steps() {
        let recording = sample_recording_of(first_tracked_frame() + 20, &["auto"]);
        let run = &recording.runs[0];
        let mut lanes = RunLanes::default();
        lanes.read(run);
        lanes.read(run);
        assert_eq!(lanes.stamps_ns.len(), run.steps.len());
        assert_eq!(lanes.tracking.iter().filter(|tracking| **tracking).count(), 20);
        let initialized = lanes.events.iter().find(|event| event.kind == EventKind::InitializedFromMotion).unwrap();
        assert_eq!(initialized.step, first_tracked_frame());
        assert!(lanes.keyframes_ns.len() > 2);
        assert_eq!(lanes.at(INFORMED, 0), None);
        assert!(lanes.at(FEATURES, recording.duration_ns).unwrap() > 60.0);
        let mut other = run.clone();
        other.steps.truncate(3);
        lanes.read(&other);
        assert_eq!((lanes.stamps_ns.len(), lanes.epoch, lanes.events.len()), (3, 1, 0));
    }
}
