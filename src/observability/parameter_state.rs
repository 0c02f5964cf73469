//! Observability of single parameters in a window, from the null and uninformed directions of its step.

use std::collections::BTreeMap;

use super::RankReport;
use crate::gimbal::ParameterId;

/// A parameter counts as lost if at least this ratio of its squared unit vector lies in the span of the directions.
const MIN_LOST_RATIO: f64 = 0.25;

/// Observability of a parameter in a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ParameterState {
    /// The window constrains it more than a prior of 10° or 3 cm.
    Informed,
    Fixed,
    /// It lies in null and uninformed directions: the window constrains it less than a prior of 10° or 3 cm.
    Uninformed,
    /// Unobservable: it lies in a structural null direction.
    Unobservable,
}

/// Observability of each parameter, `None` during initialization.
pub fn parameter_states(rank: Option<&RankReport>) -> Option<BTreeMap<ParameterId, ParameterState>> {
    let rank = rank?;
    let lost_ratio = |column: usize, structural_only: bool| -> f64 {
        let directions = rank.directions.iter().filter(|direction| direction.structural || !structural_only);
        directions.filter_map(|direction| direction.weights.get(column)).map(|weight| weight * weight).sum()
    };
    let verdict = |column: usize| {
        if lost_ratio(column, true) >= MIN_LOST_RATIO {
            ParameterState::Unobservable
        } else if lost_ratio(column, false) >= MIN_LOST_RATIO {
            ParameterState::Uninformed
        } else {
            ParameterState::Informed
        }
    };
    let fixed = rank.fixed_parameters.iter().map(|parameter| (*parameter, ParameterState::Fixed));
    let columns = rank.parameters.iter().enumerate().map(|(column, parameter)| (*parameter, verdict(column)));
    Some(columns.chain(fixed).collect())
}
