//! Parsing of a plan: its keys, their types and ranges.

use std::collections::{BTreeMap, BTreeSet};

use super::document::{PlanError, SEEDS, Section, parse};
use super::study_plan::{DisturbanceSet, JobLimits, LOG_PLACE, LogSource, SlurmOptions, StudyOutput, StudyPlan};
use super::tables;
use crate::session::{RunSpec, TrajectorySpec, TrajectorySpecError};
use crate::simulated_log::Disturbances;
use crate::study::job::Bundle;
use crate::study::perturbation::{Distribution, MagnitudeError, RigChange, RigPerturbation, RigQuantity};
use crate::study::recipe::{EncoderNoise, FlightRecipe};
use crate::text::Named as _;

const PLAN_KEYS: [&str; 14] = [
    "name",
    "seeds",
    "specs",
    "bundles",
    "logs",
    "flights",
    "disturbances",
    "perturbations",
    "exclude",
    "limits",
    "output",
    "slurm",
    "tolerance",
    "tables",
];
/// Range of times in a plan, in seconds.
const SECONDS: std::ops::RangeInclusive<f64> = 0.0..=1e6;

impl StudyPlan {
    /// Parses a plan.
    ///
    /// # Errors
    /// For invalid TOML, an unknown key, a value of the wrong type or out of its range, and for a plan without logs or
    /// with two levels of the same name.
    pub fn from_toml(text: &str) -> Result<Self, PlanError> {
        let document = parse(text)?;
        let root = Section::root(&document);
        root.allow(&PLAN_KEYS)?;
        let plan = Self {
            name: root.text("name")?.unwrap_or_default(),
            logs: root.sections("logs")?.iter().map(log).collect::<Result<_, _>>()?,
            flights: root.sections("flights")?.iter().map(flight).collect::<Result<_, _>>()?,
            specs: specs(&root)?,
            bundles: root.texts("bundles", bundle)?,
            perturbations: perturbations(&root)?,
            disturbances: disturbances(&root)?,
            seeds: seeds(&root)?,
            limits: root.section("limits")?.as_ref().map_or_else(|| Ok(JobLimits::default()), limits)?,
            output: root.section("output")?.as_ref().map_or_else(|| Ok(StudyOutput::default()), output)?,
            slurm: root.section("slurm")?.as_ref().map_or_else(|| Ok(SlurmOptions::default()), slurm)?,
            exclusions: tables::exclusions(&root)?,
            tables: tables::tables(&root)?,
            tolerances: root.section("tolerance")?.as_ref().map_or_else(|| Ok(BTreeMap::new()), tolerances)?,
        };
        if plan.logs.is_empty() && plan.flights.is_empty() {
            return Err(root.error("has no logs: expected [[logs]] with a path, or [[flights]] with an experiment"));
        }
        if plan.flights.is_empty() && plan.disturbances.iter().any(|set| !set.disturb.is_empty()) {
            return Err(
                root.error_at("disturbances", "disturb simulated flights, and there are none: expected [[flights]]")
            );
        }
        distinct(&root, "flights", plan.flights.iter().map(|flight| flight.name.as_str()))?;
        distinct(&root, "perturbations", plan.perturbations.iter().map(|level| level.name.as_str()))?;
        distinct(&root, "disturbances", plan.disturbances.iter().map(|level| level.name.as_str()))?;
        distinct(&root, "specs", plan.labels())?;
        for trajectory in plan.logs.iter().flat_map(|log| &log.trajectories) {
            if plan.labels().any(|label| label == trajectory.label) {
                let problem =
                    format!("a trajectory and a run are named '{}', expected different names", trajectory.label);
                return Err(root.error_at("specs", &problem));
            }
        }
        tables::check_exclusions(&root, &plan)?;
        Ok(plan)
    }
}

