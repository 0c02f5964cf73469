//! How much good encoders are worth: noise of 0.5°, 7° and 10°, and none.

use anyhow::Result;
use dcvins::simulation::{Experiment, SimulationOptions};

use crate::drive::{Driven, Variant, drive};
use crate::logs::Archive;
use crate::table::{Table, written};

/// Length of a flight.
const FLIGHT_S: f64 = 40.0;

/// Runs T4 with each kind of encoders.
pub(crate) fn fly(archive: &Archive, seeds: &[u64], progress: &mut dyn FnMut(&Table) -> Result<()>) -> Result<Table> {
    let kinds: [(&str, Option<f64>, &'static str); 5] = [
        ("σ 0.5°", Some(0.5), "auto"),
        ("σ 7°", Some(7.0), "auto"),
        ("σ 10°", Some(10.0), "auto"),
        ("σ 7°, readings not used", Some(7.0), "auto:encoder=off"),
        ("no encoders in the log", None, "auto"),
    ];
    let mut flown: Vec<Vec<Driven>> = kinds.iter().map(|_| Vec::new()).collect();
    for seed in seeds {
        for ((_, sigma_deg, spec), runs) in kinds.iter().zip(&mut flown) {
            let mut options = SimulationOptions::new(Experiment::T4);
            (options.seed, options.duration_s) = (*seed, Some(FLIGHT_S));
            let experiments_own = *sigma_deg == Some(7.0);
            let name = if experiments_own {
                format!("T4-{seed}")
            } else {
                options.static_camera = false;
                options.encoder_sigma_rad = sigma_deg.map(f64::to_radians);
                format!("T4-{seed}-encoders-{}", sigma_deg.map_or_else(|| "none".to_owned(), |sigma| sigma.to_string()))
            };
            let log = match archive.log(&name, &options) {
                Ok(log) => log,
                Err(_) if !archive.render => continue,
                Err(error) => return Err(error),
            };
            let kept = format!("{name}-{}", spec.replace([':', '='], "-"));
            let fly = || drive(&log, None, &[Variant::plain("encoders", spec)]);
            runs.append(&mut archive.kept(&kept, &log, fly)?);
        }
        progress(&table(&kinds.map(|(name, ..)| name), &flown))?;
    }
    Ok(table(&kinds.map(|(name, ..)| name), &flown))
}

fn table(names: &[&str], flown: &[Vec<Driven>]) -> Table {
    let mut table = Table::new(
        "encoders",
        format!(
            "Encoders: the first {FLIGHT_S} s of T4, chain given wrong by ±3 cm and ±10°, median [lowest, highest]"
        ),
        &["encoders", "flights", "ATE m", "chain after mm", "chain after °", "initialized at s", "restarts", "lost"],
    );
    for (name, runs) in names.iter().zip(flown) {
        let column =
            |value: fn(&Driven) -> Option<f64>, digits: usize| written(runs.iter().filter_map(value).collect(), digits);
        let restarts: usize = runs.iter().map(|run| run.restarts).sum();
        table.row([
            (*name).to_owned(),
            runs.len().to_string(),
            column(Driven::ate_m, 3),
            column(Driven::chain_mm, 1),
            column(Driven::chain_deg, 2),
            column(|run| run.initialized_at_s, 1),
            restarts.to_string(),
            runs.iter().filter(|run| run.ate_m().is_none()).count().to_string(),
        ]);
    }
    table
}
