//! Image rotations compared with rotations of gyroscope and chain, weighted by the noise of features, gyroscope and
//! encoders.

use nalgebra::{DMatrix, DVector, Dyn, Matrix3, Matrix3xX, Matrix6xX, UnitQuaternion, Vector3};

use crate::flight_log::stream::angle_fit::FittedAngle;
use crate::geometry::{best_rotation, mean_square_quantile, so3};
use crate::gimbal::{Chain, ClassicalChain, Parameterization};
use crate::log_check::clock_alignment::BIAS_SIGMA_RAD_PER_S;
use crate::log_check::statistics::{SIGNIFICANT_SIGMAS, median, percentile};
use crate::optimization::NormalEquations;
use crate::optimization::damped::{DampedOptions, LeastSquares, minimize};

/// Ratio up to which noise may exceed its stated level: the other checks accept twice the rig's encoder noise.
const NOISE_TOLERANCE: f64 = 2.0;
/// Quantile of the misfits that is compared with the same quantile of a standard normal number (70 %): up to three of
/// ten image rotations may be wrong, because points near a plane have two solutions.
const COMPARED_QUANTILE: f64 = 0.7;
const COMPARED_SIGMAS: f64 = 0.5244;
/// Degrees of freedom of the t distribution of a misfit: a wrong image rotation counts less than its square.
pub(crate) const TAIL_DEGREES: f64 = 3.0;
/// Steps between 1 and [`NOISE_TOLERANCE`] of the noise levels over which a likelihood is averaged.
const NOISE_STEPS: u32 = 10;
/// Prior standard deviation of an orientation that may be any.
pub(crate) const FREE_ORIENTATION_RAD: f64 = 1.0;
/// Standard deviation of a column that is fixed.
const SMALLEST_SIGMA: f64 = 1e-6;
/// Limits of the solver: a fit ends when a step lowers its cost by less than 1e-7 of it.
const OPTIONS: DampedOptions = DampedOptions {
    iterations: 30,
    relative_cost_tolerance: 1e-7,
    first_damping: 1e-6,
    min_damping: 1e-9,
    max_damping: 1e6,
    growth: 10.0,
};
/// Ratio of the median norm of three normal numbers to the root of the sum of their variances.
const MEDIAN_NORM_RATIO: f64 = 0.888;

/// Columns of the fit: orientation of the camera (3), bias of the gyroscope (3), time offset, scale, then the chain.
const BIAS: usize = 3;
const OFFSET: usize = 6;
const SCALE: usize = 7;
const CHAIN: usize = 8;

/// Rotation between two images with the measurements that predict it.
#[derive(Clone, Debug)]
pub(crate) struct RotationPair {
    /// Middle of the rotation by the camera's stamps, in seconds since the log began.
    pub(crate) middle_s: f64,
    /// Rotation vector `second_from_first` of the images in the camera frame, in radians.
    pub(crate) measured: Vector3<f64>,
    /// Sum of the covariances of `measured` and of the integrated gyroscope noise (3 × 3), in rad².
    pub(crate) covariance_rad2: Matrix3<f64>,
    /// `second_from_first` of the IMU.
    pub(crate) of_imu: UnitQuaternion<f64>,
    pub(crate) interval_s: f64,
    /// Change of the angular rate of the camera over the interval, camera frame, in rad/s.
    pub(crate) rate_change: Vector3<f64>,
    /// Joint angles at both images.
    pub(crate) angles: [Vec<FittedAngle>; 2],
}

/// Prior standard deviations of a fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FitPriors {
    /// Of the camera's orientation about each axis against the rig's, in radians.
    pub(crate) orientation_rad: f64,
    pub(crate) time_offset_s: f64,
    /// Of the ratio of image rotations to predicted ones, for a rigid camera.
    pub(crate) scale: f64,
    /// Of every parameter of a chain with joints.
    pub(crate) chain: f64,
}

/// Predicted rotation vector in the frame of the measured one, in radians, and the covariance of their difference in rad².
pub(crate) type Prediction = (Vector3<f64>, Matrix3<f64>);

