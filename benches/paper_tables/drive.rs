//! Estimators over a log, with settings that no run specification has and a look at their covariances.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use dcvins::estimator::{EstimatorConfig, EventKind, FactorKind};
use dcvins::export::{RunSummary, summarize};
use dcvins::session::{self, Recording, RunRecord, SessionPlan, SessionRequest};
use serde::{Deserialize, Serialize};

use crate::logs::Log;
use crate::samples::{CalibrationErrors, calibration_sample};

/// Frames between two samples of the covariances: about as long as a window, so that samples hardly share
/// measurements.
const SAMPLED_FRAMES: usize = 60;

/// Squared error of a pose over its covariance (NEES), of all six components, of the rotation and of the translation.
pub(crate) type PoseSquares = [f64; 3];

/// One estimator over a log.
#[derive(Clone)]
pub(crate) struct Variant {
    pub(crate) name: &'static str,
    pub(crate) spec: &'static str,
    /// Whether the covariances are wanted as well.
    pub(crate) analysed: bool,
    pub(crate) change: fn(&mut EstimatorConfig),
}

impl Variant {
    /// A run of a specification.
    pub(crate) fn plain(name: &'static str, spec: &'static str) -> Self {
        Self { name, spec, analysed: false, change: |_| () }
    }
}

/// Results of one run for the tables.
#[derive(Serialize, Deserialize)]
pub(crate) struct Driven {
    /// Length of the path over the estimated frames.
    pub(crate) length_m: f64,
    pub(crate) initialized_at_s: Option<f64>,
    pub(crate) restarts: usize,
    /// Errors against the ground truth, where it is available.
    pub(crate) accuracy: Option<Accuracy>,
    pub(crate) chain_error_initial: Option<ChainDistance>,
    /// At the end.
    pub(crate) chain_error: Option<ChainDistance>,
    /// Median and 95th percentile of the time of a step.
    pub(crate) step_ms: Option<[f64; 2]>,
    pub(crate) poses: Vec<PoseSquares>,
    /// The last one.
    pub(crate) calibration: Option<CalibrationErrors>,
    /// Mean over the steps of χ² per residual after the solve, by factor.
    pub(crate) chi2: BTreeMap<String, f64>,
    /// Seconds without a pose after the first one.
    pub(crate) lost_s: f64,
    /// Messages of the failures.
    pub(crate) failures: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

/// Errors of a trajectory after alignment by yaw and position.
#[derive(Serialize, Deserialize)]
pub(crate) struct Accuracy {
    pub(crate) ate_rmse_m: f64,
    pub(crate) ate_max_m: f64,
    pub(crate) ate_percent_of_length: f64,
}

/// Mean distance of a chain from the ground truth over the visited joint angles.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(crate) struct ChainDistance {
    pub(crate) metres: f64,
    pub(crate) degrees: f64,
}

impl ChainDistance {
    pub(crate) fn new(metres: f64, radians: f64) -> Self {
        Self { metres, degrees: radians.to_degrees() }
    }
}

impl Driven {
    /// Root mean square of the position error, as far as there is one.
    pub(crate) fn ate_m(&self) -> Option<f64> {
        Some(self.accuracy.as_ref()?.ate_rmse_m)
    }

    /// Distance of the chain from the ground truth at the end, in millimetres.
    pub(crate) fn chain_mm(&self) -> Option<f64> {
        Some(self.chain_error?.metres * 1e3)
    }

    /// The same in degrees.
    pub(crate) fn chain_deg(&self) -> Option<f64> {
        Some(self.chain_error?.degrees)
    }
}

/// Runs the variants on a log, with another rig than the log's if one is given; returns their results in order.
pub(crate) fn drive(log: &Log, rig_path: Option<&Path>, variants: &[Variant]) -> Result<Vec<Driven>> {
    let recording = session::compute(&plan(log, rig_path, variants)?, None, &mut |_| ())?.into_recording();
    Ok(recording.runs.iter().map(|run| driven(&recording, run)).collect())
}

fn plan(log: &Log, rig_path: Option<&Path>, variants: &[Variant]) -> Result<SessionPlan> {
    let request = |spec: &str| -> Result<SessionRequest> {
        Ok(SessionRequest {
            log_path: log.path.clone(),
            rig_path: rig_path.map(Path::to_owned),
            specs: vec![spec.parse()?],
            duration_s: Some(log.duration_s),
            ..SessionRequest::default()
        })
    };
    let mut plan = SessionPlan::open(&request(variants[0].spec)?)?;
    // More runs than fit side by side in a window, so one by one.
    plan.runs.clear();
    for variant in variants {
        let mut runs = SessionPlan::open(&request(variant.spec)?)?.runs;
        plan.runs.append(&mut runs);
    }
    plan.changes = variants.iter().map(|variant| variant.change).collect();
    plan.keep_linearization_every = variants.iter().any(|variant| variant.analysed).then_some(SAMPLED_FRAMES);
    Ok(plan)
}

fn driven(recording: &Recording, run: &RunRecord) -> Driven {
    let poses =
        run.pose_consistency().iter().map(|sample| [sample.pose, sample.rotation, sample.translation]).collect();
    let ground_truth = recording.ground_truth_rig.as_ref().and_then(|rig| rig.chain_of_camera(&run.camera_key));
    let last = run.steps.iter().rev().find_map(|step| calibration_sample(&step.report));

    let mut sums: BTreeMap<FactorKind, (f64, usize)> = BTreeMap::new();
    let mut failures = Vec::new();
    let (mut before_ns, mut lost_ns) = (None, 0);
    for report in run.steps.iter().map(|step| &step.report) {
        for part in &report.residuals {
            let Some(mean_square) = part.mean_square() else { continue };
            let sum = sums.entry(part.factor).or_default();
            *sum = (sum.0 + mean_square, sum.1 + 1);
        }
        let failed = report.events.iter().filter(|event| event.kind == EventKind::Failure);
        failures.extend(failed.map(|event| format!("{:.1} s: {}", report.stamp_ns as f64 * 1e-9, event.message)));
        let estimated = report.newest().is_some();
        if let Some(before_ns) = before_ns
            && !estimated
        {
            lost_ns += report.stamp_ns - before_ns;
        }
        if before_ns.is_some() || estimated {
            before_ns = Some(report.stamp_ns);
        }
    }
    let RunSummary { length_m, frames, accuracy, calibration, timing_ms, warnings, .. } =
        summarize(recording, run, true);
    Driven {
        length_m,
        initialized_at_s: frames.initialized_at_s,
        restarts: frames.restarts,
        accuracy: accuracy.map(|accuracy| Accuracy {
            ate_rmse_m: accuracy.ate_rmse_m,
            ate_max_m: accuracy.ate_max_m,
            ate_percent_of_length: accuracy.ate_percent_of_length,
        }),
        chain_error_initial: calibration
            .chain_error_initial
            .map(|error| ChainDistance::new(error.translation_mean_m, error.rotation_mean_rad)),
        chain_error: calibration
            .chain_error
            .map(|error| ChainDistance::new(error.translation_mean_m, error.rotation_mean_rad)),
        step_ms: timing_ms.map(|timing| [timing.step.p50, timing.step.p95]),
        poses,
        calibration: last.zip(ground_truth).and_then(|(sample, ground_truth)| sample.judged(&ground_truth)),
        chi2: sums.into_iter().map(|(factor, (sum, count))| (factor.name().to_owned(), sum / count as f64)).collect(),
        lost_s: lost_ns as f64 * 1e-9,
        failures,
        warnings,
    }
}
