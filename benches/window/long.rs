//! Long recording made from a short one.

use std::sync::Arc;

use dcvins::desktop::Machine;
use dcvins::gui::desktop::Desktop as _;
use dcvins::session::{Computation, Recording, RunRecord, StepRecord};

use super::Table;
use super::figures::{kib, mib};

/// Recording with its steps repeated, one copy after the other, until every run has `frames` steps.
///
/// No step is a summary: the recording has the size of one with all steps.
pub(crate) fn lengthened(computation: &Computation, frames: usize) -> Recording {
    let mut recording = Recording::clone(computation.recording());
    let period_ns = recording.duration_ns;
    let runs = (0..recording.runs.len()).map(|run| lengthened_run(computation, run, period_ns, frames));
    recording.runs = runs.collect();
    recording.duration_ns = recording.last_stamp_ns();
    recording
}

fn lengthened_run(computation: &Computation, number: usize, period_ns: i64, frames: usize) -> RunRecord {
    let run = &computation.recording().runs[number];
    let mut long = RunRecord::new(run.spec.clone(), run.camera_key.clone());
    long.finished = true;
    let whole: Vec<Arc<StepRecord>> =
        (0..run.steps.len()).filter_map(|step| computation.whole_step(number, step)).collect();
    for frame in 0..frames {
        let Some(step) = whole.get(frame % whole.len().max(1)) else { break };
        let later_ns = period_ns * (frame / whole.len()) as i64;
        let mut copy = StepRecord::clone(step);
        copy.tracks = Arc::new((*step.tracks.frame()).clone()).into();
        copy.report.stamp_ns += later_ns;
        copy.log_time_ns += later_ns;
        for frame in &mut copy.report.window {
            frame.stamp_ns += later_ns;
        }
        long.push(copy);
    }
    long
}

/// Memory of the recording.
pub(crate) fn memory(recording: &Recording) -> Table {
    let mut table = Table::new("Memory of the long recording, every step in full", &["quantity", "value"]);
    table.row("recording, without snapshots", [mib(recording.memory_bytes())]);
    let process = Machine::new().resident_bytes();
    table.row("whole process", [process.map_or_else(|| "unknown".to_owned(), |bytes| mib(bytes as usize))]);
    for run in &recording.runs {
        let steps = run.steps.len().max(1);
        let figure =
            format!("{} steps of {} and {}", steps, kib(run.memory.steps / steps), kib(run.memory.tracks / steps));
        table.row(format!("{}: steps, their tracks", run.spec.label), [figure]);
    }
    table
}
