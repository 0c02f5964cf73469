//! The paper's experiments T1–T4 flown by `simulate` and estimated by `dcvins`, beside the paper's Tables 1 to 3, with
//! the consistency of what is estimated, an ablation, encoders, robustness and speed.
//!
//! `cargo bench --bench paper_tables` flies every experiment over its full length with five seeds and prints median and
//! range over all of them, never the best. That takes hours on two cores. For less:
//!
//! | option | meaning |
//! | --- | --- |
//! | `--tables accuracy,consistency,…` | only these of accuracy, consistency, speed, encoders, robustness, ablation |
//! | `--seeds 3`, `--seeds 1,4` | the first three seeds; these seeds |
//! | `--experiments T1,T4` | only these |
//! | `--duration 60` | flights cut to their first seconds (their tables say so) |
//! | `--out DIR` | where logs and CSV files lie (default `target/paper_tables`) |
//! | `--rendered` | use the logs that lie there complete and skip what is missing |
//! | `--forget` | delete a log that was simulated once it is used |
//!
//! A log is simulated once: what lies complete in the folder with the same options is used again, also logs that
//! `dcvins simulate T4 --seed 1 -o DIR/T4-1.mcap` wrote. What was estimated is kept there as well, and used again as long
//! as the program is the same to the byte: a bench that was stopped goes on where it was. Tables are written as CSV as
//! flights come in.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    clippy::disallowed_methods,
    reason = "a bench measures time, prints its tables and how far it is"
)]

mod ablation;
mod accuracy;
mod consistency;
mod drive;
mod encoders;
mod flights;
mod kept;
mod logs;
mod robustness;
mod samples;
#[path = "../shared/mod.rs"]
mod shared;
mod speed;
mod table;

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use dcvins::simulation::Experiment;

use flights::Flight;
use logs::Archive;
use shared::process;
use table::Table;

/// All tables, in the order in which they are made: speed first, while the process is small.
const TABLES: [&str; 6] = ["speed", "accuracy", "consistency", "encoders", "robustness", "ablation"];
/// Seeds of the short flights, which are many.
const MOST_SHORT_SEEDS: usize = 3;

/// What is to be flown.
struct BenchOptions {
    tables: Vec<&'static str>,
    seeds: Vec<u64>,
    duration_s: Option<f64>,
    experiments: Vec<Experiment>,
    archive: Archive,
}

impl BenchOptions {
    fn read(arguments: impl Iterator<Item = String>) -> Result<Self> {
        let mut options = Self {
            tables: TABLES.to_vec(),
            seeds: (1..=5).collect(),
            duration_s: None,
            experiments: Experiment::ALL.to_vec(),
            archive: Archive {
                folder: PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/paper_tables"),
                forget: false,
                render: true,
                program: kept::program()?,
            },
        };
        let mut arguments = arguments;
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().with_context(|| format!("{argument} wants a value"));
            match argument.as_str() {
                // Cargo hands this to every bench.
                "--bench" => {}
                "--forget" => options.archive.forget = true,
                "--rendered" => options.archive.render = false,
                "--tables" => options.tables = tables(&value()?)?,
                "--seeds" => options.seeds = seeds(&value()?)?,
                "--duration" => options.duration_s = Some(value()?.parse().context("--duration wants seconds")?),
                "--out" => options.archive.folder = PathBuf::from(value()?),
                "--experiments" => {
                    options.experiments = value()?
                        .split(',')
                        .map(|name| Experiment::from_name(name).with_context(|| format!("no experiment '{name}'")))
                        .collect::<Result<_>>()?;
                }
                _ => bail!(
                    "unknown argument '{argument}': expected --tables, --seeds, --duration, --experiments, --out, \
                     --rendered or --forget"
                ),
            }
        }
        Ok(options)
    }

    fn wants(&self, table: &str) -> bool {
        self.tables.contains(&table)
    }

    /// The seeds of tables that fly many short flights.
    fn short_seeds(&self) -> &[u64] {
        &self.seeds[..self.seeds.len().min(MOST_SHORT_SEEDS)]
    }
}

