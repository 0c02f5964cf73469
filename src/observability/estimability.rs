//! Calibration parameters that a flight determines: posterior against prior standard deviations, with the reason where
//! the analysis of the last window or the posterior correlations name one.

use nalgebra::DMatrix;

use super::{CalibrationDirection, ParameterState, RankReport, exciting_motion, parameter_states};
use crate::estimator::CalibrationEstimate;
use crate::gimbal::{ParameterId, ParameterNames};

/// Ratio of posterior and prior σ below which a parameter is known: nine tenths of the information come from the flight.
const KNOWN_RATIO: f64 = 0.3;
/// Ratio from which the flight does not determine a parameter: it contributes less than a quarter of the prior's
/// information.
const UNKNOWN_RATIO: f64 = 0.9;
/// A direction explains a parameter if it contains at least this fraction of the parameter's squared unit vector.
const MIN_INVOLVED: f64 = 0.25;
/// Smallest weight of a named partner, relative to the parameter's own.
const MIN_PARTNER: f64 = 0.2;
/// Maximum number of named partners.
const MAX_PARTNERS: usize = 3;
/// Smallest correlation that is named.
const MIN_CORRELATION: f64 = 0.8;

/// Quality of a parameter's estimate from a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Estimability {
    /// The posterior σ is less than 0.3 of the prior σ.
    Known,
    /// The posterior σ is less than 0.9 of the prior σ.
    Weak,
    /// The prior determines the value.
    NotFromThisFlight,
    Fixed,
    /// Not estimated yet.
    Waiting,
}

/// Estimate of a calibration parameter with its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterEstimability {
    pub parameter: ParameterId,
    /// Estimate in the unit of its dimension; angles in (−π, π].
    pub value: f64,
    /// Posterior standard deviation, NaN before the first solve.
    pub sigma: f64,
    pub prior_sigma: f64,
    pub estimability: Estimability,
    /// Reason that the parameter is not known: the null or weak direction of the last window or the correlation that it
    /// belongs to, and for a sensor the motion that determines it; empty without a reason.
    pub reason: String,
}

impl Estimability {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Known => "known",
            Self::Weak => "weakly known",
            Self::NotFromThisFlight => "not from this flight",
            Self::Fixed => "fixed",
            Self::Waiting => "initializing",
        }
    }
}

impl ParameterEstimability {
    /// Posterior divided by prior standard deviation; NaN before the first solve.
    pub fn ratio(&self) -> f64 {
        self.sigma / self.prior_sigma
    }

    fn verdict(&self, state: Option<ParameterState>) -> Estimability {
        match state {
            Some(ParameterState::Fixed) => Estimability::Fixed,
            _ if self.sigma.is_nan() => Estimability::Waiting,
            _ if self.ratio() < KNOWN_RATIO => Estimability::Known,
            _ if self.ratio() < UNKNOWN_RATIO => Estimability::Weak,
            _ => Estimability::NotFromThisFlight,
        }
    }
}

/// Estimability of every parameter of an estimate, grouped, otherwise in column order; `rank` belongs to the same step
/// or to the last one before it.
pub fn estimability(
    estimate: &CalibrationEstimate,
    rank: Option<&RankReport>,
    names: &ParameterNames,
) -> Vec<ParameterEstimability> {
    let states = parameter_states(rank).unwrap_or_default();
    let correlations = rank.and_then(correlations);
    let mut rows: Vec<ParameterEstimability> = Vec::new();
    for (index, parameter) in estimate.parameters.iter().enumerate() {
        let entry = |values: &[f64]| values.get(index).copied().unwrap_or(f64::NAN);
        let mut row = ParameterEstimability {
            parameter: *parameter,
            value: parameter.principal_value(entry(&estimate.values)),
            sigma: entry(&estimate.sigmas),
            prior_sigma: entry(&estimate.prior_sigmas),
            estimability: Estimability::Waiting,
            reason: String::new(),
        };
        row.estimability = row.verdict(states.get(parameter).copied());
        if let (Some(rank), Estimability::Weak | Estimability::NotFromThisFlight) = (rank, row.estimability) {
            let reason = reason(rank, correlations.as_ref(), *parameter, names);
            let parts: Vec<String> = reason
                .into_iter()
                .chain(exciting_motion(*parameter).map(|motion| format!("suggested excitation: {motion}")))
                .collect();
            row.reason = parts.join("; ");
        }
        rows.push(row);
    }
    rows.sort_by_key(|row| row.parameter.group());
    rows
}

pub fn count_of(rows: &[ParameterEstimability], estimability: Estimability) -> usize {
    rows.iter().filter(|row| row.estimability == estimability).count()
}

/// Null direction of a parameter, else its weak direction, else its largest correlation.
fn reason(
    rank: &RankReport,
    correlations: Option<&DMatrix<f64>>,
    parameter: ParameterId,
    names: &ParameterNames,
) -> Option<String> {
    let column = rank.parameters.iter().position(|known| *known == parameter)?;
    for (structural_only, kind) in [(true, "null"), (false, "weak")] {
        let directions = rank.directions.iter().filter(|direction| direction.structural || !structural_only);
        if let Some(partners) = partners(directions, column) {
            let partners: Vec<String> =
                partners.iter().filter_map(|partner| rank.parameters.get(*partner)).map(|id| names.name(*id)).collect();
            let with = if partners.is_empty() { String::new() } else { format!(" with {}", partners.join(", ")) };
            return Some(format!("{kind} direction{with}"));
        }
    }
    let row = correlations?.row(column);
    let others = row.iter().enumerate().filter(|(other, _)| *other != column);
    let (other, correlation) = others.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let named = rank.parameters.get(other).filter(|_| correlation.abs() >= MIN_CORRELATION)?;
    Some(format!("correlation {correlation:+.2} with {}", names.name(*named)))
}