/// Returns an error if two levels have the same name.
fn distinct<'a>(root: &Section<'_>, key: &str, names: impl Iterator<Item = &'a str>) -> Result<(), PlanError> {
    let mut known = BTreeSet::new();
    for name in names {
        if !known.insert(name) {
            return Err(root.error_at(key, &format!("has two entries named '{name}', expected different names")));
        }
    }
    Ok(())
}

fn seeds(root: &Section<'_>) -> Result<Vec<u64>, PlanError> {
    let seeds = root.integers("seeds", SEEDS)?;
    if root.has("seeds") && seeds.is_empty() {
        return Err(root.error_at("seeds", "is empty, expected at least one integer"));
    }
    let distinct: BTreeSet<u64> = seeds.iter().copied().collect();
    if distinct.len() < seeds.len() {
        return Err(root.error_at("seeds", "has a seed twice, expected different integers"));
    }
    Ok(if seeds.is_empty() { vec![1] } else { seeds })
}

fn specs(root: &Section<'_>) -> Result<Vec<RunSpec>, PlanError> {
    let specs = root.texts("specs", |text| text.parse::<RunSpec>().map_err(|problem| problem.to_string()))?;
    if root.has("specs") && specs.is_empty() {
        return Err(root.error_at("specs", "is empty, expected at least one run, as in [\"auto\"]"));
    }
    Ok(if specs.is_empty() { vec![RunSpec::default()] } else { specs })
}

fn bundle(name: &str) -> Result<Bundle, String> {
    Bundle::from_name(name).ok_or_else(|| format!("expected {}", Bundle::alternatives()))
}

/// The name of a level: short, and without line breaks.
fn level_name(section: &Section<'_>) -> Result<String, PlanError> {
    let name = section.required_text("name")?;
    let fits = (1..=80).contains(&name.chars().count()) && !name.chars().any(char::is_control);
    if fits { Ok(name) } else { Err(section.error_at("name", "expected 1 to 80 characters on one line")) }
}

fn log(section: &Section<'_>) -> Result<LogSource, PlanError> {
    section.allow(&["path", "name", "rig", "truth", "start_s", "duration_s", "trajectories"])?;
    let name = section.has("name").then(|| level_name(section)).transpose()?;
    Ok(LogSource {
        pattern: section.required_text("path")?,
        name,
        rig: section.text("rig")?,
        truth: section.text("truth")?,
        start_s: section.number("start_s", SECONDS)?.unwrap_or(0.0),
        duration_s: section.number("duration_s", 0.1..=1e6)?,
        trajectories: trajectories(section)?,
    })
}

/// Trajectories of other programs, each with a unique name.
fn trajectories(section: &Section<'_>) -> Result<Vec<TrajectorySpec>, PlanError> {
    let trajectories = section.texts("trajectories", |text| {
        let spec: TrajectorySpec = text.parse().map_err(|problem: TrajectorySpecError| problem.to_string())?;
        if spec.label.contains(LOG_PLACE) {
            return Err(format!("'{text}' has no label: expected one name for all logs, as in \"{text}:vins\""));
        }
        Ok(spec)
    })?;
    let mut known = BTreeSet::new();
    if let Some(twice) = trajectories.iter().find(|spec| !known.insert(spec.label.as_str())) {
        let problem = format!("has two entries named '{}', expected different names", twice.label);
        return Err(section.error_at("trajectories", &problem));
    }
    Ok(trajectories)
}

