//! Focal lengths on a grid: the best constant one, and pieces of constant focal length by dynamic programming.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::fit::{Fitted, Fitter, Predictions, length_s};
use crate::faults::{Fault, FaultKind, LensChange};
use crate::geometry::so3;
use crate::log_check::report::ImageRotation;
use crate::log_check::rotations::data::{MeasuredRotation, joined};
use crate::log_check::rotations::fit::tail_cost;

/// Range of the ratios of a focal length to the rig's, and the number of steps whose rotations are measured.
const RATIOS: [f64; 2] = [0.4, 2.6];
const MEASURED_STEPS: usize = 24;
/// Interpolated states per measured step.
const STATES_PER_STEP: usize = 5;
/// Squared noise level of the misfits.
const NOISE_LEVEL_SQUARED: f64 = 2.25;
/// Cost of a change of the focal length in addition to the cost of its two parameters: measurements that are wrong for
/// a few images must not pay for two changes.
const CHANGE_COST: f64 = 40.0;
/// Smallest relative change that counts.
const MIN_CHANGE: f64 = 0.04;
/// Shortest piece that is reported, in seconds.
const MIN_PIECE_S: f64 = 0.4;
const ROUNDS: usize = 3;

/// Ratio of the focal length of a state to the rig's.
fn ratio(state: usize) -> f64 {
    let last = (MEASURED_STEPS * STATES_PER_STEP) as f64;
    RATIOS[0] * (RATIOS[1] / RATIOS[0]).powf(state as f64 / last)
}

/// Rotations by the focal length.
pub(super) struct FocalGrid {
    /// Rotation of each step by the stamp of its first image.
    steps: Vec<BTreeMap<i64, MeasuredRotation>>,
    /// Rotations that all steps have, in order of time.
    keys: Vec<i64>,
    /// Predictions by the rig.
    by_rig: Predictions,
}

impl FocalGrid {
    pub(super) fn new(fitter: &Fitter<'_>) -> Self {
        let lens = |step: usize| LensChange { focal: ratio(step * STATES_PER_STEP), ..LensChange::NONE };
        let lenses: Vec<LensChange> = (0..=MEASURED_STEPS).map(lens).collect();
        let by_stamp = |measured: Vec<MeasuredRotation>| {
            let all = joined(&measured, length_s(fitter.chain)).into_iter();
            all.map(|it| (it.rotation.from_ns, it)).collect::<BTreeMap<_, _>>()
        };
        let steps: Vec<_> = fitter.data.with_lenses(&lenses).into_iter().map(by_stamp).collect();
        let in_all = |key: &i64| steps.iter().all(|step| step.contains_key(key));
        let keys = steps.first().map(|step| step.keys().copied().filter(in_all).collect()).unwrap_or_default();
        Self { steps, keys, by_rig: fitter.predictions_by_rig(&fitter.measured) }
    }

    /// Ratio of the best constant focal length to the rig's, by the rig's prediction.
    pub(super) fn best_constant(&self) -> f64 {
        // A change that costs more than any misfit never occurs.
        self.cheapest(&self.by_rig, f64::MAX).first().map_or(1.0, |(_, state)| ratio(*state))
    }

    /// Fit with a focal length that changes, `None` if it does not.
    pub(super) fn pieces_fit(&self, fitter: &Fitter<'_>) -> Option<Fitted> {
        let mut predictions = self.by_rig.clone();
        let mut chosen = Vec::new();
        let mut fit = None;
        for _ in 0..ROUNDS {
            chosen = self.cheapest(&predictions, 2.0 * fitter.parameter_cost() + CHANGE_COST);
            let (found, next) = fitter.fit_measured(&self.rotations(&chosen))?;
            (fit, predictions) = (Some(found), next);
        }
        let (fit, pieces) = (fit?, self.pieces(&chosen));
        let ratios = || pieces.iter().map(|[_, ratio]| *ratio);
        let (low, high) = (ratios().fold(f64::INFINITY, f64::min), ratios().fold(0.0, f64::max));
        if pieces.len() < 2 || high < low * (1.0 + MIN_CHANGE) {
            return None;
        }
        let changes = chosen.windows(2).filter(|pair| pair[0].1 != pair[1].1).count();
        Some(Fitted {
            fault: Fault::new(FaultKind::FocalPieces, pieces.as_flattened()),
            criterion: fitter.criterion(&fit, 2 * changes + 1),
            fit,
        })
    }

    /// Rotation vector in a state, interpolated between two steps.
    fn vector(&self, key: i64, state: usize) -> Vector3<f64> {
        let step = (state / STATES_PER_STEP).min(MEASURED_STEPS - 1);
        let fraction = (state - step * STATES_PER_STEP) as f64 / STATES_PER_STEP as f64;
        let [from, to] = [step, step + 1].map(|step| so3::log(&self.steps[step][&key].rotation.second_from_first));
        from.lerp(&to, fraction)
    }

    /// Rotations in the chosen states.
    fn rotations(&self, chosen: &[(i64, usize)]) -> Vec<MeasuredRotation> {
        let rotation = |(key, state): &(i64, usize)| {
            let near = &self.steps[state / STATES_PER_STEP][key];
            let second_from_first = so3::exp(&self.vector(*key, *state));
            MeasuredRotation { rotation: ImageRotation { second_from_first, ..near.rotation.clone() }, ..near.clone() }
        };
        chosen.iter().map(rotation).collect()
    }

    /// Sequence of states with the least sum of misfits and changes (Viterbi's algorithm).
    fn cheapest(&self, predictions: &Predictions, change_cost: f64) -> Vec<(i64, usize)> {
        let states = MEASURED_STEPS * STATES_PER_STEP + 1;
        let keys: Vec<i64> = self.keys.iter().copied().filter(|key| predictions.contains_key(key)).collect();
        let mut costs: Vec<f64> = vec![0.0; states];
        let mut sources: Vec<Vec<usize>> = Vec::new();
        for key in &keys {
            let (predicted, covariance) = &predictions[key];
            let information = covariance.try_inverse().unwrap_or_else(Matrix3::zeros);
            let best = (0..states).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(0);
            let changed = costs[best] + change_cost;
            let from: Vec<usize> =
                (0..states).map(|state| if costs[state] <= changed { state } else { best }).collect();
            let next = |state: usize| {
                let misfit = self.vector(*key, state) - predicted;
                costs[state].min(changed) + tail_cost(misfit.dot(&(information * misfit)) / NOISE_LEVEL_SQUARED)
            };
            costs = (0..states).map(next).collect();
            sources.push(from);
        }
        let mut state = (0..states).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(0);
        let mut chosen = Vec::new();
        for (key, from) in keys.iter().zip(&sources).rev() {
            chosen.push((*key, state));
            state = from[state];
        }
        chosen.reverse();
        chosen
    }

    /// Begins in seconds and ratios of the pieces that last long enough.
    fn pieces(&self, chosen: &[(i64, usize)]) -> Vec<[f64; 2]> {
        let time_s = |key: i64| self.steps[0][&key].middle_s();
        let mut pieces: Vec<[f64; 2]> = Vec::new();
        for piece in chosen.chunk_by(|a, b| a.1 == b.1) {
            let (first, last) = (piece[0], piece[piece.len() - 1]);
            let near = pieces.last().is_some_and(|[_, before]| (ratio(first.1) / before - 1.0).abs() < MIN_CHANGE);
            if time_s(last.0) - time_s(first.0) >= MIN_PIECE_S && !near {
                pieces.push([time_s(first.0), ratio(first.1)]);
            }
        }
        pieces
    }
}
