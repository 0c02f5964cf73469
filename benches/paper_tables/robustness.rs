//! What happens when something goes wrong: one disturbance at a time on a short flight.

use anyhow::{Context as _, Result};
use dcvins::simulation::{Disturbances, Experiment, SimulationOptions};

use crate::drive::{Driven, Variant, drive};
use crate::logs::Archive;
use crate::table::{Table, ratios, written};

/// Length of a flight; what goes wrong does so in its middle.
const FLIGHT_S: f64 = 25.0;

/// Name, and the disturbances as `dcvins simulate --disturb` takes them.
const ROWS: [(&str, &[&str]); 16] = [
    ("nothing", &[]),
    ("fast rotation, 3 rad/s for 2 s", &["spin=11,2,3"]),
    ("exposure 10 ms", &["exposure=0.01"]),
    ("fast rotation and exposure 10 ms", &["spin=11,2,3", "exposure=0.01"]),
    ("light halves", &["light=11,0.5"]),
    ("light doubles", &["light=11,2"]),
    ("nothing to see for 1 s", &["blank=11,1"]),
    ("nothing to see for 3 s", &["blank=11,3"]),
    ("gimbal slews at 200°/s for 3 s", &["slew=11,3"]),
    ("images lost for 0.5 s", &["image-gap=11,0.5"]),
    ("images lost for 2 s", &["image-gap=11,2"]),
    ("gyroscope saturates at 1 rad/s", &["gyroscope-range=1"]),
    ("accelerometer saturates at 12 m/s²", &["accelerometer-range=12"]),
    ("joint angles start at 5 s", &["joint-start=5"]),
    ("joint angles 20 ms late", &["joint-lag=0.02"]),
    ("camera clock 10 ms off", &["camera-offset=0.01"]),
];

/// Flies each disturbance over some seeds.
pub(crate) fn fly(archive: &Archive, seeds: &[u64], progress: &mut dyn FnMut(&Table) -> Result<()>) -> Result<Table> {
    let mut flown: Vec<Vec<Driven>> = ROWS.iter().map(|_| Vec::new()).collect();
    for seed in seeds {
        for (index, ((_, disturbances), runs)) in ROWS.iter().zip(&mut flown).enumerate() {
            let mut options = SimulationOptions::new(Experiment::T3);
            (options.seed, options.duration_s, options.static_camera) = (*seed, Some(FLIGHT_S), false);
            options.disturbances = read(disturbances)?;
            let log = match archive.log(&format!("robustness-{index}-{seed}"), &options) {
                Ok(log) => log,
                Err(_) if !archive.render => continue,
                Err(error) => return Err(error),
            };
            runs.append(&mut drive(&log, None, &[Variant::plain("disturbed", "auto")])?);
        }
        progress(&table(&flown))?;
    }
    Ok(table(&flown))
}

fn read(texts: &[&str]) -> Result<Disturbances> {
    let mut disturbances = Disturbances::default();
    for text in texts {
        disturbances.set(text).with_context(|| format!("the bench's own '{text}'"))?;
    }
    Ok(disturbances)
}

fn table(flown: &[Vec<Driven>]) -> Table {
    let mut table = Table::new(
        "robustness",
        format!(
            "Robustness: the first {FLIGHT_S} s of T3 with the gimbal camera, from 11 s on unless it lasts all flight; \
             median [lowest, highest]"
        ),
        &["what goes wrong", "flights", "ATE m", "× undisturbed", "restarts", "without pose s", "lost", "what it says"],
    );
    for ((name, _), runs) in ROWS.iter().zip(flown) {
        let against = runs.iter().zip(&flown[0]).filter_map(|(run, plain)| Some(run.ate_m()? / plain.ate_m()?));
        let mut said: Vec<&String> = runs.iter().flat_map(|run| &run.failures).collect();
        said.extend(runs.iter().flat_map(|run| &run.summary.warnings));
        let first = said.first().map_or_else(String::new, |text| format!("{text} ({} in all)", said.len()));
        table.row([
            (*name).to_owned(),
            runs.len().to_string(),
            written(runs.iter().filter_map(Driven::ate_m).collect(), 3),
            ratios(&against.collect::<Vec<_>>()),
            runs.iter().map(|run| run.summary.frames.restarts).sum::<usize>().to_string(),
            written(runs.iter().map(|run| run.lost_s).collect(), 1),
            runs.iter().filter(|run| run.ate_m().is_none()).count().to_string(),
            first.replace('|', "/"),
        ]);
    }
    table
}
