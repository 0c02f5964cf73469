use serde::Serialize;

use super::principal_angle;

/// Physical dimension of a parameter; written to files as the symbol of its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub enum Dimension {
    #[serde(rename = "rad")]
    Angle,
    #[serde(rename = "m")]
    Length,
    #[serde(rename = "s")]
    Time,
    #[serde(rename = "px")]
    Pixel,
    #[serde(rename = "")]
    Ratio,
}

impl Dimension {
    /// Symbol of the unit, empty for a ratio.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Angle => "rad",
            Self::Length => "m",
            Self::Time => "s",
            Self::Pixel => "px",
            Self::Ratio => "",
        }
    }

    /// Shown units per stored unit, and the symbol of the shown unit: degrees, millimetres, milliseconds.
    pub const fn shown_unit(self) -> (f64, &'static str) {
        match self {
            Self::Angle => (180.0 / std::f64::consts::PI, "°"),
            Self::Length => (1e3, "mm"),
            Self::Time => (1e3, "ms"),
            Self::Pixel => (1.0, "px"),
            Self::Ratio => (1.0, ""),
        }
    }

    /// Difference of two values in the unit; of angles, in (−π, π].
    pub fn difference(self, value: f64, reference: f64) -> f64 {
        match self {
            Self::Angle => principal_angle(value - reference),
            _ => value - reference,
        }
    }

    /// Scale of the observability analysis, in the unit: 10°, 3 cm, 20 ms, 10 px, one tenth.
    ///
    /// Columns of a Jacobian are multiplied by the scale of their parameter, so that columns of different dimensions
    /// are comparable. The scale is about the uncertainty of a calibration before the first flight.
    pub const fn scale(self) -> f64 {
        match self {
            Self::Angle => 10.0 * std::f64::consts::PI / 180.0,
            Self::Length => 0.03,
            Self::Time => 0.02,
            Self::Pixel => 10.0,
            Self::Ratio => 0.1,
        }
    }
}