/// Columns that trade off against a column in the span of some directions, largest weight first; `None` if the column
/// is hardly in the span.
///
/// The weights are those of the column's unit vector projected on the span, which do not depend on the choice of basis.
fn partners<'a>(directions: impl Iterator<Item = &'a CalibrationDirection>, column: usize) -> Option<Vec<usize>> {
    let mut projected: Vec<f64> = Vec::new();
    for direction in directions {
        let own = direction.weights.get(column).copied().unwrap_or(0.0);
        projected.resize(direction.weights.len(), 0.0);
        projected.iter_mut().zip(&direction.weights).for_each(|(sum, weight)| *sum += own * weight);
    }
    let own = projected.get(column).copied().filter(|own| *own >= MIN_INVOLVED)?;
    let mut others: Vec<usize> =
        (0..projected.len()).filter(|other| *other != column && projected[*other].abs() >= MIN_PARTNER * own).collect();
    others.sort_by(|a, b| projected[*b].abs().total_cmp(&projected[*a].abs()));
    others.truncate(MAX_PARTNERS);
    Some(others)
}

/// Posterior correlations of the calibration columns (n × n); `None` where the information is singular.
fn correlations(rank: &RankReport) -> Option<DMatrix<f64>> {
    if rank.posterior.columns() != rank.parameters.len() {
        return None;
    }
    let covariance = rank.posterior.information().cholesky()?.inverse();
    let sigmas = covariance.diagonal().map(f64::sqrt);
    Some(DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |row, column| {
        covariance[(row, column)] / (sigmas[row] * sigmas[column])
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::{Chain, ClassicalChain, Parameterization};
    use crate::observability::PackedFactor;

    fn direction(structural: bool, weights: &[f64]) -> CalibrationDirection {
        CalibrationDirection {
            singular_value: if structural { 0.0 } else { 0.5 },
            structural,
            weights: weights.to_vec(),
        }
    }

    #[test]
    fn partners_do_not_depend_on_the_basis_of_a_null_space() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let [a, b] = [[half, -half, 0.0, 0.0, 0.0], [0.0, 0.0, half, half, 0.0]];
        let mixed = |sign: f64| -> Vec<f64> { a.iter().zip(&b).map(|(a, b)| half * (a + sign * b)).collect() };
        for directions in [[a.to_vec(), b.to_vec()], [mixed(1.0), mixed(-1.0)]] {
            let directions = directions.map(|weights| direction(true, &weights));
            let of = |column: usize| partners(directions.iter(), column);
            assert_eq!([of(0), of(1), of(2), of(4)], [Some(vec![1]), Some(vec![0]), Some(vec![3]), None]);
        }
        let alone = [direction(true, &[0.0, 1.0])];
        assert_eq!(partners(alone.iter(), 1), Some(Vec::new()));
    }

    #[test]
    fn every_parameter_has_a_verdict_and_unknown_ones_a_reason() {
        let parameters = Chain::from_classical(&ClassicalChain::default(), Parameterization::Minimal).parameters();
        let [rx, ry, rz, tx, ty, tz] = parameters[..] else { panic!("{parameters:?}") };
        // Of the six, tx is unobservable, rz weak with ty, and ry and tz are known only in combination.
        let mut information = DMatrix::identity(6, 6);
        information[(1, 5)] = 0.95;
        information[(5, 1)] = 0.95;
        let triangle = information.cholesky().unwrap().l().transpose();
        let rank = RankReport {
            parameters: parameters.clone(),
            fixed_parameters: Vec::new(),
            singular_values: Vec::new(),
            singular_values_with_priors: Vec::new(),
            reference: 1.0,
            structural_threshold: 1e-12,
            informed_threshold: 1.0,
            rank_structural: 5,
            rank_informed: 4,
            deficit_parameterization: 0,
            deficit_joints: 0,
            deficit_absorbed: 0,
            deficit_motion: 1,
            directions: vec![
                direction(true, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
                direction(false, &[0.0, 0.0, 0.8, 0.0, -0.6, 0.0]),
            ],
            margins: Vec::new(),
            known: Vec::new(),
            joint_count: 0,
            posterior: PackedFactor::new(&triangle),
        };
        let estimate = CalibrationEstimate {
            parameterization: Parameterization::Minimal,
            parameters,
            values: vec![0.1; 6],
            sigmas: vec![0.1, 0.5, 0.95, 1.0, 0.29, 0.5],
            prior_sigmas: vec![1.0; 6],
            classical: ClassicalChain::default(),
            margins: Vec::new(),
            rigid_cameras: Vec::new(),
        };
        let names = ParameterNames::default();
        let rows = estimability(&estimate, Some(&rank), &names);
        let found: Vec<_> = rows.iter().map(|row| (row.parameter, row.estimability, row.reason.as_str())).collect();
        let weak = format!("weak direction with {}", names.name(ty));
        let correlated = |with: ParameterId| format!("correlation -0.95 with {}", names.name(with));
        let (to_tz, to_ry) = (correlated(tz), correlated(ry));
        assert_eq!(
            found,
            [
                (rx, Estimability::Known, ""),
                (ry, Estimability::Weak, to_tz.as_str()),
                (rz, Estimability::NotFromThisFlight, weak.as_str()),
                (tx, Estimability::NotFromThisFlight, "null direction"),
                (ty, Estimability::Known, ""),
                (tz, Estimability::Weak, to_ry.as_str()),
            ]
        );
        assert_eq!(count_of(&rows, Estimability::Weak), 2);
        let waiting = CalibrationEstimate { sigmas: vec![f64::NAN; 6], ..estimate };
        assert!(estimability(&waiting, None, &names).iter().all(|row| row.estimability == Estimability::Waiting));
    }
}
