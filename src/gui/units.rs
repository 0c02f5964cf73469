//! Display of numbers: degrees and millimetres on the screen, radians and metres in the data.

use crate::geometry::Dimension;
use crate::gimbal::{ParameterGroup, ParameterId};
pub(crate) use crate::text::counted;

/// Conversion of a stored unit to the shown one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shown {
    /// Shown value per stored value.
    pub(crate) factor: f64,
    /// Shown unit with its leading space.
    pub(crate) unit: &'static str,
}

impl Shown {
    /// Conversion for a dimension: to degrees, millimetres, milliseconds.
    pub(crate) const fn of(dimension: Dimension) -> Self {
        match dimension {
            Dimension::Angle => Self { factor: 180.0 / std::f64::consts::PI, unit: "°" },
            Dimension::Length => Self { factor: 1000.0, unit: " mm" },
            Dimension::Time => Self { factor: 1000.0, unit: " ms" },
            Dimension::Pixel => Self { factor: 1.0, unit: " px" },
            Dimension::Ratio => Self { factor: 1.0, unit: "" },
        }
    }

    /// Conversion for a parameter: that of its dimension, or percent for scale and misalignment of the IMU.
    pub(crate) fn of_parameter(parameter: ParameterId) -> Self {
        match (parameter.group(), parameter.dimension()) {
            (ParameterGroup::Imu, Dimension::Ratio) => Self { factor: 100.0, unit: " %" },
            (_, dimension) => Self::of(dimension),
        }
    }

    /// A stored value with its unit; its precision is that of two digits of the standard deviation.
    pub(crate) fn value(self, stored: f64, stored_sigma: f64) -> String {
        format!("{}{}", fixed(stored * self.factor, decimals_for(stored_sigma * self.factor)), self.unit)
    }

    /// A standard deviation with its unit, with two digits.
    pub(crate) fn sigma(self, stored_sigma: f64) -> String {
        let sigma = stored_sigma * self.factor;
        if sigma.is_finite() { format!("{}{}", fixed(sigma, decimals_for(sigma)), self.unit) } else { "–".to_owned() }
    }
}

/// Decimals for two digits of a standard deviation; two if it is unknown.
fn decimals_for(sigma: f64) -> usize {
    if sigma.is_finite() && sigma > 0.0 { (1.0 - sigma.log10().floor()).clamp(0.0, 5.0) as usize } else { 2 }
}

/// A number with `decimals` decimals; a dash if it is not finite; never a negative zero.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
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
pub(crate) fn significant(value: f64) -> String {
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

/// Seconds since the log began with three decimals.
pub(crate) fn seconds(stamp_ns: i64) -> String {
    fixed(crate::geometry::seconds_from_ns(stamp_ns), 3)
}

/// A text that begins with a capital letter.
pub(crate) fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// An amount of memory in binary units.
pub(crate) fn bytes(count: u64) -> String {
    let mebibytes = count as f64 / (1 << 20) as f64;
    if mebibytes < 1024.0 { format!("{mebibytes:.0} MiB") } else { format!("{:.2} GiB", mebibytes / 1024.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::tests::parameter;

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
        let value = |name: &str| Shown::of_parameter(parameter(name)).value(0.0125, 0.001);
        assert_eq!(["gyroscope.sx", "k1", "fx"].map(value), ["1.25 %", "0.0125", "0.0125 px"]);
    }

    #[test]
    fn numbers_have_no_negative_zero_and_no_nan() {
        assert_eq!(fixed(-0.0004, 2), "0.00");
        assert_eq!(fixed(-0.4, 1), "-0.4");
        assert_eq!(fixed(f64::INFINITY, 1), "–");
        assert_eq!(significant(0.0), "0");
        assert_eq!(significant(1234.5), "1234");
        assert_eq!(significant(0.012345), "0.0123");
        assert_eq!(significant(3e-14), "3.0e-14");
        assert_eq!(seconds(12_350_400_000), "12.350");
        assert_eq!(bytes(300 << 20), "300 MiB");
        assert_eq!(bytes(3 << 29), "1.50 GiB");
    }
}
