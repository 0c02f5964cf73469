//! Seconds of flight until all parameters of the chain are as accurate as required: a flight that follows the motion which
//! the bar of the window asks for, move by move, against the free flight T4.
//!
//! `cargo bench --bench guided -- --seeds 1 --required translation=5mm,rotation=0.5deg`. Each row of the first table is one
//! decision: the vehicle has flown until then, the run has ended there, and the first move of the instruction is flown
//! next. A guided flight is simulated again from its start for each decision; its beginning is the same each time.

#[path = "shared/mod.rs"]
mod shared;

use std::path::Path;

use anyhow::{Context as _, Result, bail};
use dcvins::observability::laboratory::{ADVICE_DURATION_S, NEXT_MOTION_S};
use dcvins::session::{Answer, Recording, RunSpec, SessionPlan, SessionRequest, compute, motion_after, motion_text};
use dcvins::simulated_log::{SimulationOptions, simulate};
use dcvins::simulation::{Experiment, MotionSample, MotionSplines, PrescribedMotion};
use nalgebra::Rotation3;

/// Time between two rows of a flown motion, in seconds.
const ROW_S: f64 = 0.1;
/// Duration of the motion with which a guided flight begins, in seconds; a run has its first window in it.
const BEGINNING_S: f64 = 6.0;
/// Translation of that motion to either side, in metres.
const BEGINNING_M: f64 = 0.5;

struct Arguments {
    seeds: u64,
    longest_s: f64,
    required: Option<String>,
    encoder_sigma_rad: Option<f64>,
    size_px: [usize; 2],
}

impl Arguments {
    fn read(mut words: impl Iterator<Item = String>) -> Result<Self> {
        let mut arguments =
            Self { seeds: 1, longest_s: 60.0, required: None, encoder_sigma_rad: None, size_px: [640, 480] };
        while let Some(word) = words.next() {
            let mut value = || words.next().with_context(|| format!("{word} needs a value"));
            match word.as_str() {
                // Cargo adds it for a bench of its own.
                "--bench" => {}
                "--seeds" => arguments.seeds = value()?.parse()?,
                "--longest" => arguments.longest_s = value()?.parse()?,
                "--required" => arguments.required = Some(value()?),
                "--encoder-sigma-deg" => arguments.encoder_sigma_rad = Some(value()?.parse::<f64>()?.to_radians()),
                "--size" => {
                    let size = value()?;
                    let (width, height) = size.split_once('x').context("a size is as in 640x480")?;
                    arguments.size_px = [width.parse()?, height.parse()?];
                }
                _ => bail!("unknown argument {word}"),
            }
        }
        Ok(arguments)
    }

    fn options(&self, seed: u64) -> SimulationOptions {
        let flight = SimulationOptions::new(Experiment::T4);
        SimulationOptions {
            seed,
            encoder_sigma_rad: self.encoder_sigma_rad.or(flight.encoder_sigma_rad),
            static_camera: false,
            resolution_px: self.size_px,
            ..flight
        }
    }

    /// The run on a simulated flight.
    fn run(&self, options: &SimulationOptions, folder: &Path) -> Result<Recording> {
        let summary = simulate(options, &folder.join("flight.mcap"), &mut |_| ())?;
        let plan = SessionPlan::open(&SessionRequest {
            log_path: summary.log,
            specs: vec!["auto".parse::<RunSpec>()?],
            required_accuracy: self.required.clone(),
            ..SessionRequest::default()
        })?;
        Ok(compute(&plan, &mut |_| ())?.into_recording())
    }
}

/// State of the calibration after a part of a flight.
struct Reached {
    seconds: f64,
    /// Number of parameters that meet the requirement, and of all.
    met: [usize; 2],
    worst: Option<String>,
    /// Time from which on all meet it.
    since_s: Option<f64>,
    instruction: String,
    /// Motion of the instruction; its first move ends at rest.
    motion: Option<MotionSplines>,
}

impl Reached {
    fn of(recording: &Recording) -> Self {
        let run = &recording.runs[0];
        let requirement = Answer::of_run(recording, run).requirement;
        let motion =
            run.steps.last().and_then(|step| motion_after(step, &recording.rig, &run.camera_key, NEXT_MOTION_S));
        Self {
            seconds: recording.last_stamp_ns() as f64 * 1e-9,
            met: requirement.as_ref().map_or([0, 0], |it| [it.met, it.parameters]),
            worst: requirement.as_ref().and_then(|it| it.worst.clone()),
            since_s: requirement.and_then(|it| it.since_s),
            instruction: motion.as_ref().map_or_else(String::new, |motion| motion_text(motion, &recording.rig)),
            motion: motion.map(|motion| motion.motion),
        }
    }

    fn row(&self, seed: u64) -> Vec<String> {
        let [met, parameters] = self.met;
        let worst = self.worst.clone().unwrap_or_default();
        vec![
            seed.to_string(),
            format!("{:.1}", self.seconds),
            format!("{met} of {parameters}"),
            worst,
            self.instruction.clone(),
        ]
    }
}

