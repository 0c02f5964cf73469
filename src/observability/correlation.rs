//! Posterior correlations of calibration parameters.

use nalgebra::DMatrix;

use super::RankReport;
use crate::gimbal::{ParameterId, ParameterNames};

/// Smallest correlation that is named.
const MIN_NAMED: f64 = 0.5;
/// Maximum number of named partners.
const MAX_PARTNERS: usize = 3;

/// Posterior correlations after a step, from all measurements and priors up to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Correlations {
    parameters: Vec<ParameterId>,
    /// Correlation of each pair of columns (n × n).
    values: DMatrix<f64>,
}

impl Correlations {
    /// Correlations of the columns of a rank report; `None` where the information is singular.
    pub fn new(rank: &RankReport) -> Option<Self> {
        if rank.posterior.columns() != rank.parameters.len() {
            return None;
        }
        let covariance = rank.posterior.information().cholesky()?.inverse();
        let sigmas = covariance.diagonal().map(f64::sqrt);
        let values = DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |row, column| {
            covariance[(row, column)] / (sigmas[row] * sigmas[column])
        });
        Some(Self { parameters: rank.parameters.clone(), values })
    }

    /// Parameters with the largest correlations of at least one half, `pitch.a −0.93, I.ty +0.71`; empty without one.
    pub fn text(&self, parameter: ParameterId, names: &ParameterNames) -> String {
        let Some(column) = self.parameters.iter().position(|known| *known == parameter) else { return String::new() };
        let value = |other: usize| self.values[(column, other)];
        let mut others: Vec<usize> =
            (0..self.parameters.len()).filter(|it| *it != column && value(*it).abs() >= MIN_NAMED).collect();
        others.sort_by(|a, b| value(*b).abs().total_cmp(&value(*a).abs()));
        let named = others.into_iter().take(MAX_PARTNERS).map(|other| {
            let sign = if value(other) < 0.0 { '−' } else { '+' };
            format!("{} {sign}{:.2}", names.name(self.parameters[other]), value(other).abs())
        });
        named.collect::<Vec<_>>().join(", ")
    }
}
