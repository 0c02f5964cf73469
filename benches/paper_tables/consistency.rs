//! Tables of consistency: normalized squared errors of poses and calibration against their χ² bounds.

use crate::drive::PoseSquares;
use crate::flights::Flight;
use crate::samples::CalibrationErrors;
use crate::table::{Table, chi2_quantile, number};

/// The normal quantile of the two-sided 95 % bounds.
const TWO_SIDED_95: f64 = 1.959_964;
/// The normal quantile of the one-sided 95 % bound.
const ONE_SIDED_95: f64 = 1.644_854;

/// The bounds between which the mean of `count` values of χ² with `degrees` lies in 95 of 100 cases.
fn mean_bounds(degrees: f64, count: usize) -> [f64; 2] {
    let all = degrees * count as f64;
    [-TWO_SIDED_95, TWO_SIDED_95].map(|quantile| chi2_quantile(all, quantile) / count as f64)
}

/// How the poses' errors compare with their covariances.
pub(crate) fn poses(flights: &[Flight]) -> Table {
    let mut table = Table::new(
        "consistency_poses",
        "Consistency of poses: squared error over covariance (NEES) of the window's newest pose in its oldest one; \
         consistent when the mean lies in its 95 % bounds and 95 % of the samples below the bound of one",
        &[
            "flight",
            "run",
            "samples",
            "mean of 6",
            "95 % bounds",
            "median",
            "within 95 %",
            "rotation, of 3",
            "position, of 3",
        ],
    );
    for (experiment, run, name) in Flight::experiments_and_runs(flights) {
        let samples: Vec<&PoseSquares> =
            Flight::of(flights, experiment).flat_map(|flight| &flight.run(run).poses).collect();
        if samples.is_empty() {
            continue;
        }
        let count = samples.len();
        let mean = |part: usize| samples.iter().map(|sample| sample[part]).sum::<f64>() / count as f64;
        let bound = chi2_quantile(6.0, ONE_SIDED_95);
        let within = samples.iter().filter(|sample| sample[0] <= bound).count();
        let [low, high] = mean_bounds(6.0, count);
        let median = crate::table::median(samples.iter().map(|sample| sample[0]).collect());
        table.row([
            experiment.name().to_owned(),
            name.to_owned(),
            count.to_string(),
            format!("{:.1}", mean(0)),
            format!("{low:.1} to {high:.1}"),
            number(median, 1),
            format!("{:.0} %", 100.0 * within as f64 / count as f64),
            format!("{:.1}", mean(1)),
            format!("{:.1}", mean(2)),
        ]);
    }
    table
}

/// How the errors of the calibration compare with its covariance at the flights' ends.
pub(crate) fn calibration(flights: &[Flight]) -> Table {
    let mut table = Table::new(
        "consistency_calibration",
        "Consistency of the calibration at the end: squared error over covariance per column, and the parameters whose \
         error lies within one, two and three of their standard deviations (expected 68, 95 and 100 %)",
        &[
            "flight",
            "run",
            "flights",
            "columns",
            "mean per column",
            "95 % bounds",
            "within σ",
            "2 σ",
            "3 σ",
            "median error / σ",
        ],
    );
    for (experiment, run, name) in Flight::experiments_and_runs(flights) {
        let samples: Vec<&CalibrationErrors> =
            Flight::of(flights, experiment).filter_map(|flight| flight.run(run).calibration.as_ref()).collect();
        let Some(first) = samples.first() else { continue };
        let columns: usize = samples.iter().map(|sample| sample.errors.len()).sum();
        let mean = samples.iter().map(|sample| sample.square).sum::<f64>() / columns as f64;
        let ratios: Vec<f64> = samples.iter().flat_map(|sample| sample.ratios()).collect();
        let within = |sigmas: f64| {
            let inside = ratios.iter().filter(|ratio| **ratio <= sigmas).count();
            format!("{:.0} %", 100.0 * inside as f64 / ratios.len() as f64)
        };
        let [low, high] = mean_bounds(1.0, columns);
        table.row([
            experiment.name().to_owned(),
            name.to_owned(),
            samples.len().to_string(),
            first.errors.len().to_string(),
            format!("{mean:.1}"),
            format!("{low:.2} to {high:.2}"),
            within(1.0),
            within(2.0),
            within(3.0),
            number(crate::table::median(ratios), 2),
        ]);
    }
    table
}

/// χ² per residual after the solve, by kind of measurement.
pub(crate) fn residuals(flights: &[Flight]) -> Table {
    let mut table = Table::new(
        "consistency_residuals",
        "Squared whitened residuals after the solve, mean per residual (below 1 by as much as was fitted): median [lowest, \
         highest] over the flights",
        &["flight", "run", "visual", "imu", "encoder", "marginalization prior"],
    );
    for (experiment, run, name) in Flight::experiments_and_runs(flights) {
        let column = |factor: &str| {
            let values = Flight::of(flights, experiment).filter_map(|flight| flight.run(run).chi2.get(factor).copied());
            crate::table::written(values.collect(), 2)
        };
        table.row([
            experiment.name().to_owned(),
            name.to_owned(),
            column("visual"),
            column("imu"),
            column("encoder"),
            column("marginalization prior"),
        ]);
    }
    table
}

/// Every parameter of every flight.
pub(crate) fn parameters(flights: &[Flight]) -> Table {
    let mut table = Table::new(
        "consistency_parameters",
        "Every parameter at every flight's end",
        &["flight", "seed", "run", "parameter", "error", "sigma", "ratio"],
    );
    for (experiment, run, name) in Flight::experiments_and_runs(flights) {
        for flight in Flight::of(flights, experiment) {
            let Some(sample) = &flight.run(run).calibration else { continue };
            for ((parameter, error), sigma) in sample.names.iter().zip(&sample.errors).zip(&sample.sigmas) {
                table.row([
                    experiment.name().to_owned(),
                    flight.seed.to_string(),
                    name.to_owned(),
                    parameter.clone(),
                    format!("{error:.6}"),
                    format!("{sigma:.6}"),
                    format!("{:.2}", error / sigma),
                ]);
            }
        }
    }
    table
}
