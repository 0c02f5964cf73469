//! Accuracy of all runs as table rows with a column per run.

use crate::calibration::ChainDistance;
use crate::estimator::Phase;
use crate::geometry::seconds_from_ns;
use crate::gui::units::{fixed, significant};
use crate::observability::Determination;
use crate::session::{Answer, RELATIVE_LENGTHS_M, Recording, RunRecord, TrajectoryAccuracy, TrajectoryLane};

/// Number of new steps after which a run's accuracy is recomputed.
const UPDATE_PERIOD_STEPS: usize = 20;

/// Ratio of the estimated frames that runs may differ by and still be compared.
const MAX_FRAME_RATIO: f64 = 0.02;
/// Scatter of the extrinsics error as a ratio of its value: one calibration has no scatter of its own.
const EXTRINSICS_SCATTER: f64 = 0.05;
/// Number of parts of a flight whose mean errors are compared.
const PARTS: usize = 10;

/// Standard error of the mean of errors that depend on their neighbours: from the means of ten parts of the flight;
/// `None` with too few errors.
fn error_of_mean(errors: &[f64]) -> Option<f64> {
    let length = errors.len() / PARTS;
    if length < 2 {
        return None;
    }
    let means: Vec<f64> =
        errors.chunks_exact(length).take(PARTS).map(|part| part.iter().sum::<f64>() / part.len() as f64).collect();
    let mean = means.iter().sum::<f64>() / PARTS as f64;
    let variance = means.iter().map(|part| (part - mean).powi(2)).sum::<f64>() / (PARTS - 1) as f64;
    Some((variance / PARTS as f64).sqrt())
}

/// The values of one run over all its steps so far.
#[derive(Debug, Default)]
struct RunScore {
    id: u64,
    /// Key of its main camera; empty for a trajectory of another program.
    camera: String,
    count: usize,
    finished: bool,
    accuracy: Option<TrajectoryAccuracy>,
    /// Standard error of the mean position error in metres.
    ate_scatter_m: Option<f64>,
    chain: Option<ChainDistance>,
    initialized_s: Option<f64>,
    /// `None` for a trajectory of another program, like the following fields.
    estimated: Option<usize>,
    restarts: Option<usize>,
    columns: Option<usize>,
    determined: Option<usize>,
    informed: Option<usize>,
}

/// The values of all runs and then of all trajectories, cached until a run has new steps.
#[derive(Debug, Default)]
pub(crate) struct Scores {
    runs: Vec<RunScore>,
}

/// Kind of a value, by the origin of its scatter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum ScoreKind {
    #[default]
    Exact,
    /// ATE, over all estimated frames.
    Absolute,
    /// Relative pose error over sub-trajectories of this length in metres.
    Relative(f64),
    /// Error of the extrinsics.
    Extrinsics,
}

#[derive(Debug)]
pub(crate) struct ScoreRow {
    pub(crate) name: String,
    pub(super) meaning: &'static str,
    /// Shown unit, empty for counts.
    pub(crate) unit: &'static str,
    /// Values by run and then by trajectory, in the shown unit.
    pub(crate) values: Vec<Option<f64>>,
    /// Origin of the scatter of its values.
    pub(super) kind: ScoreKind,
    /// Scatter of the values in the shown unit; zero for exact ones.
    pub(super) scatters: Vec<f64>,
    /// True if smaller is better; `None` for a value that is no measure of quality, or if the values are not comparable.
    pub(super) less_is_better: Option<bool>,
    /// Decimals; `None` for three significant digits.
    pub(super) decimals: Option<usize>,
}

impl ScoreRow {
    /// Shown text of a value.
    pub(crate) fn text(&self, run: usize) -> String {
        let value = self.values.get(run).copied().flatten();
        value.map_or_else(
            || "–".to_owned(),
            |value| self.decimals.map_or_else(|| significant(value), |it| fixed(value, it)),
        )
    }

