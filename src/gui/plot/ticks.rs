//! Round tick values of an axis.

/// Round values from `low` to `high`, at most `max_count`, and their spacing.
pub(crate) fn ticks(low: f64, high: f64, max_count: usize) -> (Vec<f64>, f64) {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) || max_count == 0 {
        return (Vec::new(), 1.0);
    }
    let rough = span / max_count as f64;
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|digit| digit * power).find(|step| *step >= rough * 0.999_999);
    let step = step.unwrap_or(10.0 * power);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    // A range that is narrow relative to the magnitude of its values has no useful ticks.
    if last.saturating_sub(first) > 2 * max_count as i64 {
        return (Vec::new(), step);
    }
    ((first..=last).map(|number| number as f64 * step).collect(), step)
}

/// Decimals needed to distinguish adjacent ticks.
pub(crate) fn decimals_of_step(step: f64) -> usize {
    if step > 0.0 { (-(step * 1.000_001).log10().floor()).clamp(0.0, 9.0) as usize } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(ticks(0.0, 10.0, 5), (vec![0.0, 2.0, 4.0, 6.0, 8.0, 10.0], 2.0));
        assert_eq!(ticks(-0.3, 0.35, 3).0, [0.0]);
        assert_eq!(ticks(1.0, 1.0, 4).0, [0.0; 0]);
        assert_eq!(ticks(f64::NAN, 1.0, 4).0, [0.0; 0]);
        assert_eq!(decimals_of_step(0.25), 1);
        assert_eq!(decimals_of_step(0.1), 1);
        assert_eq!(decimals_of_step(0.05), 2);
        assert_eq!(decimals_of_step(20.0), 0);
    }
}
