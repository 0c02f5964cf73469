//! Memory of the recording of a log, and the time to seek backwards in it.

use dcvins::desktop::Machine;
use dcvins::geometry::SplitMix64;
use dcvins::gui::desktop::Desktop as _;
use dcvins::session::{Command, Session, Stopwatch};

use super::Table;
use super::figures::{Times, kib, mib};
use super::frames::Player;

/// Steps back from each position.
const STEPS_BACK: usize = 200;
/// Number of seeks to any frame.
const JUMPS: usize = 100;
/// Number of steps of a run that are recomputed from the snapshot before them.
const RECOMPUTED: usize = 100;

/// Memory of the recording.
pub(crate) fn memory(session: &Session) -> Table {
    let computation = session.computation();
    let recording = computation.recording();
    let budget = mib(recording.memory_budget_bytes);
    let mut table = Table::new(format!("Memory, limit of the recording {budget}"), &["quantity", "value"]);
    table.row("recording", [mib(recording.memory_bytes())]);
    let process = Machine::new().resident_bytes();
    table.row("whole process", [process.map_or_else(|| "unknown".to_owned(), |bytes| mib(bytes as usize))]);
    for (number, run) in recording.runs.iter().enumerate() {
        let label = &run.spec.label;
        let steps = run.steps.len().max(1);
        let summaries = run.memory.summaries;
        table.row(format!("{label}: steps, of them summaries"), [format!("{}, {summaries}", run.steps.len())]);
        let whole: Vec<usize> =
            run.steps.iter().filter(|step| !step.summary_only).map(|step| step.own_bytes()).collect();
        let of_summaries: Vec<usize> =
            run.steps.iter().filter(|step| step.summary_only).map(|step| step.own_bytes()).collect();
        let mean = |bytes: &[usize]| kib(bytes.iter().sum::<usize>() / bytes.len().max(1));
        table.row(format!("{label}: a full step, a summary"), [format!("{}, {}", mean(&whole), mean(&of_summaries))]);
        table.row(format!("{label}: tracks of a step"), [kib(run.memory.tracks / steps)]);
        if let Some(snapshots) = computation.snapshots(number) {
            let each = kib(snapshots.bytes / snapshots.count.max(1));
            let text = format!("{} of {each}, every {} steps", snapshots.count, snapshots.spacing);
            table.row(format!("{label}: snapshots"), [text]);
        }
    }
    table
}

/// Measures steps back and seeks, each until all data of the step are available, and until the window shows them.
pub(crate) fn measure(session: &mut Session, player: &mut Player) -> Table {
    let mut table = Table::new(
        "Seeking backwards, in ms: until the step is complete, until the window shows it",
        &["action", "step p50", "p95", "largest", "frame p50", "p95", "largest"],
    );
    let recording = session.recording();
    let Some(run) = recording.runs.first() else { return table };
    let stamps_ns: Vec<i64> = run.steps.iter().map(|step| step.report.stamp_ns).collect();
    if stamps_ns.is_empty() {
        return table;
    }
    let mut go = |times: &mut [Times; 2], command: Command| {
        let watch = Stopwatch::start();
        session.apply(command);
        session.settle();
        times[0].add(&watch);
        player.draw(&session.recording(), session.cursor_ns());
        times[1].add(&watch);
    };
    let cells = |times: &[Times; 2]| times.iter().flat_map(Times::cells).collect::<Vec<_>>();
    for (name, place) in [
        ("one frame back, from the end", stamps_ns.len() - 1),
        ("one frame back, from the middle", stamps_ns.len() / 2),
    ] {
        // The time of the first seek is not measured, and panels read a long recording once.
        go(&mut <[Times; 2]>::default(), Command::Seek { stamp_ns: stamps_ns[place] });
        let mut times = <[Times; 2]>::default();
        for _ in 0..STEPS_BACK.min(place) {
            go(&mut times, Command::StepFrames(-1));
        }
        table.row(name, cells(&times));
    }
    let mut random = SplitMix64::new(5);
    let mut any = || (random.next_u64() % stamps_ns.len() as u64) as usize;
    let mut times = <[Times; 2]>::default();
    for _ in 0..JUMPS {
        go(&mut times, Command::Seek { stamp_ns: stamps_ns[any()] });
    }
    table.row("a seek to any frame", cells(&times));
    let computation = session.computation();
    let mut times = Times::default();
    for _ in 0..RECOMPUTED {
        let step = any();
        times.take(|| computation.recompute(0, step, 1));
    }
    table.row("a recomputed step", times.cells());
    table
}
