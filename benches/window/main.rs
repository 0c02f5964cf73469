//! What a window costs on a log: opening it, what is remembered of it, going back in it, and every picture of it.
//!
//! `cargo bench --bench window` plays the sample log with two runs at 1920×1080. Another log and other runs:
//! `cargo bench --bench window -- flight.mcap --run auto --run classical`, and `--budget-mib N` for the memory that the
//! recording may take. Pictures are drawn by the program itself, as they are without a graphics adapter.
//!
//! `--frames 12000` measures a long flight by a short log. What a recording may remember is as much less as the log is
//! shorter, so that the same share of steps is kept in outline and snapshots lie as far apart. For the pictures the steps
//! are repeated until there are so many, each a copy of its own with later stamps.
//!
//! `--study 10000` measures the view of a made-up study of so many runs instead.

mod figures;
mod frames;
mod long;
mod opening;
#[path = "../shared/mod.rs"]
mod shared;
mod study;
#[path = "../../tests/it/study_sample.rs"]
mod study_sample;
mod travel;

use std::path::PathBuf;
use std::sync::Arc;
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use dcvins::flight_log::ImageReader;
use dcvins::session::{RunSpec, Session, SessionPlan, SessionRequest};

use figures::Table;
use frames::Player;

/// What is measured.
struct Arguments {
    log: PathBuf,
    runs: Vec<RunSpec>,
    budget_mib: Option<usize>,
    /// Frames of the long flight that is measured.
    frames: Option<usize>,
    /// Runs of the study that is measured instead.
    study: Option<usize>,
}

impl Arguments {
    fn read(words: impl Iterator<Item = String>) -> Result<Self> {
        let mut log = None;
        let mut runs = Vec::new();
        let mut budget_mib = None;
        let mut frames = None;
        let mut study = None;
        let mut words = words;
        while let Some(word) = words.next() {
            let mut value = |what: &str| words.next().with_context(|| format!("{word} needs {what}"));
            match word.as_str() {
                // Cargo says so to every bench.
                "--bench" => {}
                "--run" => runs.push(value("the name of a run")?.parse()?),
                "--budget-mib" => budget_mib = Some(value("a number of MiB")?.parse()?),
                "--study" => study = Some(value("a number of runs")?.parse()?),
                "--frames" => frames = Some(value("a number of frames")?.parse()?),
                path if !path.starts_with('-') && log.is_none() => log = Some(PathBuf::from(path)),
                other => {
                    bail!(
                        "'{other}' is not understood: expected LOG.mcap, --run SPEC, --budget-mib N, --frames N or --study N"
                    )
                }
            }
        }
        if runs.is_empty() {
            runs = ["auto", "classical"].map(str::parse).into_iter().collect::<Result<_, _>>()?;
        }
        let sample = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
        Ok(Self { log: log.unwrap_or_else(sample), runs, budget_mib, frames, study })
    }

    fn plan(&self) -> Result<SessionPlan> {
        let request =
            SessionRequest { log_path: self.log.clone(), specs: self.runs.clone(), ..SessionRequest::default() };
        let mut plan = SessionPlan::open(&request)?;
        if let Some(budget_mib) = self.budget_mib {
            plan.memory_budget_bytes = budget_mib << 20;
        }
        if let Some(frames) = self.frames {
            let images = ImageReader::new(Arc::clone(&plan.log), &plan.rig).count(&plan.runs[0].1);
            plan.memory_budget_bytes = (plan.memory_budget_bytes as f64 * images as f64 / frames as f64) as usize;
        }
        Ok(plan)
    }
}

#[expect(clippy::print_stdout, reason = "a bench prints what it measured")]
fn main() -> Result<()> {
    let arguments = Arguments::read(std::env::args().skip(1))?;
    if let Some(runs) = arguments.study {
        println!("{}", study::measure(runs)?);
        return Ok(());
    }
    println!("{}", opening::measure(&arguments)?);

    let plan = arguments.plan()?;
    let mut session = Session::start(plan.clone())?;
    while session.recording().runs.iter().any(|run| !run.finished) {
        sleep(Duration::from_millis(50));
    }
    println!("{}", travel::memory(&session));
    let mut player = Player::new(&plan);
    println!("{}", travel::measure(&mut session, &mut player));
    let mut recording = session.recording();
    if let Some(frames) = arguments.frames {
        recording = Arc::new(long::lengthened(&session.computation(), frames));
        println!("{}", long::memory(&recording));
    }
    println!("{}", frames::measure(&recording, &mut player));
    Ok(())
}
