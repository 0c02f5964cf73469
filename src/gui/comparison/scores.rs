//! The accuracy of all runs as table rows with a column per run.

use crate::calibration::ChainDistance;
use crate::estimator::Phase;
use crate::geometry::seconds_from_ns;
use crate::gui::units::{fixed, significant};
use crate::session::{RELATIVE_LENGTHS_M, Recording, RunRecord, TrajectoryAccuracy, TrajectoryLane};

/// Number of new steps after which a run's accuracy is computed again.
const UPDATE_PERIOD_STEPS: usize = 20;

/// The values of one run over all its steps so far.
#[derive(Debug, Default)]
struct RunScore {
    id: u64,
    count: usize,
    finished: bool,
    accuracy: Option<TrajectoryAccuracy>,
    chain: Option<ChainDistance>,
    initialized_s: Option<f64>,
    /// `None` of a trajectory, as what follows.
    estimated: Option<usize>,
    restarts: Option<usize>,
    columns: Option<usize>,
    informed: Option<usize>,
}

/// The values of all runs and then of all trajectories, cached until a run has new steps.
#[derive(Debug, Default)]
pub(crate) struct Scores {
    runs: Vec<RunScore>,
}

/// A row of the table.
#[derive(Debug)]
pub(crate) struct ScoreRow {
    /// Name of the value.
    pub(crate) name: String,
    /// Definition of the value.
    pub(super) meaning: &'static str,
    /// Shown unit, empty for counts.
    pub(crate) unit: &'static str,
    /// Values by run and then by trajectory, in the shown unit.
    pub(crate) values: Vec<Option<f64>>,
    /// Whether smaller is better; `None` where the value is no measure of quality.
    pub(super) less_is_better: Option<bool>,
    /// Decimals, `None` for three significant digits.
    pub(super) decimals: Option<usize>,
}

impl ScoreRow {
    /// The shown text of a value.
    pub(crate) fn text(&self, run: usize) -> String {
        let value = self.values.get(run).copied().flatten();
        value.map_or_else(
            || "–".to_owned(),
            |value| self.decimals.map_or_else(|| significant(value), |it| fixed(value, it)),
        )
    }

    /// Index of the best run, `None` where no run is better.
    pub(crate) fn best(&self) -> Option<usize> {
        let less = self.less_is_better?;
        let known = || self.values.iter().enumerate().filter_map(|(run, value)| Some((run, (*value)?)));
        let better = |a: &f64, b: &f64| if less { a.total_cmp(b) } else { b.total_cmp(a) };
        let (best, value) = known().min_by(|(_, a), (_, b)| better(a, b))?;
        // Equal texts count as equal values.
        let differs = |run: usize, other: f64| other != value && self.text(run) != self.text(best);
        let alone = known().count() > 1 && known().all(|(run, other)| run == best || differs(run, other));
        alone.then_some(best)
    }
}

impl Scores {
    /// Updates the values.
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

    /// The rows of the table.
    pub(crate) fn rows(&self) -> Vec<ScoreRow> {
        let row = |name: &str, unit: &'static str, less, decimals, of: &dyn Fn(&RunScore) -> Option<f64>| ScoreRow {
            name: name.to_owned(),
            meaning: "",
            unit,
            values: self.runs.iter().map(of).collect(),
            less_is_better: less,
            decimals,
        };
        let with = |meaning: &'static str, row: ScoreRow| ScoreRow { meaning, ..row };
        let less = Some(true);
        let ate = |row| {
            with(
                "Absolute trajectory error: distance to the ground truth after alignment in yaw and position, over the estimated frames",
                row,
            )
        };
        let mut rows = vec![
            ate(row("ATE RMS", "m", less, None, &|score| Some(score.accuracy.as_ref()?.ate_rmse_m))),
            ate(row("ATE mean", "m", less, None, &|score| Some(score.accuracy.as_ref()?.ate_mean_m))),
            ate(row("ATE median", "m", less, None, &|score| Some(score.accuracy.as_ref()?.ate_median_m))),
            ate(row("ATE max", "m", less, None, &|score| Some(score.accuracy.as_ref()?.ate_max_m))),
            ate(row("ATE RMS / path length", "%", less, Some(2), &|score| {
                let accuracy = score.accuracy.as_ref().filter(|accuracy| accuracy.length_m > 0.0)?;
                Some(accuracy.ate_percent_of_length)
            })),
        ];
        let rpe =
            |row| with("Relative pose error against the ground truth over sub-trajectories of this path length", row);
        let extrinsics = |row| {
            with("Error of imu_from_camera against the ground-truth rig, mean over the visited joint angles", row)
        };
        for delta_m in RELATIVE_LENGTHS_M {
            let over =
                |score: &RunScore| score.accuracy.as_ref()?.rpe.iter().find(|over| over.delta_m == delta_m).copied();
            let name = format!("RPE {delta_m:.0} m RMS");
            rows.push(rpe(row(&name, "m", less, None, &|score| Some(over(score)?.translation_rmse_m))));
            rows.push(rpe(row(&name, "°", less, None, &|score| Some(over(score)?.rotation_rmse_deg))));
        }
        let chain = |score: &RunScore| score.chain;
        rows.extend([
            extrinsics(row("extrinsics error, mean", "mm", less, Some(2), &|score| {
                Some(1e3 * chain(score)?.translation_mean_m)
            })),
            extrinsics(row("extrinsics error, mean", "°", less, Some(3), &|score| {
                Some(chain(score)?.rotation_mean_rad.to_degrees())
            })),
            with(
                "Length of the ground-truth path over the estimated frames",
                row("path length", "m", None, Some(1), &|score| Some(score.accuracy.as_ref()?.length_m)),
            ),
            with("Processed frames", row("frames", "", None, Some(0), &|score| Some(score.count as f64))),
            with(
                "Frames with an estimated pose",
                row("estimated frames", "", Some(false), Some(0), &|score| score.estimated.map(|count| count as f64)),
            ),
            with(
                "Stamp of the first frame with an estimated pose",
                row("initialized at", "s", less, Some(2), &|score| score.initialized_s),
            ),
            with(
                "Re-initializations after a failure",
                row("restarts", "", less, Some(0), &|score| score.restarts.map(|count| count as f64)),
            ),
            with(
                "Estimated calibration parameters of the last step",
                row("calibration columns", "", None, Some(0), &|score| score.columns.map(|count| count as f64)),
            ),
            with(
                "Informed rank of the last step with a calibration",
                row("informed rank at the end", "", None, Some(0), &|score| score.informed.map(|rank| rank as f64)),
            ),
        ]);
        rows.retain(|row| row.values.iter().any(Option::is_some));
        rows
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
            count: run.steps.len(),
            finished: run.finished,
            accuracy: run.accuracy().ok(),
            chain,
            estimated: Some(run.steps.iter().filter(tracking).count()),
            initialized_s: first.map(|step| seconds_from_ns(step.report.stamp_ns)),
            restarts: Some(last.map_or(0, |last| last.report.restarts)),
            columns: Some(last.map_or(0, |last| last.report.calibration.parameters.len())),
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
