//! Value of the information that a motion gains about the calibration.

use nalgebra::{DMatrix, DVector};

use super::super::Situation;
use crate::gimbal::ParameterId;
use crate::observability::classification::excitable_directions;
use crate::observability::flight_sigmas::sigmas_without_prior;

/// Quantity that a plan minimizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanCriterion {
    /// Largest ratio of σ to the prior's σ among the parameters.
    Worst,
    /// Largest ratio of σ to the required accuracy among the parameters.
    Required,
    /// Determinant of the covariance of the parameters.
    Determinant,
}

/// Exponent of the mean that replaces the largest ratio during the search: its value also falls when a parameter other
/// than the worst one improves.
const EXPONENT: i32 = 8;
/// A parameter whose prior σ within the observable directions is less than this, in column units, is redundant.
const REDUNDANT: f64 = 1e-6;

/// Smallest part of a parameter's squared unit vector along directions that the parameterization has twice, from which
/// the parameter is redundant.
const REDUNDANT_PART: f64 = 0.25;

/// Criterion with the prior of the calibration.
#[derive(Clone, Debug)]
pub(super) struct Objective {
    criterion: PlanCriterion,
    /// Orthonormal directions that some motion makes observable (n × k).
    excitable: DMatrix<f64>,
    /// True for each column that the parameterization has twice.
    redundant: Vec<bool>,
    /// Information of the prior along the observable directions (k × k).
    prior: DMatrix<f64>,
    /// The same before the motion: of the prior, or of an earlier flight too.
    start: DMatrix<f64>,
    /// Prior σ of every column within these directions, in column units.
    prior_sigmas: Vec<f64>,
    /// σ of every column that counts as 1 in a ratio, in column units: of the prior, or required.
    scales: Vec<f64>,
    /// Columns of the criterion.
    columns: Vec<usize>,
    /// Logarithm of the determinant of the prior covariance of these columns.
    prior_log_determinant: f64,
}

impl Objective {
    /// Criterion over some parameters of a situation, or over all if none is given; `None` if no motion makes any of
    /// them observable or a number is not finite.
    pub(super) fn new(situation: &Situation, criterion: PlanCriterion, chosen: &[ParameterId]) -> Option<Self> {
        let excitable = excitable_directions(&situation.chain, situation.joints_free());
        let start = excitable.tr_mul(&(&situation.information * &excitable));
        let mut objective = Self {
            criterion,
            excitable,
            redundant: redundant_columns(situation),
            prior: start.clone(),
            start,
            prior_sigmas: Vec::new(),
            scales: Vec::new(),
            columns: Vec::new(),
            prior_log_determinant: 0.0,
        };
        let nothing = DMatrix::zeros(situation.information.nrows(), situation.information.ncols());
        let covariance = objective.covariance(&nothing)?;
        objective.prior_sigmas = sigmas_of(&covariance);
        let parameters = situation.chain.parameters();
        let required = || parameters.iter().map(|parameter| situation.required.of(*parameter) / parameter.scale());
        objective.scales = match criterion {
            PlanCriterion::Required => required().collect(),
            PlanCriterion::Worst | PlanCriterion::Determinant => objective.prior_sigmas.clone(),
        };
        let is_left_out = |column: usize| match criterion {
            PlanCriterion::Required => objective.is_redundant(column),
            PlanCriterion::Worst | PlanCriterion::Determinant => objective.prior_sigmas[column] <= REDUNDANT,
        };
        let matters =
            |column: &usize| !is_left_out(*column) && (chosen.is_empty() || chosen.contains(&parameters[*column]));
        objective.columns = (0..parameters.len()).filter(matters).collect();
        objective.prior_log_determinant = objective.log_determinant(&covariance).unwrap_or(0.0);
        (!objective.columns.is_empty()).then_some(objective)
    }

    /// The same criterion from the posterior of an earlier flight on (information n × n, in column units); ratios remain
    /// those to the prior's σ.
    pub(super) fn after_flight(&self, information: &DMatrix<f64>) -> Self {
        Self { start: self.excitable.tr_mul(&(information * &self.excitable)), ..self.clone() }
    }

    /// Information along the observable directions (k × k) after this much more (n × n, in column units).
    fn information(&self, gained: &DMatrix<f64>) -> DMatrix<f64> {
        &self.start + self.excitable.tr_mul(&(gained * &self.excitable))
    }

