//! The plan of a sweep with its folder and its jobs.

use anyhow::Result;
use dcvins::study::{self, KeyedJob, StudyPlan};
use dcvins::sweep::{StudyFolder, find_logs, program_identity, read_plan};

use super::arguments::SweepArguments;
use crate::cli::terminal::Progress;

/// A plan with its folder and its jobs.
pub(super) struct Sweep {
    pub(super) plan: StudyPlan,
    pub(super) folder: StudyFolder,
    pub(super) program: String,
    pub(super) jobs: Vec<KeyedJob>,
}

/// Reads the plan, finds its logs and lists its jobs.
pub(super) fn open(arguments: &SweepArguments) -> Result<Sweep> {
    let plan = read_plan(&arguments.plan)?;
    let folder = StudyFolder::create(&arguments.out, &plan, &arguments.plan)?;
    let program = program_identity()?;
    let progress = Progress::spinner("reading the logs");
    let logs = find_logs(&plan, &arguments.plan, &folder.hash_cache())?;
    drop(progress);
    let jobs = study::expand(&plan, &logs, &program);
    Ok(Sweep { plan, folder, program, jobs })
}

/// Removes the rows of jobs that have no result.
pub(super) fn forget_failed(sweep: &Sweep) -> Result<()> {
    for job in &sweep.jobs {
        let row = sweep.folder.run_of(&job.key)?;
        if row.is_some_and(|row| !matches!(row.text(0, "status"), Some("ok" | "not-initialized"))) {
            sweep.folder.forget(&job.key)?;
        }
    }
    Ok(())
}
