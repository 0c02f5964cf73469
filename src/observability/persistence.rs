//! Number of steps in which a direction has been unobservable.

use nalgebra::{DMatrix, DVector};

use super::RankReport;
use crate::gimbal::ParameterId;

/// A direction is also unobservable in another step if this fraction of it lies in that step's null and uninformed
/// directions.
const SAME_RATIO: f64 = 0.9;

/// Counts the earlier steps, latest first, in which a direction was null or uninformed without interruption.
///
/// The count ends at the first step that observes the direction or has other columns.
pub fn steps_lost<'a>(
    parameters: &[ParameterId],
    direction: &[f64],
    earlier: impl IntoIterator<Item = Option<&'a RankReport>>,
) -> usize {
    let direction = DVector::from_column_slice(direction);
    let loses = |rank: &RankReport| rank.parameters == parameters && rank.loses(&direction);
    earlier.into_iter().take_while(|rank| rank.is_some_and(loses)).count()
}

impl RankReport {
    /// True if a unit direction lies in the span of the null and uninformed directions.
    fn loses(&self, direction: &DVector<f64>) -> bool {
        if self.directions.is_empty() {
            return false;
        }
        let rows = direction.len();
        let basis = DMatrix::from_fn(rows, self.directions.len(), |row, column| {
            self.directions[column].weights.get(row).copied().unwrap_or(0.0)
        });
        basis.qr().q().tr_mul(direction).norm() >= SAME_RATIO * direction.norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::{ParameterPart, Quantity};
    use crate::observability::{CalibrationDirection, PackedFactor};

    fn parameters() -> [ParameterId; 3] {
        Quantity::ROTATION.map(|quantity| ParameterId { part: ParameterPart::ImuFromCamera(0), quantity })
    }

    fn report(directions: &[[f64; 3]]) -> RankReport {
        RankReport {
            parameters: parameters().into(),
            fixed_parameters: Vec::new(),
            singular_values: vec![3.0, 2.0, 0.1],
            singular_values_with_priors: vec![3.0, 2.0, 1.0],
            reference: 1.0,
            structural_threshold: 1e-12,
            informed_threshold: 1.0,
            rank_structural: 3,
            rank_informed: 3 - directions.len(),
            deficit_parameterization: 0,
            deficit_joints: 0,
            deficit_absorbed: 0,
            deficit_motion: 0,
            directions: directions
                .iter()
                .map(|weights| CalibrationDirection {
                    singular_value: 0.1,
                    structural: false,
                    weights: weights.to_vec(),
                })
                .collect(),
            margins: Vec::new(),
            known: Vec::new(),
            joint_count: 0,
            posterior: PackedFactor::default(),
            flight_sigmas: Vec::new(),
        }
    }

    #[test]
    fn a_direction_is_lost_until_a_step_observes_it() {
        let names = parameters();
        let (first, mixed) = ([1.0, 0.0, 0.0], [0.6, 0.8, 0.0]);
        let (lost, seen) = (report(&[[0.0, 1.0, 0.0], first]), report(&[[0.0, 0.0, 1.0]]));
        let count =
            |direction: &[f64], earlier: &[Option<&RankReport>]| steps_lost(&names, direction, earlier.iter().copied());
        assert_eq!(count(&first, &[Some(&lost), Some(&lost), Some(&seen), Some(&lost)]), 2);
        // A combination of unobservable directions is also unobservable, in any basis of the step.
        assert_eq!(count(&mixed, &[Some(&lost), Some(&report(&[mixed])), Some(&report(&[first]))]), 2);
        assert_eq!(count(&first, &[None, Some(&lost)]), 0);
        assert_eq!(steps_lost(&names[..2], &first, [Some(&lost)]), 0);
        assert_eq!(count(&first, &[Some(&report(&[]))]), 0);
    }
}
