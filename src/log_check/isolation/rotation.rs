//! Rotations of the vehicle by two sources, compared with each other.

use nalgebra::{Matrix3, Matrix3xX, UnitQuaternion, Vector3};

use super::comparison::{Change, Comparison, Fit, Parameter, Row};
use super::orientations::Orientations;
use super::source::Source;
use crate::geometry::{best_rotation, so3};
use crate::log_check::clock_alignment::ORIENTATION_TOLERANCE_RAD;
use crate::log_check::report::FindingInterval;
use crate::log_check::statistics::median;

/// Length of the compared rotations, in seconds: joint angles are noisy.
const LENGTH_S: f64 = 0.3;
/// Misfits below this part of the rotation are tolerated: scales and axes of sound sensors have a percent.
const TOLERATED_RATIO: f64 = 0.01;
/// The same of rotations near zero, in radians.
const TOLERATED_RAD: f64 = 1e-3;
/// Ratio up to which noise may exceed its stated level, as for image rotations.
const NOISE_TOLERANCE: f64 = 2.0;
/// Rounds in which rotations are computed again with the time offset and the axes that fit.
const ROUNDS: usize = 3;
/// Half the step of the derivative by the time offset, in seconds.
const HALF_STEP_S: f64 = 0.005;
/// Constant differences that are a disagreement.
const WRONG_DELAY_S: f64 = 0.02;
pub(super) const WRONG_SCALE: f64 = 0.05;
/// Number of standard deviations from which they are.
const SIGNIFICANT_SIGMAS: f64 = 5.0;
/// Ratio of the misfit in other axes to that in the rig's from which they are the first guess.
const OTHER_AXES_RATIO: f64 = 0.5;

const PARAMETERS: [Parameter; 6] = [
    Parameter::Rate,
    Parameter::Orientation,
    Parameter::Delay,
    Parameter::Scale,
    Parameter::AxisScales,
    Parameter::RateDrift,
];
/// Number of the parameters that sound sources have, and columns of the others.
const SOUND: usize = 4;
const ORIENTATION: usize = 3;
const DELAY: usize = 6;
const SCALE: usize = 7;
const AXIS_SCALES: usize = 8;
const RATE_DRIFT: usize = 11;
const COLUMNS: usize = 14;

/// Constant differences of two sources of rotation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Offsets {
    /// Axes of the first source from those of the second one.
    pub(super) first_from_second: UnitQuaternion<f64>,
    /// Time of the second source less that of the first one, in seconds.
    pub(super) delay_s: f64,
}

/// Compares two sources; the first one is the one with fewer orientations. `None` without common rotations.
pub(super) fn compare(one: &Orientations, other: &Orientations) -> Option<([Source; 2], Fit, Offsets)> {
    let (first, second) = if one.spacing_s() >= other.spacing_s() { (one, other) } else { (other, one) };
    let intervals = first.intervals_s(LENGTH_S);
    let vectors: Vec<(Vector3<f64>, Vector3<f64>)> = intervals
        .iter()
        .filter_map(|[from_s, to_s]| {
            let [predicted, measured] = [second, first].map(|source| source.rotation_between(*from_s, *to_s));
            Some((so3::log(&predicted?.0), so3::log(&measured?.0)))
        })
        .collect();
    let best_axes = |vectors: &[(Vector3<f64>, Vector3<f64>)]| best_rotation(vectors).map(|(rotation, _)| rotation);
    let given = UnitQuaternion::identity();
    let misfit = |rotation: &UnitQuaternion<f64>| {
        median(&vectors.iter().map(|(from, to)| (to - rotation * from).norm()).collect::<Vec<_>>())
    };
    let best = best_axes(&vectors).filter(|best| misfit(best) < OTHER_AXES_RATIO * misfit(&given));
    let (mut fit, mut offsets) = fit_from(first, second, &intervals, best.unwrap_or(given))?;
    // Axes that change at a time may be other ones for most of the log.
    let begins = |fit: &Fit| fit.disagrees.is_none_or(|interval| interval.since_s.is_some());
    if !begins(&fit) {
        let earlier = best_axes(&vectors[..vectors.len() / 3]);
        let others = best.map(|_| given).into_iter().chain(earlier);
        let begun = others.filter_map(|axes| fit_from(first, second, &intervals, axes)).find(|(fit, _)| begins(fit));
        (fit, offsets) = begun.unwrap_or((fit, offsets));
    }
    let sources = [first.source.clone(), second.source.clone()];
    if fit.disagrees.is_none()
        && let Some(change) = constant_change(&sources, &fit, &offsets)
    {
        fit.disagrees = Some(FindingInterval::default());
        fit.change = Some(change);
    }
    Some((sources, fit, offsets))
}

