//! A focal length that varies periodically: measured rotations as linear functions of the predicted ones find its period, then
//! rotations are measured again with it.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};

use super::fit::{Fitted, Fitter, Predictions};
use crate::faults::{Fault, FaultKind, LensChange};
use crate::geometry::so3;
use crate::log_check::rotations::data::MeasuredRotation;
use crate::log_check::rotations::fit::{RotationFit, TAIL_DEGREES, tail_cost};
use crate::log_check::statistics::percentile;

/// Quantile of the squared differences that tells their level, and the same quantile of the sum of three squared standard
/// normal numbers: much of a log may be at rest.
const LEVEL_QUANTILE: f64 = 0.9;
const LEVEL_SQUARE: f64 = 6.251;
/// Rounds of weighting by a t distribution.
const ROUNDS: usize = 4;
/// Shortest period of a focal length in seconds, its longest as a ratio of the log, and the ratio of tried periods.
const SHORTEST_PERIOD_S: f64 = 0.5;
const LONGEST_PERIOD: f64 = 0.6;
const PERIOD_RATIO: f64 = 1.03;
/// Number of parameters of a period: length, amplitude, phase and mean.
const PERIOD_PARAMETERS: usize = 4;
/// Number of times that rotations are measured with a focal length that varies.
const MEASURED: usize = 3;

/// Rotation with its prediction by a fit.
struct Row {
    time_s: f64,
    measured: Vector3<f64>,
    predicted: Vector3<f64>,
    information: Matrix3<f64>,
}

/// Rotations of a camera with the predictions of the fit without a correction.
pub(super) struct LinearModels {
    fit: RotationFit,
    rows: Vec<Row>,
    /// Quantile of the squared differences over its expected value, at least one: weights are relative to the misfit.
    level: f64,
    /// Cost without a correction.
    given: f64,
}

impl LinearModels {
    pub(super) fn new(fitter: &Fitter<'_>, measured: &[MeasuredRotation]) -> Option<Self> {
        let (fit, predictions) = fitter.fit_measured(measured)?;
        let rows: Vec<Row> = measured.iter().filter_map(|it| Row::of(it, &predictions)).collect();
        let squares: Vec<f64> = rows.iter().map(|row| row.square(&(row.measured - row.predicted))).collect();
        let level = (percentile(&squares, LEVEL_QUANTILE) / LEVEL_SQUARE).max(1.0);
        let given = squares.iter().map(|square| tail_cost(square / level)).sum();
        Some(Self { fit, rows, level, given })
    }

    /// Fit with a focal length that varies periodically, at the period that explains most.
    pub(super) fn period_fit(&self, fitter: &Fitter<'_>) -> Option<Fitted> {
        let (first_s, last_s) = (self.rows.first()?.time_s, self.rows.last()?.time_s);
        let waves = |period_s: f64| {
            move |row: &Row| {
                let (sine, cosine) = (TAU * row.time_s / period_s).sin_cos();
                let scaled = across(&row.predicted);
                Matrix3xX::from_columns(&[scaled, scaled * sine, scaled * cosine])
            }
        };
        let longest_s = LONGEST_PERIOD * (last_s - first_s);
        let periods = std::iter::successors(Some(SHORTEST_PERIOD_S), |period_s| Some(period_s * PERIOD_RATIO));
        let tried = periods.take_while(|period_s| *period_s < longest_s);
        let costs = tried.map(|period_s| (self.cost(&waves(period_s)), period_s));
        let (_, coarse_s) = costs.min_by(|one, other| one.0.total_cmp(&other.0))?;
        let near = (-4..=4).map(|step| coarse_s * PERIOD_RATIO.powf(f64::from(step) / 4.0));
        let costs = near.map(|period_s| (self.cost(&waves(period_s)), period_s));
        let (_, period_s) = costs.min_by(|one, other| one.0.total_cmp(&other.0))?;
        if self.cost(&waves(period_s)) + PERIOD_PARAMETERS as f64 * fitter.parameter_cost() > self.given {
            return None;
        }
        // A focal length that changes between two images also moves features towards the edge: rotations are measured again.
        let first = self.solution(&waves(period_s))?;
        let mut wave = Wave { mean: first[0], sine: first[1], cosine: first[2], period_s, middle_s: 0.0 }
            .about(0.5 * (first_s + last_s));
        let mut fit = None;
        for _ in 0..MEASURED {
            let measured = fitter.with_lens_at(|time_s| LensChange { focal: wave.ratio(time_s), ..LensChange::NONE });
            let models = Self::new(fitter, &measured)?;
            let columns = |row: &Row| {
                let columns = wave.derivatives(row.time_s).map(|derivative| across(&row.predicted) * derivative);
                Matrix3xX::from_columns(&columns)
            };
            wave.change(&models.solution(&columns)?);
            fit = Some(models.fit);
        }
        let fit = fit?;
        Some(Fitted {
            fault: Fault::new(FaultKind::FocalPeriod, &[1.0 + wave.sine.hypot(wave.cosine), wave.period_s]),
            criterion: fitter.criterion(&fit, PERIOD_PARAMETERS),
            fit,
        })
    }

