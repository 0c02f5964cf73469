//! `summary.json`: the result of one run.

use std::sync::Arc;

use serde::{Serialize, Serializer};

use super::answer::Answer;
use super::motion::{motion_after, motion_text};
use super::withheld::table_with;
use crate::calibration::ChainDistance;
use crate::estimator::{Phase, Stage, StageTimes};
use crate::geometry::seconds_from_ns;
use crate::gimbal::{ClassicalChain, ParameterId};
use crate::observability::laboratory::LONGEST_MOTION_S;
use crate::observability::{Deficit, ParameterRate, information_rate};
use crate::sensors::Rig;
use crate::session::accuracy::path_length_m;
use crate::session::record::{
    FlightParameter, KnownLossSummary, ParameterSummary, Recording, RunRecord, TrajectoryAccuracy, TrajectoryLane,
    known_losses, log_warning_lines, run_warning_lines,
};
use crate::text::{Named as _, log_name};

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameCounts {
    /// Number of images passed to the estimator.
    pub total: usize,
    /// Number of images with an estimated pose.
    pub estimated: usize,
    pub keyframes: usize,
    /// Stamp of the first pose, in seconds since the log began.
    pub initialized_at_s: Option<f64>,
    /// Number of restarts after a failure.
    pub restarts: usize,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationSummary {
    /// Name of the final parameterization.
    pub parameterization: String,
    /// Number of calibration parameters.
    pub columns: usize,
    /// Factor on the standard deviations of the measurements, at least 1: the root mean square change of the estimates
    /// in units of the change that their standard deviations allow.
    pub sigma_scale: f64,
    /// The parameters in column order.
    pub parameters: Vec<ParameterSummary>,
    /// Calibration table: verdicts of the whole flight, in groups; empty for a run with fixed calibration.
    pub estimability: Vec<FlightParameter>,
    /// Final distance of the whole chain from the ground truth over the joint angles of the run.
    pub chain_error: Option<ChainDistance>,
    /// The same with the values of the rig.
    pub chain_error_initial: Option<ChainDistance>,
}

impl CalibrationSummary {
    /// Root mean square of error over σ of the parameters that have both; `None` if there are none.
    pub fn parameter_error_sigma(&self) -> Option<f64> {
        let ratios = self.parameters.iter().filter_map(|parameter| {
            let sigma = parameter.sigma.filter(|sigma| *sigma > 0.0)?;
            Some((parameter.error? / sigma).powi(2))
        });
        let squares: Vec<f64> = ratios.collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DirectionWeight {
    pub name: String,
    /// Signed weight in the prior-scaled unit direction.
    pub weight: f64,
}

/// Observability of the calibration at the last step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RankSummary {
    pub columns: usize,
    pub rank_structural: usize,
    pub rank_informed: usize,
    /// Rank deficit by cause.
    pub deficit: Deficit,
    /// Structural null directions, each by its parameters with a weight above 0.01.
    pub null_directions: Vec<Vec<DirectionWeight>>,
    /// Null directions of the parameterization known in closed form, compared with every step.
    pub known: Vec<KnownLossSummary>,
    /// Information gain of all images by parameter and by motion.
    pub information: Option<InformationSummary>,
}

/// Information gain over the steps of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InformationSummary {
    /// Total length of the steps in seconds.
    pub duration_s: f64,
    /// Names of the motions in the order of `by_motion`.
    pub motions: Vec<String>,
    /// Gain by parameter; a gain of one bit halves the standard deviation.
    pub parameters: Vec<ParameterInformation>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterInformation {
    pub name: String,
    pub bits_per_s: f64,
    /// Contribution of each motion in bits per second; negative for a motion that reduces the contribution of others.
    pub by_motion: Vec<f64>,
    /// Remaining gain, from images that confirm earlier ones outside the window.
    pub earlier: f64,
}

/// Percentiles of one stage's time in milliseconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageSummary {
    /// Median over the estimated frames.
    pub p50: f64,
    /// 95th percentile over the estimated frames.
    pub p95: f64,
    pub max: f64,
}

/// Times of all stages in milliseconds by their keys, over the estimated frames.
#[derive(Clone, Debug, PartialEq)]
pub struct TimingSummary(pub Vec<(&'static str, StageSummary)>);

impl Serialize for TimingSummary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(key, stage)| (key, stage)))
    }
}

