//! The hidden command for one job, which `sweep` starts as a child process.

use std::io::{self, Read as _};
use std::ops::ControlFlow;
use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use clap::Args;
use dcvins::study::{SimulatedFlight, StudyOutput};
use dcvins::sweep::StudyFolder;

use crate::cli::exit::{ExitOutcome, INTERRUPTED};

#[derive(Args, Clone, Debug)]
pub(crate) struct SweepJobArguments {
    /// Folder of the study.
    pub folder: PathBuf,
    /// Version and hash of the program that started it.
    #[arg(long)]
    pub program: String,
    /// Key of the job.
    #[arg(long)]
    pub key: Option<String>,
    /// Number of the attempt.
    #[arg(long, default_value_t = 1)]
    pub attempt: usize,
    /// Render this flight instead of running a job.
    #[arg(long, conflicts_with = "key")]
    pub flight: Option<String>,
    /// Also write the rows of all frames.
    #[arg(long)]
    pub frames: bool,
    /// Also write the files of the run.
    #[arg(long)]
    pub files: bool,
}

pub(crate) fn sweep_job(arguments: &SweepJobArguments) -> Result<ExitOutcome> {
    end_with_parent()?;
    let folder = StudyFolder::open(&arguments.folder)?;
    match (&arguments.key, &arguments.flight) {
        (Some(key), _) => {
            let output = StudyOutput { frames: arguments.frames, files: arguments.files };
            folder.run_job(key, &arguments.program, arguments.attempt, output)?;
        }
        (None, Some(text)) => {
            let flight: SimulatedFlight = serde_json::from_str(text).context("--flight is no flight of a study")?;
            folder.render(&flight, &mut |_| ControlFlow::Continue(()))?;
        }
        (None, None) => bail!("expected --key or --flight; this command is started by 'dcvins sweep'"),
    }
    Ok(ExitOutcome::Success)
}

/// Ends this process when its standard input closes, which happens when the parent process ends, even if it is killed.
fn end_with_parent() -> Result<()> {
    #[expect(clippy::exit, reason = "nobody is left to whom an outcome could be returned")]
    let wait = || {
        let mut byte = [0; 1];
        while io::stdin().read(&mut byte).is_ok_and(|count| count > 0) {}
        std::process::exit(i32::from(INTERRUPTED));
    };
    std::thread::Builder::new().name("parent".to_owned()).spawn(wait).context("cannot start a thread")?;
    Ok(())
}