    /// Index of the best run, `None` where no run is better than all others by more than the scatter of both.
    pub(crate) fn best(&self) -> Option<usize> {
        let less = self.less_is_better?;
        let known = || self.values.iter().enumerate().filter_map(|(run, value)| Some((run, (*value)?)));
        let better = |a: &f64, b: &f64| if less { a.total_cmp(b) } else { b.total_cmp(a) };
        let (best, value) = known().min_by(|(_, a), (_, b)| better(a, b))?;
        // Equal texts count as equal values.
        let scatter = |run: usize| self.scatters.get(run).copied().unwrap_or(0.0);
        let differs = |run: usize, other: f64| {
            (other - value).abs() > scatter(run).hypot(scatter(best)) && self.text(run) != self.text(best)
        };
        let alone = known().count() > 1 && known().all(|(run, other)| run == best || differs(run, other));
        alone.then_some(best)
    }
}

impl Scores {
    pub(super) fn read(&mut self, recording: &Recording) {
        self.runs.resize_with(recording.runs.len() + recording.trajectories.len(), RunScore::default);
        let (of_runs, of_trajectories) = self.runs.split_at_mut(recording.runs.len());
        for (score, lane) in of_trajectories.iter_mut().zip(&recording.trajectories) {
            if score.id != lane.id {
                *score = RunScore::of_trajectory(lane);
            }
        }
        for (score, run) in of_runs.iter_mut().zip(&recording.runs) {
            let count = run.steps.len();
            let grown = count < score.count || count >= score.count + UPDATE_PERIOD_STEPS;
            if score.id != run.id || grown || run.finished && !(score.finished && score.count == count) {
                *score = RunScore::of(recording, run);
            }
        }
    }

    /// True if values are missing of a run that is still computed.
    pub(super) fn is_unfinished(&self) -> bool {
        self.runs.iter().any(|score| !score.finished)
    }