/// Summary of a run, the content of `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunSummary {
    /// File name of the log.
    pub log: String,
    /// Specification of the run in the syntax of the command line.
    pub run: String,
    /// Trust in the results, the cause of a doubt, and the required accuracy.
    pub answer: Answer,
    /// Keys of the cameras.
    pub camera: String,
    pub frames: FrameCounts,
    /// Path length over the estimated frames in metres, of the ground truth if there is one, else of the estimate.
    pub length_m: f64,
    /// Errors against ground truth, if there is one and the run was initialized.
    pub accuracy: Option<TrajectoryAccuracy>,
    /// Reason why there is no accuracy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy_missing: Option<String>,
    pub calibration: CalibrationSummary,
    /// Observability, `None` before the first solve.
    pub rank: Option<RankSummary>,
    /// Stage times, `None` if they were omitted for reproducible bytes.
    pub timing_ms: Option<TimingSummary>,
    /// Seconds of log per second of computation.
    pub real_time_factor: Option<f64>,
    /// Warnings about the log and of the run.
    pub warnings: Vec<String>,
    /// Trajectories of other programs, evaluated like the runs.
    #[serde(serialize_with = "lanes", skip_serializing_if = "Vec::is_empty")]
    pub trajectories: Vec<Arc<TrajectoryLane>>,
}

fn lanes<S: Serializer>(lanes: &[Arc<TrajectoryLane>], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(lanes.iter().map(Arc::as_ref))
}

/// Summary of a run with the motion that its parameters still need, which takes some tenths of a second.
pub fn summarize_with_motion(recording: &Recording, run: &RunRecord, timing: bool) -> RunSummary {
    let mut summary = summarize(recording, run, timing);
    let step = run.steps.iter().rev().find(|step| step.rank.is_some());
    if let Some(step) = step.filter(|_| summary.answer.needs_motion()) {
        let motion = motion_after(step, &recording.rig, &run.camera_key, LONGEST_MOTION_S);
        summary.answer.remedy = motion.map_or_else(String::new, |motion| motion_text(&motion, &recording.rig));
    }
    summary
}

pub fn summarize(recording: &Recording, run: &RunRecord, timing: bool) -> RunSummary {
    let estimated: Vec<_> = run.steps.iter().filter(|step| step.report.newest().is_some()).collect();
    let positions: Vec<_> = estimated.iter().filter_map(|step| step.report.newest()).collect();
    let own_length_m = || path_length_m(positions.iter().map(|frame| &frame.world_from_imu.translation_m));
    let length_m = run.true_length_m().unwrap_or_else(own_length_m);
    let (accuracy, accuracy_missing) = match run.accuracy() {
        Ok(accuracy) => (Some(accuracy), None),
        Err(_) if estimated.is_empty() => (None, Some(never_initialized(run))),
        Err(reason) => (None, Some(reason)),
    };
    let answer = Answer::of_run(recording, run);
    RunSummary {
        log: log_name(&recording.log_path),
        run: run.spec.to_string(),
        calibration: calibration(recording, run, &answer),
        answer,
        camera: run.last_camera_keys().join(", "),
        frames: FrameCounts {
            total: run.steps.len(),
            estimated: estimated.len(),
            keyframes: estimated.iter().filter(|step| step.report.keyframe).count(),
            initialized_at_s: estimated.first().map(|step| seconds_from_ns(step.report.stamp_ns)),
            restarts: run.steps.last().map_or(0, |step| step.report.restarts),
        },
        length_m,
        accuracy,
        accuracy_missing,
        rank: rank(recording, run),
        timing_ms: if timing { timing_summary(run) } else { None },
        real_time_factor: if timing { real_time_factor(run) } else { None },
        warnings: warnings(recording, run),
        trajectories: recording.trajectories.clone(),
    }
}

/// Reasons of the last failed initialization attempt.
fn never_initialized(run: &RunRecord) -> String {
    let reasons = run.waiting_reasons();
    if reasons.is_empty() {
        return "the run never initialized: no image reached the estimator".to_owned();
    }
    let shown = reasons.iter().take(WAITING_REASONS).map(|(reason, images)| format!("{reason} ({images} images)"));
    format!("the run never initialized; reasons: {}", shown.collect::<Vec<_>>().join("; "))
}

/// Reasons of a run that never initialized that are named.
const WAITING_REASONS: usize = 3;

