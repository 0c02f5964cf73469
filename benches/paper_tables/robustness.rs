//! What happens when something goes wrong: one disturbance at a time on a short flight.

use anyhow::{Context as _, Result};
use dcvins::simulation::{Disturbances, Experiment, SimulationOptions};

use crate::drive::{Driven, Variant, drive};
use crate::logs::Archive;
use crate::table::{Table, ratios, written};

/// Length of a flight; what goes wrong does so in its middle.
const FLIGHT_S: f64 = 25.0;

/// Name, the disturbances as `dcvins simulate --disturb` takes them, and the run.
const ROWS: [(&str, &[&str], &str); 18] = [
    ("nothing", &[], "auto"),
    ("fast rotation, 3 rad/s for 2 s", &["spin=11,2,3"], "auto"),
    ("exposure 10 ms", &["exposure=0.01"], "auto"),
    ("fast rotation and exposure 10 ms", &["spin=11,2,3", "exposure=0.01"], "auto"),
    ("light halves", &["light=11,0.5"], "auto"),
    ("light doubles", &["light=11,2"], "auto"),
    ("nothing to see for 1 s", &["blank=11,1"], "auto"),
    ("nothing to see for 3 s", &["blank=11,3"], "auto"),
    ("gimbal slews at 200°/s for 3 s", &["slew=11,3"], "auto"),
    ("images lost for 0.5 s", &["image-gap=11,0.5"], "auto"),
    ("images lost for 2 s", &["image-gap=11,2"], "auto"),
    ("gyroscope saturates at 1 rad/s", &["gyroscope-range=1"], "auto"),
    ("accelerometer saturates at 12 m/s²", &["accelerometer-range=12"], "auto"),
    ("joint angles start at 5 s", &["joint-start=5"], "auto"),
    ("joint angles 20 ms late", LATE_JOINTS, "auto"),
    ("joint angles 20 ms late, timeshift=on", LATE_JOINTS, "auto:timeshift=on"),
    ("camera clock 10 ms off", LATE_CAMERA, "auto"),
    ("camera clock 10 ms off, timeshift=on", LATE_CAMERA, "auto:timeshift=on"),
];
const LATE_JOINTS: &[&str] = &["joint-lag=0.02"];
const LATE_CAMERA: &[&str] = &["camera-offset=0.01"];

/// Runs each disturbance with several seeds.
pub(crate) fn fly(archive: &Archive, seeds: &[u64], progress: &mut dyn FnMut(&Table) -> Result<()>) -> Result<Table> {
    let mut flown: Vec<Vec<Driven>> = ROWS.iter().map(|_| Vec::new()).collect();
    for seed in seeds {
        for ((_, disturbances, spec), runs) in ROWS.iter().zip(&mut flown) {
            let mut options = SimulationOptions::new(Experiment::T3);
            (options.seed, options.duration_s, options.static_camera) = (*seed, Some(FLIGHT_S), false);
            options.disturbances = read(disturbances)?;
            let name = format!("robustness-{}-{seed}", disturbances.join("-").replace(['=', ','], "_"));
            let log = match archive.log(&name, &options) {
                Ok(log) => log,
                Err(_) if !archive.render => continue,
                Err(error) => return Err(error),
            };
            let kept = format!("{name}-{}", spec.replace([':', '='], "-"));
            let fly = || drive(&log, None, &[Variant::plain("disturbed", spec)]);
            runs.append(&mut archive.kept(&kept, &log, fly)?);
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
    for ((name, ..), runs) in ROWS.iter().zip(flown) {
        let against = runs.iter().zip(&flown[0]).filter_map(|(run, plain)| Some(run.ate_m()? / plain.ate_m()?));
        let mut said: Vec<&String> = runs.iter().flat_map(|run| &run.failures).collect();
        said.extend(runs.iter().flat_map(|run| &run.warnings));
        let first = said.first().map_or_else(String::new, |text| format!("{text} ({} in all)", said.len()));
        table.row([
            (*name).to_owned(),
            runs.len().to_string(),
            written(runs.iter().filter_map(Driven::ate_m).collect(), 3),
            ratios(&against.collect::<Vec<_>>()),
            runs.iter().map(|run| run.restarts).sum::<usize>().to_string(),
            written(runs.iter().map(|run| run.lost_s).collect(), 1),
            runs.iter().filter(|run| run.ate_m().is_none()).count().to_string(),
            first.replace('|', "/"),
        ]);
    }
    table
}
