//! The plan as plain data.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::session::{RunSpec, TrajectorySpec};
use crate::study::perturbation::RigPerturbation;
use crate::study::recipe::FlightRecipe;
use crate::study::summary_table::SummaryTable;
use crate::study::table::StudyTable;

/// Recorded logs of a plan: every file that a pattern matches.
#[derive(Clone, Debug, PartialEq)]
pub struct LogSource {
    /// Path or pattern with `*`, `?` and `**`, relative to the folder of the plan.
    pub pattern: String,
    /// Name in the tables, for a pattern that matches one file; otherwise the names of the files are used.
    pub name: Option<String>,
    /// Path of the rig, relative to the folder of the plan, when it is not beside the logs or in them.
    pub rig: Option<String>,
    /// Path of the ground-truth rig, likewise.
    pub truth: Option<String>,
    /// Seconds to skip at the start.
    pub start_s: f64,
    /// Seconds to process from there, `None` for the rest.
    pub duration_s: Option<f64>,
    /// Trajectories of other programs on these logs; in paths, which are relative to the folder of the plan, [`LOG_PLACE`]
    /// stands for the name of a log's file without its extension.
    pub trajectories: Vec<TrajectorySpec>,
}

/// Stands for the name of a log's file without its extension in the path of a trajectory.
pub const LOG_PLACE: &str = "{log}";

/// A named set of disturbances, one level of that factor; only simulated flights have them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DisturbanceSet {
    /// Name in the tables.
    pub name: String,
    /// Disturbances as `dcvins simulate --disturb` takes them, in addition to the flight's own.
    pub disturb: Vec<String>,
}

/// Combinations of levels that a plan leaves out: those that are in each list that is not empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exclusion {
    /// Names of logs and flights.
    pub logs: Vec<String>,
    /// Names of disturbances.
    pub disturbances: Vec<String>,
    /// Names of rig errors.
    pub perturbations: Vec<String>,
    /// Names of runs.
    pub specs: Vec<String>,
    /// Seeds.
    pub seeds: Vec<u64>,
}

/// Limits on one job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobLimits {
    /// Wall time after which a job is ended, in seconds.
    pub timeout_s: f64,
    /// Expected memory of a job in bytes, before one has been measured.
    pub memory_bytes: u64,
}

impl Default for JobLimits {
    fn default() -> Self {
        Self { timeout_s: 3600.0, memory_bytes: 3 << 29 }
    }
}

/// What is written beside the tables of runs and parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StudyOutput {
    /// A third table with one row per run and frame.
    pub frames: bool,
    /// The files of `dcvins run` for each job.
    pub files: bool,
}

/// How a plan runs under Slurm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlurmOptions {
    /// Partition, `None` for the cluster's default.
    pub partition: Option<String>,
    /// Time limit of one array task, as `sbatch --time` takes it.
    pub time: Option<String>,
    /// Memory of one array task, as `sbatch --mem` takes it.
    pub memory: Option<String>,
    /// Number of array tasks, among which the jobs are divided.
    pub tasks: usize,
    /// Processors of one array task.
    pub cpus_per_task: usize,
    /// Further options of `sbatch`, as in `--account=lab`.
    pub options: Vec<String>,
}

impl Default for SlurmOptions {
    fn default() -> Self {
        Self { partition: None, time: None, memory: None, tasks: 4, cpus_per_task: 1, options: Vec::new() }
    }
}

/// A plan: every combination of logs, disturbances, perturbations, seeds and specifications is one run, but for those left
/// out.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyPlan {
    /// Name of the study.
    pub name: String,
    /// Recorded logs.
    pub logs: Vec<LogSource>,
    /// Simulated flights.
    pub flights: Vec<FlightRecipe>,
    /// Runs over each log.
    pub specs: Vec<RunSpec>,
    /// Levels of the rig's errors.
    pub perturbations: Vec<RigPerturbation>,
    /// Levels of disturbances.
    pub disturbances: Vec<DisturbanceSet>,
    /// Seeds of simulated flights and of random perturbations.
    pub seeds: Vec<u64>,
    /// Combinations that are left out.
    pub exclusions: Vec<Exclusion>,
    /// Limits on one job.
    pub limits: JobLimits,
    /// What is written beside the tables.
    pub output: StudyOutput,
    /// How it runs under Slurm.
    pub slurm: SlurmOptions,
    /// Tolerances of the comparison with a baseline, by column.
    pub tolerances: BTreeMap<String, f64>,
    /// Tables for people.
    pub tables: Vec<SummaryTable>,
}

impl StudyPlan {
    /// Its tables for people of a table of runs, as Markdown.
    pub fn tables_text(&self, runs: &StudyTable) -> String {
        self.tables.iter().map(|table| table.markdown(runs)).collect::<Vec<_>>().join("\n")
    }
}
