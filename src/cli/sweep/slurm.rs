//! The cluster engine: a Slurm array job, one task per shard of the jobs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use dcvins::study::{self, JobCosts, JobLog, JobStatus, KeyedJob, SlurmOptions};
use dcvins::sweep::write_text;

use super::arguments::{Sweep, SweepArguments};
use super::pool::{PoolOutcome, last_lines};
use crate::cli::exit::JOBS_FAILED;
use crate::cli::interrupt::Interrupt;
use crate::cli::terminal::{Progress, notify};

/// Maximum number of submissions of the array: again for tasks that were killed as a whole.
const SUBMISSIONS: usize = 2;
/// Period of queries to the controller.
const POLL: Duration = Duration::from_secs(2);
/// Period of checks for an interrupt within [`POLL`].
const INTERRUPT_POLL: Duration = Duration::from_millis(100);
/// Number of unanswered queries after which the controller counts as unreachable.
const UNANSWERED: usize = 60;

/// Submits the array and waits for it; submits a second array of the tasks that left jobs undone.
pub(super) fn run(
    sweep: &Sweep,
    arguments: &SweepArguments,
    jobs: &[KeyedJob],
    interrupt: &Interrupt,
) -> Result<PoolOutcome> {
    let tasks = sweep.plan.slurm.tasks.min(groups(&sweep.jobs)).max(1);
    let script = write_script(sweep, arguments, tasks)?;
    let mut outcome = PoolOutcome::default();
    let mut submitted = String::new();
    for submission in 1..=SUBMISSIONS {
        let undone = tasks_of_undone(sweep, tasks);
        if undone.is_empty() {
            break;
        }
        submitted = submit(&script, &undone)?;
        let again = if submission > 1 { " again" } else { "" };
        notify(&format!(
            "dcvins: submitted{again} as Slurm job {submitted}: {} tasks, {}",
            undone.len(),
            script.display()
        ));
        if watch(sweep, jobs, &submitted, interrupt)? {
            outcome.interrupted = true;
            return Ok(outcome);
        }
    }
    give_up_undone(sweep, tasks, &submitted)?;
    for job in jobs {
        let row = sweep.folder.run_of(&job.key)?;
        match row.as_ref().and_then(|row| row.text(0, "status")) {
            Some("ok" | "not-initialized") => outcome.done += 1,
            _ => outcome.failed += 1,
        }
    }
    Ok(outcome)
}

/// Number of groups of jobs that [`study::shard`] keeps together.
fn groups(jobs: &[KeyedJob]) -> usize {
    let mut flights = BTreeSet::new();
    let alone = jobs.iter().filter(|job| match &job.job.log {
        JobLog::Simulated(flight) => flights.insert(flight.id()),
        JobLog::Recorded(_) => true,
    });
    alone.count()
}

/// Tasks of the array that still have jobs, with these jobs.
fn undone_by_task(sweep: &Sweep, tasks: usize) -> Vec<(usize, Vec<KeyedJob>)> {
    let undone = |task: usize| {
        let mut jobs = study::shard(sweep.jobs.clone(), task, tasks);
        jobs.retain(|job| !sweep.folder.is_done(&job.key, &sweep.plan));
        (task, jobs)
    };
    (1..=tasks).map(undone).filter(|(_, jobs)| !jobs.is_empty()).collect()
}

fn tasks_of_undone(sweep: &Sweep, tasks: usize) -> Vec<usize> {
    undone_by_task(sweep, tasks).into_iter().map(|(task, _)| task).collect()
}

/// Quotes a text as one word for a shell.
fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// Batch script of the array.
fn script(sweep: &Sweep, plan: &Path, program: &Path, tasks: usize) -> String {
    let SlurmOptions { partition, time, memory, cpus_per_task, options, .. } = &sweep.plan.slurm;
    let name: String =
        sweep.plan.name.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' }).collect();
    let mut lines = vec![
        "#!/bin/bash".to_owned(),
        format!("#SBATCH --job-name=dcvins-{name}"),
        format!("#SBATCH --cpus-per-task={cpus_per_task}"),
    ];
    let optional = [("partition", partition), ("time", time), ("mem", memory)];
    let given = optional.into_iter().filter_map(|(option, value)| Some((option, value.as_ref()?)));
    lines.extend(given.map(|(option, value)| format!("#SBATCH --{option}={value}")));
    lines.extend(options.iter().map(|option| format!("#SBATCH {option}")));
    let bound = memory.as_deref().and_then(gib_of).map_or_else(String::new, |gib| format!(" --memory {gib}"));
    let word = |path: &Path| quoted(&path.display().to_string());
    lines.push(format!(
        "{} sweep {} -o {} --shard \"$SLURM_ARRAY_TASK_ID/{tasks}\" --jobs {cpus_per_task}{bound} || [ $? -eq {JOBS_FAILED} ]",
        word(program),
        word(plan),
        word(sweep.folder.root()),
    ));
    lines.push(String::new());
    lines.join("\n")
}

