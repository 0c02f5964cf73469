//! A long recording from a short one.

use std::sync::Arc;

use dcvins::export::Machine;
use dcvins::gui::desktop::Desktop as _;
use dcvins::session::{Recording, RunRecord, StepRecord};

use super::Table;
use super::figures::{kib, mib};

/// The recording with its steps repeated, one copy after the other, until every run has so many.
///
/// Nothing is kept in outline: it is what a recording takes that remembers everything.
pub(crate) fn lengthened(recording: &Recording, frames: usize) -> Recording {
    let mut recording = recording.clone();
    let period_ns = recording.duration_ns;
    recording.runs = recording.runs.iter().map(|run| lengthened_run(run, period_ns, frames)).collect();
    recording.duration_ns = recording.last_stamp_ns();
    recording
}

fn lengthened_run(run: &RunRecord, period_ns: i64, frames: usize) -> RunRecord {
    let mut long = RunRecord::new(run.spec.clone(), run.camera_key.clone());
    long.finished = true;
    let whole: Vec<Arc<StepRecord>> = (0..run.steps.len()).filter_map(|step| run.whole_step(step)).collect();
    for number in 0..frames {
        let Some(step) = whole.get(number % whole.len().max(1)) else { break };
        let later_ns = period_ns * (number / whole.len()) as i64;
        let mut copy = StepRecord::clone(step);
        copy.tracks = Arc::new((*step.tracks).clone());
        copy.report.stamp_ns += later_ns;
        copy.log_time_ns += later_ns;
        for frame in &mut copy.report.window {
            frame.stamp_ns += later_ns;
        }
        long.push(copy);
    }
    long
}

/// What it takes.
pub(crate) fn memory(recording: &Recording) -> Table {
    let mut table = Table::new("Memory of the long recording, every step whole", &["what", "figure"]);
    table.row("recording, without snapshots", [mib(recording.memory_bytes())]);
    let process = Machine::new().resident_bytes();
    table.row("whole process", [process.map_or_else(|| "not known".to_owned(), |bytes| mib(bytes as usize))]);
    for run in &recording.runs {
        let steps = run.steps.len().max(1);
        let figure =
            format!("{} steps of {} and {}", steps, kib(run.memory.own / steps), kib(run.memory.tracks / steps));
        table.row(format!("{}: steps, their tracks", run.spec.label), [figure]);
    }
    table
}
