//! The breakpoints of a session and their hits.

use std::collections::BTreeMap;

use super::condition::{Condition, NamedValue, StepContext};
use crate::gimbal::ParameterNames;
use crate::session::record::{Recording, RunRecord};

/// A step in which the condition of a breakpoint became true.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hit {
    /// Stamp of the step, in nanoseconds since the log began.
    pub stamp_ns: i64,
    pub run: usize,
    pub step: usize,
    pub breakpoint: usize,
}

/// The steps of one run that a breakpoint has been evaluated over, and its hits.
#[derive(Clone, Debug, Default, PartialEq)]
struct RunHits {
    read: usize,
    was_true: bool,
    /// Stamp and index of each step in which the condition became true.
    hits: Vec<(i64, usize)>,
}

/// A condition at which the cursor stops.
#[derive(Clone, Debug, PartialEq)]
pub struct Breakpoint {
    /// Condition that triggers the breakpoint when it becomes true.
    pub condition: Condition,
    /// True if the cursor stops at its hits.
    pub enabled: bool,
    /// Hits of each run by [`RunRecord::id`].
    tracks: BTreeMap<u64, RunHits>,
}

impl Breakpoint {
    /// An enabled breakpoint that has not been evaluated yet.
    pub fn new(condition: Condition) -> Self {
        Self { condition, enabled: true, tracks: BTreeMap::new() }
    }

    /// Number of hits in a run so far.
    pub fn hit_count(&self, run: &RunRecord) -> usize {
        self.tracks.get(&run.id).map_or(0, |track| track.hits.len())
    }

    /// Stamps of the hits in a run so far, in ascending order.
    pub fn hits_ns(&self, run: &RunRecord) -> impl Iterator<Item = i64> {
        self.tracks.get(&run.id).into_iter().flat_map(|track| track.hits.iter().map(|(stamp_ns, _)| *stamp_ns))
    }

    fn read(&mut self, runs: &[RunRecord], names: &ParameterNames) {
        self.tracks.retain(|id, _| runs.iter().any(|run| run.id == *id));
        for run in runs {
            let track = self.tracks.entry(run.id).or_default();
            for number in track.read..run.steps.len() {
                let was_true =
                    context(run, number, names).and_then(|context| self.condition.holds(&context)) == Some(true);
                if was_true && !track.was_true {
                    track.hits.push((run.steps[number].report.stamp_ns, number));
                }
                track.was_true = was_true;
            }
            track.read = run.steps.len();
        }
    }
}

/// A step and the step before it.
fn context<'a>(run: &'a RunRecord, number: usize, names: &'a ParameterNames) -> Option<StepContext<'a>> {
    let previous = number.checked_sub(1).and_then(|before| run.steps.get(before));
    Some(StepContext { step: run.steps.get(number)?, previous: previous.map(|step| &**step), names })
}

/// All breakpoints, evaluated over the steps computed so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Breakpoints {
    list: Vec<Breakpoint>,
}

impl Breakpoints {
    /// The breakpoints in the order in which they were set.
    pub fn list(&self) -> &[Breakpoint] {
        &self.list
    }

    /// Appends an enabled breakpoint with this condition.
    pub fn add(&mut self, condition: Condition) {
        self.list.push(Breakpoint::new(condition));
    }

    pub fn remove(&mut self, number: usize) {
        if number < self.list.len() {
            self.list.remove(number);
        }
    }

    /// Appends a breakpoint, or removes the one with the same text.
    pub fn toggle(&mut self, condition: Condition) {
        match self.list.iter().position(|known| known.condition.text() == condition.text()) {
            Some(number) => self.remove(number),
            None => self.add(condition),
        }
    }

    /// Replaces the condition of a breakpoint; its hits are evaluated again.
    pub fn change(&mut self, number: usize, condition: Condition) {
        if let Some(breakpoint) = self.list.get_mut(number) {
            *breakpoint = Breakpoint { enabled: breakpoint.enabled, ..Breakpoint::new(condition) };
        }
    }

    pub fn enable(&mut self, number: usize, enabled: bool) {
        if let Some(breakpoint) = self.list.get_mut(number) {
            breakpoint.enabled = enabled;
        }
    }