/// Parameter of a correction: derivatives of the rotations of every pair, in rad per unit.
#[derive(Clone, Debug)]
pub(crate) struct ExtraColumn {
    /// Of the predicted rotations, before the fitted orientation is applied.
    pub(crate) of_predicted: Vec<Vector3<f64>>,
    /// Of the measured rotations.
    pub(crate) of_measured: Vec<Vector3<f64>>,
    /// Prior standard deviation of the parameter.
    pub(crate) sigma: f64,
}

/// Orientation of a camera by its image rotations, and the misfit that remains with its prediction.
#[derive(Clone, Debug)]
pub(crate) struct RotationFit {
    /// Rotation of the measured rotation vectors against the predicted ones.
    pub(crate) orientation: UnitQuaternion<f64>,
    /// Largest standard deviation of the orientation about any axis, from the misfit.
    pub(crate) orientation_sigma_rad: f64,
    /// Ratio of the image rotations to the predicted ones.
    pub(crate) scale: f64,
    /// Ratio of the second singular value of the rotations to the first; near zero for rotations about one axis only.
    pub(crate) spread: f64,
    /// Middle of each pair in seconds, and its misfit.
    pub(crate) misfits_rad: Vec<(f64, f64)>,
    /// Median misfit, and the median that the noise predicts.
    pub(crate) misfit_rad: f64,
    pub(crate) predicted_misfit_rad: f64,
    /// χ² over its degrees of freedom, from the quantile of the pairs' χ².
    pub(crate) mean_square: f64,
    pub(crate) degrees_of_freedom: usize,
    /// Values of the extra columns, and their standard deviations from the misfit.
    pub(crate) extra: Vec<f64>,
    pub(crate) extra_sigmas: Vec<f64>,
    /// −2 times the logarithm of the likelihood of the misfits by a t distribution, without constants.
    pub(crate) deviance: f64,
    /// Sum of the squares of orientation and chain parameters in units of their prior standard deviations.
    pub(crate) prior_square: f64,
}

impl RotationPair {
    fn angles_rad(&self) -> [Vec<f64>; 2] {
        self.angles.each_ref().map(|angles| angles.iter().map(|fitted| fitted.angle_rad).collect())
    }

    /// Rotation vector that gyroscope, joints and chain predict, in the camera frame.
    pub(crate) fn predicted(&self, chain: &ClassicalChain) -> Vector3<f64> {
        let [from, to] = self.angles_rad().map(|angles_rad| chain.imu_from_camera(&angles_rad).rotation);
        so3::log(&(to.inverse() * self.of_imu * from))
    }

    fn row(&self, chain: &Chain, is_rigid: bool) -> Row {
        let [from, to] = self.angles_rad().map(|angles_rad| chain.linearize(&angles_rad));
        let (first, second) = (from.imu_from_camera.rotation, to.imu_from_camera.rotation);
        let rotation = second.inverse() * self.of_imu * first;
        let turned = rotation.to_rotation_matrix().into_inner();
        let of_joints = |at: &Matrix6xX<f64>, angles: &[FittedAngle]| {
            let variances = DVector::from_iterator(angles.len(), angles.iter().map(|fitted| fitted.variance_rad2));
            let columns = at.fixed_rows::<3>(0);
            columns * DMatrix::from_diagonal(&variances) * columns.transpose()
        };
        let noise = turned * of_joints(&from.by_joints, &self.angles[0]) * turned.transpose()
            + of_joints(&to.by_joints, &self.angles[1]);
        let columns = if is_rigid { CHAIN } else { CHAIN + chain.dof() };
        let mut jacobian = Matrix3xX::zeros(columns);
        let predicted = so3::log(&rotation);
        jacobian.fixed_columns_mut::<3>(0).copy_from(&-so3::hat(&predicted));
        let by_bias = second.inverse().to_rotation_matrix().into_inner() * self.interval_s;
        jacobian.fixed_columns_mut::<3>(BIAS).copy_from(&by_bias);
        jacobian.set_column(OFFSET, &self.rate_change);
        jacobian.set_column(SCALE, &predicted);
        if !is_rigid {
            let by_chain = turned * from.by_parameters.fixed_rows::<3>(0) - to.by_parameters.fixed_rows::<3>(0);
            jacobian.columns_mut(CHAIN, chain.dof()).copy_from(&by_chain);
        }
        let by_measured = Matrix3xX::zeros(columns);
        let covariance = self.covariance_rad2 + noise;
        let log_noise_ratio = (covariance.determinant() / self.covariance_rad2.determinant()).ln();
        let (middle_s, measured) = (self.middle_s, self.measured);
        Row { middle_s, measured, predicted, jacobian, by_measured, covariance, log_noise_ratio }
    }
}

