//! The sub-commands: each turns its arguments into calls of the library and prints what came of it.

#[cfg(feature = "gui")]
use anyhow::{Context as _, Result, bail};
use dcvins::calibration::CalibrationOptions;
use dcvins::export::{self, EvaluationOptions, RunFileOptions, RunSummary};
use dcvins::flight_log::{self, FlightLog};
use dcvins::geometry::seconds_from_ns;
use dcvins::log_check;
use dcvins::observability::LEAST_FALSE_GAIN;
use dcvins::sensors::Rig;
use dcvins::session::breakpoints::Condition;
use dcvins::session::{self, BreakpointHit, CalibrationRequest, Computation, Recording, SessionPlan, Stopwatch};
use dcvins::simulation::{self, Experiment, SimulationOptions};
use std::io::{self, IsTerminal as _, Write as _};
use std::path::Path;
use std::sync::Arc;

use crate::cli::arguments::{
    CalibrateArguments, CheckArguments, ConvertArguments, EncoderArgument, EvaluateArguments, ExperimentArgument,
    RunArguments, SimulateArguments, ViewArguments,
};

/// Least time between two drawings of the progress bar.
const PROGRESS_PERIOD_MS: f64 = 100.0;
/// Width of the progress bar in characters.
const PROGRESS_WIDTH: usize = 32;

/// Writes to standard output; a reader that went away is no failure.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to standard output"),
    }
}

/// Says something to the person at the terminal.
#[cfg(feature = "gui")]
pub(crate) fn tell(text: &str) {
    // With standard error gone there is nobody left to tell.
    drop(writeln!(io::stderr(), "{text}"));
}

/// A bar on standard error, none when that is not a terminal.
struct Progress {
    watch: Option<Stopwatch>,
    drawn_ms: f64,
}

impl Progress {
    fn new() -> Self {
        Self { watch: io::stderr().is_terminal().then(Stopwatch::start), drawn_ms: -PROGRESS_PERIOD_MS }
    }

    fn show(&mut self, share: f64, text: impl FnOnce() -> String) {
        let Some(watch) = &self.watch else { return };
        let now_ms = watch.elapsed_ms();
        if now_ms - self.drawn_ms < PROGRESS_PERIOD_MS {
            return;
        }
        self.drawn_ms = now_ms;
        let filled = ((share.clamp(0.0, 1.0) * PROGRESS_WIDTH as f64) as usize).min(PROGRESS_WIDTH);
        let bar = ["█".repeat(filled), "░".repeat(PROGRESS_WIDTH - filled)].concat();
        drop(write!(io::stderr(), "\r{bar} {:3.0} % {}\x1b[K", share * 100.0, text()));
    }

    fn clear(&self) {
        if self.watch.is_some() {
            drop(write!(io::stderr(), "\r\x1b[K"));
        }
    }
}

/// Computes a plan to its end (or to a time of the log) with a progress bar.
pub(crate) fn compute(plan: &SessionPlan, until_ns: Option<i64>) -> Result<Computation> {
    let begin_s = plan.start_s;
    let log_end_s = seconds_from_ns(plan.log.duration_ns());
    let end_s = plan.duration_s.map_or(log_end_s, |duration_s| log_end_s.min(begin_s + duration_s));
    let end_s = until_ns.map_or(end_s, |until_ns| end_s.min(seconds_from_ns(until_ns)));
    let mut progress = Progress::new();
    let computation = session::compute(plan, until_ns, &mut |recording| {
        let now_s = seconds_from_ns(recording.computed_ns());
        progress.show((now_s - begin_s) / (end_s - begin_s).max(1e-3), || format!("{now_s:.1} of {end_s:.1} s"));
    })?;
    progress.clear();
    Ok(computation)
}

