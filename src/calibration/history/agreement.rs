//! Agreement of flights: each against the sum of the flights before it.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::CalibratedFlights;
use super::measurement::{Belief, FlightMeasurement};
use crate::geometry::normal_quantile_of_chi_square;

/// Largest misfit of a flight that agrees, as a quantile of the normal distribution: exceeded by one of 3,000 flights.
const MAX_MISFIT_SIGMA: f64 = 3.4;
/// Largest number of parameters by whose change a misfit is explained.
const MAX_CHANGES: usize = 6;
/// Other parameters whose change explains a misfit as well as the best one: χ² falls by less than this below its fall.
const EQUAL_EXPLANATION: f64 = 4.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing to compare it with.
    First,
    /// Agrees with the sum of the interval.
    Agrees,
    /// Agrees with no other flight: the interval goes on after it, and its sum is without it.
    Alone,
    /// Does not agree with the flights before it: the mechanism has changed, and another interval begins.
    Changed,
}

/// Change of a parameter that explains why a flight does not agree with those before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Index of its column.
    pub column: usize,
    /// Change of the value with its standard deviation.
    pub by: f64,
    pub sigma: f64,
    /// Columns whose change instead would explain the misfit as well.
    pub instead: Vec<usize>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct FlightAgreement {
    pub verdict: Verdict,
    /// Sum of the squared differences from the flights before, in standard deviations; 0 for the first flight.
    pub chi_square: f64,
    /// Number of directions that the flight measures.
    pub directions: usize,
    /// The same as a quantile of the normal distribution; `None` for the first flight and if nothing is measured.
    pub misfit_sigma: Option<f64>,
    /// Explanation of a misfit, the largest contribution first.
    pub changes: Vec<Change>,
}

/// Flights between two changes of the mechanism with the sum of those that agree.
#[derive(Clone, Debug, PartialEq)]
pub struct Interval {
    /// Indices of the flights in the sum.
    pub flights: Vec<usize>,
    /// Values and covariance of the sum.
    pub values: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct FlightHistory {
    /// Agreement of each flight, in their order.
    pub agreements: Vec<FlightAgreement>,
    /// From the oldest to the newest.
    pub intervals: Vec<Interval>,
}

/// An interval while flights are added to it.
struct OpenInterval {
    flights: Vec<usize>,
    belief: Belief,
}

impl CalibratedFlights {
    /// Compares each flight with the sum of the flights before it since the last change.
    ///
    /// A flight that does not agree begins another interval, unless the next one agrees with the flights before both and
    /// not with it. `None` if a covariance is not positive definite.
    pub fn history(&self) -> Option<FlightHistory> {
        let measurements: Vec<FlightMeasurement> = self.flights.iter().map(|flight| self.measurement(flight)).collect();
        let start = self.start();
        let begun =
            |flight: usize| Some(OpenInterval { flights: vec![flight], belief: start.with(&measurements[flight])? });
        let mut open = begun(0)?;
        let mut agreements = vec![FlightAgreement::first(&measurements[0])];
        let mut closed = Vec::new();
        for (flight, measurement) in measurements.iter().enumerate().skip(1) {
            let mut agreement = FlightAgreement::of(&open.belief, measurement)?;
            if agreement.agrees() {
                open.belief = open.belief.with(measurement)?;
                open.flights.push(flight);
            } else {
                let other = begun(flight)?;
                let next = measurements.get(flight + 1);
                let agrees = |belief: &Belief| Some(FlightAgreement::of(belief, next?)?.agrees());
                if agrees(&open.belief) == Some(true) && agrees(&other.belief) == Some(false) {
                    agreement.verdict = Verdict::Alone;
                } else {
                    agreement.verdict = Verdict::Changed;
                    closed.push(std::mem::replace(&mut open, other));
                }
            }
            agreements.push(agreement);
        }
        closed.push(open);
        let intervals = closed.into_iter().map(|interval| Interval {
            flights: interval.flights,
            values: self.reference() + interval.belief.mean,
            covariance: interval.belief.covariance,
        });
        Some(FlightHistory { agreements, intervals: intervals.collect() })
    }
}

impl FlightAgreement {
    fn first(measurement: &FlightMeasurement) -> Self {
        Self {
            verdict: Verdict::First,
            chi_square: 0.0,
            directions: measurement.values.len(),
            misfit_sigma: None,
            changes: Vec::new(),
        }
    }

    /// Agreement of a flight with what was known before it; the verdict is [`Verdict::Agrees`] until it is replaced.
    fn of(before: &Belief, measurement: &FlightMeasurement) -> Option<Self> {
        let innovation = before.innovation(measurement)?;
        let (chi_square, directions) = (innovation.values.norm_squared(), innovation.values.len());
        let misfit_sigma = (directions > 0).then(|| normal_quantile_of_chi_square(chi_square, directions as f64));
        let mut agreement =
            Self { verdict: Verdict::Agrees, chi_square, directions, misfit_sigma, changes: Vec::new() };
        if !agreement.agrees() {
            agreement.changes = explanation(&innovation);
        }
        Some(agreement)
    }

    fn agrees(&self) -> bool {
        self.misfit_sigma.is_none_or(|sigma| sigma <= MAX_MISFIT_SIGMA)
    }
}

/// Changes of as few parameters as explain an innovation: the one that lowers χ² most is added, until the rest of χ² is
/// within the limit of an agreement.
fn explanation(innovation: &FlightMeasurement) -> Vec<Change> {
    let mut chosen: Vec<usize> = Vec::new();
    let mut changes = Vec::new();
    let rows = innovation.values.len();
    while chosen.len() < MAX_CHANGES.min(rows.saturating_sub(1)) {
        let with = |column: usize| {
            let columns: Vec<usize> = chosen.iter().copied().chain([column]).collect();
            Some((column, fit(innovation, &columns)?))
        };
        let candidates: Vec<(usize, Fit)> =
            (0..innovation.jacobian.ncols()).filter(|column| !chosen.contains(column)).filter_map(with).collect();
        let Some((column, best)) = candidates.iter().min_by(|a, b| a.1.chi_square.total_cmp(&b.1.chi_square)) else {
            break;
        };
        let equal = candidates.iter().filter(|(_, fit)| fit.chi_square < best.chi_square + EQUAL_EXPLANATION);
        let instead = equal.map(|(other, _)| *other).filter(|other| other != column).collect();
        chosen.push(*column);
        changes.push(Change { column: *column, by: 0.0, sigma: 0.0, instead });
        // The changes so far are estimated again together with the new one.
        for (change, (by, sigma)) in changes.iter_mut().zip(&best.changes) {
            (change.by, change.sigma) = (*by, *sigma);
        }
        let left = (rows - chosen.len()) as f64;
        if normal_quantile_of_chi_square(best.chi_square, left) <= MAX_MISFIT_SIGMA {
            break;
        }
    }
    changes
}

struct Fit {
    /// Change and standard deviation of each column.
    changes: Vec<(f64, f64)>,
    /// Sum of the squares that these changes do not explain.
    chi_square: f64,
}

/// Least squares for the changes of some columns; `None` if the measurements do not determine them.
fn fit(innovation: &FlightMeasurement, columns: &[usize]) -> Option<Fit> {
    let jacobian = innovation.jacobian.select_columns(columns);
    let covariance = jacobian.tr_mul(&jacobian).cholesky()?.inverse();
    let changes = &covariance * jacobian.tr_mul(&innovation.values);
    let chi_square = (&innovation.values - &jacobian * &changes).norm_squared();
    let sigmas = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
    Some(Fit { changes: changes.iter().copied().zip(sigmas.iter().copied()).collect(), chi_square })
}
