//! Calibrations of one mechanism over many flights: whether they agree, since when not, and what they know together.

mod agreement;
mod measurement;
#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, DVector};

use crate::gimbal::ParameterId;

pub use agreement::{Change, FlightAgreement, FlightHistory, Interval, Verdict};

/// Calibration of one flight in the columns of a history.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedFlight {
    /// Values and covariance after the flight, in radians, metres, seconds and pixels.
    pub values: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// The same before any measurement of the flight: of the rig, or of another flight.
    pub values_before: DVector<f64>,
    pub covariance_before: DMatrix<f64>,
}

/// Calibrations of one mechanism in the order of the flights.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedFlights {
    pub columns: Vec<ParameterId>,
    /// There is at least one flight.
    pub flights: Vec<CalibratedFlight>,
}
