//! Arguments of all sub-commands that run the estimator.

use std::path::PathBuf;

use clap::Args;
use dcvins::session::{RunSpec, SessionRequest};

use crate::cli::limit_arguments::LimitArguments;
use crate::cli::value_parsers::seconds;

/// Runs, rig, ground truth and time range, shared by the sub-commands that run the estimator.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct EstimationArguments {
    /// A run over the log: NAME[:key=value,…], NAME one of auto, minimal, minimal-swapped, classical, poe, static,
    /// cluster; keys encoder=on|off, calibrate=on|off, timeshift=on|off, readout=on|off, intrinsics=on|off,
    /// imu-intrinsics=on|off, first-estimates=on|off, window=N, camera=KEY, name=LABEL. Up to four.
    #[arg(long = "run", value_name = "SPEC")]
    pub runs: Vec<RunSpec>,
    /// The rig, when it is not beside the log (LOG with .rig.yaml) or attached to it.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// The ground truth of the rig, when it is not beside the log (LOG with .truth.yaml).
    #[arg(long = "truth", value_name = "FILE")]
    pub ground_truth: Option<PathBuf>,
    /// Skip this many seconds at the start of the log.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, value_parser = seconds)]
    pub start: f64,
    /// Duration to process from there.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<f64>,
    /// Limits on the log.
    #[command(flatten)]
    pub limits: LimitArguments,
}

impl EstimationArguments {
    /// The session request with these arguments.
    pub(crate) fn request(&self, log_path: PathBuf) -> SessionRequest {
        SessionRequest {
            log_path,
            rig_path: self.rig.clone(),
            ground_truth_path: self.ground_truth.clone(),
            specs: self.runs.clone(),
            start_s: self.start,
            duration_s: self.duration,
            limits: self.limits.limits(),
        }
    }
}