    pub(crate) fn rows(&self) -> Vec<ScoreRow> {
        const ATE: &str = "Absolute trajectory error: distance to the ground truth after alignment in yaw and position, over the estimated frames";
        const RPE: &str = "Relative pose error against the ground truth over sub-trajectories of this path length";
        const EXTRINSICS: &str =
            "Error of imu_from_camera against the ground-truth rig, mean over the visited joint angles";
        let row = |name: &str, unit, kind, meaning, decimals, of: &dyn Fn(&RunScore) -> Option<f64>| ScoreRow {
            name: name.to_owned(),
            meaning,
            unit,
            values: self.runs.iter().map(of).collect(),
            kind,
            scatters: Vec::new(),
            less_is_better: Some(true),
            decimals,
        };
        let ate = |name: &str, of: fn(&TrajectoryAccuracy) -> f64| {
            row(name, "m", ScoreKind::Absolute, ATE, None, &|score| score.accuracy.as_ref().map(of))
        };
        let count = |name: &str, meaning: &'static str, of: fn(&RunScore) -> Option<usize>| {
            let row = row(name, "", ScoreKind::Exact, meaning, Some(0), &|score| of(score).map(|count| count as f64));
            ScoreRow { less_is_better: None, ..row }
        };
        let mut rows = vec![
            ate("ATE RMS", |accuracy| accuracy.ate_rmse_m),
            ate("ATE mean", |accuracy| accuracy.ate_mean_m),
            ate("ATE median", |accuracy| accuracy.ate_median_m),
            ate("ATE max", |accuracy| accuracy.ate_max_m),
            row("ATE RMS / path length", "%", ScoreKind::Absolute, ATE, Some(2), &|score| {
                let accuracy = score.accuracy.as_ref().filter(|accuracy| accuracy.length_m > 0.0)?;
                Some(accuracy.ate_percent_of_length)
            }),
        ];
        for delta_m in RELATIVE_LENGTHS_M {
            let over = |score: &RunScore| score.accuracy.as_ref()?.rpe.iter().find(|it| it.delta_m == delta_m).copied();
            let (name, kind) = (format!("RPE {delta_m:.0} m RMS"), ScoreKind::Relative(delta_m));
            rows.push(row(&name, "m", kind, RPE, None, &|score| Some(over(score)?.translation_rmse_m)));
            rows.push(row(&name, "°", kind, RPE, None, &|score| Some(over(score)?.rotation_rmse_deg)));
        }
        let length = |score: &RunScore| Some(score.accuracy.as_ref()?.length_m);
        let length_meaning = "Length of the ground-truth path over the estimated frames";
        let first = "Stamp of the first frame with an estimated pose";
        rows.extend([
            row("extrinsics error, mean", "mm", ScoreKind::Extrinsics, EXTRINSICS, Some(2), &|score| {
                Some(1e3 * score.chain?.translation_mean_m)
            }),
            row("extrinsics error, mean", "°", ScoreKind::Extrinsics, EXTRINSICS, Some(3), &|score| {
                Some(score.chain?.rotation_mean_rad.to_degrees())
            }),
            ScoreRow {
                less_is_better: None,
                ..row("path length", "m", ScoreKind::Exact, length_meaning, Some(1), &length)
            },
            count("frames", "Processed frames", |score| Some(score.count)),
            ScoreRow {
                less_is_better: Some(false),
                ..count("estimated frames", "Frames with an estimated pose", |score| score.estimated)
            },
            row("initialized at", "s", ScoreKind::Exact, first, Some(2), &|score| score.initialized_s),
            ScoreRow {
                less_is_better: Some(true),
                ..count("restarts", "Re-initializations after a failure", |score| score.restarts)
            },
            count("calibration columns", "Estimated calibration parameters of the last step", |score| score.columns),
            count(
                "determined parameters",
                "Parameters that reach the required accuracy by the measurements of the flight alone; none for a run that is not trusted",
                |score| score.determined,
            ),
            count("informed rank at the end", "Informed rank of the last step with a calibration", |score| {
                score.informed
            }),
        ]);
        for row in &mut rows {
            self.add_scatter(row);
        }
        rows.retain(|row| row.values.iter().any(Option::is_some));
        rows
    }

    /// Sets the scatter of values, and which are comparable: none while a run is computed, no errors of runs that have
    /// estimated different numbers of frames, and no extrinsics of different cameras.
    fn add_scatter(&self, row: &mut ScoreRow) {
        let counts = || self.runs.iter().filter_map(|score| score.estimated);
        let (fewest, most) = (counts().min().unwrap_or(0), counts().max().unwrap_or(0));
        let of_trajectory = matches!(row.kind, ScoreKind::Absolute | ScoreKind::Relative(_));
        if of_trajectory && (most - fewest) as f64 > MAX_FRAME_RATIO * most as f64 {
            row.less_is_better = None;
        }
        let valued = || self.runs.iter().zip(&row.values).filter(|(_, value)| value.is_some()).map(|(score, _)| score);
        let of_one_camera = valued().zip(valued().skip(1)).all(|(a, b)| a.camera == b.camera);
        if self.is_unfinished() || row.kind == ScoreKind::Extrinsics && !of_one_camera {
            row.less_is_better = None;
        }
        let ratio = |score: &RunScore| match row.kind {
            ScoreKind::Exact => None,
            ScoreKind::Absolute => Some(score.ate_scatter_m? / score.accuracy.as_ref()?.ate_mean_m),
            // Sub-trajectories overlap; those that do not are independent.
            ScoreKind::Relative(delta_m) => {
                Some(1.0 / (2.0 * (score.accuracy.as_ref()?.length_m / delta_m).max(1.0)).sqrt())
            }
            ScoreKind::Extrinsics => Some(EXTRINSICS_SCATTER),
        };
        let values = self.runs.iter().zip(&row.values);
        row.scatters = values.map(|(score, value)| ratio(score).unwrap_or(0.0) * value.unwrap_or(0.0).abs()).collect();
    }
}

impl RunScore {
    fn of(recording: &Recording, run: &RunRecord) -> Self {
        let tracking = |step: &&std::sync::Arc<crate::session::StepRecord>| step.report.phase == Phase::Tracking;
        let last = run.steps.last();
        let ground_truth = recording.ground_truth_rig.as_ref().and_then(|rig| rig.chain_of_camera(&run.camera_key));
        let chain = ground_truth
            .zip(last)
            .and_then(|(ground_truth, last)| run.chain_distance(&last.report.calibration.classical, &ground_truth));
        let first = run.steps.iter().find(tracking);
        Self {
            id: run.id,
            camera: run.camera_key.clone(),
            count: run.steps.len(),
            finished: run.finished,
            accuracy: run.accuracy().ok(),
            ate_scatter_m: error_of_mean(&run.position_errors_m()),
            chain,
            estimated: Some(run.steps.iter().filter(tracking).count()),
            initialized_s: first.map(|step| seconds_from_ns(step.report.stamp_ns)),
            restarts: Some(last.map_or(0, |last| last.report.restarts)),
            columns: Some(last.map_or(0, |last| last.report.calibration.parameters.len())),
            determined: last.filter(|_| Answer::of_run(recording, run).withheld().is_none()).map(|last| {
                let verdicts = last.determinations(&recording.rig.required_accuracy);
                verdicts.iter().filter(|(_, verdict)| *verdict == Determination::Determined).count()
            }),
            informed: run.steps.iter().rev().find_map(|step| step.rank.as_ref()).map(|rank| rank.rank_informed),
        }
    }

