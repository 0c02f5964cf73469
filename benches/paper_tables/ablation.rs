//! Effect of each option of the estimator: runs that differ from the default by one option, over the same intervals.

use anyhow::Result;
use dcvins::estimator::{EstimatorConfig, TrackContinuation};
use dcvins::optimization::{LandmarkModel, RobustLoss};
use dcvins::simulation::Experiment;

use crate::drive::{Driven, Variant, drive};
use crate::logs::Archive;
use crate::table::{Table, ratios, written};

/// Length of a piece: long enough for the chain to settle, short enough for many.
const PIECE_S: f64 = 40.0;

/// The default and what differs from it by one option.
fn variants() -> Vec<Variant> {
    let changed = |name, change: fn(&mut EstimatorConfig)| Variant { change, ..Variant::plain(name, "auto") };
    vec![
        Variant::plain("as it is", "auto"),
        changed("pixel σ 0.18 px", |config| config.options.pixel_sigma_px = 0.18),
        changed("pixel σ 0.35 px", |config| config.options.pixel_sigma_px = 0.35),
        changed("pixel σ 0.5 px", |config| config.options.pixel_sigma_px = 0.5),
        changed("no robust loss", |config| config.options.loss = RobustLoss::None),
        changed("Huber at 1 σ", |config| config.options.loss = RobustLoss::Huber(1.0)),
        changed("Huber at 1.5 σ, pixel σ 0.5 px", |config| {
            config.options.loss = RobustLoss::Huber(1.5);
            config.options.pixel_sigma_px = 0.5;
        }),
        changed("Cauchy at 0.7 σ", |config| config.options.loss = RobustLoss::Cauchy(0.7)),
        changed("Cauchy at 2 σ", |config| config.options.loss = RobustLoss::Cauchy(2.0)),
        changed("no first estimates", |config| {
            config.options.first_estimate_reach_rad = 0.0;
            config.options.calibration_first_estimates = false;
        }),
        changed("first estimates however far", |config| config.options.first_estimate_reach_rad = f64::INFINITY),
        changed("first window as the later ones", |config| config.options.first_window_factor = 1),
        changed("no first estimates of the calibration", |config| config.options.calibration_first_estimates = false),
        changed("no prior on the chain", |config| config.chain_prior = None),
        changed("anchor's measurement exact", |config| {
            config.options.landmark_model = LandmarkModel::InverseDistance;
        }),
        changed("measurements used again", |config| {
            config.options.track_continuation = TrackContinuation::Reuse;
        }),
        changed("anchor's measurement forgotten", |config| {
            config.options.track_continuation = TrackContinuation::DropAnchor;
        }),
        changed("12 iterations", |config| config.options.iterations = 12),
        changed("inertial noise × 2", |config| config.options.imu_noise_factor = 2.0),
        Variant::plain("without encoders", "auto:encoder=off"),
        Variant::plain("clocks estimated", "auto:timeshift=on"),
        Variant::plain("calibration held fixed", "auto:calibrate=off"),
        Variant::plain("window of 15", "auto:window=15"),
        Variant::plain("classical", "classical"),
        Variant::plain("minimal as printed", "minimal"),
        Variant::plain("minimal, swapped", "minimal-swapped"),
        Variant::plain("product of exponentials", "poe"),
    ]
}

/// Runs the variants on the first seconds of an experiment's flights and writes the results after each.
pub(crate) fn fly(
    archive: &Archive,
    experiment: Experiment,
    seeds: &[u64],
    progress: &mut dyn FnMut(&Table) -> Result<()>,
) -> Result<Table> {
    let variants = variants();
    let mut pieces: Vec<Vec<Driven>> = Vec::new();
    for seed in seeds {
        let log = match archive.flight(experiment, *seed, Some(PIECE_S)) {
            Ok(log) => log,
            Err(_) if !archive.render => continue,
            Err(error) => return Err(error),
        };
        let name = format!("{}-{seed}-ablation", experiment.name());
        pieces.push(archive.kept(&name, &log, || drive(&log, None, &variants))?);
        progress(&table(experiment, &variants, &pieces))?;
    }
    Ok(table(experiment, &variants, &pieces))
}

fn table(experiment: Experiment, variants: &[Variant], pieces: &[Vec<Driven>]) -> Table {
    let mut table = Table::new(
        if experiment == Experiment::T4 { "ablation_t4" } else { "ablation" },
        format!(
            "Ablation: the first {PIECE_S} s of {} flights of {}; ratios to the first row on the same flight, geometric \
             mean [lowest, highest]",
            pieces.len(),
            experiment.name()
        ),
        &["what differs", "ATE m", "× ATE", "× chain mm", "× chain °", "restarts", "lost"],
    );
    for (index, variant) in variants.iter().enumerate() {
        let against = |value: fn(&Driven) -> Option<f64>| -> Vec<f64> {
            pieces.iter().filter_map(|runs| Some(value(&runs[index])? / value(&runs[0])?)).collect()
        };
        let errors: Vec<f64> = pieces.iter().filter_map(|runs| runs[index].ate_m()).collect();
        let restarts: usize = pieces.iter().map(|runs| runs[index].restarts).sum();
        table.row([
            variant.name.to_owned(),
            written(errors.clone(), 3),
            ratios(&against(Driven::ate_m)),
            ratios(&against(Driven::chain_mm)),
            ratios(&against(Driven::chain_deg)),
            restarts.to_string(),
            (pieces.len() - errors.len()).to_string(),
        ]);
    }
    table
}
