//! One flight of an experiment, estimated by every run.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use dcvins::calibration::CalibrationOptions;
use dcvins::export::{CalibrationReport, report_calibration, write_calibration};
use dcvins::session::{self, CalibrationRequest};
use dcvins::simulation::Experiment;
use serde::{Deserialize, Serialize};

use crate::drive::{ChainDistance, Driven, Variant, drive};
use crate::logs::{Archive, Log};

/// The runs over each flight, by name and specification: the camera on the gimbal with online calibration, the same with
/// the given chain held fixed, the static camera, and both cameras in one window.
pub(crate) const RUNS: [(&str, &str); 4] = [
    ("online", "auto"),
    ("given chain fixed", "minimal:calibrate=off,name=fixed"),
    ("static", "static"),
    ("cluster", "cluster"),
];
/// Indices of [`RUNS`].
pub(crate) const ONLINE: usize = 0;
pub(crate) const FIXED: usize = 1;
pub(crate) const STATIC: usize = 2;
pub(crate) const CLUSTER: usize = 3;

/// The offline baseline: calibrated from the same flight, then run with that calibration fixed.
#[derive(Serialize, Deserialize)]
pub(crate) struct Offline {
    pub(crate) calibration: OfflineErrors,
    pub(crate) run: Driven,
    pub(crate) calibrated_in_s: f64,
}

/// What is left after the steps of an offline calibration.
#[derive(Serialize, Deserialize)]
pub(crate) struct OfflineErrors {
    /// Mean reprojection error of the static camera alone.
    pub(crate) static_alone_px: f64,
    /// The same of each camera in the cluster, static one first.
    pub(crate) cluster_px: Vec<f64>,
    /// The static camera on the IMU after its own calibration.
    pub(crate) static_mount: Option<ChainDistance>,
    /// The whole chain at the end.
    pub(crate) chain: Option<ChainDistance>,
}

impl OfflineErrors {
    fn of(report: &CalibrationReport) -> Self {
        let ground_truth = report.ground_truth.as_ref();
        Self {
            static_alone_px: report.camera_imu_reprojection.error_px.mean,
            cluster_px: report.reprojection.iter().map(|camera| camera.error_px.mean).collect(),
            static_mount: ground_truth.map(|ground_truth| {
                let error = &ground_truth.static_camera_imu;
                ChainDistance::new(error.translation_mean_m, error.rotation_mean_rad)
            }),
            chain: ground_truth.map(|ground_truth| {
                let error = &ground_truth.chain_final;
                ChainDistance::new(error.translation_mean_m, error.rotation_mean_rad)
            }),
        }
    }
}

/// Results of one flight.
pub(crate) struct Flight {
    pub(crate) experiment: Experiment,
    pub(crate) seed: u64,
    pub(crate) duration_s: f64,
    pub(crate) simulated_in_s: Option<f64>,
    pub(crate) estimated: Estimated,
}

/// Results of the estimators on a flight.
#[derive(Serialize, Deserialize)]
pub(crate) struct Estimated {
    /// In the order of [`RUNS`].
    pub(crate) runs: Vec<Driven>,
    /// For T4 only, as in the paper; `Err` has the reason why the calibration failed.
    pub(crate) offline: Option<Result<Offline, String>>,
    pub(crate) in_s: f64,
}

impl Flight {
    /// Estimates the log of an experiment.
    pub(crate) fn fly(archive: &Archive, experiment: Experiment, seed: u64, duration_s: Option<f64>) -> Result<Self> {
        let log = archive.flight(experiment, seed, duration_s)?;
        let name = format!("{}-{seed}-flight", experiment.name());
        let estimated = archive.kept(&name, &log, || {
            let begin = Instant::now();
            let variants = RUNS.map(|(name, spec)| Variant { analysed: true, ..Variant::plain(name, spec) });
            let runs = drive(&log, None, &variants)?;
            let in_s = begin.elapsed().as_secs_f64();
            let offline = (experiment == Experiment::T4)
                .then(|| calibrate_and_fly(&log, &archive.folder).map_err(|error| format!("{error:#}")));
            Ok(Estimated { runs, offline, in_s })
        })?;
        Ok(Self { experiment, seed, duration_s: log.duration_s, simulated_in_s: log.simulated_in_s, estimated })
    }

