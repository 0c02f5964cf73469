//! One flight: simulated, estimated by every run, summed up.

use std::fs;
use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use dcvins::export::{RunSummary, summarize};
use dcvins::session::{self, SessionPlan, SessionRequest};
use dcvins::simulation::{Experiment, SimulationOptions, simulate};

/// The runs over each flight: the camera on the gimbal with online calibration, the same with the given chain held
/// fixed, and the static camera.
pub(crate) const RUNS: [&str; 3] = ["auto", "minimal:calibrate=off,name=fixed", "static"];

/// What came of one flight.
pub(crate) struct Flight {
    pub(crate) experiment: Experiment,
    pub(crate) seed: u64,
    pub(crate) duration_s: f64,
    pub(crate) path_length_m: f64,
    /// In the order of [`RUNS`].
    pub(crate) runs: Vec<RunSummary>,
    pub(crate) simulated_in_s: f64,
    pub(crate) estimated_in_s: f64,
}

impl Flight {
    /// ATE of each run in metres, as far as there is one.
    pub(crate) fn ate_m(&self, run: usize) -> Option<f64> {
        Some(self.runs[run].accuracy.as_ref()?.ate_rmse_m)
    }

    /// Mean error of the chain at the end: metres and degrees.
    pub(crate) fn chain_error(&self, run: usize) -> Option<(f64, f64)> {
        let error = self.runs[run].calibration.chain_error.as_ref()?;
        Some((error.translation_mean_m, error.rotation_mean_rad.to_degrees()))
    }

    pub(crate) fn in_a_line(&self) -> String {
        let ates: Vec<String> = self
            .runs
            .iter()
            .enumerate()
            .map(|(run, summary)| {
                let ate = self.ate_m(run).map_or_else(|| "none".to_owned(), |ate_m| format!("{ate_m:.3} m"));
                format!("{} {ate} ({} restarts)", summary.run, summary.frames.restarts)
            })
            .collect();
        let chain = self
            .chain_error(0)
            .map_or_else(String::new, |(metres, degrees)| format!("; chain {:.1} mm {degrees:.2}°", metres * 1e3));
        format!(
            "{} seed {}: {:.0} s, {:.0} m; ATE {}{chain}; simulated in {:.0} s, estimated in {:.0} s",
            self.experiment.name(),
            self.seed,
            self.duration_s,
            self.path_length_m,
            ates.join(", "),
            self.simulated_in_s,
            self.estimated_in_s
        )
    }
}

/// Writes the log of an experiment and estimates it.
pub(crate) fn fly(
    experiment: Experiment,
    seed: u64,
    duration_s: Option<f64>,
    folder: &Path,
    keep: bool,
) -> Result<Flight> {
    let mut options = SimulationOptions::new(experiment);
    options.seed = seed;
    options.duration_s = duration_s;
    let log_path = folder.join(format!("{}-{seed}.mcap", experiment.name()));
    let begin = Instant::now();
    let simulated = simulate(&options, &log_path, &mut |_| ())?;
    let simulated_in_s = begin.elapsed().as_secs_f64();

    let begin = Instant::now();
    let specs = RUNS.iter().map(|spec| spec.parse()).collect::<Result<_, _>>()?;
    let request = SessionRequest { log_path: log_path.clone(), specs, ..SessionRequest::default() };
    let plan = SessionPlan::open(&request)?;
    let recording = session::compute(&plan, None, &mut |_| ())?;
    let runs = recording.runs.iter().map(|run| summarize(&recording, run, true)).collect();
    let estimated_in_s = begin.elapsed().as_secs_f64();
    if !keep {
        for file in [&simulated.log, &simulated.rig, &simulated.truth] {
            fs::remove_file(file)?;
        }
    }
    Ok(Flight {
        experiment,
        seed,
        duration_s: simulated.duration_s,
        path_length_m: simulated.path_length_m,
        runs,
        simulated_in_s,
        estimated_in_s,
    })
}
