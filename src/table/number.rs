//! Numbers as people read them: in degrees, millimetres and milliseconds, without a negative zero.

use crate::geometry::Dimension;

/// Place where a table is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Medium {
    Screen,
    /// Page of a report.
    Page,
}

impl Medium {
    /// A number with `decimals` decimals, on a page with a true minus sign.
    pub fn fixed(self, value: f64, decimals: usize) -> String {
        let text = fixed(value, decimals);
        if self == Self::Page { text.replacen('-', "−", 1) } else { text }
    }
}

/// A number with `decimals` decimals; a dash if it is not finite; never a negative zero.
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.bytes().all(|byte| matches!(byte, b'0' | b'.')) => digits.to_owned(),
        _ => text,
    }
}

/// A number with three significant digits, in powers of ten if it is very large or small.
pub fn significant(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        "–".to_owned()
    } else if size == 0.0 {
        "0".to_owned()
    } else if size < 1e-3 || size >= 1e6 {
        format!("{value:.1e}")
    } else {
        fixed(value, (2.0 - size.log10().floor()).clamp(0.0, 4.0) as usize)
    }
}

/// Conversion of a stored unit to the shown one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// Shown value per stored value.
    pub factor: f64,
    /// Shown unit with its leading space.
    pub unit: &'static str,
}

impl Shown {
    /// Conversion for a dimension: to degrees, millimetres, milliseconds.
    pub const fn of(dimension: Dimension) -> Self {
        let (factor, _) = dimension.shown_unit();
        let unit = match dimension {
            Dimension::Angle => "°",
            Dimension::Length => " mm",
            Dimension::Time => " ms",
            Dimension::Pixel => " px",
            Dimension::Ratio => "",
        };
        Self { factor, unit }
    }

    /// A stored value with its unit, to the decimal of the second digit of its standard deviation.
    pub fn value(self, stored: f64, stored_sigma: f64) -> String {
        format!("{}{}", fixed(stored * self.factor, decimals_for(stored_sigma * self.factor)), self.unit)
    }

    /// A stored value with its standard deviation and unit: `4.2 ± 0.5 mm`.
    pub fn value_with_sigma(self, stored: f64, stored_sigma: f64) -> String {
        let value = self.value(stored, stored_sigma);
        format!("{} ± {}", value.trim_end_matches(self.unit), self.sigma(stored_sigma))
    }

    /// A standard deviation with its unit, with two digits.
    pub fn sigma(self, stored_sigma: f64) -> String {
        let sigma = stored_sigma * self.factor;
        if sigma.is_finite() { format!("{}{}", fixed(sigma, decimals_for(sigma)), self.unit) } else { "–".to_owned() }
    }
}

/// Decimals for two digits of a standard deviation; two if it is unknown.
fn decimals_for(sigma: f64) -> usize {
    if sigma.is_finite() && sigma > 0.0 { (1.0 - sigma.log10().floor()).clamp(0.0, 5.0) as usize } else { 2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_as_precise_as_their_sigma() {
        let angle = Shown::of(Dimension::Angle);
        assert_eq!(angle.value(1.0, 0.0002), "57.296°");
        assert_eq!(angle.sigma(0.0002), "0.011°");
        assert_eq!(Shown::of(Dimension::Length).value(-0.0123, 0.0004), "-12.30 mm");
        assert_eq!(Shown::of(Dimension::Length).value(0.05, f64::NAN), "50.00 mm");
        assert_eq!(angle.sigma(f64::NAN), "–");
        assert_eq!(Shown::of(Dimension::Time).value(-0.01, 0.0002), "-10.00 ms");
        assert_eq!(Shown::of(Dimension::Ratio).value(0.25, 0.01), "0.250");
        for dimension in [Dimension::Angle, Dimension::Length, Dimension::Time, Dimension::Pixel, Dimension::Ratio] {
            assert_eq!(Shown::of(dimension).unit.trim(), dimension.shown_unit().1);
        }
    }

    #[test]
    fn numbers_have_no_negative_zero_and_no_nan() {
        assert_eq!(fixed(-0.0004, 2), "0.00");
        assert_eq!(fixed(-0.4, 1), "-0.4");
        assert_eq!(fixed(f64::INFINITY, 1), "–");
        assert_eq!(Medium::Page.fixed(-1.25, 1), "−1.2");
        assert_eq!(Medium::Page.fixed(-0.001, 2), "0.00");
        assert_eq!(Medium::Page.fixed(3.0, 0), "3");
        assert_eq!(significant(0.0), "0");
        assert_eq!(significant(1234.5), "1234");
        assert_eq!(significant(0.012345), "0.0123");
        assert_eq!(significant(3e-14), "3.0e-14");
    }
}
