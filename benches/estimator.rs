//! Stages of the estimator on one full window of a synthetic flight with a gimbal: 150 features, eleven frames, a step
//! that marginalizes the oldest frame.
//!
//! `cargo bench --bench estimator` measures the time of the solve, the linearization, the report, the marginalization,
//! the rank analysis and the whole step; each sample starts from the same snapshot.

#![expect(clippy::disallowed_methods, reason = "a bench measures time")]

use std::hint::black_box;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use dcvins::estimator::{
    Estimator, EstimatorConfig, EstimatorOptions, EventKind, Phase, StageTimes, StepInput, StepReport,
};
use dcvins::gimbal::{Chain, Parameterization};
use dcvins::observability::analyse;
use dcvins::simulation::{SyntheticFlight, SyntheticFrame, SyntheticOptions, synthetic_tracks};

/// The window is full well before this frame.
const FIRST_FRAME: usize = 160;

fn clock_ms() -> f64 {
    static BEGIN: LazyLock<Instant> = LazyLock::new(Instant::now);
    BEGIN.elapsed().as_secs_f64() * 1e3
}

/// Snapshot before a step, and the frame of that step.
struct Recorded {
    estimator: Estimator,
    frame: SyntheticFrame,
    encoder_sigma_rad: f64,
}

impl Recorded {
    /// First step after [`FIRST_FRAME`] that marginalizes the oldest frame.
    fn new() -> Self {
        let flight = synthetic_tracks(&SyntheticOptions::default());
        let encoder_sigma_rad = encoder_sigma_rad(&flight);
        let mut estimator = Estimator::new(config(&flight));
        for frame in flight.frames {
            let before = estimator.clone();
            let report = step(&mut estimator, &frame, encoder_sigma_rad);
            let marginalized = report.events.iter().any(|event| event.kind == EventKind::OldestMarginalized);
            if frame.index >= FIRST_FRAME && report.phase == Phase::Tracking && marginalized {
                return Self { estimator: before, frame, encoder_sigma_rad };
            }
        }
        panic!("a flight of {} s marginalizes a frame", SyntheticOptions::default().duration_s);
    }

    /// Repeats the step.
    fn step(&self) -> StepReport {
        step(&mut self.estimator.clone(), &self.frame, self.encoder_sigma_rad)
    }
}

fn encoder_sigma_rad(flight: &SyntheticFlight) -> f64 {
    let gimbal = flight.given_rig.gimbal.as_ref().expect("the synthetic rig has a gimbal");
    gimbal.encoder_sigma_rad.expect("its joints have encoders")
}

fn config(flight: &SyntheticFlight) -> EstimatorConfig {
    EstimatorConfig {
        options: EstimatorOptions { keep_linearization: true, ..EstimatorOptions::default() },
        clock_ms,
        ..EstimatorConfig::for_camera(&flight.given_rig, "cam0", Parameterization::Minimal)
            .expect("the synthetic camera is cam0")
    }
}

fn step(estimator: &mut Estimator, frame: &SyntheticFrame, encoder_sigma_rad: f64) -> StepReport {
    let joint_angles = frame.encoder_angles(encoder_sigma_rad);
    estimator.step(&StepInput {
        frame_index: frame.index,
        stamp_ns: frame.stamp_ns,
        imu: &frame.imu,
        imu_after: &[],
        image_times_s: &[],
        gimbal_imu: &[],
        joint_angles: joint_angles.as_ref(),
        tracks: &frame.tracks,
        further_tracks: &[],
    })
}

fn stages(criterion: &mut Criterion) {
    let recorded = Recorded::new();
    let report = recorded.step();
    let linearization = report.linearization.expect("the linearization was asked for");
    let chain = Chain::from_classical(&report.calibration.classical, Parameterization::Minimal);
    let angles: Vec<&[f64]> = report.window.iter().map(|frame| frame.joint_angles_rad.as_slice()).collect();

    let mut group = criterion.benchmark_group("estimator");
    let mut stage = |name: &str, time_ms: fn(&StageTimes) -> f64| {
        group.bench_function(name, |bencher| {
            bencher.iter_custom(|count| {
                let total_ms: f64 = (0..count).map(|_| time_ms(&recorded.step().times)).sum();
                Duration::from_secs_f64(total_ms * 1e-3)
            });
        });
    };
    stage("optimize", |times| times.optimize_ms);
    stage("linearize", |times| times.linearize_ms);
    stage("report", |times| times.report_ms);
    stage("marginalize", |times| times.marginalize_ms);
    stage("step", |times| times.step_ms);
    group.bench_function("observability", |bencher| {
        bencher.iter(|| black_box(analyse(&linearization, &chain, &angles, false)));
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = stages
}
criterion_main!(benches);