/// Computes a plan until a condition comes true, with a progress bar.
fn compute_until(plan: &SessionPlan, condition: &Condition) -> Result<(Recording, Option<BreakpointHit>)> {
    let (names, parameters) = (plan.rig.parameter_names(), plan.parameters());
    let unknown = condition.unknown_names(&names, &parameters);
    if !unknown.is_empty() {
        let known: Vec<String> = parameters.iter().map(|parameter| names.name(*parameter)).collect();
        bail!("no run has '{}' of '{condition}'; there are {}", unknown.join("', '"), known.join(", "));
    }
    let end_s = seconds_from_ns(plan.log.duration_ns());
    let mut progress = Progress::new();
    let (computation, hit) = session::compute_until(plan, condition, &mut |recording| {
        let now_s = seconds_from_ns(recording.computed_ns());
        progress.show(now_s / end_s.max(1e-3), || format!("{now_s:.1} s, looking for {condition}"));
    })?;
    progress.clear();
    Ok((computation.into_recording(), hit))
}

/// What `--break` came to, in a line for people.
fn describe_break(condition: &Condition, hit: Option<&BreakpointHit>) -> String {
    hit.map_or_else(|| format!("break: '{condition}' never came true\n"), |hit| format!("break: {}\n", hit.description))
}

/// What `--break` came to, for programs.
fn break_json(condition: &Condition, hit: Option<&BreakpointHit>, recording: &Recording) -> serde_json::Value {
    let Some(found) = hit else { return serde_json::json!({ "condition": condition.text(), "hit": null }) };
    let run = recording.runs.get(found.hit.run);
    let values: serde_json::Map<String, serde_json::Value> =
        found.values.iter().map(|value| (value.name.clone(), value.value.into())).collect();
    serde_json::json!({
        "condition": condition.text(),
        "hit": {
            "run": run.map(|run| run.spec.label.as_str()),
            "time_s": seconds_from_ns(found.hit.stamp_ns),
            "frame": run.and_then(|run| run.steps.get(found.hit.step)).map(|step| step.report.frame_index),
            "values": values,
        },
    })
}

/// `dcvins run`.
pub(crate) fn run(arguments: &RunArguments) -> Result<()> {
    let plan = SessionPlan::open(&arguments.estimation.request(arguments.log.clone()))?;
    let (recording, hit) = match &arguments.break_at {
        Some(condition) => compute_until(&plan, condition)?,
        None => (compute(&plan, None)?.into_recording(), None),
    };
    let mut summaries = Vec::new();
    for run in &recording.runs {
        let options =
            RunFileOptions { timing: !arguments.no_timing, mcap: arguments.mcap, euroc_trajectory: arguments.euroc };
        let (folder, summary) = export::write_run(&recording, run, &arguments.out, options)?;
        summaries.push((folder, summary));
    }
    if arguments.json {
        let all: Vec<&RunSummary> = summaries.iter().map(|(_, summary)| summary).collect();
        let text = match &arguments.break_at {
            Some(condition) => serde_json::to_string_pretty(&serde_json::json!({
                "break": break_json(condition, hit.as_ref(), &recording),
                "runs": all,
            })),
            None => serde_json::to_string_pretty(&all),
        };
        print(&format!("{}\n", text?))?;
    } else {
        for (folder, summary) in &summaries {
            print(&describe(folder, summary))?;
        }
        if let Some(condition) = &arguments.break_at {
            print(&describe_break(condition, hit.as_ref()))?;
        }
    }
    let failed: Vec<&str> = recording.runs.iter().filter_map(|run| run.error.as_deref()).collect();
    if !failed.is_empty() {
        bail!("{}", failed.join("; "));
    }
    if recording.runs.iter().all(|run| run.steps.is_empty()) {
        let log = export::log_name(&arguments.log);
        bail!("no image of '{log}' could be used; 'dcvins check {}' says why", arguments.log.display());
    }
    Ok(())
}

