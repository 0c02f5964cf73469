//! Parameters that a parameterization has twice, in the columns of a step.

use nalgebra::DMatrix;

use super::{KnownLoss, RankReport, chain_of_step, known_losses};
use crate::estimator::StepReport;
use crate::gimbal::ParameterId;

/// A direction contains a parameter if at least this fraction of the parameter's squared unit vector lies in the span.
const MIN_CONTAINED: f64 = 0.25;
/// Smallest weight of a named partner, relative to the parameter's own.
const MIN_PARTNER: f64 = 0.2;
/// Maximum number of named partners.
const MAX_PARTNERS: usize = 3;

/// Null directions that follow from a step's parameterization, not from its motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Redundancy {
    parameters: Vec<ParameterId>,
    /// Projector onto the span of the directions (n × n), columns in units of their scale; empty without directions.
    projector: DMatrix<f64>,
}

impl Redundancy {
    /// Redundancy of a step: its null directions in closed form, or the measured ones if the parameterization is the
    /// cause of all of them, as at a singularity.
    pub fn of_step(report: &StepReport, rank: &RankReport) -> Self {
        if rank.deficit_parameterization == 0 {
            return Self::default();
        }
        let mut directions = closed_form(report, rank);
        if directions.is_empty() && rank.deficit() == only_parameterization(rank) {
            let structural = rank.directions.iter().filter(|direction| direction.structural);
            directions = structural.map(|direction| direction.weights.clone()).collect();
        }
        if directions.is_empty() {
            return Self::default();
        }
        let rows = rank.parameters.len();
        let span =
            DMatrix::from_fn(rows, directions.len(), |row, column| directions[column].get(row).copied().unwrap_or(0.0));
        let basis = span.qr().q();
        Self { parameters: rank.parameters.clone(), projector: &basis * basis.transpose() }
    }

    /// True if a parameter is redundant.
    pub fn contains(&self, parameter: ParameterId) -> bool {
        self.column(parameter).is_some()
    }

    /// Parameters with the same motion as a redundant parameter, largest weight first; empty for any other parameter.
    ///
    /// The weights are the entries of the parameter's unit vector projected on the span, which do not depend on the
    /// choice of basis.
    pub fn partners(&self, parameter: ParameterId) -> Vec<ParameterId> {
        let Some(column) = self.column(parameter) else { return Vec::new() };
        let (own, weight) = (self.projector[(column, column)], |other: usize| self.projector[(column, other)].abs());
        let mut others: Vec<usize> =
            (0..self.parameters.len()).filter(|it| *it != column && weight(*it) >= MIN_PARTNER * own).collect();
        others.sort_by(|a, b| weight(*b).total_cmp(&weight(*a)));
        others.into_iter().take(MAX_PARTNERS).map(|other| self.parameters[other]).collect()
    }

    fn column(&self, parameter: ParameterId) -> Option<usize> {
        let column = self.parameters.iter().position(|known| *known == parameter)?;
        (self.projector[(column, column)] >= MIN_CONTAINED).then_some(column)
    }
}

fn only_parameterization(rank: &RankReport) -> super::Deficit {
    let parameterization = rank.deficit_parameterization;
    super::Deficit { parameterization, joints: 0, absorbed: 0, motion: 0 }
}

/// Unit directions in closed form as weights by column of the rank report; directions of free joint angles are not
/// redundant.
fn closed_form(report: &StepReport, rank: &RankReport) -> Vec<Vec<f64>> {
    let Some(chain) = chain_of_step(report, rank) else { return Vec::new() };
    let parameters = chain.parameters();
    let measured = |loss: &KnownLoss| rank.known.iter().any(|known| known.loss == *loss);
    known_losses(&chain, true)
        .into_iter()
        .filter(|(loss, _)| !matches!(loss, KnownLoss::FreeAngle(_)) && measured(loss))
        .map(|(_, direction)| {
            let weight = |parameter: &ParameterId| {
                let column = parameters.iter().position(|known| known == parameter);
                column.map_or(0.0, |column| direction[column] / parameter.scale())
            };
            let weights: Vec<f64> = rank.parameters.iter().map(weight).collect();
            let norm = weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
            weights.into_iter().map(|weight| weight / norm).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::tests::parameter;

    #[test]
    fn partners_do_not_depend_on_the_basis() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let parameters = ["EC.rx", "EC.ry", "EC.rz", "EC.tx", "EC.ty"].map(parameter);
        let [a, b] = [[half, -half, 0.0, 0.0, 0.0], [0.0, 0.0, half, half, 0.0]];
        let mixed = |sign: f64| -> Vec<f64> { a.iter().zip(&b).map(|(a, b)| half * (a + sign * b)).collect() };
        for directions in [[a.to_vec(), b.to_vec()], [mixed(1.0), mixed(-1.0)]] {
            let basis = DMatrix::from_fn(5, 2, |row, column| directions[column][row]);
            let redundancy = Redundancy { parameters: parameters.to_vec(), projector: &basis * basis.transpose() };
            assert_eq!(redundancy.partners(parameters[0]), [parameters[1]]);
            assert_eq!(redundancy.partners(parameters[2]), [parameters[3]]);
            assert!(redundancy.contains(parameters[3]) && !redundancy.contains(parameters[4]));
            assert!(redundancy.partners(parameters[4]).is_empty());
        }
        assert!(!Redundancy::default().contains(parameters[0]));
    }
}