    /// By index of [`RUNS`].
    pub(crate) fn run(&self, run: usize) -> &Driven {
        &self.estimated.runs[run]
    }

    /// The offline baseline, where it worked.
    pub(crate) fn offline(&self) -> Option<&Offline> {
        self.estimated.offline.as_ref()?.as_ref().ok()
    }

    pub(crate) fn path_length_m(&self) -> f64 {
        self.estimated.runs.iter().map(|run| run.length_m).fold(0.0, f64::max)
    }

    /// The flights of an experiment.
    pub(crate) fn of(flights: &[Self], experiment: Experiment) -> impl Iterator<Item = &Self> {
        flights.iter().filter(move |flight| flight.experiment == experiment)
    }

    /// Simulated experiments in order.
    pub(crate) fn experiments(flights: &[Self]) -> impl Iterator<Item = Experiment> {
        Experiment::ALL.into_iter().filter(|experiment| Self::of(flights, *experiment).next().is_some())
    }

    /// Every experiment with every run: index and name.
    pub(crate) fn experiments_and_runs(flights: &[Self]) -> impl Iterator<Item = (Experiment, usize, &'static str)> {
        let runs = |experiment| RUNS.iter().enumerate().map(move |(run, (name, _))| (experiment, run, *name));
        Self::experiments(flights).flat_map(runs)
    }

    /// What a person who waits wants to know.
    pub(crate) fn in_a_line(&self) -> String {
        let mut parts = vec![format!(
            "{} seed {}: {:.0} s, {:.0} m; ATE",
            self.experiment.name(),
            self.seed,
            self.duration_s,
            self.path_length_m()
        )];
        parts.extend(
            RUNS.iter().zip(&self.estimated.runs).map(|((name, _), run)| format!("{name} {},", run.ate_in_words())),
        );
        match &self.estimated.offline {
            None => {}
            Some(Err(error)) => parts.push(format!("offline failed: {error},")),
            Some(Ok(offline)) => parts.push(format!("offline {},", offline.run.ate_in_words())),
        }
        if let Some(ChainDistance { metres, degrees }) = self.run(ONLINE).chain_error {
            parts.push(format!("chain {:.1} mm {degrees:.2}°,", metres * 1e3));
        }
        parts.push(format!("estimated in {:.0} s", self.estimated.in_s));
        parts.join(" ")
    }
}

impl Driven {
    fn ate_in_words(&self) -> String {
        let ate = self.ate_m().map_or_else(|| "none".to_owned(), |ate_m| format!("{ate_m:.3} m"));
        match self.restarts {
            0 => ate,
            restarts => format!("{ate} ({restarts} restarts: {})", self.failures.join("; ")),
        }
    }
}

/// The paper's other procedure: calibrate offline, then run with the result fixed.
fn calibrate_and_fly(log: &Log, folder: &Path) -> Result<Offline> {
    let begin = Instant::now();
    let request = CalibrationRequest {
        log_path: log.path.clone(),
        duration_s: Some(log.duration_s),
        ..CalibrationRequest::default()
    };
    let calibrated = session::calibrate(&request, &CalibrationOptions::default(), &mut |_| ControlFlow::Continue(()))?;
    let report = report_calibration(&calibrated);
    let rig_folder = folder.join(format!("offline-{}-{}", log.experiment.name(), log.seed));
    write_calibration(&calibrated, &report, &rig_folder)?;
    let calibrated_in_s = begin.elapsed().as_secs_f64();
    let variant = Variant::plain("offline", "minimal:calibrate=off,name=offline");
    let mut runs = drive(log, Some(&rig_folder.join("rig.yaml")), &[variant])?;
    Ok(Offline { calibration: OfflineErrors::of(&report), run: runs.swap_remove(0), calibrated_in_s })
}
