//! Residuals of IMU factors with their degrees of freedom.
//!
//! Residuals after the fit are smaller than their noise, because the states fit the samples. With whitened rows `J` of
//! the factors, posterior covariance `P` of the window (all factors and priors) and true noise densities, their
//! covariance is `R = I − J P Jᵀ`. The degrees of freedom of some rows are the trace of their block (the redundancy
//! numbers of Förstner and Baarda). Prediction errors of the newest frame would also contain the error of its images.
//!
//! The square root of the information is lower triangular in the order rotation, position, velocity, biases: the first
//! three rows depend on the gyroscope's noise only, the next six on the accelerometer's given the former, and the last
//! six on the random walks.

use std::collections::BTreeSet;
use std::ops::Range;

use nalgebra::DMatrix;

use crate::estimator::{FactorRows, FrameId, JacobianFactor, StepReport};
use crate::optimization::{Cholesky, DIAGONAL_FLOOR};
use crate::text::Named;

/// Number of rows of an IMU factor.
const ROWS: usize = 15;
/// Number of frames at either end of a window that are excluded because they are less certain.
const EDGE_FRAMES: usize = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseDensity {
    /// White noise of the gyroscope.
    Gyroscope,
    /// White noise of the accelerometer.
    Accelerometer,
    /// Random walk of the gyroscope bias.
    GyroscopeWalk,
    /// Random walk of the accelerometer bias.
    AccelerometerWalk,
}

/// Keys in the rig's `imu0`.
impl Named for NoiseDensity {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Gyroscope, "gyroscope_noise_density"),
        (Self::Accelerometer, "accelerometer_noise_density"),
        (Self::GyroscopeWalk, "gyroscope_random_walk"),
        (Self::AccelerometerWalk, "accelerometer_random_walk"),
    ];
}

impl NoiseDensity {
    pub fn unit(self) -> &'static str {
        match self {
            Self::Gyroscope => "rad/s/√Hz",
            Self::Accelerometer => "m/s²/√Hz",
            Self::GyroscopeWalk => "rad/s²/√Hz",
            Self::AccelerometerWalk => "m/s³/√Hz",
        }
    }

    pub(super) fn is_random_walk(self) -> bool {
        matches!(self, Self::GyroscopeWalk | Self::AccelerometerWalk)
    }

    fn rows(self) -> Range<usize> {
        match self {
            Self::Gyroscope => 0..3,
            Self::Accelerometer => 3..9,
            Self::GyroscopeWalk => 9..12,
            Self::AccelerometerWalk => 12..15,
        }
    }
}

/// Sums over the residuals of one density.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct InnovationSums {
    pub(super) chi2: f64,
    /// Degrees of freedom of the residuals.
    pub(super) freedom: f64,
    /// `tr(R R)` over the rows: twice the Fisher information of the logarithm of the variance.
    pub(super) information: f64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Innovations {
    /// Sums in the order of [`NoiseDensity::NAMES`].
    pub(super) sums: [InnovationSums; 4],
    /// Weighted squared residuals of the observations, and their degrees of freedom.
    pub(super) visual: (f64, f64),
    /// First and last stamp of the intervals.
    pub(super) span_ns: Option<(i64, i64)>,
    pub(super) intervals: usize,
    pub(super) length_ns: i64,
    seen: BTreeSet<FrameId>,
}

