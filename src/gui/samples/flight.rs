//! A short synthetic flight with a three-axis gimbal, processed by the real estimator once per test process.
//!
//! Two seconds of hover, then an aggressive flight around a house; feature tracks are projections of landmarks with
//! noise, and some of the tracks drift.

use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

use rayon::prelude::*;

use crate::estimator::{Estimator, EstimatorConfig, EstimatorOptions, StepInput};
use crate::faults::LensChange;
use crate::flight_log::{LogWarning, WarningKind};
use crate::gimbal::{Chain, Parameterization, auto_parameterization};
use crate::observability::analyse;
use crate::sensors::Rig;
use crate::session::{Recording, RunRecord, StepRecord, record_synthetic};
use crate::simulation::{SyntheticFlight, SyntheticMount, SyntheticOptions, synthetic_tracks};

/// Period of the images in nanoseconds (20 Hz).
pub(crate) const FRAME_PERIOD_NS: i64 = 50_000_000;
pub(crate) const SAMPLE_FRAMES: usize = 120;
/// Delay of the images in the log, in nanoseconds.
const LOG_DELAY_NS: i64 = 19_000_000;
const RUNS: [&str; 2] = ["auto", "classical"];

static SAMPLE: LazyLock<Recording> = LazyLock::new(|| {
    let options = SyntheticOptions {
        duration_s: SAMPLE_FRAMES as f64 * FRAME_PERIOD_NS as f64 * 1e-9,
        features: 90,
        outlier_ratio: 0.05,
        ..SyntheticOptions::default()
    };
    recording_of(&flight_of(&options), &RUNS)
});

/// Six seconds with the runs `auto` and `classical`.
pub(crate) fn sample_recording() -> Recording {
    SAMPLE.clone()
}

/// The first frames of [`sample_recording`] with some of its runs, each with a new id.
pub(crate) fn sample_recording_of(frame_count: usize, runs: &[&str]) -> Recording {
    let part_of = |name: &&str| {
        let whole = SAMPLE.runs.iter().find(|run| run.spec.label == **name).expect("a run of the sample");
        let mut part = RunRecord::new(whole.spec.clone(), whole.camera_key.clone());
        for step in &whole.steps[..frame_count] {
            part.push(StepRecord::clone(step));
        }
        part.finished = true;
        part
    };
    Recording {
        runs: runs.iter().map(part_of).collect(),
        duration_ns: frame_count as i64 * FRAME_PERIOD_NS,
        ..SAMPLE.clone()
    }
}

/// The first frame in which the estimators track.
pub(crate) fn first_tracked_frame() -> usize {
    let tracks = |step: &Arc<StepRecord>| step.report.newest().is_some();
    SAMPLE.runs[0].steps.iter().position(tracks).expect("the sample initializes")
}

/// A run on a short flight with a camera without a gimbal.
pub(crate) fn rigid_recording() -> Recording {
    static RIGID: LazyLock<Recording> = LazyLock::new(|| {
        let options = SyntheticOptions {
            mount: SyntheticMount::Static,
            duration_s: 3.5,
            features: 40,
            ..SyntheticOptions::default()
        };
        recording_of(&flight_of(&options), &["static"])
    });
    RIGID.clone()
}

/// A run that also estimates the shutter and the intrinsics of camera and IMU, whose values in the rig are wrong.
pub(crate) fn sensor_recording() -> Recording {
    static SENSORS: LazyLock<Recording> = LazyLock::new(|| {
        let flight = flight_of(&SyntheticOptions {
            duration_s: 6.0,
            features: 70,
            readout_s: 0.02,
            intrinsics_error: LensChange { focal: 1.01, ..LensChange::NONE },
            imu_intrinsics_error: [0.01, 0.01],
            ..SyntheticOptions::default()
        });
        let spec = "auto:timeshift=on,readout=on,intrinsics=on,imu-intrinsics=on".parse().unwrap();
        let run = record_synthetic(&flight, &spec).unwrap();
        Recording { runs: vec![run], ..recording_of(&flight, &[]) }
    });
    SENSORS.clone()
}