/// Linearized prediction of one rotation, with the columns of the fit before its orientation is applied.
struct Row {
    middle_s: f64,
    measured: Vector3<f64>,
    predicted: Vector3<f64>,
    jacobian: Matrix3xX<f64>,
    /// Derivative of the measured rotation by the columns: zero but for extra ones.
    by_measured: Matrix3xX<f64>,
    covariance: Matrix3<f64>,
    /// Logarithm of the determinant of the covariance over that without the noise of joint angles: with other units or
    /// gears, joint angles have other noise.
    log_noise_ratio: f64,
}

impl Row {
    /// The row with further columns, whose values belong to this pair.
    fn with_columns(mut self, pair: usize, extra: &[ExtraColumn]) -> Self {
        let first = self.jacobian.ncols();
        self.jacobian = self.jacobian.resize_horizontally(first + extra.len(), 0.0);
        self.by_measured = self.by_measured.resize_horizontally(first + extra.len(), 0.0);
        for (number, column) in extra.iter().enumerate() {
            self.jacobian.set_column(first + number, &column.of_predicted[pair]);
            self.by_measured.set_column(first + number, &column.of_measured[pair]);
        }
        self
    }
}

impl RotationFit {
    /// Fits the camera's orientation and, within their priors, the gyroscope's bias, the time offset, the scale of a rigid
    /// camera and the chain's parameters; `None` if the rotations do not constrain the orientation.
    pub(crate) fn of(pairs: &[RotationPair], chain: &ClassicalChain, priors: &FitPriors) -> Option<Self> {
        Self::with_columns(pairs, chain, priors, &[])
    }

    /// [`Self::of`] with further columns.
    pub(crate) fn with_columns(
        pairs: &[RotationPair],
        chain: &ClassicalChain,
        priors: &FitPriors,
        extra: &[ExtraColumn],
    ) -> Option<Self> {
        let (problem, estimate, spread) = Self::fitted(pairs, chain, priors, extra)?;
        problem.finish(&estimate, spread)
    }

    /// [`Self::of`] with the prediction of each pair by the fit in the frame of the measured rotations, and its covariance
    /// in rad².
    pub(crate) fn with_predictions(
        pairs: &[RotationPair],
        chain: &ClassicalChain,
        priors: &FitPriors,
    ) -> Option<(Self, Vec<Prediction>)> {
        let (problem, at, spread) = Self::fitted(pairs, chain, priors, &[])?;
        let prediction = |row: &Row| (row.measured - row.residual(&at), row.covariance_in_camera(&at));
        let predictions = problem.rows.iter().map(prediction).collect();
        Some((problem.finish(&at, spread)?, predictions))
    }

    /// Problem with its solution, and the ratio of the second singular value of the rotations to the first.
    fn fitted(
        pairs: &[RotationPair],
        chain: &ClassicalChain,
        priors: &FitPriors,
        extra: &[ExtraColumn],
    ) -> Option<(FitProblem, FitEstimate, f64)> {
        let is_rigid = chain.links.is_empty();
        let parameterized = Chain::from_classical(chain, Parameterization::Classical);
        let row =
            |(number, pair): (usize, &RotationPair)| pair.row(&parameterized, is_rigid).with_columns(number, extra);
        let rows: Vec<Row> = pairs.iter().enumerate().map(row).collect();
        let vectors: Vec<_> = rows.iter().map(|row| (row.predicted, row.measured)).collect();
        let (best, spread) = best_rotation(&vectors)?;
        let start = if priors.orientation_rad < FREE_ORIENTATION_RAD { UnitQuaternion::identity() } else { best };
        let mut problem = FitProblem::new(rows, priors, is_rigid, extra);
        let start = FitEstimate { orientation: start, values: DVector::zeros(problem.prior_information.len()) };
        let estimate = minimize(&mut problem, start, &OPTIONS).estimate;
        Some((problem, estimate, spread))
    }

