//! Arguments of all sub-commands that run the estimator.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use dcvins::sensors::LeverArm;
use dcvins::session::{ParameterizationChoice, RunSpec, SessionRequest, TrajectorySource, TrajectorySpec};
use dcvins::text::{Named as _, key_list};

use crate::cli::shared_arguments::{LimitArguments, PriorArguments, seconds};

/// Runs, rig, ground truth and time range, shared by the sub-commands that run the estimator.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct EstimationArguments {
    #[arg(long = "run", value_name = "SPEC", help = run_help())]
    pub runs: Vec<RunSpec>,
    /// A trajectory of another program, aligned and evaluated like the runs: FILE[:LABEL] in TUM's or EuRoC's format
    /// with header stamps of the log, or topic:NAME[:LABEL] for a topic of odometry, stamped poses or transforms. Up to
    /// four.
    #[arg(long = "trajectory", value_name = "FILE[:LABEL]")]
    pub trajectories: Vec<TrajectorySpec>,
    /// Rig file; default: next to the log (LOG with .rig.yaml) or attached to it.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// Ground-truth rig file; default: next to the log (LOG with .truth.yaml).
    #[arg(long = "truth", value_name = "FILE")]
    pub ground_truth: Option<PathBuf>,
    /// Ground truth of the trajectory instead of the rig's topic: a file in TUM's or EuRoC's format, or topic:NAME. Poses of
    /// the IMU, or positions of an antenna (without attitudes, stamped points, satellite fixes).
    #[arg(long, value_name = "FILE", value_parser = truth_trajectory)]
    pub truth_trajectory: Option<TrajectorySource>,
    /// Lever arm of the antenna whose positions are the ground truth: X,Y,Z in metres in the IMU frame, or estimate.
    #[arg(long, value_name = "X,Y,Z|estimate", value_parser = lever_arm, allow_hyphen_values = true)]
    pub lever_arm: Option<LeverArm>,
    /// Compare the calibration with this accuracy instead of the rig's (or 5 mm and 0.1°):
    /// translation=5mm,rotation=0.1deg,NAME=VALUE with the name of a parameter as in the calibration table; without a
    /// value the rig's. 'run' then ends with exit code 7 if a run is not trusted or does not reach it.
    #[arg(long, value_name = "KEY=VALUE,…", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    pub require: Option<String>,
    /// Skip this many seconds at the start of the log.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds)]
    pub start: f64,
    /// Duration to process from there.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
    #[command(flatten)]
    pub prior: PriorArguments,
    #[command(flatten)]
    pub limits: LimitArguments,
}

fn run_help() -> String {
    let (names, keys) = (ParameterizationChoice::names(), key_list(RunSpec::KEYS));
    format!("A run over the log: NAME[:key=value,…], NAME one of {names}; keys {keys}. Up to four")
}

fn truth_trajectory(text: &str) -> Result<TrajectorySource, String> {
    text.parse::<TrajectorySource>().map_err(|problem| problem.to_string())
}

fn lever_arm(text: &str) -> Result<LeverArm, String> {
    text.parse::<LeverArm>()
}

impl EstimationArguments {
    /// Paths of the log, of the rig and its ground truth where they are separate files, and of trajectories.
    pub(crate) fn input_files(&self, log: &Path) -> Vec<PathBuf> {
        let beside = |given: Option<&PathBuf>, extension: &str| {
            let beside = || Some(log.with_extension(extension)).filter(|path| path.is_file());
            given.cloned().or_else(beside)
        };
        let rig = beside(self.rig.as_ref(), "rig.yaml");
        let ground_truth = beside(self.ground_truth.as_ref(), "truth.yaml");
        let trajectories = self.trajectories.iter().filter_map(|spec| match &spec.source {
            TrajectorySource::File(path) => Some(path.clone()),
            TrajectorySource::Topic(_) => None,
        });
        [Some(log.to_owned()), rig, ground_truth].into_iter().flatten().chain(trajectories).collect()
    }

    /// Checks that no argument replaces what a saved session contains.
    ///
    /// # Errors
    /// If runs, the calibration of earlier flights or the required accuracy are given.
    #[cfg(feature = "gui")]
    pub(crate) fn check_for_session(&self) -> Result<()> {
        if !self.runs.is_empty() {
            anyhow::bail!("a saved session contains its runs: leave --run out");
        }
        if self.prior.prior.is_some() {
            anyhow::bail!("a saved session contains the prior of its runs: leave --prior out");
        }
        if self.require.is_some() {
            anyhow::bail!("a saved session contains the required accuracy: leave --require out");
        }
        Ok(())
    }

    /// The session request with these arguments.
    ///
    /// # Errors
    /// If the calibration of earlier flights cannot be read.
    pub(crate) fn request(&self, log_path: PathBuf) -> Result<SessionRequest> {
        Ok(SessionRequest {
            log_path,
            recording: Vec::new(),
            rig_path: self.rig.clone(),
            ground_truth_path: self.ground_truth.clone(),
            specs: self.runs.clone(),
            prior: self.prior.read()?,
            trajectories: self.trajectories.clone(),
            truth_trajectory: self.truth_trajectory.clone(),
            lever_arm: self.lever_arm,
            required_accuracy: self.require.clone(),
            start_s: self.start,
            duration_s: self.duration,
            limits: self.limits.limits(),
            following: None,
        })
    }
}