    /// Evaluates all breakpoints over the new steps.
    pub fn read(&mut self, recording: &Recording) {
        let names = recording.rig.parameter_names();
        for breakpoint in &mut self.list {
            breakpoint.read(&recording.runs, &names);
        }
    }

    /// True if there are steps that have not been evaluated.
    pub fn is_behind(&self, recording: &Recording) -> bool {
        let read = |breakpoint: &Breakpoint, run: &RunRecord| breakpoint.tracks.get(&run.id).map(|track| track.read);
        self.list.iter().any(|breakpoint| {
            breakpoint.tracks.len() != recording.runs.len()
                || recording.runs.iter().any(|run| read(breakpoint, run) != Some(run.steps.len()))
        })
    }

    /// Hits of the enabled breakpoints in all runs, unordered.
    fn hits<'a>(&'a self, recording: &'a Recording) -> impl Iterator<Item = Hit> + 'a {
        let enabled = self.list.iter().enumerate().filter(|(_, breakpoint)| breakpoint.enabled);
        enabled.flat_map(|(number, breakpoint)| {
            recording.runs.iter().enumerate().flat_map(move |(run, record)| {
                let hits = breakpoint.tracks.get(&record.id).map_or(&[][..], |track| &track.hits);
                hits.iter().map(move |(stamp_ns, step)| Hit {
                    stamp_ns: *stamp_ns,
                    run,
                    step: *step,
                    breakpoint: number,
                })
            })
        })
    }

    /// The first hit of an enabled breakpoint after a stamp.
    pub fn next_after(&self, recording: &Recording, stamp_ns: i64) -> Option<Hit> {
        let after = self.hits(recording).filter(|hit| hit.stamp_ns > stamp_ns);
        after.min_by_key(|hit| (hit.stamp_ns, hit.run, hit.breakpoint))
    }

    /// The last hit of an enabled breakpoint before a stamp.
    pub fn last_before(&self, recording: &Recording, stamp_ns: i64) -> Option<Hit> {
        let before = self.hits(recording).filter(|hit| hit.stamp_ns < stamp_ns);
        before.min_by_key(|hit| (std::cmp::Reverse(hit.stamp_ns), hit.run, hit.breakpoint))
    }

    /// The quantities of the breakpoint's condition with their values in the step of the hit.
    pub fn values_at(&self, recording: &Recording, hit: Hit) -> Vec<NamedValue> {
        let run = recording.runs.get(hit.run);
        let names = recording.rig.parameter_names();
        let context = run.and_then(|run| context(run, hit.step, &names));
        let breakpoint = self.list.get(hit.breakpoint);
        breakpoint.zip(context).map_or_else(Vec::new, |(breakpoint, context)| breakpoint.condition.values(&context))
    }

    /// One line of text: `rank < 18 in auto at 4.250 s, frame 85: rank = 17`.
    pub fn describe(&self, recording: &Recording, hit: Hit) -> String {
        let Some((breakpoint, run)) = self.list.get(hit.breakpoint).zip(recording.runs.get(hit.run)) else {
            return String::new();
        };
        let frame = run.steps.get(hit.step).map_or_else(String::new, |step| step.report.frame_name());
        let time_s = crate::geometry::seconds_from_ns(hit.stamp_ns);
        let values = self.values_at(recording, hit);
        let values: Vec<String> = values.iter().map(NamedValue::to_string).collect();
        let values = if values.is_empty() { String::new() } else { format!(": {}", values.join(", ")) };
        format!("{} in {} at {time_s:.3} s, frame {frame}{values}", breakpoint.condition, run.spec.label)
    }
}

impl std::fmt::Display for NamedValue {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.value {
            Some(value) if value.fract() == 0.0 && value.abs() < 1e9 => write!(formatter, "{} = {value}", self.name),
            Some(value) if (1e-3..1e6).contains(&value.abs()) => write!(formatter, "{} = {value:.4}", self.name),
            Some(value) => write!(formatter, "{} = {value:.3e}", self.name),
            None => write!(formatter, "{} is missing", self.name),
        }
    }
}
