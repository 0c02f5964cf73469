//! Axes of values: their ticks, linear and logarithmic scales.

pub(crate) use crate::geometry::ticks;

/// Decimals needed to distinguish adjacent ticks.
pub(crate) fn decimals_of_step(step: f64) -> usize {
    if step > 0.0 { (-(step * 1.000_001).log10().floor()).clamp(0.0, 9.0) as usize } else { 0 }
}

/// An axis over values: linear, or logarithmic over positive values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ValueAxis {
    pub(crate) logarithmic: bool,
    /// Value at the lower end.
    pub(crate) low: f64,
    /// Value at the upper end, larger than `low`.
    pub(crate) high: f64,
}

/// Ratio of the largest to the median value above which an axis is logarithmic.
const LOGARITHMIC_FROM: f64 = 20.0;
/// Margin beyond the extreme values, as a ratio of the range.
const MARGIN: f64 = 0.03;

impl ValueAxis {
    /// A linear axis from `low` to `high` with a margin on both sides; an empty range is extended.
    pub(crate) fn linear(low: f64, high: f64) -> Self {
        let margin = MARGIN * (high - low);
        let margin = match low.abs().max(high.abs()) {
            0.0 => 1.0,
            size if margin > 1e-12 * size => margin,
            size => 0.5 * size,
        };
        Self { logarithmic: false, low: low - margin, high: high + margin }
    }

    /// A logarithmic axis over positive values.
    pub(crate) fn logarithmic(low: f64, high: f64) -> Self {
        let ratio = (high / low).max(2.0).powf(MARGIN);
        Self { logarithmic: true, low: low / ratio, high: (high * ratio).max(low * 1.5) }
    }

    /// The axis over finite values: logarithmic if all are positive and the largest is far beyond their median.
    pub(crate) fn over(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let (Some(low), Some(high)) = (values.first().copied(), values.last().copied()) else {
            return Self::linear(0.0, 1.0);
        };
        if low > 0.0 && high > LOGARITHMIC_FROM * values[values.len() / 2] {
            return Self::logarithmic(low, high);
        }
        // Zero is included if it is near, so that lengths can be compared.
        let low = if low > 0.0 && low < 0.5 * high { 0.0 } else { low };
        let axis = Self::linear(low, high);
        if low == 0.0 { Self { low: 0.0, ..axis } } else { axis }
    }

    /// An axis with zero in its middle part, for differences.
    pub(crate) fn around_zero(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = values.fold((0.0_f64, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
        Self::linear(low, high)
    }

    /// Position of a value, 0 at `low` and 1 at `high`, limited to a few lengths of the axis to avoid overflow.
    pub(crate) fn fraction(&self, value: f64) -> f64 {
        let map = |value: f64| if self.logarithmic { value.max(f64::MIN_POSITIVE).ln() } else { value };
        ((map(value) - map(self.low)) / (map(self.high) - map(self.low))).clamp(-4.0, 5.0)
    }

    /// Position of a value; values outside the axis are clamped to the nearer end.
    pub(crate) fn position(&self, value: f64) -> f64 {
        self.fraction(value).clamp(-0.02, 1.02)
    }

    /// Decimal powers and digits 1, 2 and 5 of the values on a logarithmic axis.
    pub(crate) fn decades(self) -> impl Iterator<Item = (i32, f64)> {
        let powers = (self.low.log10().floor() as i32)..=(self.high.log10().ceil() as i32);
        let values = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|digit| (power, digit)));
        values.filter(move |(power, digit)| (self.low..=self.high).contains(&(digit * 10_f64.powi(*power))))
    }

    /// Round values inside the axis, at most about `count`.
    pub(crate) fn marks(&self, count: usize) -> Vec<f64> {
        if !self.logarithmic {
            return ticks(self.low, self.high, count).0;
        }
        let all = (self.high / self.low).log10() * 3.0 <= count as f64;
        let inside = self.decades().filter(|(_, digit)| all || *digit == 1.0);
        let inside: Vec<f64> = inside.map(|(power, digit)| digit * 10_f64.powi(power)).collect();
        let every = inside.len().div_ceil(count.max(1)).max(1);
        inside.into_iter().step_by(every).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_have_the_decimals_of_the_step() {
        assert_eq!(decimals_of_step(0.25), 1);
        assert_eq!(decimals_of_step(0.1), 1);
        assert_eq!(decimals_of_step(0.05), 2);
        assert_eq!(decimals_of_step(20.0), 0);
    }

    #[test]
    fn axes_show_all_values_and_round_marks() {
        let check = |values: &[f64], logarithmic: bool| {
            let axis = ValueAxis::over(values.iter().copied());
            assert_eq!(axis.logarithmic, logarithmic, "{values:?}");
            for value in values {
                assert!((0.0..=1.0).contains(&axis.position(*value)), "{value} on {axis:?}");
            }
            let marks = axis.marks(6);
            assert!(!marks.is_empty() && marks.len() <= 14, "{marks:?}");
            assert!(marks.iter().all(|mark| (-0.001..=1.001).contains(&axis.position(*mark))), "{marks:?} on {axis:?}");
        };
        check(&[0.01, 0.02, 0.03], false);
        check(&[0.01, 0.02, 3.0], true);
        check(&[-1.0, 0.0, 100.0], false);
        check(&[5.0, 5.0], false);
        check(&[0.0], false);
        check(&[1e-9, 1e-9, 1e6], true);
        assert_eq!(ValueAxis::over([0.2, 1.0].into_iter()).low, 0.0, "zero is near");
        let axis = ValueAxis::around_zero([0.5, 2.0].into_iter());
        assert!(axis.low < 0.0 && axis.position(0.0) > 0.0);
    }
}