fn flight(section: &Section<'_>) -> Result<FlightRecipe, PlanError> {
    section.allow(&[
        "name",
        "experiment",
        "world",
        "swing_deg",
        "mirrored",
        "duration_s",
        "encoder_sigma_deg",
        "size_px",
        "rate_hz",
        "static_camera",
        "camera_rate_hz",
        "camera_phase_ms",
        "stereo_m",
        "gimbal_camera",
        "gimbal_imu",
        "disturb",
        "start_error_m",
        "start_error_deg",
        "imu_noise_scale",
        "lens",
    ])?;
    let experiment = section.required_text("experiment")?.to_ascii_uppercase();
    let name = if section.has("name") { level_name(section)? } else { experiment.to_ascii_lowercase() };
    let size_px = match section.integers("size_px", 32..=4096)?.as_slice() {
        [] => [640, 480],
        [width, height] => [*width as usize, *height as usize],
        _ => return Err(section.error_at("size_px", "expected width and height, as in [640, 480]")),
    };
    let encoder = section.number_or(
        "encoder_sigma_deg",
        |sigma_deg| (sigma_deg > 0.0 && sigma_deg <= 90.0).then_some(EncoderNoise::Degrees(sigma_deg)),
        |text| (text == "none").then_some(EncoderNoise::None),
        "degrees, a number above 0 and up to 90, or \"none\"",
    )?;
    let recipe = FlightRecipe {
        name,
        experiment,
        world: section.text("world")?,
        swing_deg: section.number("swing_deg", 0.0..=90.0)?,
        mirrored: section.boolean("mirrored")?.unwrap_or(false),
        duration_s: section.number("duration_s", 0.5..=3600.0)?,
        encoder: encoder.unwrap_or(EncoderNoise::OfExperiment),
        size_px,
        rate_hz: section.number("rate_hz", 0.1..=200.0)?.unwrap_or(20.0),
        static_camera: section.boolean("static_camera")?.unwrap_or(true),
        static_camera_rate_hz: section.number("camera_rate_hz", 0.1..=200.0)?,
        static_camera_phase_s: section.number("camera_phase_ms", 0.0..=10_000.0)?.map(|phase_ms| 1e-3 * phase_ms),
        stereo_baseline_m: section.number("stereo_m", 0.01..=2.0)?,
        gimbal_camera: section.text("gimbal_camera")?,
        gimbal_imu_noise_scale: section.number("gimbal_imu", 0.0..=1000.0)?,
        disturb: disturb(section)?,
        start_error_m: section.number("start_error_m", 0.0..=1.0)?,
        start_error_deg: section.number("start_error_deg", 0.0..=90.0)?,
        imu_noise_scale: section.number("imu_noise_scale", 0.0..=1000.0)?.unwrap_or(1.0),
        lens: section.text("lens")?.unwrap_or_else(|| "pinhole".to_owned()),
    };
    recipe.check().map_err(|(key, problem)| section.error_at(key, &problem))?;
    Ok(recipe)
}

/// A list of disturbances in the syntax of `dcvins simulate --disturb`.
fn disturb(section: &Section<'_>) -> Result<Vec<String>, PlanError> {
    section.texts("disturb", |text| {
        Disturbances::default().set(text).map(|()| text.to_owned()).map_err(|problem| problem.to_string())
    })
}

fn disturbances(root: &Section<'_>) -> Result<Vec<DisturbanceSet>, PlanError> {
    let read = |section: &Section<'_>| {
        section.allow(&["name", "disturb"])?;
        Ok(DisturbanceSet { name: level_name(section)?, disturb: disturb(section)? })
    };
    let mut levels = root.sections("disturbances")?.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    if levels.is_empty() {
        levels.push(DisturbanceSet { name: "none".to_owned(), disturb: Vec::new() });
    }
    Ok(levels)
}

fn perturbations(root: &Section<'_>) -> Result<Vec<RigPerturbation>, PlanError> {
    let mut levels = root.sections("perturbations")?.iter().map(perturbation).collect::<Result<Vec<_>, _>>()?;
    if levels.is_empty() {
        levels.push(RigPerturbation { name: "none".to_owned(), ..RigPerturbation::default() });
    }
    Ok(levels)
}