/// Fit of rotations over some intervals, whose axes are first these.
fn fit_from(
    first: &Orientations,
    second: &Orientations,
    intervals_s: &[[f64; 2]],
    first_from_second: UnitQuaternion<f64>,
) -> Option<(Fit, Offsets)> {
    let mut offsets = Offsets { first_from_second, delay_s: 0.0 };
    let fit = |offsets: &Offsets| {
        let rows = rows(first, second, intervals_s, offsets);
        Comparison { rows: &rows, parameters: &PARAMETERS, sound: SOUND, changing: &PARAMETERS[..SOUND] }.fit()
    };
    for _ in 1..ROUNDS {
        let found = fit(&offsets)?;
        let step = Vector3::from_iterator(found.constants[ORIENTATION..DELAY].iter().copied());
        offsets.first_from_second = so3::plus_left(&offsets.first_from_second, &step);
        offsets.delay_s += found.constants[DELAY];
    }
    Some((fit(&offsets)?, offsets))
}

/// Constant difference that sound sources do not have.
fn constant_change(sources: &[Source; 2], fit: &Fit, offsets: &Offsets) -> Option<Change> {
    let is_significant = |value: f64, tolerance: f64, sigma: f64| {
        value.abs() > tolerance.max(SIGNIFICANT_SIGMAS * sigma * fit.misfit.max(1.0))
    };
    let scale = fit.constants[SCALE];
    if is_significant(scale, WRONG_SCALE, fit.sigmas[SCALE]) {
        return Some(Change { parameter: Parameter::Scale, values: vec![scale] });
    }
    if is_significant(offsets.delay_s, WRONG_DELAY_S, fit.sigmas[DELAY]) {
        return Some(Change { parameter: Parameter::Delay, values: vec![offsets.delay_s] });
    }
    // The axes of ground truth and attitudes are not those of the rig.
    let in_rig = |source: &Source| matches!(source, Source::Gyroscope | Source::Images { .. } | Source::GimbalImu);
    let sigma_rad = fit.sigmas[ORIENTATION..DELAY].iter().copied().fold(0.0, f64::max);
    let turned = so3::log(&offsets.first_from_second);
    let is_turned = is_significant(turned.norm(), ORIENTATION_TOLERANCE_RAD, sigma_rad);
    (sources.iter().all(in_rig) && is_turned)
        .then(|| Change { parameter: Parameter::Orientation, values: turned.iter().copied().collect() })
}

fn rows(first: &Orientations, second: &Orientations, intervals_s: &[[f64; 2]], offsets: &Offsets) -> Vec<Row> {
    let [first_s, last_s] = [intervals_s.first(), intervals_s.last()].map(|it| it.map_or(0.0, |[from_s, _]| *from_s));
    let length_s = (last_s - first_s).max(LENGTH_S);
    let row = |interval_s: &[f64; 2]| {
        let [from_s, to_s] = *interval_s;
        let (measured, of_first) = first.rotation_between(from_s, to_s)?;
        let turn = offsets.first_from_second.to_rotation_matrix().into_inner();
        let at = |delay_s: f64| {
            let (rotation, variance) = second.rotation_between(from_s + delay_s, to_s + delay_s)?;
            Some((turn * so3::log(&rotation), variance))
        };
        let (predicted, noise_of_second) = at(offsets.delay_s)?;
        let by_delay =
            (at(offsets.delay_s + HALF_STEP_S)?.0 - at(offsets.delay_s - HALF_STEP_S)?.0) / (2.0 * HALF_STEP_S);
        let measured = so3::log(&measured);
        let mut jacobian = Matrix3xX::zeros(COLUMNS);
        // Rotations are `second_from_first`: a larger rate turns the other way.
        jacobian.fixed_columns_mut::<3>(0).copy_from(&(Matrix3::identity() * (from_s - to_s)));
        jacobian.fixed_columns_mut::<3>(ORIENTATION).copy_from(&-so3::hat(&predicted));
        jacobian.set_column(DELAY, &by_delay);
        jacobian.set_column(SCALE, &predicted);
        let of_second = turn.transpose() * predicted;
        let drifted = Matrix3::identity() * ((from_s - to_s) * (from_s - first_s) / length_s);
        jacobian.fixed_columns_mut::<3>(RATE_DRIFT).copy_from(&drifted);
        jacobian.fixed_columns_mut::<3>(AXIS_SCALES).copy_from(&(turn * Matrix3::from_diagonal(&of_second)));
        Some((0.5 * (from_s + to_s), measured - predicted, jacobian, of_first + noise_of_second, measured.norm()))
    };
    let found: Vec<_> = intervals_s.iter().filter_map(row).collect();
    let usual_rad = median(&found.iter().map(|(.., rotation_rad)| *rotation_rad).collect::<Vec<_>>());
    let tolerated_variance = TOLERATED_RAD.powi(2) + (TOLERATED_RATIO * usual_rad).powi(2);
    let row = |(time_s, residual, jacobian, noise, signal)| Row {
        time_s,
        residual,
        jacobian,
        variance: tolerated_variance + NOISE_TOLERANCE.powi(2) * noise,
        signal,
    };
    found.into_iter().map(row).collect()
}