/// A flight whose first frame has stamp 0, so that frame `k` has stamp `k` · [`FRAME_PERIOD_NS`].
fn flight_of(options: &SyntheticOptions) -> SyntheticFlight {
    let mut flight = synthetic_tracks(options);
    let first_ns = flight.frames[0].stamp_ns;
    for frame in &mut flight.frames {
        frame.stamp_ns -= first_ns;
        frame.tracks.stamp_ns -= first_ns;
        frame.imu.iter_mut().for_each(|sample| sample.stamp_ns -= first_ns);
    }
    flight
}

fn recording_of(flight: &SyntheticFlight, runs: &[&str]) -> Recording {
    let frame_count = flight.frames.len() as i64;
    Recording {
        log_path: PathBuf::from("sample/yard.mcap"),
        rig: Arc::new(flight.given_rig.clone()),
        ground_truth_rig: Some(Arc::new(flight.true_rig.clone())),
        duration_ns: frame_count * FRAME_PERIOD_NS,
        start_ns: 0,
        epoch_ns: 1_718_451_937_250_000_000,
        prior: None,
        runs: runs.par_iter().map(|name| run_on(flight, name)).collect(),
        truth_is_batch: false,
        position_truth: None,
        trajectories: Vec::new(),
        check: None,
        agreement: Arc::default(),
        is_being_checked: false,
        is_being_written: false,
        interruption: None,
        warnings: vec![LogWarning::new(
            WarningKind::ImuGap,
            "/imu",
            6_000_000_000,
            "no IMU sample for 0.034 s at 6.00 s; bridged by interpolation".to_owned(),
        )],
        memory_budget_bytes: crate::session::DEFAULT_MEMORY_BUDGET_BYTES,
    }
}

/// Results of the estimator on all frames of a flight, each step with its rank.
fn run_on(flight: &SyntheticFlight, name: &str) -> RunRecord {
    let rig = &flight.given_rig;
    let mut estimator = Estimator::new(configuration(rig, name));
    let encoder_sigma_rad = rig.gimbal.as_ref().and_then(|gimbal| gimbal.encoder_sigma_rad);
    let spec = name.parse().expect("runs are named after parameterizations");
    let mut run = RunRecord::new(spec, "cam0".to_owned());
    for frame in &flight.frames {
        let joint_angles = encoder_sigma_rad.and_then(|sigma_rad| frame.encoder_angles(sigma_rad));
        let mut report = estimator.step(&StepInput {
            frame_index: frame.index,
            stamp_ns: frame.stamp_ns,
            imu: &frame.imu,
            imu_after: &[],
            image_times_s: &[],
            gimbal_imu: &[],
            joint_angles: joint_angles.as_ref(),
            tracks: &frame.tracks,
            further_tracks: &[],
        });
        let rank = report.linearization.take().and_then(|linearization| {
            let angles: Vec<&[f64]> = report.window.iter().map(|frame| frame.joint_angles_rad.as_slice()).collect();
            let calibration = &report.calibration;
            let chain = Chain::from_classical(&calibration.classical, calibration.parameterization);
            analyse(&linearization, &chain, &angles, false)
        });
        run.push(StepRecord {
            report,
            rank,
            tracks: Arc::new(frame.tracks.clone()).into(),
            further_images: Vec::new(),
            ground_truth: Some(frame.true_world_from_imu),
            log_time_ns: frame.stamp_ns + LOG_DELAY_NS,
            summary_only: false,
        });
    }
    run.finished = true;
    run
}

fn configuration(rig: &Rig, name: &str) -> EstimatorConfig {
    let auto = name == "auto";
    let parameterization = match name {
        "auto" => auto_parameterization(&rig.chain_of_camera("cam0").unwrap_or_default()),
        "classical" => Parameterization::Classical,
        _ => Parameterization::Minimal,
    };
    let configuration = EstimatorConfig::for_camera(rig, "cam0", parameterization).expect("the rig has cam0");
    EstimatorConfig {
        options: EstimatorOptions { keep_linearization: true, ..EstimatorOptions::default() },
        auto_parameterize: auto,
        ..configuration
    }
}