    fn of_trajectory(lane: &TrajectoryLane) -> Self {
        let samples = lane.track.samples();
        Self {
            id: lane.id,
            count: samples.len(),
            finished: true,
            accuracy: lane.evaluation.accuracy.clone(),
            initialized_s: samples.first().map(|sample| seconds_from_ns(sample.stamp_ns)),
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(estimated: usize, accuracy: Option<TrajectoryAccuracy>, ate_scatter_m: Option<f64>) -> RunScore {
        RunScore { estimated: Some(estimated), accuracy, ate_scatter_m, finished: true, ..RunScore::default() }
    }

    fn accuracy(ate_m: f64) -> TrajectoryAccuracy {
        use crate::gui::samples::sample_recording;

        let known = sample_recording().runs[0].accuracy().unwrap();
        TrajectoryAccuracy { ate_rmse_m: ate_m, ate_mean_m: ate_m, ..known }
    }

    #[test]
    fn a_run_is_better_only_beyond_the_scatter_and_with_as_many_frames() {
        let best = |ate_m: [f64; 2], scatter_m: f64, frames: [usize; 2]| {
            let runs = [0, 1].map(|run| score(frames[run], Some(accuracy(ate_m[run])), Some(scatter_m)));
            let rows = Scores { runs: runs.into() }.rows();
            rows.iter().find(|row| row.name == "ATE RMS").unwrap().best()
        };
        assert_eq!(best([0.100, 0.150], 0.01, [400, 400]), Some(0));
        assert_eq!(best([0.100, 0.110], 0.01, [400, 400]), None, "within the scatter");
        assert_eq!(best([0.100, 0.150], 0.01, [400, 300]), None, "one has skipped a part of the flight");
    }

    #[test]
    fn only_finished_runs_are_compared_and_extrinsics_of_one_camera() {
        let best = |name: &str, finished: bool, cameras: [&str; 2]| {
            let runs = [0, 1].map(|run| RunScore {
                finished: finished || run == 0,
                camera: cameras[run].to_owned(),
                chain: Some(ChainDistance {
                    translation_mean_m: [0.001, 0.002][run],
                    rotation_mean_rad: 0.001,
                    translation_std_m: 0.0,
                    rotation_std_rad: 0.0,
                }),
                ..score(400, Some(accuracy([0.1, 0.2][run])), Some(0.01))
            });
            let rows = Scores { runs: runs.into() }.rows();
            rows.iter().find(|row| row.name == name).unwrap().best()
        };
        let extrinsics = "extrinsics error, mean";
        assert_eq!(best("ATE RMS", true, ["cam0", "cam1"]), Some(0));
        assert_eq!(best("ATE RMS", false, ["cam0", "cam0"]), None, "a run is still computed");
        assert_eq!(best(extrinsics, true, ["cam0", "cam0"]), Some(0));
        assert_eq!(best(extrinsics, true, ["cam0", "cam1"]), None, "other cameras");
    }

    #[test]
    fn the_error_of_a_mean_is_that_of_parts() {
        assert_eq!(error_of_mean(&[0.1; 19]), None);
        assert_eq!(error_of_mean(&[0.5; 40]), Some(0.0));
        // Ten parts with the means 0 and 1 in turn: deviation 0.527, over √10.
        let turns: Vec<f64> = (0..50).map(|place| f64::from(place / 5 % 2)).collect();
        assert!((error_of_mean(&turns).unwrap() - 0.1667).abs() < 1e-3);
    }
}
