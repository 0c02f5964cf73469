//! The paper's experiments T1–T4 flown by `simulate` and estimated by `dcvins`, beside the paper's Tables 1 to 3.
//!
//! `cargo bench --bench paper_tables` flies every experiment over its full length with five seeds and prints median and
//! range over all of them, never the best. It takes hours on two cores, most of it for rendering; with
//! `-- --seeds 2 --duration 60 --experiments T1,T4` it flies less and says so. A log is deleted once it is estimated
//! unless `--keep` is given. The tables also lie as CSV in `target/paper_tables/`.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    clippy::disallowed_methods,
    reason = "a bench measures time, prints its tables and how far it is"
)]

mod flights;
mod tables;

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use dcvins::simulation::Experiment;

use flights::Flight;

/// What is to be flown.
struct BenchOptions {
    seeds: Vec<u64>,
    duration_s: Option<f64>,
    experiments: Vec<Experiment>,
    keep: bool,
    folder: PathBuf,
}

impl BenchOptions {
    fn read(arguments: impl Iterator<Item = String>) -> Result<Self> {
        let mut options = Self {
            seeds: (1..=5).collect(),
            duration_s: None,
            experiments: Experiment::ALL.to_vec(),
            keep: false,
            folder: PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/paper_tables"),
        };
        let mut arguments = arguments;
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().with_context(|| format!("{argument} wants a value"));
            match argument.as_str() {
                // Cargo hands this to every bench.
                "--bench" => {}
                "--keep" => options.keep = true,
                "--seeds" => options.seeds = (1..=value()?.parse().context("--seeds wants a number")?).collect(),
                "--duration" => options.duration_s = Some(value()?.parse().context("--duration wants seconds")?),
                "--out" => options.folder = PathBuf::from(value()?),
                "--experiments" => {
                    options.experiments = value()?
                        .split(',')
                        .map(|name| Experiment::from_name(name).with_context(|| format!("no experiment '{name}'")))
                        .collect::<Result<_>>()?;
                }
                _ => bail!("unknown argument '{argument}': expected --seeds, --duration, --experiments, --out, --keep"),
            }
        }
        Ok(options)
    }
}

fn main() -> Result<()> {
    let options = BenchOptions::read(std::env::args().skip(1))?;
    std::fs::create_dir_all(&options.folder)?;
    let mut flights: Vec<Flight> = Vec::new();
    for seed in &options.seeds {
        for experiment in &options.experiments {
            let flight = flights::fly(*experiment, *seed, options.duration_s, &options.folder, options.keep)?;
            eprintln!("{}", flight.in_a_line());
            flights.push(flight);
            // A bench that is stopped has written what it knows.
            tables::write_csv(&flights, &options.folder)?;
        }
    }
    if let Some(duration_s) = options.duration_s {
        println!("Flights cut to {duration_s} s: errors grow with length, so these are not the paper's lengths.\n");
    }
    print!("{}", tables::accuracy(&flights));
    print!("{}", tables::calibration(&flights));
    print!("{}", tables::offline(&flights));
    print!("{}", tables::speed(&flights));
    Ok(())
}