/// A run's summary in a few lines.
fn describe(folder: &Path, summary: &RunSummary) -> String {
    let frames = &summary.frames;
    let mut lines = vec![format!("{} on {} ({})\n", summary.run, summary.log, summary.camera)];
    let begin = frames
        .initialized_at_s
        .map_or_else(|| "never initialized".to_owned(), |time_s| format!("initialized at {time_s:.2} s"));
    lines.push(format!(
        "  frames       {} of {} estimated, {} keyframes, {begin}, {} restarts\n",
        frames.estimated, frames.total, frames.keyframes, frames.restarts
    ));
    if let Some(accuracy) = &summary.accuracy {
        lines.push(format!(
            "  accuracy     ATE {:.3} m rmse, {:.3} m max ({}), {:.2} % of {:.1} m\n",
            accuracy.ate_rmse_m,
            accuracy.ate_max_m,
            accuracy.alignment,
            accuracy.ate_percent_of_length,
            summary.length_m
        ));
    } else if let Some(reason) = &summary.accuracy_missing {
        lines.push(format!("  accuracy     none: {reason}\n"));
    }
    let calibration = &summary.calibration;
    if let (Some(first), Some(last)) = (&calibration.chain_error_initial, &calibration.chain_error) {
        lines.push(format!(
            "  chain error  {:.1} mm, {:.2}° with the rig's values; {:.1} ± {:.1} mm, {:.2} ± {:.2}° at the end ({})\n",
            first.translation_mean_m * 1e3,
            first.rotation_mean_rad.to_degrees(),
            last.translation_mean_m * 1e3,
            last.translation_std_m * 1e3,
            last.rotation_mean_rad.to_degrees(),
            last.rotation_std_rad.to_degrees(),
            calibration.parameterization
        ));
    }
    if let Some(rank) = &summary.rank {
        lines.push(format!(
            "  rank         structural {} of {}, informed {}; lost: {} parameterization, {} joints, {} absorbed, {} motion\n",
            rank.rank_structural,
            rank.columns,
            rank.rank_informed,
            rank.deficit.parameterization,
            rank.deficit.joints,
            rank.deficit.absorbed,
            rank.deficit.motion
        ));
        let held = |known: &export::KnownLossSummary| known.agreeing == known.steps;
        if !rank.known.is_empty() {
            let agreeing = rank.known.iter().filter(|known| held(known)).count();
            lines.push(format!(
                "  structure    {agreeing} of {} known losses measured as null in every step; {}\n",
                rank.known.len(),
                falsely_known(&rank.known)
            ));
        }
        lines.extend(rank.known.iter().filter(|known| !held(known)).map(|known| {
            format!("               null in {} of {} steps only: {}\n", known.agreeing, known.steps, known.reason)
        }));
    }
    if let (Some(timing), Some(factor)) = (&summary.timing_ms, summary.real_time_factor) {
        let stage = |stage: &export::StageSummary| format!("{:.1}/{:.1}", stage.p50, stage.p95);
        lines.push(format!(
            "  ms p50/p95   front end {}, optimize {}, linearize {}, report {}, marginalize {}, observability {}, step {}; {factor:.1} × real time\n",
            stage(&timing.frontend),
            stage(&timing.optimize),
            stage(&timing.linearize),
            stage(&timing.report),
            stage(&timing.marginalize),
            stage(&timing.observability),
            stage(&timing.step)
        ));
    }
    for warning in &summary.warnings {
        lines.push(format!("  warning      {warning}\n"));
    }
    lines.push(format!("  files        {}\n", folder.display()));
    lines.concat()
}

/// How much priors claim of what nobody can measure.
fn falsely_known(known: &[export::KnownLossSummary]) -> String {
    let claimed = known.iter().map(|known| known.largest_false_gain).filter(|gain| *gain > LEAST_FALSE_GAIN);
    match (claimed.clone().count(), claimed.fold(0.0, f64::max)) {
        (0, _) => "no prior claims to know them".to_owned(),
        (count, most) => format!("priors falsely claim {count}, up to {most:.2} (1: as much as 10° or 3 cm)"),
    }
}

