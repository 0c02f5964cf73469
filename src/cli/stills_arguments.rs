//! Arguments of `dcvins calibrate --stills`, and its work.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use dcvins::calibration::stills::{AngleModel, StillsError, StillsOptions, calibrate_stills, judge_stills};
use dcvins::export::{self, StillsReport};
use dcvins::files::stills::{read_stills, read_stills_chain};
use dcvins::sensors::Stills;
use dcvins::text::log_name;

use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::terminal::{Progress, notify, print, print_json};

#[derive(Args, Clone, Debug)]
pub(crate) struct StillsArguments {
    /// Calibrate from still images of known points with joint readings, without IMU (docs/formats.md, Stills).
    #[arg(long, value_name = "FILE")]
    pub stills: Option<PathBuf>,
    /// Judge the chain of a rig or JSON file on the stills instead of calibrating.
    #[arg(long, value_name = "FILE", requires = "stills", conflicts_with = "logs")]
    pub chain: Option<PathBuf>,
    /// Use of the joint readings of the stills.
    #[arg(long, value_enum, default_value_t = JointAnglesArgument::Encoder, requires = "stills", conflicts_with_all = ["chain", "logs"])]
    pub joint_angles: JointAnglesArgument,
    /// Number of groups of stations; each is left out once for the hold-out error.
    #[arg(
        long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(2..=100),
        requires = "stills", conflicts_with_all = ["chain", "logs"]
    )]
    pub folds: u16,
    /// Ids of sets that are not used.
    #[arg(long, value_name = "ID,…", value_delimiter = ',', requires = "stills", conflicts_with = "logs")]
    pub without: Vec<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum JointAnglesArgument {
    /// Readings with noise, its σ estimated per joint; wrong readings are found and named.
    Encoder,
    /// Free in every set: shows what the readings are needed for.
    Free,
}

impl StillsArguments {
    /// Calibrates from the stills, or judges the given chain; writes and prints the result.
    pub(crate) fn calibrate(&self, path: &Path, out: &Path, [force, json]: [bool; 2]) -> Result<ExitOutcome> {
        export::check_stills_folder(out, path, force)?;
        let mut stills = read_stills(path)?;
        self.leave_out(&mut stills, path)?;
        let given = self.chain.as_ref().map(|chain| read_stills_chain(chain, &stills)).transpose()?;
        let interrupt = Interrupt::watch()?;
        let progress = Progress::new();
        let mut on_progress = |at: dcvins::calibration::CalibrationProgress| {
            progress.show(at.fraction, || at.stage.to_owned());
            interrupt.control_flow()
        };
        let angles = match self.joint_angles {
            JointAnglesArgument::Encoder => AngleModel::Encoder,
            JointAnglesArgument::Free => AngleModel::Free,
        };
        let outcome = if let Some(chain) = &given {
            judge_stills(&stills, chain, &mut on_progress)
        } else {
            let options = StillsOptions { angles, folds: usize::from(self.folds) };
            calibrate_stills(&stills, &options, &mut on_progress)
        };
        drop(progress);
        let outcome = match outcome {
            Err(error @ StillsError::Interrupted { .. }) => {
                notify(&format!("dcvins: {error}"));
                return Ok(ExitOutcome::Interrupted);
            }
            Err(error) => bail!("{error}: {}", path.display()),
            Ok(outcome) => outcome,
        };
        let report = StillsReport {
            stills: log_name(path),
            judged: self.chain.as_deref().map(log_name),
            without: self.without.clone(),
            outcome,
        };
        export::write_stills(&stills, &report, out)?;
        if json {
            print_json(&report)?;
        } else {
            print(&format!("{report}\nfiles: {}\n", out.display()))?;
        }
        Ok(ExitOutcome::Success)
    }

    /// Removes the sets of `--without`.
    fn leave_out(&self, stills: &mut Stills, path: &Path) -> Result<()> {
        if let Some(unknown) = self.without.iter().find(|id| !stills.sets.iter().any(|set| set.id == **id)) {
            bail!("--without names the set {unknown}, which the stills do not have: {}", path.display());
        }
        stills.sets.retain(|set| !self.without.contains(&set.id));
        Ok(())
    }
}
