//! `dcvins report`: runs the estimators, draws the figures and writes the page.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use dcvins::export;
use dcvins::report::{ReportFigure, ReportOptions, write_known_report, write_report};
use dcvins::session::{Computation, SessionPlan};
#[cfg(feature = "gui")]
use dcvins::sweep::{OpenedStudy, is_study};
use dcvins::text::{command_line, log_name};

use crate::cli::compute::compute;
use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::log_checking::beside_check;
use crate::cli::prepared_log::prepared_log;
#[cfg(feature = "gui")]
use crate::cli::report_figures;
use crate::cli::result_cache::{CacheArguments, CachedResult};
use crate::cli::run::{interrupted, is_initialized};
use crate::cli::shared_arguments::seconds;
#[cfg(feature = "gui")]
use crate::cli::study_arguments::StudyArguments;
#[cfg(feature = "gui")]
use crate::cli::study_report::study_report;
use crate::cli::terminal::{notify, print};

#[derive(Args, Clone, Debug)]
pub(crate) struct ReportArguments {
    /// The log, a recording that is converted into the cache folder first, or the folder of a study.
    pub log: PathBuf,
    /// Folder for report.html, report.json and the files of each run.
    #[arg(short, long, visible_alias = "out", value_name = "DIR")]
    pub output: PathBuf,
    /// A time of the figures, in seconds since the first message of the log; may be given several times [default: the
    /// end].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub at: Vec<f64>,
    /// Overwrite any content of the folder. Without it, only a report on a log of the same name and its runs are
    /// replaced.
    #[arg(long)]
    pub force: bool,
    #[cfg(feature = "gui")]
    #[command(flatten)]
    pub study: StudyArguments,
    #[command(flatten)]
    pub estimation: EstimationArguments,
    #[command(flatten)]
    pub cache: CacheArguments,
}

pub(crate) fn report(arguments: &ReportArguments) -> Result<ExitOutcome> {
    #[cfg(feature = "gui")]
    if is_study(&arguments.log) {
        return of_study(arguments);
    }
    #[cfg(feature = "gui")]
    arguments.study.require_none(&arguments.log)?;
    let (log, estimation) = prepared_log(std::slice::from_ref(&arguments.log), &arguments.estimation)?;
    let arguments = &ReportArguments { log, estimation, ..arguments.clone() };
    let plan = SessionPlan::open(&arguments.estimation.request(arguments.log.clone())?)?;
    let labels: Vec<&str> = plan.runs.iter().map(|(spec, _)| spec.label.as_str()).collect();
    export::check_report_folder(&arguments.output, &labels, &arguments.log, arguments.force)?;
    let interrupt = Interrupt::watch()?;
    let cached = arguments.cache.result_of(&own_command_line(), &arguments.log, &arguments.estimation, &plan);
    if let Some(files) = cached.as_ref().and_then(CachedResult::load) {
        write_known_report(&files, &arguments.output, &labels, &log_name(&arguments.log))?;
        print(&format!("{}\n", page_of(arguments).display()))?;
        return Ok(ExitOutcome::Success);
    }
    let plan = SessionPlan { interrupted: interrupt.flag(), ..plan.clone() };
    let (computed, checked) = beside_check(&plan, &arguments.cache, || {
        let mut computation = compute(&plan)?;
        if interrupt.is_set() && computation.recording().runs.iter().all(|run| run.steps.is_empty()) {
            return Ok(None);
        }
        let figures = figures_of(arguments, &plan, &mut computation)?;
        Ok(Some((computation, figures)))
    });
    let Some((mut computation, figures)) = computed? else {
        notify("dcvins: interrupted before the first step; nothing is written");
        return Ok(ExitOutcome::Interrupted);
    };
    // The verdict needs complete last steps.
    computation.fill_in(computation.recording().last_stamp_ns());
    let options = ReportOptions {
        command: own_command_line(),
        check: Some(checked),
        inputs: arguments.estimation.input_files(&arguments.log),
        figures,
    };
    if let Some(checked) = &options.check {
        computation.set_check(checked.clone());
    }
    let recording = computation.recording();
    let written = write_report(recording, &arguments.output, &options)?;
    print(&format!("{}\n", page_of(arguments).display()))?;
    let failed: Vec<&str> = recording.runs.iter().filter_map(|run| run.error.as_deref()).collect();
    if !failed.is_empty() {
        anyhow::bail!("{}", failed.join("; "));
    }
    if interrupt.is_set() {
        notify(&interrupted(recording));
        return Ok(ExitOutcome::Interrupted);
    }
    if !recording.runs.iter().all(is_initialized) {
        return Ok(ExitOutcome::NeverInitialized);
    }
    if let Some(mut cached) = cached
        && written.iter().all(|path| add_written(&mut cached, path, &arguments.output).is_some())
    {
        cached.store();
    }
    Ok(ExitOutcome::Success)
}

fn page_of(arguments: &ReportArguments) -> PathBuf {
    arguments.output.join("report.html")
}

/// Adds a written file to the cached result; `None` if the file is outside `folder` or cannot be read again.
fn add_written(cached: &mut CachedResult, path: &Path, folder: &Path) -> Option<()> {
    let name = path.strip_prefix(folder).ok()?.to_str()?;
    cached.add(name.to_owned(), std::fs::read(path).ok()?);
    Some(())
}

#[cfg(feature = "gui")]
fn of_study(arguments: &ReportArguments) -> Result<ExitOutcome> {
    if !arguments.at.is_empty() || !arguments.estimation.runs.is_empty() {
        anyhow::bail!("{} is a study: leave --at and --run out", arguments.log.display());
    }
    let study = OpenedStudy::read(&arguments.log)?;
    let view = arguments.study.options();
    study_report(&study, &view, &arguments.output, own_command_line(), arguments.force)?;
    Ok(ExitOutcome::Success)
}

/// The command line of this process in a form that can be typed again; the program's name is without its folder.
pub(crate) fn own_command_line() -> String {
    let mut words: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    if let Some(program) = words.first_mut() {
        *program = Path::new(program).file_name().unwrap_or_default().to_string_lossy().into_owned();
    }
    command_line(words)
}

#[cfg(feature = "gui")]
fn figures_of(
    arguments: &ReportArguments,
    plan: &SessionPlan,
    computation: &mut Computation,
) -> Result<Vec<ReportFigure>> {
    report_figures::draw(&arguments.at, plan, computation)
}

/// Figures cannot be drawn in a build without the window.
#[cfg(not(feature = "gui"))]
#[expect(clippy::unnecessary_wraps, reason = "with the window it can fail")]
fn figures_of(_: &ReportArguments, _: &SessionPlan, _: &mut Computation) -> Result<Vec<ReportFigure>> {
    Ok(Vec::new())
}
