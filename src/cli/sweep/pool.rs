//! The local engine: jobs as child processes, limited by processors and memory.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use anyhow::{Context as _, Result};
use dcvins::session::Stopwatch;
use dcvins::study::{JobCosts, JobLog, JobStatus, KeyedJob, SimulatedFlight, StudyPlan};
use dcvins::sweep::StudyFolder;

use crate::cli::interrupt::Interrupt;
use crate::cli::terminal::Progress;

/// Number of times that a job is started before it is given up.
const MAX_ATTEMPTS: usize = 2;
/// Period of checking the children.
const POLL: Duration = Duration::from_millis(20);
/// Number of lines of standard error in the row of a failed job.
const KEPT_LINES: usize = 8;
/// Number of bytes at the end of standard error that are read for these lines.
const KEPT_BYTES: usize = 4096;

#[derive(Clone, Copy, Debug)]
pub(super) struct PoolLimits {
    /// Number of jobs at a time.
    pub(super) jobs: usize,
    /// Number of processors for all jobs together.
    pub(super) processors: usize,
    /// Memory for all jobs together, in bytes.
    pub(super) memory_bytes: u64,
}

/// Numbers of jobs of a pool by outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PoolOutcome {
    /// Number of finished jobs.
    pub(super) done: usize,
    /// Number of jobs without a result.
    pub(super) failed: usize,
    /// True if the pool was interrupted.
    pub(super) interrupted: bool,
}

/// Task of one child process.
#[derive(Clone, Debug)]
enum Task {
    Flight(Box<SimulatedFlight>),
    /// A job, by its index among the jobs of the pool.
    Job(usize),
}

struct Running {
    child: Child,
    task: Task,
    attempt: usize,
    started: Stopwatch,
    memory_bytes: u64,
}

/// The pool: waiting and running tasks.
pub(super) struct Pool<'a> {
    folder: &'a StudyFolder,
    plan: &'a StudyPlan,
    program: &'a str,
    jobs: &'a [KeyedJob],
    limits: PoolLimits,
    /// Waiting jobs, with the number of their next attempt.
    waiting: VecDeque<(usize, usize)>,
    running: Vec<Running>,
    /// Flight id of each job, `None` for recorded logs.
    flight_ids: Vec<Option<String>>,
    /// Number of attempts to render a flight, by its id.
    flight_attempts: BTreeMap<String, usize>,
    /// Reasons why flights could not be rendered, by their id.
    failed_flights: BTreeMap<String, (JobStatus, String)>,
    /// Ids of flights that are known to be rendered.
    rendered: BTreeSet<String>,
    /// Largest measured memory of a job by the name of its log.
    peaks: BTreeMap<String, u64>,
    outcome: PoolOutcome,
}

impl<'a> Pool<'a> {
    pub(super) fn new(
        folder: &'a StudyFolder,
        plan: &'a StudyPlan,
        program: &'a str,
        jobs: &'a [KeyedJob],
        limits: PoolLimits,
    ) -> Self {
        Self {
            folder,
            plan,
            program,
            jobs,
            limits,
            waiting: (0..jobs.len()).map(|job| (job, 1)).collect(),
            running: Vec::new(),
            flight_ids: jobs.iter().map(|job| flight_of(job).map(SimulatedFlight::id)).collect(),
            flight_attempts: BTreeMap::new(),
            failed_flights: BTreeMap::new(),
            rendered: BTreeSet::new(),
            peaks: BTreeMap::new(),
            outcome: PoolOutcome::default(),
        }
    }

    /// Runs all jobs. The first interrupt ends the children; their unfinished jobs run in the next sweep.
    pub(super) fn run(mut self, interrupt: &Interrupt) -> Result<PoolOutcome> {
        let (progress, clock) = (Progress::new(), Stopwatch::start());
        let run = self.run_all(interrupt, &progress, &clock);
        for running in &mut self.running {
            // Killing a child that has just ended fails, which is harmless.
            drop(running.child.kill());
            drop(running.child.wait());
        }
        drop(progress);
        run?;
        Ok(self.outcome)
    }