    /// Cost of all rows with the best values of a linear function.
    fn cost(&self, columns: &dyn Fn(&Row) -> Matrix3xX<f64>) -> f64 {
        let values = self.solution(columns);
        let left = |row: &Row| {
            let change = values.as_ref().map_or_else(Vector3::zeros, |values| columns(row) * values);
            row.measured - row.predicted - change
        };
        self.rows.iter().map(|row| tail_cost(row.square(&left(row)) / self.level)).sum()
    }

    /// Values of a linear function of the differences, by least squares with the weights of a t distribution.
    fn solution(&self, columns: &dyn Fn(&Row) -> Matrix3xX<f64>) -> Option<DVector<f64>> {
        let count = columns(self.rows.first()?).ncols();
        let mut values = DVector::zeros(count);
        for _ in 0..ROUNDS {
            let (mut hessian, mut gradient) = (DMatrix::identity(count, count), DVector::zeros(count));
            for row in &self.rows {
                let jacobian = columns(row);
                let difference = row.measured - row.predicted;
                let square = row.square(&(difference - &jacobian * &values)) / self.level;
                let information = row.information * (TAIL_DEGREES + 3.0) / (TAIL_DEGREES + square);
                hessian += jacobian.transpose() * information * &jacobian;
                gradient += jacobian.transpose() * (information * difference);
            }
            values = hessian.cholesky()?.solve(&gradient);
        }
        Some(values)
    }
}

impl Row {
    fn of(measured: &MeasuredRotation, predictions: &Predictions) -> Option<Self> {
        let (predicted, covariance) = predictions.get(&measured.rotation.from_ns)?;
        Some(Self {
            time_s: measured.middle_s(),
            measured: so3::log(&measured.rotation.second_from_first),
            predicted: *predicted,
            information: covariance.try_inverse()?,
        })
    }

    fn square(&self, left: &Vector3<f64>) -> f64 {
        left.dot(&(self.information * left))
    }
}

/// Ratio of a focal length to the rig's that varies periodically: `1 + mean + sine · sin φ + cosine · cos φ` with the phase
/// `φ` from the time `middle_s` on.
struct Wave {
    mean: f64,
    sine: f64,
    cosine: f64,
    period_s: f64,
    middle_s: f64,
}

impl Wave {
    /// The same with the phase from another time on: a change of the period then hardly changes the phase.
    fn about(self, middle_s: f64) -> Self {
        let (sine, cosine) = self.phase(middle_s).sin_cos();
        Self {
            sine: self.sine * cosine - self.cosine * sine,
            cosine: self.sine * sine + self.cosine * cosine,
            middle_s,
            ..self
        }
    }

    fn phase(&self, time_s: f64) -> f64 {
        TAU * (time_s - self.middle_s) / self.period_s
    }

    fn ratio(&self, time_s: f64) -> f64 {
        let (sine, cosine) = self.phase(time_s).sin_cos();
        1.0 + self.mean + self.sine * sine + self.cosine * cosine
    }

    /// Derivatives by mean, sine, cosine and period.
    fn derivatives(&self, time_s: f64) -> [f64; 4] {
        let phase = self.phase(time_s);
        let (sine, cosine) = phase.sin_cos();
        [1.0, sine, cosine, (self.cosine * sine - self.sine * cosine) * phase / self.period_s]
    }

    fn change(&mut self, change: &DVector<f64>) {
        self.mean += change[0];
        self.sine += change[1];
        self.cosine += change[2];
        self.period_s += change[3];
    }
}

/// Part of a rotation vector across the optical axis, which the focal length scales.
fn across(rotation: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(rotation.x, rotation.y, 0.0)
}
