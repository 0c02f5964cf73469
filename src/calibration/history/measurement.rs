//! Measurements of one flight, without the prior that its run started from.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::{CalibratedFlight, CalibratedFlights};
use crate::optimization::prior_square_root_information;

/// Smallest information of a direction that counts as measured, in units of the prior's: σ falls by 5 %.
const MIN_INFORMATION: f64 = 0.1;
/// Variance of a direction after a flight over that before below which it was fixed and not measured.
const FIXED_VARIANCE_RATIO: f64 = 1e-12;

/// Independent measurements with unit noise: `jacobian · (θ − reference) = values`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FlightMeasurement {
    /// Derivatives of the values, directions × columns.
    pub(super) jacobian: DMatrix<f64>,
    pub(super) values: DVector<f64>,
}

/// Mean of the columns relative to a reference, with their covariance.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Belief {
    pub(super) mean: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
}

impl CalibratedFlights {
    /// `values − reference`, angles within half a turn.
    pub(super) fn difference(&self, values: &DVector<f64>, reference: &DVector<f64>) -> DVector<f64> {
        let differences = self.columns.iter().zip(values.iter().zip(reference.iter()));
        let differences = differences.map(|(column, (value, from))| column.dimension().difference(*value, *from));
        DVector::from_iterator(values.len(), differences)
    }

    /// Values before the first flight, to which means and measurements are relative.
    pub(super) fn reference(&self) -> &DVector<f64> {
        &self.flights[0].values_before
    }

    /// Belief before the first flight.
    pub(super) fn start(&self) -> Belief {
        let first = &self.flights[0];
        Belief { mean: DVector::zeros(self.columns.len()), covariance: first.covariance_before.clone() }
    }

    /// Measurements of a flight: `P⁻¹ − P₀⁻¹` of its covariances `P` after and `P₀` before it, by directions. With the
    /// variance `λ` of a direction in which `P₀` is one, its information is `1/λ − 1`.
    pub(super) fn measurement(&self, flight: &CalibratedFlight) -> FlightMeasurement {
        let whitening = prior_square_root_information(flight.covariance_before.clone());
        let SymmetricEigen { eigenvalues, eigenvectors } =
            (&whitening * &flight.covariance * whitening.transpose()).symmetric_eigen();
        let moved = &whitening * self.difference(&flight.values, &flight.values_before);
        let before = self.difference(&flight.values_before, self.reference());
        let variances = eigenvalues.iter().zip(eigenvectors.column_iter());
        let measured = variances.filter_map(|(variance, direction)| {
            let information = variance.recip() - 1.0;
            let counts = *variance > FIXED_VARIANCE_RATIO && information >= MIN_INFORMATION;
            counts.then(|| {
                let row = whitening.tr_mul(&direction) * information.sqrt();
                let value = direction.dot(&moved) / (variance * information.sqrt()) + row.dot(&before);
                (row, value)
            })
        });
        let (rows, values): (Vec<DVector<f64>>, Vec<f64>) = measured.unzip();
        FlightMeasurement {
            jacobian: DMatrix::from_fn(rows.len(), self.columns.len(), |row, column| rows[row][column]),
            values: DVector::from_vec(values),
        }
    }
}

impl Belief {
    /// Differences of measured values from their prediction, divided by their standard deviations, and the jacobian in
    /// the same units; `None` if their covariance is not positive definite.
    pub(super) fn innovation(&self, measurement: &FlightMeasurement) -> Option<FlightMeasurement> {
        let FlightMeasurement { jacobian, values } = measurement;
        let covariance =
            DMatrix::identity(values.len(), values.len()) + jacobian * &self.covariance * jacobian.transpose();
        let lower = covariance.cholesky()?.unpack();
        Some(FlightMeasurement {
            jacobian: lower.solve_lower_triangular(jacobian)?,
            values: lower.solve_lower_triangular(&(values - jacobian * &self.mean))?,
        })
    }

    /// This belief together with measurements; `None` if the information is not positive definite.
    pub(super) fn with(&self, measurement: &FlightMeasurement) -> Option<Self> {
        let innovation = self.innovation(measurement)?;
        let gain = &self.covariance * innovation.jacobian.transpose();
        let covariance = &self.covariance - &gain * gain.transpose();
        let covariance = (&covariance + covariance.transpose()) * 0.5;
        Some(Self { mean: &self.mean + gain * innovation.values, covariance })
    }
}
