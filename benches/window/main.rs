//! Costs of the window on a log: opening it, memory of the recording, seeking backwards, and every frame.
//!
//! `cargo bench --bench window` plays the sample log with two runs at 1920×1080, and measures the frames and the memory
//! with four runs too. Another log and other runs:
//! `cargo bench --bench window -- flight.mcap --run auto --run classical`, and `--budget-mib N` for the memory limit of
//! the recording. Frames are drawn by the CPU painter, as without a graphics adapter.
//!
//! `--frames 12000` simulates a long flight with a short log. The memory limit of the recording is reduced by the same
//! factor, so that the ratio of summaries and the distance of snapshots are those of the long flight. For the frames
//! the steps are repeated until there are enough, each as a copy with later stamps.
//!
//! `--study 10000` measures the view of a simulated study with this number of runs instead.

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

struct Arguments {
    log: PathBuf,
    runs: Vec<RunSpec>,
    /// True if the frames are measured with four runs too.
    with_four: bool,
    budget_mib: Option<usize>,
    /// Frames of the simulated long flight.
    frames: Option<usize>,
    /// Number of runs of the study that is measured instead.
    study: Option<usize>,
}

fn specs(names: &[&str]) -> Result<Vec<RunSpec>> {
    Ok(names.iter().map(|name| name.parse()).collect::<Result<_, _>>()?)
}

/// Session whose runs are computed.
fn computed(plan: &SessionPlan) -> Result<Session> {
    let session = Session::start(plan.clone())?;
    while session.recording().runs.iter().any(|run| !run.finished) {
        sleep(Duration::from_millis(50));
    }
    Ok(session)
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
                // Cargo passes it to every benchmark.
                "--bench" => {}
                "--run" => runs.push(value("the name of a run")?.parse()?),
                "--budget-mib" => budget_mib = Some(value("a number of MiB")?.parse()?),
                "--study" => study = Some(value("a number of runs")?.parse()?),
                "--frames" => frames = Some(value("a number of frames")?.parse()?),
                path if !path.starts_with('-') && log.is_none() => log = Some(PathBuf::from(path)),
                other => {
                    bail!(
                        "unknown argument '{other}': expected LOG.mcap, --run SPEC, --budget-mib N, --frames N or --study N"
                    )
                }
            }
        }
        let with_four = runs.is_empty();
        if with_four {
            runs = specs(&["auto", "classical"])?;
        }
        let sample = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
        Ok(Self { log: log.unwrap_or_else(sample), runs, with_four, budget_mib, frames, study })
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
    let mut session = computed(&plan)?;
    println!("{}", travel::memory(&session));
    let mut player = Player::new(&plan);
    println!("{}", travel::measure(&mut session, &mut player));
    let mut recording = session.recording();
    if let Some(frames) = arguments.frames {
        recording = Arc::new(long::lengthened(&session.computation(), frames));
        println!("{}", long::memory(&recording));
    }
    println!("{}", frames::measure(&recording, &mut player));
    if arguments.with_four {
        drop((session, player, recording));
        let runs = specs(&["auto", "static", "cluster", "classical"])?;
        let plan = Arguments { runs, ..arguments }.plan()?;
        let session = computed(&plan)?;
        println!("{}", travel::memory(&session));
        println!("{}", frames::measure(&session.recording(), &mut Player::new(&plan)));
    }
    Ok(())
}