    /// Largest χ² over its degrees of freedom that noise explains.
    pub(crate) fn largest_mean_square(&self) -> f64 {
        NOISE_TOLERANCE.powi(2) * mean_square_quantile(self.degrees_of_freedom as f64, SIGNIFICANT_SIGMAS)
    }

    pub(crate) fn is_explained(&self) -> bool {
        self.mean_square <= self.largest_mean_square()
    }
}

/// Unknowns of a fit.
#[derive(Clone)]
struct FitEstimate {
    orientation: UnitQuaternion<f64>,
    /// Values of all columns but the columns of the orientation, which are zero.
    values: DVector<f64>,
}

/// Rows of a fit with a robust loss: `ρ(s) = s` up to the largest square that noise explains, `c + c ln(s / c)` beyond it.
struct FitProblem {
    rows: Vec<Row>,
    prior_information: DVector<f64>,
    /// Number of extra columns, which are the last ones.
    extra: usize,
    /// Largest squared residual that noise explains.
    largest_square: f64,
}

impl FitProblem {
    fn new(rows: Vec<Row>, priors: &FitPriors, is_rigid: bool, extra: &[ExtraColumn]) -> Self {
        let columns = rows.first().map_or(CHAIN + extra.len(), |row| row.jacobian.ncols());
        // Noise of a prediction by encoders would shorten the estimated scale.
        let scale = if is_rigid { priors.scale } else { SMALLEST_SIGMA };
        let mut sigmas = DVector::repeat(columns, priors.chain);
        sigmas.rows_mut(0, BIAS).fill(priors.orientation_rad);
        sigmas.rows_mut(BIAS, OFFSET - BIAS).fill(BIAS_SIGMA_RAD_PER_S);
        sigmas[OFFSET] = priors.time_offset_s;
        sigmas[SCALE] = scale;
        for (number, column) in extra.iter().enumerate() {
            sigmas[columns - extra.len() + number] = column.sigma;
        }
        let prior_information = sigmas.map(|sigma: f64| sigma.max(SMALLEST_SIGMA).powi(-2));
        let largest_square = 3.0 * mean_square_quantile(3.0, SIGNIFICANT_SIGMAS);
        Self { rows, prior_information, extra: extra.len(), largest_square }
    }

    /// All unknowns as differences from their priors.
    fn differences(at: &FitEstimate) -> DVector<f64> {
        let mut differences = at.values.clone();
        differences.fixed_rows_mut::<3>(0).copy_from(&so3::log(&at.orientation));
        differences
    }

    fn prior_square(&self, at: &FitEstimate) -> f64 {
        let squares = self.prior_information.component_mul(&Self::differences(at).map(|value| value * value));
        let chain = CHAIN..squares.len() - self.extra;
        squares.rows(0, BIAS).sum() + squares.rows(chain.start, chain.len()).sum()
    }