/// Memory in GiB from the syntax of `sbatch --mem`: a number of MiB, or with a unit K, M, G or T.
fn gib_of(memory: &str) -> Option<f64> {
    let digits = memory.trim_end_matches(|letter: char| letter.is_ascii_alphabetic());
    let per_gib = match memory[digits.len()..].to_ascii_uppercase().as_str() {
        "" | "M" | "MB" => 1024.0,
        "K" | "KB" => 1024.0 * 1024.0,
        "G" | "GB" => 1.0,
        "T" | "TB" => 1.0 / 1024.0,
        _ => return None,
    };
    digits.parse::<f64>().ok().map(|number| number / per_gib).filter(|gib| *gib > 0.0)
}

fn write_script(sweep: &Sweep, arguments: &SweepArguments, tasks: usize) -> Result<PathBuf> {
    let program = std::env::current_exe().context("cannot find the program's own file")?;
    let plan =
        std::fs::canonicalize(&arguments.plan).with_context(|| format!("cannot read: {}", arguments.plan.display()))?;
    let folder = sweep.folder.slurm();
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot write: {}", folder.display()))?;
    let path = folder.join("batch.sh");
    write_text(&path, &script(sweep, &plan, &program, tasks))?;
    Ok(path)
}

fn slurm(command: &mut Command) -> Result<Output> {
    let name = command.get_program().to_string_lossy().into_owned();
    command.output().with_context(|| {
        format!("cannot run '{name}': --slurm needs the commands of Slurm (Debian: slurm-client) on this machine")
    })
}

/// Submits the tasks and returns the job id.
fn submit(script: &Path, tasks: &[usize]) -> Result<String> {
    let array = tasks.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
    let log = script.with_file_name("task-%a.log");
    let mut command = Command::new("sbatch");
    command.args(["--parsable", &format!("--array={array}"), &format!("--output={}", log.display())]).arg(script);
    let output = slurm(&mut command)?;
    if !output.status.success() {
        bail!("sbatch refused '{}': {}", script.display(), String::from_utf8_lossy(&output.stderr).trim());
    }
    // The output is JOB or JOB;CLUSTER.
    let text = String::from_utf8_lossy(&output.stdout);
    Ok(text.trim().split(';').next().unwrap_or_default().to_owned())
}

/// Waits until no task of the array is left. Returns true if it was interrupted; the array is then cancelled.
fn watch(sweep: &Sweep, jobs: &[KeyedJob], submitted: &str, interrupt: &Interrupt) -> Result<bool> {
    let progress = Progress::new();
    let mut unanswered = 0;
    loop {
        let done = jobs.iter().filter(|job| sweep.folder.is_done(&job.key, &sweep.plan)).count();
        let output = slurm(Command::new("squeue").args(["-h", "-r", "-o", "%T", "-j", submitted]))?;
        let answer = String::from_utf8_lossy(&output.stdout);
        let problem = String::from_utf8_lossy(&output.stderr);
        if output.status.success() {
            unanswered = 0;
            if answer.trim().is_empty() {
                return Ok(false);
            }
        } else if problem.contains("Invalid job id") {
            // The controller forgets jobs some minutes after their end.
            return Ok(false);
        } else {
            unanswered += 1;
            if unanswered > UNANSWERED {
                bail!(
                    "squeue does not answer: {}; the array {submitted} continues, collect with --collect",
                    problem.trim()
                );
            }
        }
        let running = answer.lines().filter(|state| state.trim() == "RUNNING").count();
        let waiting = answer.lines().filter(|state| state.trim() == "PENDING").count();
        progress.show(done as f64 / jobs.len().max(1) as f64, || {
            format!("{done} of {} jobs, {running} tasks running, {waiting} waiting", jobs.len())
        });
        for _ in 0..POLL.as_millis() / INTERRUPT_POLL.as_millis() {
            if interrupt.is_set() {
                slurm(Command::new("scancel").arg(submitted))?;
                return Ok(true);
            }
            std::thread::sleep(INTERRUPT_POLL);
        }
    }
}

/// Writes the rows of jobs whose tasks were killed twice, with the state reported by Slurm.
fn give_up_undone(sweep: &Sweep, tasks: usize, submitted: &str) -> Result<()> {
    for (task, jobs) in undone_by_task(sweep, tasks) {
        let log = last_lines(&sweep.folder.slurm().join(format!("task-{task}.log")));
        let id = format!("{submitted}_{task}");
        // On a cluster without accounting, only the log is available.
        let state = slurm(Command::new("sacct").args(["-n", "-X", "-P", "-o", "State", "-j", &id]));
        let state = state.ok().filter(|output| output.status.success());
        let state = state.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned()).unwrap_or_default();
        let parts = [format!("the task {id} of Slurm ended before the job"), state, log];
        let message = parts.iter().filter(|part| !part.is_empty()).cloned().collect::<Vec<_>>().join("\n");
        for job in &jobs {
            let costs = JobCosts { attempts: SUBMISSIONS, program: sweep.program.clone(), ..JobCosts::default() };
            sweep.folder.write_job(job)?;
            sweep.folder.write_failure(job, JobStatus::Killed, &message, &costs, sweep.plan.output)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_as_sbatch_does() {
        assert_eq!(gib_of("2048"), Some(2.0));
        assert_eq!(gib_of("4G"), Some(4.0));
        assert_eq!(gib_of("512M"), Some(0.5));
        assert_eq!(gib_of("1T"), Some(1024.0));
        for none in ["", "G", "4X", "0"] {
            assert_eq!(gib_of(none), None, "{none}");
        }
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }
}
