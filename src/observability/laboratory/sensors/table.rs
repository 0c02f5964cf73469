//! Ranks of one experiment for several sets of sensor columns.

use super::window::SensorWindow;
use super::{LaboratoryForm, LaboratorySetup};
use crate::geometry::dense;
use crate::gimbal::ParameterId;
use crate::observability::CalibrationDirection;
use crate::observability::analysis::measured_block;
use crate::observability::directions::weak_directions;
use crate::observability::laboratory::SensorColumns;

/// Rank for one set of columns, including the columns of the chain.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SetRank {
    pub(crate) columns: SensorColumns,
    /// Columns of the chain, then of the sensors.
    pub(crate) parameters: Vec<ParameterId>,
    pub(crate) rank: usize,
    /// Singular values, largest first.
    pub(crate) singular_values: Vec<f64>,
    /// Singular values at or below this are structural zeros.
    pub(crate) structural_threshold: f64,
    /// Null directions, each scaled to a unit vector.
    pub(crate) null: Vec<CalibrationDirection>,
}

/// Ranks of an experiment for each set of columns; `None` when a value is not finite.
///
/// The unknowns of the trajectory are projected out once for all sets.
pub(crate) fn set_ranks(setup: &LaboratorySetup, form: LaboratoryForm, sets: &[SensorColumns]) -> Option<Vec<SetRank>> {
    let window = SensorWindow::new(setup, form, SensorColumns::ALL);
    let linearization = window.linearization(&window.truth)?;
    let whole = measured_block(&linearization)?;
    let parameters: Vec<ParameterId> = linearization.columns.iter().filter_map(|block| block.id.parameter()).collect();
    let chain = linearization.chain.dof();
    sets.iter()
        .map(|columns| {
            let kept: Vec<usize> =
                (0..parameters.len()).filter(|column| *column < chain || columns.has(parameters[*column])).collect();
            let selected = whole.select(&linearization, &kept);
            let svd = dense::thin_svd(&selected.block)?;
            let singular_values: Vec<f64> = svd.singular_values.iter().copied().collect();
            let rank = singular_values.iter().filter(|value| **value > selected.structural_threshold).count();
            Some(SetRank {
                columns: *columns,
                parameters: kept.iter().map(|column| parameters[*column]).collect(),
                rank,
                null: weak_directions(&selected.block, &svd.v, &singular_values, rank, 0.0),
                singular_values,
                structural_threshold: selected.structural_threshold,
            })
        })
        .collect()
}

impl SetRank {
    pub(crate) fn deficit(&self) -> usize {
        self.parameters.len() - self.rank
    }
}
