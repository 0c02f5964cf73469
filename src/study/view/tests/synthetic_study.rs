//! A synthetic study, for the tests of this crate and of the window, which includes this file by its path.

use crate::geometry::SplitMix64;
use crate::study::view::Study;
use crate::study::{Cell, ColumnType, StudyColumn, StudyTable};

pub(crate) const LOGS: [&str; 8] = ["house", "city", "yard", "forest", "bridge", "hall", "field", "ridge"];
const RUNS: [&str; 5] = ["auto", "minimal-swapped", "classical", "auto:encoder=off", "static"];
const PERTURBATIONS: [&str; 5] = ["none", "mount-1deg", "mount-3deg", "noise-x2", "offset-5ms"];
pub(crate) const PARAMETERS: [(&str, &str, f64); 6] = [
    ("yaw.alpha", "rad", 2e-3),
    ("yaw.a", "m", 1e-3),
    ("roll.theta", "rad", 1.5e-3),
    ("roll.d", "m", 2e-3),
    ("pitch.alpha", "rad", 3e-3),
    ("gimbal_camera.timeshift", "s", 5e-4),
];

fn table(columns: &[(&str, ColumnType, &str)]) -> StudyTable {
    let column = |(name, kind, unit): &(&str, ColumnType, &str)| StudyColumn::new(name, *kind, unit, "of a test");
    StudyTable::new(columns.iter().map(column).collect()).unwrap()
}

/// A study of 8 logs × 5 specifications × 5 perturbations × `seeds` seeds: `auto` is best, without encoders the error
/// is 1.5 times as large, a static camera is ten times worse and often fails, and σ of `pitch.alpha` is half of the
/// correct value.
pub(crate) fn synthetic_study(seeds: usize) -> Study {
    use ColumnType::{Bool, Integer, Number, Text};
    let mut runs = table(&[
        ("key", Text, ""),
        ("log", Text, ""),
        ("disturbance", Text, ""),
        ("perturbation", Text, ""),
        ("seed", Integer, ""),
        ("run", Text, ""),
        ("encoder", Bool, ""),
        ("status", Text, ""),
        ("message", Text, ""),
        ("log_path", Text, ""),
        ("rig_path", Text, ""),
        ("restarts", Integer, ""),
        ("ate_rmse_m", Number, "m"),
        ("ate_percent", Number, "%"),
        ("pose_nees", Number, ""),
        ("worst_frame_s", Number, "s"),
        ("chain_error_m", Number, "m"),
        ("chain_error_rad", Number, "rad"),
        ("rank_informed", Integer, ""),
        ("peak_memory_bytes", Integer, "B"),
    ]);
    let mut parameters = table(&[
        ("key", Text, ""),
        ("parameter", Text, ""),
        ("unit", Text, ""),
        ("sigma", Number, ""),
        ("error", Number, ""),
    ]);
    let mut random = SplitMix64::new(7);
    let mut number = 0_usize;
    for (log_place, log) in LOGS.iter().enumerate() {
        for perturbation in PERTURBATIONS {
            for seed in 0..seeds {
                let mut normal = || (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
                let flight = 0.04 * (1.0 + log_place as f64) * (0.35 * normal()).exp();
                for (place, run) in RUNS.iter().enumerate() {
                    let factor = [1.0, 1.02, 1.15, 1.5, 10.0][place];
                    let key = format!("{number:064x}");
                    number += 1;
                    let is_static = *run == "static";
                    let crashed = !is_static && normal() > 3.0;
                    let lost = is_static && normal() > 0.2;
                    let status = if crashed {
                        "crashed"
                    } else if lost {
                        "not-initialized"
                    } else {
                        "ok"
                    };
                    let ate = flight * factor * (0.08 * normal()).exp();
                    let ok = (status == "ok").then_some(());
                    let message = crashed.then_some("thread 'main' panicked at src/estimator/window.rs");
                    runs.push([
                        ("key", key.as_str().into()),
                        ("log", (*log).into()),
                        ("disturbance", "none".into()),
                        ("perturbation", perturbation.into()),
                        ("seed", seed.into()),
                        ("run", (*run).into()),
                        ("encoder", (!run.contains("encoder=off")).into()),
                        ("status", status.into()),
                        ("message", message.into()),
                        ("log_path", format!("flights/{log}-{seed}/{log}.mcap").into()),
                        ("rig_path", format!("jobs/{key}/perturbed.rig.yaml").into()),
                        ("restarts", ok.map(|()| usize::from(is_static)).into()),
                        ("ate_rmse_m", ok.map(|()| ate).into()),
                        ("ate_percent", ok.map(|()| ate / 1.5).into()),
                        ("pose_nees", ok.map(|()| 6.0 * (0.2 * normal()).exp()).into()),
                        ("worst_frame_s", ok.map(|()| 3.0 + 20.0 * (normal() / 12.0 + 0.5)).into()),
                        ("chain_error_m", ok.map(|()| 0.002 * factor * (0.3 * normal()).exp()).into()),
                        ("chain_error_rad", ok.map(|()| 0.003 * factor * (0.3 * normal()).exp()).into()),
                        ("rank_informed", ok.map(|()| 18_usize - place).into()),
                        ("peak_memory_bytes", Cell::Integer(300 << 20)),
                    ])
                    .unwrap();
                    for (name, unit, sigma) in PARAMETERS.iter().filter(|_| status == "ok" && !is_static) {
                        let sigma = sigma * (0.3 * normal()).exp();
                        let truth = if *name == "pitch.alpha" { 2.0 } else { 1.0 };
                        parameters
                            .push([
                                ("key", key.as_str().into()),
                                ("parameter", (*name).into()),
                                ("unit", (*unit).into()),
                                ("sigma", sigma.into()),
                                ("error", (truth * sigma * normal()).into()),
                            ])
                            .unwrap();
                    }
                }
            }
        }
    }
    Study { name: "gimbal-sweep".to_owned(), runs, parameters }
}