/// `dcvins evaluate`.
pub(crate) fn evaluate(arguments: &EvaluateArguments) -> Result<()> {
    let options = EvaluationOptions {
        alignment: arguments.align.into(),
        delta: arguments.delta,
        max_difference_s: arguments.max_difference,
    };
    let report = export::evaluate(&arguments.estimate, &arguments.reference, &options)?;
    if arguments.json {
        print(&format!("{}\n", serde_json::to_string_pretty(&report)?))
    } else {
        print(&report.to_string())
    }
}

/// `dcvins view`: the window, or its pictures where there is no display.
#[cfg(feature = "gui")]
pub(crate) fn view(arguments: &ViewArguments) -> Result<()> {
    use dcvins::export::{Machine, is_session};
    use dcvins::gui::app::PlayingLog;
    use dcvins::gui::app::run_window::{WindowError, WindowOptions, run_window};
    use dcvins::gui::theme::ThemeName;
    use dcvins::session::Session;
    use parking_lot::Mutex;

    // What is wrong with the log or its rig is told here, before a window opens.
    let request = |log: &Path| arguments.estimation.request(log.to_owned());
    let given = arguments.log.as_deref();
    let plan = given.filter(|path| !is_session(path)).map(|log| SessionPlan::open(&request(log))).transpose()?;
    if let Some(path) = given.filter(|path| is_session(path)) {
        saved_session(path)?;
    }
    let opened = Mutex::new(plan.clone());
    let estimation = arguments.estimation.clone();
    let open_log = move |path: &Path| {
        let mut opened = opened.lock();
        // The log of the command line is open already; whatever comes later is opened here.
        let session = match opened.take().filter(|plan| plan.log_path == path) {
            Some(plan) => Session::start(plan),
            None if is_session(path) => {
                let session = saved_session(path).and_then(|saved| Ok(saved.open()?));
                let session = session.map_err(|error| format!("{error:#}: {}", path.display()))?;
                return Ok(Box::new(session) as Box<dyn PlayingLog>);
            }
            None => Session::open(&estimation.request(path.to_owned())),
        };
        Ok(Box::new(session.map_err(|error| error.to_string())?) as Box<dyn PlayingLog>)
    };
    let options = WindowOptions {
        log: None,
        log_path: arguments.log.clone(),
        open_log: Arc::new(open_log),
        desktop: Arc::new(Machine::new()),
        theme: ThemeName::Light,
    };
    match (run_window(options), &plan) {
        (Err(WindowError::NoDisplay), Some(plan)) => write_pictures(plan, arguments.out.as_deref()),
        (result, _) => Ok(result?),
    }
}

/// Reads a saved session.
#[cfg(feature = "gui")]
pub(crate) fn saved_session(path: &Path) -> Result<session::SavedSession> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    session::SavedSession::from_text(&text).with_context(|| format!("cannot open {}", path.display()))
}

/// `dcvins view` of a program that was built without the window.
#[cfg(not(feature = "gui"))]
pub(crate) fn view(_arguments: &ViewArguments) -> Result<()> {
    bail!("this program was built without the window (cargo feature 'gui'); 'dcvins run LOG --out DIR' works")
}

/// What the window would show at the end of the log, as pictures.
#[cfg(feature = "gui")]
fn write_pictures(plan: &SessionPlan, out: Option<&Path>) -> Result<()> {
    use dcvins::export::{PANEL_NAMES, PictureOptions, draw_panel, write_png};
    use dcvins::flight_log::ImageReader;

    let stem = plan.log_path.file_stem().unwrap_or(plan.log_path.as_os_str());
    let folder = out.map_or_else(|| Path::new("dcvins-output").join(stem), Path::to_path_buf);
    tell(&format!("dcvins: there is no display, so the pictures are written to {}", folder.display()));
    let mut computation = compute(plan, None)?;
    computation.fill_in(computation.recording().last_stamp_ns());
    let recording = computation.into_recording();
    let mut images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
    let options = PictureOptions::default();
    for name in PANEL_NAMES {
        let path = folder.join(format!("{name}.png"));
        write_png(&draw_panel(name, &recording, recording.last_stamp_ns(), &mut images, &options)?, &path)?;
        print(&format!("{}\n", path.display()))?;
    }
    for run in &recording.runs {
        let (folder, summary) = export::write_run(&recording, run, &folder, RunFileOptions::default())?;
        print(&describe(&folder, &summary))?;
    }
    Ok(())
}