impl Innovations {
    /// Adds the intervals of the step's window that have images on both sides; each interval counts once.
    pub(super) fn take(&mut self, report: &StepReport) -> Option<()> {
        let window = &report.window;
        let inner = EDGE_FRAMES..window.len().saturating_sub(EDGE_FRAMES);
        let unseen: Vec<usize> =
            inner.filter(|slot| !self.seen.contains(&FrameId(window[*slot].frame_index))).collect();
        if unseen.is_empty() {
            return None;
        }
        let linearization = report.linearization.as_ref()?;
        let columns = linearization.jacobian.ncols();
        let all = report.factor_rows.as_ref()?;
        let factors: Vec<&FactorRows> = all.iter().filter(|rows| is_imu(rows)).collect();
        let mut information = linearization.jacobian.tr_mul(&linearization.jacobian);
        information += linearization.prior_jacobian.tr_mul(&linearization.prior_jacobian);
        for column in 0..columns {
            information[(column, column)] += DIAGONAL_FLOOR;
        }
        let cholesky = Cholesky::new(&information)?;
        for slot in unseen {
            self.take_interval(&cholesky, columns, &factors, FrameId(window[slot].frame_index));
            let (from_ns, to_ns) = (window[slot - 1].stamp_ns, window[slot].stamp_ns);
            let (begin, end) = self.span_ns.unwrap_or((from_ns, to_ns));
            self.span_ns = Some((begin.min(from_ns), end.max(to_ns)));
            self.length_ns += to_ns - from_ns;
        }
        // Rows of the observations come first.
        let others = ROWS * factors.len()
            + all
                .iter()
                .filter(|rows| rows.factor == JacobianFactor::ZeroVelocity)
                .map(|it| it.rows.nrows())
                .sum::<usize>()
            + window.iter().filter_map(|frame| frame.encoder_angles_rad.as_ref()).map(Vec::len).sum::<usize>();
        let visual = linearization.jacobian.rows(0, linearization.jacobian.nrows().saturating_sub(others));
        self.take_observations(report, &cholesky, &visual.into_owned());
        Some(())
    }

    fn take_interval(&mut self, cholesky: &Cholesky, columns: usize, factors: &[&FactorRows], number: FrameId) {
        let Some(own) = factors.iter().position(|rows| ends_at(rows, number)) else { return };
        // Columns of fixed parameters come first and are missing in the linearization.
        let jacobian = |rows: &FactorRows| rows.rows.columns(rows.rows.ncols() - 1 - columns, columns).into_owned();
        let of_interval = jacobian(factors[own]);
        let mut gains = DMatrix::zeros(columns, ROWS);
        for row in 0..ROWS {
            gains.set_column(row, &cholesky.solve(&of_interval.row(row).transpose()));
        }
        let residual = factors[own].rows.column(factors[own].rows.ncols() - 1).into_owned();
        for (density, sums) in NoiseDensity::all().zip(&mut self.sums) {
            let rows = density.rows();
            for (index, other) in factors.iter().enumerate() {
                // Block of R between the density's rows of this interval and the rows of `other`.
                let mut block = -(jacobian(other).rows_range(rows.clone()) * gains.columns_range(rows.clone()));
                if index == own {
                    block += DMatrix::identity(rows.len(), rows.len());
                    sums.freedom += block.trace();
                }
                sums.information += block.norm_squared();
            }
            sums.chi2 += residual.rows_range(rows.clone()).norm_squared();
        }
        self.seen.insert(number);
        self.intervals += 1;
    }

    /// Adds the observations of the window. Each landmark reduces their degrees of freedom by three, the states by the
    /// leverage of their rows after elimination of the landmarks.
    fn take_observations(&mut self, report: &StepReport, cholesky: &Cholesky, rows: &DMatrix<f64>) {
        let leverage: f64 = rows
            .row_iter()
            .map(|row| {
                let column = row.transpose();
                column.dot(&cholesky.solve(&column))
            })
            .sum();
        let kept = || report.features.iter().filter(|feature| !feature.rejected);
        let observations = || kept().flat_map(|feature| feature.observations.iter());
        let chi2: f64 = observations().map(|observed| observed.robust_weight * observed.chi2).sum();
        let freedom = 2.0 * observations().count() as f64 - 3.0 * kept().count() as f64 - leverage;
        self.visual.0 += chi2;
        self.visual.1 += freedom;
    }
}

fn is_imu(rows: &FactorRows) -> bool {
    matches!(rows.factor, JacobianFactor::Imu { .. }) && rows.rows.nrows() == ROWS
}

fn ends_at(rows: &FactorRows, number: FrameId) -> bool {
    matches!(rows.factor, JacobianFactor::Imu { to, .. } if to == number)
}