    fn run_all(&mut self, interrupt: &Interrupt, progress: &Progress, clock: &Stopwatch) -> Result<()> {
        while !self.waiting.is_empty() || !self.running.is_empty() {
            if interrupt.is_set() {
                self.outcome.interrupted = true;
                return Ok(());
            }
            while self.running.len() < self.limits.jobs {
                if !self.start_next()? {
                    break;
                }
            }
            self.finish_ended(interrupt)?;
            self.show(progress, clock);
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    /// Shows the number of finished jobs and the remaining time on the terminal.
    fn show(&self, progress: &Progress, clock: &Stopwatch) {
        let PoolOutcome { done, failed, .. } = self.outcome;
        let (ended, all) = (done + failed, self.jobs.len());
        progress.show(ended as f64 / all.max(1) as f64, || {
            let problems = if failed > 0 { format!(", {failed} failed") } else { String::new() };
            let elapsed_s = clock.elapsed_ms() * 1e-3;
            let left = if ended > 0 {
                format!(", {} left", duration_text(elapsed_s / ended as f64 * (all - ended) as f64))
            } else {
                String::new()
            };
            format!("{ended} of {all} jobs{problems}{left}")
        });
    }

    /// Starts one more child if there is a waiting task and enough memory for it.
    fn start_next(&mut self) -> Result<bool> {
        let mut place = 0;
        let mut in_work: BTreeSet<String> = BTreeSet::new();
        while let Some((job, attempt)) = self.waiting.get(place).copied() {
            if let Some((flight, id)) = flight_of(&self.jobs[job]).zip(self.flight_ids[job].clone()) {
                if in_work.contains(&id) {
                    place += 1;
                    continue;
                }
                if let Some((status, message)) = self.failed_flights.get(&id).cloned() {
                    self.waiting.remove(place);
                    self.give_up(job, status, &message, 0.0, self.flight_attempts.get(&id).copied().unwrap_or(0))?;
                    continue;
                }
                if !self.is_rendered(flight, &id) {
                    let rendering =
                        |running: &Running| matches!(&running.task, Task::Flight(other) if other.id() == id);
                    if !self.running.iter().any(rendering) {
                        return self.start_flight(&flight.clone());
                    }
                    in_work.insert(id);
                    place += 1;
                    continue;
                }
            }
            let memory_bytes = self.expected_memory(job);
            if !self.fits(memory_bytes) {
                return Ok(false);
            }
            self.waiting.remove(place);
            self.start_job(job, attempt, memory_bytes)?;
            return Ok(true);
        }
        Ok(false)
    }

    fn is_rendered(&mut self, flight: &SimulatedFlight, id: &str) -> bool {
        if self.rendered.contains(id) {
            return true;
        }
        let rendered = self.folder.rendered(flight).is_some();
        if rendered {
            self.rendered.insert(id.to_owned());
        }
        rendered
    }

    /// Expected memory of a job: the maximum of earlier jobs on the same log, else on any log, else the value of the
    /// plan.
    fn expected_memory(&self, job: usize) -> u64 {
        let known = self.peaks.get(self.jobs[job].job.log.name()).or_else(|| self.peaks.values().max());
        known.copied().unwrap_or(self.plan.limits.memory_bytes)
    }

    /// True if there is memory for one more child; the first one always runs.
    fn fits(&self, memory_bytes: u64) -> bool {
        let taken: u64 = self.running.iter().map(|running| running.memory_bytes).sum();
        self.running.is_empty() || taken.saturating_add(memory_bytes) <= self.limits.memory_bytes
    }

    /// Number of threads of one child, so that the children use all processors.
    fn threads(&self) -> usize {
        let at_once = self.limits.jobs.min(self.waiting.len() + self.running.len() + 1);
        (self.limits.processors / at_once.max(1)).max(1)
    }

    fn start_flight(&mut self, flight: &SimulatedFlight) -> Result<bool> {
        let memory_bytes = self.plan.limits.memory_bytes;
        if !self.fits(memory_bytes) {
            return Ok(false);
        }
        let attempts = self.flight_attempts.entry(flight.id()).or_default();
        *attempts += 1;
        let attempt = *attempts;
        let text = serde_json::to_string(flight).context("a flight has a JSON text")?;
        let mut command = self.command(&self.folder.flight_stderr(flight))?;
        command.arg("--flight").arg(text);
        self.spawn(command, Task::Flight(Box::new(flight.clone())), attempt, memory_bytes)?;
        Ok(true)
    }

    fn start_job(&mut self, job: usize, attempt: usize, memory_bytes: u64) -> Result<()> {
        let keyed = &self.jobs[job];
        self.folder.write_job(keyed)?;
        let mut command = self.command(&self.folder.job_stderr(&keyed.key))?;
        command.args(["--key", &keyed.key, "--attempt", &attempt.to_string()]);
        if self.plan.output.frames {
            command.arg("--frames");
        }
        if self.plan.output.files {
            command.arg("--files");
        }
        self.spawn(command, Task::Job(job), attempt, memory_bytes)
    }

    /// Command line of the program itself with the hidden command for one task.
    fn command(&self, stderr: &Path) -> Result<Command> {
        let program = std::env::current_exe().context("cannot find the program's own file")?;
        let stderr = File::create(stderr).with_context(|| format!("cannot write: {}", stderr.display()))?;
        let mut command = Command::new(program);
        command.arg("sweep-job").arg(self.folder.root()).args(["--program", self.program]);
        command.env("RAYON_NUM_THREADS", self.threads().to_string());
        // A child ends when its standard input closes, so it ends with this process, however that ends.
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(stderr);
        Ok(command)
    }

    fn spawn(&mut self, mut command: Command, task: Task, attempt: usize, memory_bytes: u64) -> Result<()> {
        let child = command.spawn().context("cannot start a job")?;
        self.running.push(Running { child, task, attempt, started: Stopwatch::start(), memory_bytes });
        Ok(())
    }

    /// Collects the results of children that have ended, and kills those that exceed the time limit.
    fn finish_ended(&mut self, interrupt: &Interrupt) -> Result<()> {
        let mut place = 0;
        while place < self.running.len() {
            let running = &mut self.running[place];
            let elapsed_s = running.started.elapsed_ms() * 1e-3;
            // A flight may be waiting for another process that renders it.
            let limited = matches!(running.task, Task::Job(_));
            let timeout = limited && elapsed_s > self.plan.limits.timeout_s;
            if timeout {
                drop(running.child.kill());
            }
            let status = if timeout {
                Some(running.child.wait().context("cannot wait for a job")?)
            } else {
                running.child.try_wait().context("cannot wait for a job")?
            };
            let Some(status) = status else {
                place += 1;
                continue;
            };
            let ended = self.running.swap_remove(place);
            if interrupt.is_set() {
                // It was ended by the same Ctrl+C.
                return Ok(());
            }
            let failure = if timeout { Some(JobStatus::Timeout) } else { failure_of(status) };
            self.finish(&ended, failure, elapsed_s)?;
        }
        Ok(())
    }

    fn finish(&mut self, ended: &Running, failure: Option<JobStatus>, elapsed_s: f64) -> Result<()> {
        match &ended.task {
            Task::Flight(flight) => {
                let missing = || self.folder.rendered(flight).is_none().then_some(JobStatus::Failed);
                let failure = failure.or_else(missing).filter(|_| ended.attempt >= MAX_ATTEMPTS);
                let Some(status) = failure else { return Ok(()) };
                let message = last_lines(&self.folder.flight_stderr(flight));
                self.failed_flights.insert(flight.id(), (status, format!("the flight was not rendered: {message}")));
            }
            Task::Job(job) => {
                let key = &self.jobs[*job].key;
                let done = failure.is_none() && self.folder.is_done(key, self.plan);
                if done {
                    self.outcome.done += 1;
                    self.measure(*job)?;
                } else if ended.attempt < MAX_ATTEMPTS {
                    self.waiting.push_front((*job, ended.attempt + 1));
                } else {
                    let status = failure.unwrap_or(JobStatus::Failed);
                    let message = match status {
                        JobStatus::Timeout => {
                            format!("longer than {} s (limits.timeout_s)", self.plan.limits.timeout_s)
                        }
                        _ => last_lines(&self.folder.job_stderr(key)),
                    };
                    self.give_up(*job, status, &message, elapsed_s, ended.attempt)?;
                }
            }
        }
        Ok(())
    }

    /// Updates the peak memory of a log from the row of a run; a trajectory of another program is no measure for runs.
    fn measure(&mut self, job: usize) -> Result<()> {
        let keyed = &self.jobs[job];
        if !keyed.job.subject.computes() {
            return Ok(());
        }
        let row = self.folder.run_of(&keyed.key)?;
        let measured =
            row.and_then(|row| row.integer(0, "peak_memory_bytes")).and_then(|bytes| u64::try_from(bytes).ok());
        if let Some(bytes) = measured {
            let peak = self.peaks.entry(keyed.job.log.name().to_owned()).or_default();
            *peak = bytes.max(*peak);
        }
        Ok(())
    }

    /// Writes the row of a job without a result.
    fn give_up(&mut self, job: usize, status: JobStatus, message: &str, wall_s: f64, attempts: usize) -> Result<()> {
        let keyed = &self.jobs[job];
        let costs = JobCosts { wall_s, attempts, program: self.program.to_owned(), ..JobCosts::default() };
        self.folder.write_job(keyed)?;
        self.folder.write_failure(keyed, status, message, &costs, self.plan.output)?;
        self.outcome.failed += 1;
        Ok(())
    }
}

fn flight_of(job: &KeyedJob) -> Option<&SimulatedFlight> {
    match &job.job.log {
        JobLog::Simulated(flight) => Some(flight),
        JobLog::Recorded(_) => None,
    }
}

/// Failure of a child; `None` for success.
fn failure_of(status: ExitStatus) -> Option<JobStatus> {
    /// Exit code of a Rust program after a panic.
    const PANIC: i32 = 101;
    match status.code() {
        Some(0) => None,
        Some(PANIC) => Some(JobStatus::Crashed),
        Some(_) => Some(JobStatus::Failed),
        None => Some(ended_by_signal(status)),
    }
}

#[cfg(unix)]
fn ended_by_signal(status: ExitStatus) -> JobStatus {
    use std::os::unix::process::ExitStatusExt as _;
    /// SIGILL, SIGTRAP, SIGABRT, SIGBUS, SIGFPE, SIGSEGV and SIGSYS.
    const FAULTS: [i32; 7] = [4, 5, 6, 7, 8, 11, 31];
    if status.signal().is_some_and(|signal| FAULTS.contains(&signal)) { JobStatus::Crashed } else { JobStatus::Killed }
}

#[cfg(not(unix))]
fn ended_by_signal(_status: ExitStatus) -> JobStatus {
    JobStatus::Killed
}

/// Last lines of a file as one text; empty if there are none.
pub(super) fn last_lines(path: &Path) -> String {
    let Ok(bytes) = std::fs::read(path) else { return String::new() };
    let end = String::from_utf8_lossy(&bytes[bytes.len().saturating_sub(KEPT_BYTES)..]).into_owned();
    let lines: Vec<&str> = end.lines().filter(|line| !line.trim().is_empty()).collect();
    lines[lines.len().saturating_sub(KEPT_LINES)..].join("\n")
}

/// A duration as text: `50 s`, `12 min`, `3 h 20 min`.
pub(super) fn duration_text(duration_s: f64) -> String {
    let (minutes, seconds) = ((duration_s / 60.0).round() as u64, duration_s.round() as u64);
    match (seconds, minutes) {
        (0..=99, _) => format!("{seconds} s"),
        (_, 0..=99) => format!("{minutes} min"),
        _ => format!("{} h {} min", minutes / 60, minutes % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_short() {
        assert_eq!(duration_text(0.4), "0 s");
        assert_eq!(duration_text(99.0), "99 s");
        assert_eq!(duration_text(100.0), "2 min");
        assert_eq!(duration_text(3.0 * 3600.0 + 1200.0), "3 h 20 min");
    }
}