/// `dcvins calibrate`.
pub(crate) fn calibrate(arguments: &CalibrateArguments) -> Result<()> {
    let request = CalibrationRequest {
        log_path: arguments.log.clone(),
        rig_path: arguments.rig.clone(),
        truth_path: arguments.truth.clone(),
        start_s: arguments.start,
        duration_s: arguments.duration,
    };
    let mut progress = Progress::new();
    let run = session::calibrate(&request, &CalibrationOptions::default(), &mut |at| {
        progress.show(at.share, || at.stage.to_owned());
    });
    progress.clear();
    let run = run?;
    let report = export::report_calibration(&run);
    export::write_calibration(&run, &report, &arguments.out)?;
    if arguments.json {
        print(&format!("{}\n", serde_json::to_string_pretty(&report)?))
    } else {
        print(&format!("{report}  files        {}\n", arguments.out.display()))
    }
}

/// `dcvins check`.
pub(crate) fn check(arguments: &CheckArguments) -> Result<()> {
    let log = Arc::new(FlightLog::open(&arguments.log)?);
    let rig = Rig::for_log(&log, arguments.rig.as_deref());
    let rotations = rig.as_ref().map_or_else(|_| Vec::new(), |rig| session::image_rotations(&log, rig));
    let report = log_check::check(&log, rig.as_ref(), &rotations);
    if arguments.json {
        print(&format!("{}\n", serde_json::to_string_pretty(&report)?))
    } else {
        print(&report.to_string())
    }
}

/// `dcvins convert`.
pub(crate) fn convert(arguments: &ConvertArguments) -> Result<()> {
    let mut progress = Progress::new();
    let report = flight_log::convert::convert(&arguments.source, &arguments.output, &mut |share| {
        progress.show(share, String::new);
    });
    progress.clear();
    let report = report?;
    if arguments.json {
        print(&format!("{}\n", serde_json::to_string_pretty(&report)?))
    } else {
        print(&report.to_string())
    }
}

/// `dcvins simulate`.
pub(crate) fn simulate(arguments: &SimulateArguments) -> Result<()> {
    let experiment = match arguments.experiment {
        ExperimentArgument::T1 => Experiment::T1,
        ExperimentArgument::T2 => Experiment::T2,
        ExperimentArgument::T3 => Experiment::T3,
        ExperimentArgument::T4 => Experiment::T4,
    };
    let mut options = SimulationOptions::new(experiment);
    options.seed = arguments.seed;
    options.duration_s = arguments.duration;
    options.resolution_px = arguments.size;
    options.camera_rate_hz = arguments.rate;
    options.static_camera = !arguments.no_static_camera;
    match arguments.encoder_sigma_deg {
        Some(EncoderArgument::None) => options.encoder_sigma_rad = None,
        Some(EncoderArgument::Sigma(sigma_deg)) => options.encoder_sigma_rad = Some(sigma_deg.to_radians()),
        None => {}
    }
    for disturbance in &arguments.disturb {
        options.disturbances.set(disturbance)?;
    }
    let mut progress = Progress::new();
    let summary = simulation::simulate(&options, &arguments.output, &mut |at| {
        let share = at.images_done as f64 / at.images_total.max(1) as f64;
        progress.show(share, || format!("{} of {} images", at.images_done, at.images_total));
    })?;
    progress.clear();
    let (translation_m, rotation_rad) = summary.given_chain_error;
    print(&format!(
        "{}: {:.1} s, {:.1} m, {} images; the given chain is off by {:.1} mm and {:.2}°\n{}\n{}\n",
        summary.log.display(),
        summary.duration_s,
        summary.path_length_m,
        summary.images,
        translation_m * 1e3,
        rotation_rad.to_degrees(),
        summary.rig.display(),
        summary.truth.display(),
    ))
}
