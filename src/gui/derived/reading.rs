//! Times and value ranges at which all plots are read: the pointer's time, two reading cursors, lines of events.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::follow::Follower;
use crate::estimator::EventKind;
use crate::session::{RunRecord, StepRecord};

/// One of the two reading cursors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadingCursor {
    A,
    B,
}

impl ReadingCursor {
    pub(crate) const ALL: [Self; 2] = [Self::A, Self::B];

    pub(crate) const fn letter(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
        }
    }
}

/// Settings of reading that all plots share. Stamps are in nanoseconds since the log began.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// Time under the pointer in the plot that it is over; independent of the playback cursor.
    pub(crate) pointer_ns: Option<i64>,
    cursors_ns: [Option<i64>; 2],
    /// Value ranges that do not follow the data, by plot, in stored units.
    pub(crate) fixed_values: BTreeMap<String, [f64; 2]>,
    /// Events that all plots show as vertical lines; empty while that is off.
    pub(crate) events: Arc<Vec<EventLine>>,
}

impl Reading {
    /// Stamp of a reading cursor; `None` if it is not set.
    pub fn cursor_ns(&self, cursor: ReadingCursor) -> Option<i64> {
        self.cursors_ns[cursor as usize]
    }

    pub fn set_cursor(&mut self, cursor: ReadingCursor, stamp_ns: i64) {
        self.cursors_ns[cursor as usize] = Some(stamp_ns);
    }

    pub fn clear_cursors(&mut self) {
        self.cursors_ns = [None; 2];
    }

    /// Fixes the value range of a plot, or removes a fixed one.
    pub(crate) fn toggle_fixed(&mut self, key: &str, range: [f64; 2]) {
        if self.fixed_values.remove(key).is_none() {
            self.fixed_values.insert(key.to_owned(), range);
        }
    }

    /// Stamp of B minus stamp of A; `None` unless both are set.
    pub fn interval_ns(&self) -> Option<i64> {
        let [from_ns, to_ns] = self.cursors_ns;
        Some(to_ns? - from_ns?)
    }
}

/// Vertical line of an event in all plots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EventLine {
    pub(crate) stamp_ns: i64,
    pub(crate) kind: EventLineKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EventLineKind {
    Event(EventKind),
    /// The informed rank is lower than in the step before.
    RankLoss,
}

/// Events and rank losses of all runs, read incrementally.
#[derive(Debug, Default)]
pub(crate) struct EventLines {
    runs: Vec<RunEvents>,
    lines: Arc<Vec<EventLine>>,
}

#[derive(Debug, Default)]
struct RunEvents {
    follower: Follower,
    /// Informed rank and number of parameters of the last step with a rank.
    rank: Option<(usize, usize)>,
    lines: Vec<EventLine>,
}

impl EventLines {
    /// Lines of all runs, in the order of the runs.
    pub(crate) fn read(&mut self, runs: &[RunRecord]) -> Arc<Vec<EventLine>> {
        let mut changed = self.runs.len() != runs.len();
        self.runs.resize_with(runs.len(), RunEvents::default);
        for (events, run) in self.runs.iter_mut().zip(runs) {
            changed |= events.read(run);
        }
        if changed {
            self.lines = Arc::new(self.runs.iter().flat_map(|run| run.lines.iter().copied()).collect());
        }
        Arc::clone(&self.lines)
    }
}

impl RunEvents {
    /// Reads the new steps of a run; returns whether the lines have changed.
    fn read(&mut self, run: &RunRecord) -> bool {
        let new_steps = self.follower.new_steps(run);
        let before = self.lines.len();
        if new_steps.restarted {
            (self.rank, self.lines) = (None, Vec::new());
        }
        for step in new_steps.steps {
            let stamp_ns = step.report.stamp_ns;
            let events = step.report.events.iter().filter(|event| event.kind.is_notable());
            self.lines.extend(events.map(|event| EventLine { stamp_ns, kind: EventLineKind::Event(event.kind) }));
            if let Some(rank) = rank_of(step) {
                // Another number of parameters is another parameterization, whose rank is not comparable.
                if self.rank.is_some_and(|(informed, count)| count == rank.1 && rank.0 < informed) {
                    self.lines.push(EventLine { stamp_ns, kind: EventLineKind::RankLoss });
                }
                self.rank = Some(rank);
            }
        }
        new_steps.restarted || self.lines.len() != before
    }
}

fn rank_of(step: &StepRecord) -> Option<(usize, usize)> {
    let rank = step.rank.as_ref().filter(|rank| !rank.parameters.is_empty())?;
    Some((rank.rank_informed, rank.parameters.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording_of;

    #[test]
    fn events_and_rank_losses_are_lines() {
        let recording = sample_recording_of(120, &["auto"]);
        let run = &recording.runs[0];
        let mut lines = EventLines::default();
        let found = lines.read(&recording.runs);
        let ranks: Vec<(i64, usize)> =
            run.steps.iter().filter_map(|step| Some((step.report.stamp_ns, rank_of(step)?.0))).collect();
        let losses: Vec<i64> = ranks.windows(2).filter(|pair| pair[1].1 < pair[0].1).map(|pair| pair[1].0).collect();
        let of_kind = |kind: EventLineKind| -> Vec<i64> {
            found.iter().filter(|line| line.kind == kind).map(|line| line.stamp_ns).collect()
        };
        assert_eq!(of_kind(EventLineKind::RankLoss), losses);
        assert_eq!(of_kind(EventLineKind::Event(EventKind::InitializedFromMotion)).len(), 1);
        // Nothing new: the same list is returned.
        assert!(Arc::ptr_eq(&lines.read(&recording.runs), &found));
        assert!(lines.read(&[]).is_empty());
    }

    #[test]
    fn the_interval_is_from_a_to_b() {
        let mut reading = Reading::default();
        reading.set_cursor(ReadingCursor::B, 2_000_000_000);
        assert_eq!(reading.interval_ns(), None);
        reading.set_cursor(ReadingCursor::A, 3_500_000_000);
        assert_eq!(reading.interval_ns(), Some(-1_500_000_000));
        reading.clear_cursors();
        assert_eq!(ReadingCursor::ALL.map(|cursor| reading.cursor_ns(cursor)), [None, None]);
    }
}
