//! The logs that the tables are made from: found in the folder, or simulated.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, bail};
use dcvins::simulation::{Experiment, SimulationOptions, simulate};

/// Where logs lie and what may be done about those that are missing.
pub(crate) struct Archive {
    pub(crate) folder: PathBuf,
    /// Delete what has been simulated once it is used.
    pub(crate) forget: bool,
    /// Simulate what is missing.
    pub(crate) render: bool,
    /// Hash of the program, whose earlier results are used again.
    pub(crate) program: String,
}

/// A log ready to be estimated.
pub(crate) struct Log {
    pub(crate) path: PathBuf,
    pub(crate) experiment: Experiment,
    pub(crate) seed: u64,
    /// How much of the log is to be read.
    pub(crate) duration_s: f64,
    /// Seconds that simulating took, when the log was not there already.
    pub(crate) simulated_in_s: Option<f64>,
    forget: bool,
}

impl Archive {
    /// The log of a plain experiment (whole, or its first seconds, which a longer log holds as well).
    pub(crate) fn flight(&self, experiment: Experiment, seed: u64, duration_s: Option<f64>) -> Result<Log> {
        let mut options = SimulationOptions::new(experiment);
        (options.seed, options.duration_s) = (seed, duration_s);
        self.log(&format!("{}-{seed}", experiment.name()), &options)
    }

    /// The log of some options under a name: what lies there complete is used again when it was made with the same
    /// options, or is a longer flight of the same experiment and seed.
    pub(crate) fn log(&self, name: &str, options: &SimulationOptions) -> Result<Log> {
        let path = self.folder.join(format!("{name}.mcap"));
        if let Some(found) = Self::found(&path, options) {
            return Ok(found);
        }
        if !self.render {
            bail!("{} does not lie there complete", path.display());
        }
        let begin = Instant::now();
        let written = options_path(&path);
        if written.exists() {
            fs::remove_file(&written)?;
        }
        let simulated = simulate(options, &path, &mut |_| ())?;
        fs::write(&written, but_for_length(options))?;
        Ok(Log {
            path,
            experiment: options.experiment,
            seed: options.seed,
            duration_s: simulated.duration_s,
            simulated_in_s: Some(begin.elapsed().as_secs_f64()),
            forget: self.forget,
        })
    }

    /// The log at a path when it lies there complete and was made with these options.
    fn found(path: &Path, options: &SimulationOptions) -> Option<Log> {
        // The truth is written when the log is complete.
        let ground_truth = fs::read_to_string(path.with_extension("truth.yaml")).ok().filter(|_| path.exists())?;
        let note = |key: &str| {
            let notes = ground_truth.split_once("\ntruth:\n")?.1;
            notes.lines().find_map(|line| line.trim().strip_prefix(key)?.strip_prefix(": "))
        };
        let seconds: f64 = note("duration")?.parse().ok()?;
        let path_length_m: f64 = note("path_length")?.parse().ok()?;
        let same_flight = note("experiment")? == options.experiment.name() && note("seed")? == options.seed.to_string();
        let long_enough = match options.duration_s {
            Some(wanted_s) => seconds >= wanted_s - 1e-6,
            None => path_length_m >= options.experiment.length_m() - 0.5,
        };
        let plain = SimulationOptions { seed: options.seed, ..SimulationOptions::new(options.experiment) };
        // Logs that `dcvins simulate` wrote have the experiment's own options and no word about them.
        let written = fs::read_to_string(options_path(path)).unwrap_or_else(|_| but_for_length(&plain));
        let same_options = written == but_for_length(options);
        (same_flight && long_enough && same_options).then(|| Log {
            path: path.to_owned(),
            experiment: options.experiment,
            seed: options.seed,
            duration_s: options.duration_s.unwrap_or(seconds),
            simulated_in_s: None,
            forget: false,
        })
    }
}

/// The options as a text, without the length, which is held against the truth's.
fn but_for_length(options: &SimulationOptions) -> String {
    format!("{:?}\n", SimulationOptions { duration_s: None, ..options.clone() })
}

/// Where the options stand that a log was simulated with.
fn options_path(log: &Path) -> PathBuf {
    log.with_extension("options.txt")
}

impl Drop for Log {
    fn drop(&mut self) {
        if self.forget {
            for extension in ["mcap", "rig.yaml", "truth.yaml", "options.txt"] {
                // What is left behind does no harm.
                drop(fs::remove_file(self.path.with_extension(extension)));
            }
        }
    }
}