    /// Result at the solution; `None` if the rotations do not constrain it.
    fn finish(&self, at: &FitEstimate, spread: f64) -> Option<RotationFit> {
        let rows = &self.rows;
        let covariance = self.linearize(at).hessian.cholesky()?.inverse();
        let squares: Vec<f64> = rows.iter().filter_map(|row| row.square(at)).collect();
        let mean_square = percentile(&squares, COMPARED_QUANTILE) / (3.0 * mean_square_quantile(3.0, COMPARED_SIGMAS));
        let degrees_of_freedom = (3 * rows.len()).saturating_sub(CHAIN).max(1);
        let norms: Vec<f64> = rows.iter().map(|row| row.residual(at).norm()).collect();
        let predicted: Vec<f64> = rows.iter().map(|row| MEDIAN_NORM_RATIO * row.covariance.trace().sqrt()).collect();
        let first_extra = at.values.len() - self.extra;
        let extra = at.values.rows(first_extra, self.extra).iter().copied().collect();
        let level = mean_square.max(1.0);
        let extra_sigmas = (first_extra..at.values.len()).map(|at| (covariance[(at, at)] * level).sqrt()).collect();
        let of_orientation = covariance.fixed_view::<3, 3>(0, 0).into_owned().symmetric_eigenvalues();
        Some(RotationFit {
            orientation: at.orientation,
            orientation_sigma_rad: (of_orientation.max() * level).sqrt(),
            scale: 1.0 + at.values[SCALE],
            spread,
            misfit_rad: median(&norms),
            misfits_rad: rows.iter().map(|row| row.middle_s).zip(norms).collect(),
            predicted_misfit_rad: median(&predicted),
            mean_square,
            degrees_of_freedom,
            extra,
            extra_sigmas,
            prior_square: self.prior_square(at),
            deviance: deviance(&squares) + rows.iter().map(|row| row.log_noise_ratio).sum::<f64>(),
        })
    }
}

impl Row {
    /// Rotation vector before the fitted orientation is applied.
    fn corrected(&self, at: &FitEstimate) -> Vector3<f64> {
        self.predicted + &self.jacobian * &at.values
    }

    fn residual(&self, at: &FitEstimate) -> Vector3<f64> {
        self.measured + &self.by_measured * &at.values - at.orientation * self.corrected(at)
    }

    /// Covariance of the residual, in the frame of the measured rotation.
    fn covariance_in_camera(&self, at: &FitEstimate) -> Matrix3<f64> {
        let rotation = at.orientation.to_rotation_matrix().into_inner();
        rotation * self.covariance * rotation.transpose()
    }

    /// Squared residual in units of its covariance: χ² with three degrees of freedom.
    fn square(&self, at: &FitEstimate) -> Option<f64> {
        let residual = self.residual(at);
        Some(residual.dot(&self.covariance_in_camera(at).cholesky()?.solve(&residual)))
    }
}

impl LeastSquares for FitProblem {
    type Estimate = FitEstimate;
    type Equations = NormalEquations<Dyn>;

    fn cost(&self, at: &FitEstimate) -> f64 {
        let largest = self.largest_square;
        let loss = |row: &Row| match row.square(at) {
            Some(square) if square <= largest => square,
            Some(square) => largest * (1.0 + (square / largest).ln()),
            None => f64::INFINITY,
        };
        let of_prior = self.prior_information.dot(&Self::differences(at).map(|value| value * value));
        self.rows.iter().map(loss).sum::<f64>() + of_prior
    }

    fn linearize(&self, at: &FitEstimate) -> NormalEquations<Dyn> {
        let hessian = DMatrix::from_diagonal(&self.prior_information);
        let gradient = self.prior_information.component_mul(&Self::differences(at));
        let mut equations = NormalEquations { hessian, gradient };
        let rotation = at.orientation.to_rotation_matrix().into_inner();
        for row in &self.rows {
            let (Some(square), Some(factor)) = (row.square(at), row.covariance_in_camera(at).cholesky()) else {
                continue;
            };
            let mut jacobian = row.jacobian.clone();
            jacobian.fixed_columns_mut::<3>(0).copy_from(&-so3::hat(&row.corrected(at)));
            // Derivative of the prediction less the measurement.
            let jacobian = rotation * jacobian - &row.by_measured;
            let lower = factor.l();
            let whitened = (lower.solve_lower_triangular(&-row.residual(at)), lower.solve_lower_triangular(&jacobian));
            if let (Some(residual), Some(jacobian)) = whitened {
                equations.add(&residual, &jacobian, (self.largest_square / square.max(f64::MIN_POSITIVE)).min(1.0));
            }
        }
        equations
    }

