//! The plan as plain data.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::summary_table::SummaryTable;
use crate::session::{RunSpec, TrajectorySpec};
use crate::study::job::Bundle;
use crate::study::perturbation::RigPerturbation;
use crate::study::recipe::FlightRecipe;
use crate::study::table::StudyTable;
use crate::text::Named as _;

/// Recorded logs of a plan: every file that a pattern matches.
#[derive(Clone, Debug, PartialEq)]
pub struct LogSource {
    /// Path or pattern with `*`, `?` and `**`, relative to the folder of the plan.
    pub pattern: String,
    /// Name in the tables, for a pattern that matches one file; `None` uses the names of the files.
    pub name: Option<String>,
    /// Path of the rig, relative to the folder of the plan; `None` if it is next to the logs or inside them.
    pub rig: Option<String>,
    /// Path of the ground-truth rig, likewise.
    pub truth: Option<String>,
    /// Seconds to skip at the start.
    pub start_s: f64,
    /// Seconds to process from there, `None` for the rest.
    pub duration_s: Option<f64>,
    /// Trajectories of other programs on these logs. Paths are relative to the folder of the plan, and [`LOG_PLACE`] in
    /// them stands for the name of a log's file without its extension.
    pub trajectories: Vec<TrajectorySpec>,
}

/// Placeholder for the name of a log's file without its extension in the path of a trajectory.
pub const LOG_PLACE: &str = "{log}";

/// A named set of disturbances, one level of the factor "disturbance"; only simulated flights have disturbances.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DisturbanceSet {
    /// Name in the tables.
    pub name: String,
    /// Disturbances in the syntax of `dcvins simulate --disturb`, in addition to the flight's.
    pub disturb: Vec<String>,
}

/// Combinations of levels that a plan omits: those that are in each non-empty list.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exclusion {
    /// Names of logs and flights.
    pub logs: Vec<String>,
    pub disturbances: Vec<String>,
    /// Names of rig errors.
    pub perturbations: Vec<String>,
    /// Names of runs and bundle adjustments.
    pub specs: Vec<String>,
    pub seeds: Vec<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobLimits {
    /// Wall time in seconds after which a job is terminated.
    pub timeout_s: f64,
    /// Expected memory of a job in bytes, before one has been measured.
    pub memory_bytes: u64,
}

impl Default for JobLimits {
    fn default() -> Self {
        Self { timeout_s: 3600.0, memory_bytes: 3 << 29 }
    }
}

/// Output in addition to the tables of runs and parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StudyOutput {
    /// True for a third table with one row per run and frame.
    pub frames: bool,
    /// True for the files of `dcvins run` for each job.
    pub files: bool,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SlurmOptions {
    /// Partition, `None` for the cluster's default.
    pub partition: Option<String>,
    /// Time limit of one array task, in the syntax of `sbatch --time`.
    pub time: Option<String>,
    /// Memory of one array task, in the syntax of `sbatch --mem`.
    pub memory: Option<String>,
    /// Number of array tasks among which the jobs are divided.
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

/// A plan: every combination of logs, disturbances, perturbations, seeds and specifications is one run, except for the
/// exclusions.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyPlan {
    pub name: String,
    pub logs: Vec<LogSource>,
    pub flights: Vec<FlightRecipe>,
    /// Runs on each log.
    pub specs: Vec<RunSpec>,
    /// Bundle adjustments over each log.
    pub bundles: Vec<Bundle>,
    /// Levels of the rig's errors.
    pub perturbations: Vec<RigPerturbation>,
    pub disturbances: Vec<DisturbanceSet>,
    /// Seeds of simulated flights and of random perturbations.
    pub seeds: Vec<u64>,
    /// Combinations that are omitted.
    pub exclusions: Vec<Exclusion>,
    pub limits: JobLimits,
    pub output: StudyOutput,
    pub slurm: SlurmOptions,
    /// Relative tolerances of the comparison with a baseline, by column.
    pub tolerances: BTreeMap<String, f64>,
    /// Markdown tables of the results.
    pub tables: Vec<SummaryTable>,
}

impl StudyPlan {
    /// The plan's tables of a table of runs, as Markdown.
    pub fn tables_text(&self, runs: &StudyTable) -> String {
        self.tables.iter().map(|table| table.markdown(runs)).collect::<Vec<_>>().join("\n")
    }

    /// Names of runs and bundle adjustments in the tables.
    pub(super) fn labels(&self) -> impl Iterator<Item = &str> {
        let bundles = self.bundles.iter().map(|bundle| bundle.name());
        self.specs.iter().map(|spec| spec.label.as_str()).chain(bundles)
    }
}
