//! A short synthetic flight processed by the real estimator, for panels that need a real linearization.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use crate::estimator::{Estimator, EstimatorConfig, EstimatorOptions, StepInput};
use crate::gimbal::{Chain, Parameterization};
use crate::observability::analyse;
use crate::session::{Recording, RunRecord, StepRecord};
use crate::simulation::{SyntheticOptions, synthetic_tracks};

/// Five seconds in the classical, the minimal and the swapped parameterization; computed once.
pub(crate) fn simulated_recording() -> &'static Recording {
    static RECORDING: OnceLock<Recording> = OnceLock::new();
    RECORDING.get_or_init(simulate_runs)
}

fn simulate_runs() -> Recording {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 5.0, features: 80, ..SyntheticOptions::default() });
    let rig = &flight.given_rig;
    let gimbal = rig.gimbal.as_ref().expect("the synthetic rig has a gimbal");
    let sigma_rad = gimbal.encoder_sigma_rad.expect("with encoders");
    let runs = [Parameterization::Classical, Parameterization::Minimal, Parameterization::MinimalSwapped];
    let runs = runs.map(|parameterization| {
        let configuration = EstimatorConfig::for_camera(rig, "cam0", parameterization).expect("cam0");
        let mut estimator = Estimator::new(EstimatorConfig {
            options: EstimatorOptions { keep_linearization: true, ..EstimatorOptions::default() },
            ..configuration
        });
        let spec = parameterization.name().parse().expect("runs are named after parameterizations");
        let mut run = RunRecord::new(spec, "cam0".to_owned());
        for frame in &flight.frames {
            let joints = frame.encoder_angles(sigma_rad);
            let mut report = estimator.step(&StepInput {
                frame_index: frame.index,
                stamp_ns: frame.stamp_ns,
                imu: &frame.imu,
                joint_angles: joints.as_ref(),
                tracks: &frame.tracks,
                rigid_tracks: &[],
            });
            let rank = report.linearization.take().and_then(|linearization| {
                let angles: Vec<&[f64]> = report.window.iter().map(|frame| frame.joint_angles_rad.as_slice()).collect();
                let chain = Chain::from_classical(&report.calibration.classical, parameterization);
                analyse(&linearization, &chain, &angles, false)
            });
            run.push(StepRecord {
                report,
                rank,
                tracks: Arc::new(frame.tracks.clone()),
                ground_truth: Some(frame.true_world_from_imu),
                log_time_ns: frame.stamp_ns,
                summary_only: false,
            });
        }
        run.finished = true;
        run
    });
    Recording {
        log_path: PathBuf::from("sample/flight.mcap"),
        rig: Arc::new(rig.clone()),
        ground_truth_rig: Some(Arc::new(flight.true_rig.clone())),
        duration_ns: flight.frames.last().map_or(0, |frame| frame.stamp_ns),
        start_ns: 0,
        epoch_ns: 0,
        runs: runs.into(),
        warnings: Vec::new(),
        memory_budget_bytes: crate::session::DEFAULT_MEMORY_BUDGET_BYTES,
    }
}
