//! Time by stage, processor time per frame, memory.

use std::fs;
use std::time::Instant;

use anyhow::Result;
use dcvins::export::{RunSummary, StageSummary, TimingSummary, summarize};
use dcvins::session::{self, SessionPlan, SessionRequest};
use dcvins::simulation::Experiment;

use crate::logs::Archive;
use crate::shared::process::cpu_s;
use crate::table::{Table, number};

/// One run alone over a flight.
struct Timed {
    spec: &'static str,
    summary: RunSummary,
    frames: usize,
    log_s: f64,
    wall_s: f64,
    cpu_s: Option<f64>,
    peak_mib: Option<f64>,
}

/// Flies T1 with one run at a time.
pub(crate) fn fly(archive: &Archive, seed: u64, duration_s: Option<f64>) -> Result<Table> {
    let log = archive.flight(Experiment::T1, seed, duration_s)?;
    let mut timed = Vec::new();
    for spec in ["auto", "static"] {
        let request = SessionRequest {
            log_path: log.path.clone(),
            specs: vec![spec.parse()?],
            duration_s: Some(log.duration_s),
            ..SessionRequest::default()
        };
        let (begin, cpu_before_s) = (Instant::now(), cpu_s());
        let plan = SessionPlan::open(&request)?;
        let recording = session::compute(&plan, None, &mut |_| ())?.into_recording();
        timed.push(Timed {
            spec,
            frames: recording.runs[0].steps.len(),
            log_s: log.duration_s,
            wall_s: begin.elapsed().as_secs_f64(),
            cpu_s: cpu_s().zip(cpu_before_s).map(|(after, before)| after - before),
            peak_mib: peak_memory_mib(),
            summary: summarize(&recording, &recording.runs[0], true),
        });
    }
    Ok(table(&timed))
}

fn table(timed: &[Timed]) -> Table {
    let mut table = Table::new(
        "speed",
        "Speed: one run alone over T1, ms per image p50 / p95 (wall clock, whatever else the machine does), and the \
         process's processor time",
        &[
            "run",
            "images",
            "front end",
            "optimize",
            "linearize",
            "marginalize",
            "observability",
            "report",
            "step",
            "CPU ms per image",
            "× real time",
            "largest memory MiB",
        ],
    );
    for run in timed {
        let stage = |pick: fn(&TimingSummary) -> &StageSummary| {
            let timing = run.summary.timing_ms.as_ref().map(pick);
            timing.map_or_else(String::new, |stage| format!("{:.1} / {:.1}", stage.p50, stage.p95))
        };
        table.row([
            run.spec.to_owned(),
            run.frames.to_string(),
            stage(|timing| &timing.frontend),
            stage(|timing| &timing.optimize),
            stage(|timing| &timing.linearize),
            stage(|timing| &timing.marginalize),
            stage(|timing| &timing.observability),
            stage(|timing| &timing.report),
            stage(|timing| &timing.step),
            number(run.cpu_s.map(|cpu_s| 1e3 * cpu_s / run.frames.max(1) as f64), 1),
            format!("{:.2}", run.log_s / run.wall_s),
            number(run.peak_mib, 0),
        ]);
    }
    table
        .notes
        .push("The largest memory is that of the process so far, with all steps of the flights kept.".to_owned());
    table
}

/// Largest resident memory so far, where the system tells it.
fn peak_memory_mib() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<f64>().ok()? / 1024.0)
}