/// The tables named in a list.
fn tables(list: &str) -> Result<Vec<&'static str>> {
    let named = |name: &str| TABLES.into_iter().find(|table| *table == name);
    list.split(',')
        .map(|name| named(name).with_context(|| format!("no table '{name}': expected some of {}", TABLES.join(", "))))
        .collect()
}

/// `5`: the first five; `1,4` or `4,`: these.
fn seeds(list: &str) -> Result<Vec<u64>> {
    let number = |text: &str| text.parse::<u64>().with_context(|| format!("--seeds holds '{text}', no number"));
    if list.contains(',') {
        list.split(',').filter(|text| !text.is_empty()).map(number).collect()
    } else {
        Ok((1..=number(list)?).collect())
    }
}

fn main() -> Result<()> {
    let begin = Instant::now();
    let options = BenchOptions::read(std::env::args().skip(1))?;
    let folder = &options.archive.folder;
    std::fs::create_dir_all(folder)?;
    if let Some(duration_s) = options.duration_s {
        println!("Flights cut to {duration_s} s: errors grow with length, so these are not the paper's lengths.\n");
    }
    if options.wants("speed") {
        let seed = options.seeds.first().copied().unwrap_or(1);
        show(&speed::fly(&options.archive, seed, options.duration_s)?, folder)?;
    }
    if options.wants("accuracy") || options.wants("consistency") {
        flights(&options)?;
    }
    let mut partial = |table: &Table| table.write(folder);
    if options.wants("encoders") {
        show(&encoders::fly(&options.archive, options.short_seeds(), &mut partial)?, folder)?;
    }
    if options.wants("robustness") {
        show(&robustness::fly(&options.archive, options.short_seeds(), &mut partial)?, folder)?;
    }
    if options.wants("ablation") {
        for experiment in [Experiment::T4, Experiment::T1] {
            if options.experiments.contains(&experiment) {
                show(&ablation::fly(&options.archive, experiment, &options.seeds, &mut partial)?, folder)?;
            }
        }
    }
    let cpu = process::cpu_s().map_or_else(String::new, |cpu_s| format!(", {:.0} min of processor time", cpu_s / 60.0));
    println!("All of this took {:.0} min{cpu}.", begin.elapsed().as_secs_f64() / 60.0);
    Ok(())
}

/// The tables over the experiments' flights.
fn flights(options: &BenchOptions) -> Result<()> {
    let folder = &options.archive.folder;
    let mut flights: Vec<Flight> = Vec::new();
    for seed in &options.seeds {
        for experiment in &options.experiments {
            match Flight::fly(&options.archive, *experiment, *seed, options.duration_s) {
                Ok(flight) => {
                    eprintln!("{}", flight.in_a_line());
                    flights.push(flight);
                }
                Err(error) if !options.archive.render => eprintln!("left out: {error:#}"),
                Err(error) => return Err(error),
            }
            // A bench that is stopped has written what it knows.
            for table in of_flights(options, &flights) {
                table.write(folder)?;
            }
            consistency::parameters(&flights).write(folder)?;
            accuracy::every_flight(&flights).write(folder)?;
        }
    }
    for table in of_flights(options, &flights) {
        show(&table, folder)?;
    }
    Ok(())
}

fn of_flights(options: &BenchOptions, flights: &[Flight]) -> Vec<Table> {
    let mut tables = Vec::new();
    if options.wants("accuracy") {
        tables.push(accuracy::cameras(flights));
        if Flight::of(flights, Experiment::T4).next().is_some() {
            tables.extend([accuracy::online_and_offline(flights), accuracy::offline(flights)]);
        }
        tables.push(accuracy::chains(flights));
    }
    if options.wants("consistency") {
        tables.extend([
            consistency::poses(flights),
            consistency::calibration(flights),
            consistency::residuals(flights),
        ]);
    }
    tables
}

fn show(table: &Table, folder: &Path) -> Result<()> {
    print!("{table}");
    table.write(folder)
}
