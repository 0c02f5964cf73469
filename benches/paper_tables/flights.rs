//! One flight: simulated, estimated by every run, summed up.

use std::fs;
use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use dcvins::calibration::CalibrationOptions;
use dcvins::export::{CalibrationReport, RunSummary, report_calibration, summarize, write_calibration};
use dcvins::session::{self, CalibrationRequest, SessionPlan, SessionRequest};
use dcvins::simulation::{Experiment, SimulationOptions, simulate};

/// The runs over each flight: the camera on the gimbal with online calibration, the same with the given chain held
/// fixed, and the static camera.
pub(crate) const RUNS: [&str; 3] = ["auto", "minimal:calibrate=off,name=fixed", "static"];

/// The offline baseline: calibrated from the same flight, then flown with that calibration held fixed.
pub(crate) struct Offline {
    pub(crate) calibration: CalibrationReport,
    pub(crate) run: RunSummary,
    pub(crate) calibrated_in_s: f64,
}

/// What came of one flight.
pub(crate) struct Flight {
    pub(crate) experiment: Experiment,
    pub(crate) seed: u64,
    pub(crate) duration_s: f64,
    pub(crate) path_length_m: f64,
    /// In the order of [`RUNS`].
    pub(crate) runs: Vec<RunSummary>,
    /// For T4 alone, as in the paper; `Err` tells why it could not be calibrated.
    pub(crate) offline: Option<Result<Offline, String>>,
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
        let offline = match &self.offline {
            None => String::new(),
            Some(Err(error)) => format!(", offline failed: {error}"),
            Some(Ok(offline)) => {
                let ate = offline.run.accuracy.as_ref();
                ate.map_or_else(|| ", offline none".to_owned(), |ate| format!(", offline {:.3} m", ate.ate_rmse_m))
            }
        };
        let chain = self
            .chain_error(0)
            .map_or_else(String::new, |(metres, degrees)| format!("; chain {:.1} mm {degrees:.2}°", metres * 1e3));
        format!(
            "{} seed {}: {:.0} s, {:.0} m; ATE {}{offline}{chain}; simulated in {:.0} s, estimated in {:.0} s",
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
    let offline = (experiment == Experiment::T4)
        .then(|| calibrate_and_fly(&log_path, folder).map_err(|error| format!("{error:#}")));
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
        offline,
        simulated_in_s,
        estimated_in_s,
    })
}

/// The paper's other way: calibrate first, then fly with the result as it is.
fn calibrate_and_fly(log_path: &Path, folder: &Path) -> Result<Offline> {
    let begin = Instant::now();
    let request = CalibrationRequest { log_path: log_path.to_owned(), ..CalibrationRequest::default() };
    let calibrated = session::calibrate(&request, &CalibrationOptions::default(), &mut |_| ())?;
    let calibration = report_calibration(&calibrated);
    let rig_folder = folder.join("offline");
    write_calibration(&calibrated, &calibration, &rig_folder)?;
    let calibrated_in_s = begin.elapsed().as_secs_f64();
    let request = SessionRequest {
        log_path: log_path.to_owned(),
        rig_path: Some(rig_folder.join("rig.yaml")),
        specs: vec!["minimal:calibrate=off,name=offline".parse()?],
        ..SessionRequest::default()
    };
    let recording = session::compute(&SessionPlan::open(&request)?, None, &mut |_| ())?;
    Ok(Offline { calibration, run: summarize(&recording, &recording.runs[0], true), calibrated_in_s })
}