fn perturbation(section: &Section<'_>) -> Result<RigPerturbation, PlanError> {
    section.allow(&["name", "start", "prior", "changes"])?;
    let start = section.named("start")?.unwrap_or_default();
    let match_prior = match section.text("prior")?.as_deref() {
        None | Some("rig") => false,
        Some("changes") => true,
        Some(other) => {
            return Err(section.error_at("prior", &format!("is '{other}', expected \"rig\" or \"changes\"")));
        }
    };
    let changes = section.sections("changes")?.iter().map(change).collect::<Result<_, _>>()?;
    Ok(RigPerturbation { name: level_name(section)?, start, match_prior, changes })
}

fn change(section: &Section<'_>) -> Result<RigChange, PlanError> {
    section.allow(&["quantity", "distribution", "magnitude"])?;
    let quantity = section.required_text("quantity")?;
    let unknown = || {
        let names = RigQuantity::names();
        section.error_at("quantity", &format!("is '{quantity}', expected one of {names}"))
    };
    let quantity = RigQuantity::from_name(&quantity).ok_or_else(unknown)?;
    let distribution = section.named("distribution")?.unwrap_or(Distribution::Uniform);
    let expected = MagnitudeError { dimension: quantity.dimension() }.to_string();
    let in_range = |value: f64| quantity.range().contains(&value).then_some(value);
    let magnitude = section.number_or(
        "magnitude",
        in_range,
        |text| quantity.dimension().parse(text).and_then(in_range),
        &format!("{expected}, within {} to {}", quantity.range().start(), quantity.range().end()),
    )?;
    let magnitude = magnitude.ok_or_else(|| section.error("lacks the key 'magnitude'"))?;
    Ok(RigChange { quantity, distribution, magnitude })
}

fn limits(section: &Section<'_>) -> Result<JobLimits, PlanError> {
    section.allow(&["timeout_s", "memory_gib"])?;
    let standard = JobLimits::default();
    let memory_gib = section.number("memory_gib", 0.05..=1e5)?;
    Ok(JobLimits {
        timeout_s: section.number("timeout_s", 0.1..=1e7)?.unwrap_or(standard.timeout_s),
        memory_bytes: memory_gib.map_or(standard.memory_bytes, |gib| (gib * f64::from(1 << 30)) as u64),
    })
}

fn output(section: &Section<'_>) -> Result<StudyOutput, PlanError> {
    section.allow(&["frames", "files"])?;
    Ok(StudyOutput {
        frames: section.boolean("frames")?.unwrap_or(false),
        files: section.boolean("files")?.unwrap_or(false),
    })
}

fn slurm(section: &Section<'_>) -> Result<SlurmOptions, PlanError> {
    section.allow(&["partition", "time", "memory", "tasks", "cpus_per_task", "options"])?;
    let one_word = |text: &str| {
        let plain = !text.is_empty() && !text.chars().any(|letter| letter.is_whitespace() || letter.is_control());
        if plain { Ok(text.to_owned()) } else { Err("expected one word without blanks".to_owned()) }
    };
    let word = |key: &str| {
        let text = section.text(key)?;
        text.map(|text| one_word(&text).map_err(|problem| section.error_at(key, &problem))).transpose()
    };
    let option = |text: &str| {
        if text.starts_with("--") {
            one_word(text)
        } else {
            Err("expected an option of sbatch, as in --account=lab".to_owned())
        }
    };
    let standard = SlurmOptions::default();
    Ok(SlurmOptions {
        partition: word("partition")?,
        time: word("time")?,
        memory: word("memory")?,
        tasks: section.integer("tasks", 1..=100_000)?.map_or(standard.tasks, |tasks| tasks as usize),
        cpus_per_task: section.integer("cpus_per_task", 1..=1024)?.map_or(standard.cpus_per_task, |cpus| cpus as usize),
        options: section.texts("options", option)?,
    })
}

fn tolerances(section: &Section<'_>) -> Result<BTreeMap<String, f64>, PlanError> {
    Ok(section.numbers(&(0.0..=1e6))?.into_iter().collect())
}