fn calibration(recording: &Recording, run: &RunRecord, answer: &Answer) -> CalibrationSummary {
    let Some(last) = run.steps.last().map(|step| &step.report.calibration) else {
        return CalibrationSummary {
            parameterization: run.spec.parameterization.name().to_owned(),
            columns: 0,
            sigma_scale: 1.0,
            parameters: Vec::new(),
            estimability: Vec::new(),
            chain_error: None,
            chain_error_initial: None,
        };
    };
    let ground_truth = recording.ground_truth_rig.as_ref().and_then(|rig| rig.chain_of_camera(&run.camera_key));
    let given = recording.rig.chain_of_camera(&run.camera_key);
    let values_in = |rig: &Rig| run.values_in(rig, &recording.rig, last);
    let initial_values = values_in(&recording.rig).unwrap_or_default();
    let true_values = recording.ground_truth_rig.as_deref().and_then(values_in).unwrap_or_default();
    let value_of = |values: &[(ParameterId, f64)], parameter: ParameterId| {
        values.iter().find(|(known, _)| *known == parameter).map(|(_, value)| *value)
    };
    let names = recording.rig.parameter_names();
    let parameters = last
        .parameters
        .iter()
        .enumerate()
        .map(|(index, parameter)| {
            let parameter = *parameter;
            let dimension = parameter.dimension();
            let value = run.shown_value(parameter, last.values[index]);
            let near = |other: f64| parameter.value_near(value, other);
            let ground_truth = value_of(&true_values, parameter).map(near);
            ParameterSummary {
                name: names.name(parameter),
                dimension,
                initial: value_of(&initial_values, parameter).map_or(value, near),
                last: value,
                sigma: last.sigmas.get(index).copied().filter(|sigma| sigma.is_finite()),
                ground_truth,
                error: ground_truth.map(|ground_truth| dimension.difference(value, ground_truth)),
            }
        })
        .collect();
    let chain_error =
        |chain: &ClassicalChain| ground_truth.as_ref().and_then(|reference| run.chain_distance(chain, reference));
    CalibrationSummary {
        parameterization: last.parameterization.to_string(),
        columns: last.parameters.len(),
        sigma_scale: last.sigma_scale,
        parameters,
        estimability: table_with(recording, run, answer),
        chain_error: chain_error(&last.classical),
        chain_error_initial: given.as_ref().and_then(chain_error),
    }
}

fn rank(recording: &Recording, run: &RunRecord) -> Option<RankSummary> {
    let rank = run.steps.iter().rev().find_map(|step| step.rank.as_ref())?;
    let names = recording.rig.parameter_names();
    let null_directions = rank
        .directions
        .iter()
        .filter(|direction| direction.structural)
        .map(|direction| {
            let weights = rank.parameters.iter().zip(&direction.weights);
            weights
                .filter(|(_, weight)| weight.abs() > 0.01)
                .map(|(parameter, weight)| DirectionWeight { name: names.name(*parameter), weight: *weight })
                .collect()
        })
        .collect();
    Some(RankSummary {
        columns: rank.parameters.len(),
        rank_structural: rank.rank_structural,
        rank_informed: rank.rank_informed,
        deficit: rank.deficit(),
        null_directions,
        known: known_losses(run, &names),
        information: information(recording, run),
    })
}

fn information(recording: &Recording, run: &RunRecord) -> Option<InformationSummary> {
    let rate = information_rate(run.steps.iter().filter_map(|step| step.gain()))?;
    let (names, joints) = (recording.rig.parameter_names(), recording.rig.joint_names());
    let named = |rate: &ParameterRate| ParameterInformation {
        name: names.name(rate.parameter),
        bits_per_s: rate.bits_per_s,
        by_motion: rate.by_motion.clone(),
        earlier: rate.earlier,
    };
    Some(InformationSummary {
        duration_s: rate.duration_s,
        motions: rate.motions.iter().map(|motion| motion.name(&joints)).collect(),
        parameters: rate.parameters.iter().map(named).collect(),
    })
}

fn timing_summary(run: &RunRecord) -> Option<TimingSummary> {
    let times: Vec<&StageTimes> =
        run.steps.iter().filter(|step| step.report.phase == Phase::Tracking).map(|step| &step.report.times).collect();
    let summary = |stage: &Stage| {
        let mut sorted: Vec<f64> = times.iter().map(|times| (stage.time_ms)(times)).collect();
        sorted.sort_by(f64::total_cmp);
        let at = |fraction: f64| {
            sorted.get(((sorted.len() as f64 * fraction) as usize).min(sorted.len().saturating_sub(1))).copied()
        };
        Some((stage.key, StageSummary { p50: at(0.5)?, p95: at(0.95)?, max: at(1.0)? }))
    };
    StageTimes::STAGES.iter().map(summary).collect::<Option<_>>().map(TimingSummary)
}

fn real_time_factor(run: &RunRecord) -> Option<f64> {
    let first = run.steps.first()?;
    let last = run.steps.last()?;
    let work_ms: f64 = run.steps.iter().map(|step| step.report.times.step_ms).sum();
    let log_s = seconds_from_ns(last.report.stamp_ns - first.report.stamp_ns);
    (work_ms > 0.0).then(|| log_s * 1e3 / work_ms)
}

/// Warnings about the log, then of the run, each kind once with the stamp of the first, the count and the time span.
fn warnings(recording: &Recording, run: &RunRecord) -> Vec<String> {
    let lines = log_warning_lines(&recording.warnings).into_iter().chain(run_warning_lines(run));
    lines.map(|line| line.with_time()).chain(run.error.iter().cloned()).collect()
}