    /// Covariance of the columns (n × n, in column units) after this much information.
    fn covariance(&self, gained: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let inverse = self.information(gained).cholesky()?.inverse();
        Some(&self.excitable * inverse * self.excitable.transpose())
    }

    /// Logarithm of the determinant of the covariance of the columns of the criterion; redundant combinations of them
    /// are left out.
    fn log_determinant(&self, covariance: &DMatrix<f64>) -> Option<f64> {
        let mut values: Vec<f64> = covariance
            .select_rows(&self.columns)
            .select_columns(&self.columns)
            .symmetric_eigenvalues()
            .as_slice()
            .into();
        values.sort_by(|a, b| b.total_cmp(a));
        values.truncate(self.excitable.ncols());
        values.iter().all(|value| value.is_finite()).then(|| values.iter().map(|value| value.max(1e-300).ln()).sum())
    }

    /// Prior σ and σ after this much information of every column, in column units.
    pub(super) fn sigmas(&self, gained: &DMatrix<f64>) -> Option<(&[f64], Vec<f64>)> {
        Some((&self.prior_sigmas, sigmas_of(&self.covariance(gained)?)))
    }

    /// σ of every column after this much information, without the part of the prior, in column units.
    pub(super) fn sigmas_without_prior(&self, gained: &DMatrix<f64>) -> Option<Vec<f64>> {
        let [factor, prior] = [self.information(gained), self.prior.clone()]
            .map(|information| information.cholesky().map(|cholesky| cholesky.l().transpose()));
        Some(sigmas_without_prior(&factor?, &prior?, &self.excitable))
    }

    /// Ratios of σ to the prior's σ or to the required one, of the columns of the criterion, with their columns.
    pub(super) fn ratios(&self, gained: &DMatrix<f64>) -> Option<Vec<(usize, f64)>> {
        let covariance = self.covariance(gained)?;
        let ratio = |column: usize| covariance[(column, column)].max(0.0).sqrt() / self.scales[column];
        Some(self.columns.iter().map(|column| (*column, ratio(*column))).collect())
    }

    /// The criterion; without information 1, unless it compares with the required accuracy.
    pub(super) fn value(&self, gained: &DMatrix<f64>) -> Option<f64> {
        match self.criterion {
            PlanCriterion::Worst | PlanCriterion::Required => {
                self.ratios(gained).map(|ratios| ratios.iter().map(|it| it.1).fold(0.0, f64::max))
            }
            PlanCriterion::Determinant => self.mean_ratio_of_determinant(gained),
        }
    }

    /// Value that the search minimizes, smooth for the largest ratio.
    pub(super) fn search_value(&self, gained: &DMatrix<f64>) -> Option<f64> {
        match self.criterion {
            PlanCriterion::Worst | PlanCriterion::Required => {
                let ratios = self.ratios(gained)?;
                let sum: f64 = ratios.iter().map(|(_, ratio)| ratio.powi(EXPONENT)).sum();
                Some((sum / ratios.len() as f64).powf(1.0 / f64::from(EXPONENT)))
            }
            PlanCriterion::Determinant => self.mean_ratio_of_determinant(gained),
        }
    }

    /// Geometric mean of the ratios of σ along the axes of the covariance.
    fn mean_ratio_of_determinant(&self, gained: &DMatrix<f64>) -> Option<f64> {
        let after = self.log_determinant(&self.covariance(gained)?)?;
        let count = self.columns.len().min(self.excitable.ncols());
        Some((0.5 * (after - self.prior_log_determinant) / count as f64).exp())
    }

    pub(super) fn is_chosen(&self, column: usize) -> bool {
        self.columns.contains(&column)
    }

    /// True if the parameterization has other parameters for the same motion.
    pub(super) fn is_redundant(&self, column: usize) -> bool {
        self.redundant[column] || self.prior_sigmas[column] <= REDUNDANT
    }
}

/// Columns whose unit vectors lie to a good part along directions that no motion makes observable even with known joint
/// angles.
fn redundant_columns(situation: &Situation) -> Vec<bool> {
    let observable = excitable_directions(&situation.chain, false);
    observable.row_iter().map(|row| 1.0 - row.norm_squared() >= REDUNDANT_PART).collect()
}

fn sigmas_of(covariance: &DMatrix<f64>) -> Vec<f64> {
    let variances: DVector<f64> = covariance.diagonal();
    variances.iter().map(|variance| variance.max(0.0).sqrt()).collect()
}
