//! Whether the covariances tell the truth: normalized squared errors of poses and calibration within their χ² bounds.
//!
//! Poses are judged relative to each other, newest against oldest frame of a window: that difference does not depend on
//! the four directions (position, yaw) which no measurement sees, and needs no alignment.

use std::collections::BTreeMap;

use dcvins::estimator::{ColumnGroup, Linearization, StepReport};
use dcvins::geometry::{RigidTransform, so3};
use dcvins::gimbal::{Chain, ClassicalChain};
use nalgebra::{DMatrix, Matrix3, Matrix6, SMatrix};
use serde::{Deserialize, Serialize};

use crate::flights::Flight;
use crate::table::{Table, chi2_quantile, number};

/// Information that all poses are given about the absolute position and orientation, so that the matrix can be inverted:
/// a hundred metres, a hundred radians. It does not act on differences.
const WEAK_INFORMATION: f64 = 1e-4;
/// The normal quantile of the two-sided 95 % bounds.
const TWO_SIDED_95: f64 = 1.959_964;
/// The normal quantile of the one-sided 95 % bound.
const ONE_SIDED_95: f64 = 1.644_854;

/// The pose of a window's newest frame in its oldest one.
pub(crate) struct PoseSample {
    stamps_ns: [i64; 2],
    oldest_from_newest: RigidTransform,
    covariance: Matrix6<f64>,
}

/// Squared error of a pose over its covariance, of all six components, of the rotation and of the translation.
pub(crate) type PoseSquares = [f64; 3];

/// The calibration at one step with its covariance.
pub(crate) struct CalibrationSample {
    chain: ClassicalChain,
    parameterization: String,
    names: Vec<String>,
    /// Columns of the chain of the camera in question, without those of a rigid camera beside it.
    chain_columns: usize,
    covariance: DMatrix<f64>,
}

/// A calibration held against the truth.
#[derive(Serialize, Deserialize)]
pub(crate) struct CalibrationErrors {
    names: Vec<String>,
    /// Estimate minus truth.
    errors: Vec<f64>,
    sigmas: Vec<f64>,
    /// Squared error over the covariance.
    square: f64,
}

/// Inverse of all columns' covariance, of the measurements and the priors.
fn information(linearization: &Linearization) -> DMatrix<f64> {
    let (measured, prior) = (&linearization.jacobian, &linearization.prior_jacobian);
    let mut information = measured.tr_mul(measured);
    if prior.nrows() > 0 {
        information += prior.tr_mul(prior);
    }
    for block in linearization.columns.iter().filter(|block| block.group == ColumnGroup::Pose) {
        for column in block.start..block.start + block.len {
            information[(column, column)] += WEAK_INFORMATION;
        }
    }
    information
}

/// The relative pose of a step's window; `None` before the window is there.
pub(crate) fn pose_sample(report: &StepReport) -> Option<PoseSample> {
    let linearization = report.linearization.as_ref()?;
    let poses = || linearization.columns.iter().filter(|block| block.group == ColumnGroup::Pose);
    let (first, last) = (poses().next()?.start, poses().next_back()?.start);
    let [oldest, .., newest] = report.window.as_slice() else { return None };
    let relative = oldest.world_from_imu.inverse() * newest.world_from_imu;
    // From the perturbation rule: rotation on the right, translation added.
    let mut change: SMatrix<f64, 6, 12> = SMatrix::zeros();
    let oldest_from_world = oldest.world_from_imu.rotation_matrix().transpose();
    change.fixed_view_mut::<3, 3>(0, 0).copy_from(&-relative.rotation_matrix().transpose());
    change.fixed_view_mut::<3, 3>(0, 6).copy_from(&Matrix3::identity());
    change.fixed_view_mut::<3, 3>(3, 0).copy_from(&so3::hat(&relative.translation_m));
    change.fixed_view_mut::<3, 3>(3, 3).copy_from(&-oldest_from_world);
    change.fixed_view_mut::<3, 3>(3, 9).copy_from(&oldest_from_world);

    let information = information(linearization);
    let mut right = DMatrix::zeros(information.nrows(), 6);
    for (place, start) in [(0, first), (6, last)] {
        right.rows_mut(start, 6).copy_from(&change.fixed_columns::<6>(place).transpose());
    }
    let solved = information.cholesky()?.solve(&right);
    let covariance = Matrix6::from_iterator((right.transpose() * solved).iter().copied());
    let stamps_ns = [oldest.stamp_ns, newest.stamp_ns];
    Some(PoseSample { stamps_ns, oldest_from_newest: relative, covariance })
}

impl PoseSample {
    /// The sample held against the true poses; `None` when they are not known.
    pub(crate) fn judged(&self, truths: &BTreeMap<i64, RigidTransform>) -> Option<PoseSquares> {
        let [Some(oldest), Some(newest)] = self.stamps_ns.map(|stamp_ns| truths.get(&stamp_ns)) else { return None };
        let error = self.oldest_from_newest.minus(&(oldest.inverse() * *newest));
        let whole = error.dot(&self.covariance.cholesky()?.solve(&error));
        let part = |start: usize| {
            let error = error.fixed_rows::<3>(start).into_owned();
            Some(error.dot(&self.covariance.fixed_view::<3, 3>(start, start).into_owned().cholesky()?.solve(&error)))
        };
        Some([whole, part(0)?, part(3)?])
    }
}

/// The calibration of a step with its covariance; `None` when nothing is calibrated.
pub(crate) fn calibration_sample(report: &StepReport) -> Option<CalibrationSample> {
    let linearization = report.linearization.as_ref()?;
    let columns = linearization.columns.iter().filter(|block| block.group == ColumnGroup::Calibration).count();
    if columns == 0 {
        return None;
    }
    let information = information(linearization);
    let right = DMatrix::identity(information.nrows(), columns);
    let covariance = information.cholesky()?.solve(&right).rows(0, columns).into_owned();
    Some(CalibrationSample {
        chain: report.calibration.classical.clone(),
        parameterization: report.calibration.parameterization.clone(),
        names: report.calibration.names.clone(),
        chain_columns: report.calibration.names.len() - 6 * report.calibration.rigid_cameras.len(),
        covariance,
    })
}

impl CalibrationSample {
    /// The sample held against the true chain; `None` when the two have other columns.
    pub(crate) fn judged(&self, truth: &ClassicalChain) -> Option<CalibrationErrors> {
        let parameterization = self.parameterization.parse().ok()?;
        let chain = |classical: &ClassicalChain| {
            let chain = Chain::from_classical(classical, parameterization);
            if chain.dof() == self.chain_columns { chain } else { chain.without_joint_offsets() }
        };
        let error = chain(&self.chain).minus(&chain(truth));
        let columns = error.len();
        if columns > self.covariance.nrows() {
            return None;
        }
        // A rigid camera's columns stand behind the chain's.
        let covariance = self.covariance.view((0, 0), (columns, columns)).into_owned();
        Some(CalibrationErrors {
            names: self.names[..columns].to_vec(),
            errors: error.iter().copied().collect(),
            sigmas: covariance.diagonal().map(f64::sqrt).iter().copied().collect(),
            square: error.dot(&covariance.cholesky()?.solve(&error)),
        })
    }
}

impl CalibrationErrors {
    /// |error| over σ of every parameter.
    fn ratios(&self) -> impl Iterator<Item = f64> {
        self.errors.iter().zip(&self.sigmas).map(|(error, sigma)| error.abs() / sigma)
    }
}

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
