//! Directions of the calibration as text.

use super::CalibrationDirection;
use crate::gimbal::{ParameterId, ParameterNames};

/// The parameters with the largest weights in a direction, `L1.d - I.tx`, at most `max_count`.
pub fn parameters_of(
    names: &ParameterNames,
    parameters: &[ParameterId],
    direction: &CalibrationDirection,
    max_count: usize,
) -> String {
    parameters_of_weights(names, parameters, &direction.weights, max_count)
}

/// [`parameters_of`] for weights that belong to no [`CalibrationDirection`].
pub fn parameters_of_weights(
    names: &ParameterNames,
    parameters: &[ParameterId],
    weights: &[f64],
    max_count: usize,
) -> String {
    const SMALLEST_NAMED: f64 = 0.2;
    let mut entries: Vec<(usize, f64)> = weights.iter().copied().enumerate().collect();
    entries.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    entries.retain(|(_, weight)| weight.abs() >= SMALLEST_NAMED);
    let omitted = entries.len().saturating_sub(max_count);
    // The sign of a direction is arbitrary: the first weight is shown as positive.
    let flip = entries.first().map_or(1.0, |(_, weight)| weight.signum());
    let mut text = String::new();
    for (place, (column, weight)) in entries.iter().take(max_count).enumerate() {
        let sign = if weight * flip < 0.0 { " − " } else { " + " };
        if place > 0 {
            text.push_str(sign);
        }
        let name = parameters.get(*column).map_or_else(|| "?".to_owned(), |parameter| names.name(*parameter));
        text.push_str(&name);
    }
    if omitted > 0 {
        let others = if omitted == 1 { "other" } else { "others" };
        return format!("{text} and {omitted} {others}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::report::trades_with;
    use super::*;
    use crate::gimbal::{ParameterPart, Quantity};

    #[test]
    fn directions_are_named_by_their_largest_weights() {
        let names = ParameterNames::default();
        let parameters = Quantity::LINK.map(|quantity| ParameterId { part: ParameterPart::Link(0), quantity });
        let direction =
            |weights: &[f64]| CalibrationDirection { singular_value: 0.0, structural: true, weights: weights.to_vec() };
        assert_eq!(parameters_of(&names, &parameters, &direction(&[-0.7, 0.7, 0.0, 0.1]), 3), "L1.theta − L1.d");
        assert_eq!(
            parameters_of(&names, &parameters, &direction(&[0.5, 0.5, 0.5, 0.5]), 2),
            "L1.theta + L1.d and 2 others"
        );
        assert_eq!(parameters_of(&names, &parameters, &direction(&[0.0; 4]), 2), "");
    }
    #[test]
    fn sensor_columns_name_what_they_trade_with() {
        let chain = ParameterId { part: ParameterPart::Link(2), quantity: Quantity::D };
        let other = ParameterId { part: ParameterPart::Link(2), quantity: Quantity::A };
        let parameters = [chain, other, ParameterId::readout(0), ParameterId::timeshift(0)];
        let partner = |weights: [f64; 4]| {
            let direction = CalibrationDirection { singular_value: 0.1, structural: false, weights: weights.to_vec() };
            trades_with(&parameters, &direction)
        };
        assert_eq!(partner([0.1, 0.0, -0.8, 0.6]), Some(ParameterId::timeshift(0)));
        assert_eq!(partner([0.0, 0.0, 0.5, -0.9]), Some(ParameterId::readout(0)));
        assert_eq!(partner([0.1, 0.0, 1.0, 0.1]), None);
        // Names of runs without such columns stay as they are.
        assert_eq!(partner([0.8, 0.6, 0.0, 0.0]), None);
        assert_eq!(partner([0.8, 0.0, 0.0, 0.6]), None);
    }
}
