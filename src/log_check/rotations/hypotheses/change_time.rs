//! Time from which on the rotations of a camera contradict the rig.

use super::fit::Fitter;
use crate::geometry::so3;
use crate::log_check::rotations::data::MeasuredRotation;
use crate::log_check::rotations::fit::TAIL_DEGREES;

/// Minimum number of rotations before and after the time.
const MIN_SIDE: usize = 8;
/// Smallest increase of the mean logarithm of the squared misfit: its square root grows by a half.
const MIN_INCREASE: f64 = 0.8;

/// Time in seconds since the log began that separates smaller from larger misfits best; `None` if they do not increase.
pub(super) fn change_s(fitter: &Fitter<'_>) -> Option<f64> {
    let predictions = fitter.predictions_by_rig(&fitter.measured);
    let misfit = |it: &MeasuredRotation| {
        let (predicted, covariance) = predictions.get(&it.rotation.from_ns)?;
        let difference = so3::log(&it.rotation.second_from_first) - predicted;
        let square = difference.dot(&covariance.cholesky()?.solve(&difference));
        Some((it.middle_s(), (square / TAIL_DEGREES).ln_1p()))
    };
    let misfits: Vec<(f64, f64)> = fitter.measured.iter().filter_map(misfit).collect();
    let total: f64 = misfits.iter().map(|(_, misfit)| misfit).sum();
    let mut before = 0.0;
    let mut best: Option<(f64, usize, f64)> = None;
    for place in 1..misfits.len() {
        before += misfits[place - 1].1;
        let [first, second] = [place, misfits.len() - place].map(|count| count as f64);
        let increase = (total - before) / second - before / first;
        let explained = increase * increase * first * second;
        let is_inside = place.min(misfits.len() - place) >= MIN_SIDE;
        if is_inside && increase > 0.0 && best.is_none_or(|(largest, ..)| explained > largest) {
            best = Some((explained, place, increase));
        }
    }
    let (_, place, increase) = best?;
    (increase > MIN_INCREASE).then(|| 0.5 * (misfits[place - 1].0 + misfits[place].0))
}