    fn plus(&self, at: &FitEstimate, step: &DVector<f64>) -> FitEstimate {
        let mut values = &at.values + step;
        values.fixed_rows_mut::<3>(0).fill(0.0);
        let orientation = so3::plus(&at.orientation, &step.fixed_rows::<3>(0).into_owned());
        FitEstimate { orientation, values }
    }
}

/// −2 times the logarithm of the density of a squared misfit with three degrees of freedom by a t distribution, without
/// constants.
pub(crate) fn tail_cost(square: f64) -> f64 {
    (TAIL_DEGREES + 3.0) * (square / TAIL_DEGREES).ln_1p()
}

/// −2 times the logarithm of the likelihood of squared misfits (three degrees of freedom each) by a t distribution, averaged
/// over noise levels up to [`NOISE_TOLERANCE`] times the stated one.
pub(crate) fn deviance(squares: &[f64]) -> f64 {
    let at = |step: u32| {
        let level = 1.0 + (NOISE_TOLERANCE - 1.0) * f64::from(step) / f64::from(NOISE_STEPS);
        let variance = level * level;
        let of_pair = |square: &f64| 3.0 * variance.ln() + tail_cost(square / variance);
        squares.iter().map(of_pair).sum::<f64>()
    };
    let deviances: Vec<f64> = (0..=NOISE_STEPS).map(at).collect();
    let least = deviances.iter().copied().fold(f64::INFINITY, f64::min);
    let likelihoods: f64 = deviances.iter().map(|deviance| (0.5 * (least - deviance)).exp()).sum();
    least - 2.0 * (likelihoods / deviances.len() as f64).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::DhLink;
    use crate::log_check::tests::Noise;

    /// Rotations of a camera behind one joint with noisy readings of variance 4e-6, as if it was `variance_rad2`.
    fn pairs(variance_rad2: f64) -> (Vec<RotationPair>, ClassicalChain) {
        let chain =
            ClassicalChain { links: vec![DhLink { alpha_rad: 0.4, ..DhLink::default() }], ..Default::default() };
        let mut noise = Noise(3);
        let fitted = |angle_rad: f64| FittedAngle {
            angle_rad,
            rate_rad_per_s: 0.0,
            variance_rad2,
            rate_variance: 0.0,
            acceleration_rad_per_s2: 0.0,
            acceleration_variance: 0.0,
        };
        let mut pair = |number: i32| {
            let of_imu = so3::exp(&(0.02 * noise.vector()));
            let angles_rad = [0, 1].map(|step| (0.1 * f64::from(number + step)).sin());
            let [from, to] = angles_rad.map(|angle_rad| chain.imu_from_camera(&[angle_rad]).rotation);
            let measured = so3::log(&(to.inverse() * of_imu * from)) + 1e-4 * noise.vector();
            RotationPair {
                middle_s: 0.05 * (f64::from(number) + 0.5),
                measured,
                covariance_rad2: Matrix3::identity() * 1e-8,
                of_imu,
                interval_s: 0.05,
                rate_change: Vector3::zeros(),
                angles: angles_rad.map(|angle_rad| vec![fitted(angle_rad + 2e-3 * noise.vector().x)]),
            }
        };
        ((0..100).map(&mut pair).collect(), chain)
    }

    fn fit(variance_rad2: f64) -> RotationFit {
        let (pairs, chain) = pairs(variance_rad2);
        RotationFit::of(
            &pairs,
            &chain,
            &FitPriors { orientation_rad: FREE_ORIENTATION_RAD, time_offset_s: 1e-3, scale: 0.3, chain: 1e-6 },
        )
        .unwrap()
    }

    #[test]
    fn a_misfit_is_explained_by_noise_of_the_encoders_only_if_they_have_it() {
        let stated = fit(4e-6);
        assert!((0.6..1.5).contains(&stated.mean_square), "{stated:?}");
        assert!((0.6..1.6).contains(&(stated.misfit_rad / stated.predicted_misfit_rad)), "{stated:?}");
        assert!(stated.orientation.angle() < 4.0 * stated.orientation_sigma_rad, "{stated:?}");
        let unstated = fit(1e-8);
        assert!(!unstated.is_explained(), "{unstated:?}");
    }
}