/// Motion to either side for a few seconds, with which a flight begins.
fn beginning(joints_rad: &[f64]) -> MotionSplines {
    let mut splines = MotionSplines::at_rest(joints_rad, BEGINNING_S, 20);
    let sideways = joints_rad.len() + 1;
    for index in splines.free_points() {
        let half_turn = std::f64::consts::PI * splines.time_of_point(index) / BEGINNING_S;
        splines.set_point(sideways, index, BEGINNING_M * (2.0 * half_turn).sin() * half_turn.sin());
    }
    splines
}

/// Appends a motion that begins at rest where the vehicle and its joints are, slowed down by a factor.
fn append(flown: &mut PrescribedMotion, motion: &MotionSplines, duration_s: f64, slowness: f64) {
    let rows = (duration_s * slowness / ROW_S).round() as usize;
    let sample = |row: usize| motion.sample((row as f64 * ROW_S / slowness).min(duration_s));
    let Some(last) = flown.samples.last().cloned() else {
        flown.samples = (0..=rows).map(sample).collect();
        return;
    };
    let first = motion.sample(0.0);
    let turn = Rotation3::from_euler_angles(0.0, 0.0, last.heading_rad);
    for row in 1..=rows {
        let sample = sample(row);
        let joints = sample.joints_rad.iter().zip(&first.joints_rad).zip(&last.joints_rad);
        flown.samples.push(MotionSample {
            time_s: last.time_s + row as f64 * ROW_S,
            joints_rad: joints.map(|((angle, begin), at)| at + angle - begin).collect(),
            position_m: last.position_m + turn * (sample.position_m - first.position_m),
            heading_rad: last.heading_rad + sample.heading_rad - first.heading_rad,
        });
    }
}

/// Factors by which a move is slowed down until the simulated vehicle can fly it after the moves before.
const SLOWNESSES: [f64; 3] = [1.0, 1.2, 1.5];

/// Flies the first move of a motion after what has been flown, as fast as the vehicle can, and runs the estimator over it.
fn fly(
    arguments: &Arguments,
    seed: u64,
    folder: &Path,
    flown: &mut PrescribedMotion,
    motion: &MotionSplines,
    duration_s: f64,
) -> Result<Recording> {
    let mut problem = None;
    for slowness in SLOWNESSES {
        let mut next = flown.clone();
        append(&mut next, motion, duration_s, slowness);
        let options = SimulationOptions { motion: Some(next.clone()), ..arguments.options(seed) };
        match arguments.run(&options, folder) {
            Ok(recording) => {
                *flown = next;
                return Ok(recording);
            }
            Err(refused) => problem = Some(refused),
        }
    }
    Err(problem.context("no speed of the motion was tried")?)
}

/// A guided flight from its beginning to the required accuracy, or to the longest time; prints one row per decision.
#[expect(clippy::print_stdout, reason = "a bench prints what it measured")]
fn guided(arguments: &Arguments, seed: u64, folder: &Path) -> Result<Reached> {
    let short = SimulationOptions { duration_s: Some(0.5), ..arguments.options(seed) };
    let joint_names = arguments.run(&short, folder)?.rig.joint_names();
    let (mut motion, mut duration_s) = (beginning(&vec![0.0; joint_names.len()]), BEGINNING_S);
    let mut flown = PrescribedMotion { joint_names, samples: Vec::new() };
    loop {
        let reached = Reached::of(&fly(arguments, seed, folder, &mut flown, &motion, duration_s)?);
        println!("{}", shared::markdown::line(&reached.row(seed)));
        match &reached.motion {
            Some(next) if reached.seconds < arguments.longest_s => motion = next.clone(),
            _ => return Ok(reached),
        }
        duration_s = ADVICE_DURATION_S;
    }
}

#[expect(clippy::print_stdout, reason = "a bench prints what it measured")]
fn main() -> Result<()> {
    let arguments = Arguments::read(std::env::args().skip(1))?;
    let folder = tempfile::tempdir()?;
    let mut flights = Vec::new();
    println!(
        "{}",
        shared::markdown::head(&["seed", "flown, s", "parameters as accurate as required", "worst", "instruction"])
    );
    for seed in 1..=arguments.seeds {
        let guided = guided(&arguments, seed, folder.path())?;
        let free = SimulationOptions { duration_s: Some(arguments.longest_s), ..arguments.options(seed) };
        let free = Reached::of(&arguments.run(&free, folder.path())?);
        for (name, reached) in [("guided", guided), ("T4", free)] {
            let since = reached.since_s.map_or_else(|| format!("not in {:.0}", reached.seconds), |s| format!("{s:.1}"));
            let [met, parameters] = reached.met;
            let end = format!("{met} of {parameters} {}", reached.worst.unwrap_or_default());
            flights.push(vec![seed.to_string(), name.to_owned(), since, end]);
        }
    }
    let mut table = String::new();
    let header = ["seed", "flight", "required accuracy after, s", "at the end"];
    shared::markdown::write_table(&mut table, "\nSeconds to the required accuracy", &header, &flights)?;
    println!("{table}");
    if let Some(cpu_s) = shared::process::cpu_s() {
        println!("\nprocessor time: {cpu_s:.0} s");
    }
    Ok(())
}
